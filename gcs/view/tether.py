"""Whether the load is on the cable, from one LOAD_STATE after the other."""

from __future__ import annotations

import math
from typing import Any


class Tether:
    """The cable as far as it is known by now; `gcs.analysis.release` does the same for a whole flight."""

    def __init__(self, margin_m: float) -> None:
        self._margin_m = margin_m  # an attached load is at most this farther away than when last taut
        self.length_m: float | None = None  # when it was last taut
        self.attached = True  # False from a reading with the load farther away until the cable is taut again

    def update(self, load: Any) -> None:
        """Process a LOAD_STATE."""
        if load.taut:
            self.attached = True
            if math.isfinite(load.distance):
                self.length_m = load.distance
        elif self.length_m is not None and load.distance > self.length_m + self._margin_m:
            self.attached = False
