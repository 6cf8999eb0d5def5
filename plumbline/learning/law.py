"""A trained policy as a control law, for `--law FILE:CLASS`.

from pathlib import Path
from plumbline.learning.law import PolicyLaw

class Hover(PolicyLaw):
    file = Path(__file__).with_name("hover.npz")
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from gcs.errors import GcsError
from plumbline.laws import Asked, Now, wrench
from plumbline.learning.policy import PolicyPilot, load_policy


class PolicyLaw:
    """Flies the load with the policy in `file`; the other modes are flown by the built-in law."""

    file: ClassVar[str | Path]

    def __init__(self, parameters: Mapping[str, float]) -> None:
        if not hasattr(self, "file"):
            raise GcsError(f"{type(self).__name__}: file, the path of the policy (.npz), is not set")
        self._pilot = PolicyPilot(load_policy(self.file), parameters["CTL_RATE_HZ"])

    def start(self, now: Now) -> None:
        """Reset the policy, as at the beginning of an episode."""
        self._pilot.start()

    def load_position(self, memory: None, now: Now) -> tuple[None, Asked]:
        """The policy's command; the policy itself keeps its earlier observations."""
        thrust, moment = self._pilot.tick(now.state, now.reference.jet)
        return None, wrench(thrust, moment)
