"""A trained policy as a control law: what `--law FILE:CLASS` takes.

from pathlib import Path
from plumbline.learning.law import PolicyLaw

class Hover(PolicyLaw):
    file = Path(__file__).with_name("hover.npz")
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from plumbline.laws import Asked, Now, wrench
from plumbline.learning.policy import PolicyPilot, load_policy


class PolicyLaw:
    """Flies the load with the policy in `file`; the other modes are flown by the built-in law."""

    file: ClassVar[str | Path]

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._pilot = PolicyPilot(load_policy(self.file))

    def start(self, now: Now) -> None:
        """Begin as an episode begins."""
        self._pilot.start()

    def load_position(self, memory: None, now: Now) -> tuple[None, Asked]:
        """What the policy asks for; it remembers by itself what it has seen."""
        thrust, moment = self._pilot.tick(now.state, now.reference.jet)
        return None, wrench(thrust, moment)
