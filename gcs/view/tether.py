"""Whether the load is on the cable, from one LOAD_STATE after the other."""

from __future__ import annotations

import math
from typing import Any


class Tether:
    """The cable as far as it is known by now; `gcs.analysis.release` tells the same of a whole flight."""

    def __init__(self, beyond_m: float) -> None:
        self._beyond_m = beyond_m  # by which a load that is held is never farther away than when last taut
        self.length_m: float | None = None  # when it was taut last
        self.attached = True  # until the load is seen farther away, and again once the cable is taut

    def see(self, load: Any) -> None:
        """Take a LOAD_STATE in."""
        if load.taut:
            self.attached = True
            if math.isfinite(load.distance):
                self.length_m = load.distance
        elif self.length_m is not None and load.distance > self.length_m + self._beyond_m:
            self.attached = False
