"""A law that serves only to compile, in advance, the tick that calls custom laws."""

from __future__ import annotations

from autopilot.control.law_exchange import Asked, Now
from autopilot.own.law_commands import force

WARMUP_LAW = f"{__name__}:WarmupLaw"


class WarmupLaw:
    """A law that only carries the weight."""

    def load_position(self, memory: None, now: Now) -> tuple[None, Asked]:
        """A force that carries vehicle and load."""
        believed = now.believed
        return None, force((0.0, 0.0, (believed.quad_mass + believed.load_mass) * believed.gravity))
