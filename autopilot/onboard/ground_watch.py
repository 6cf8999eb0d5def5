"""What follows when the ground station falls silent in flight: NAV_DLL_ACT, as PX4 knows it."""

from __future__ import annotations

from typing import Any

from autopilot.services.requests import Land, Pause, ReturnHome
from autopilot.services.streams import NEVER_US
from autopilot.supervisor.state import IN_AIR, LANDING, Phase
from autopilot.wire.parameter_table import ParameterTable

LOST_TEXT, BACK_TEXT = "Ground station lost: {}", "Ground station heard again"
_ACTIONS: dict[int, tuple[Any, str]] = {
    1: (Pause(), "holding"),
    2: (ReturnHome(), "returning"),
    3: (Land(), "landing"),
}


class GroundWatch:
    """Whether the ground station was heard of late, and what the vehicle is to do where it was not."""

    def __init__(self) -> None:
        self._patience_us = NEVER_US
        self._action = 0
        self.lost = False  # and it was acted upon

    def follow(self, table: ParameterTable) -> None:
        """Other parameters."""
        self._action = int(table["NAV_DLL_ACT"])
        self._patience_us = round(table["COM_DL_LOSS_T"] * 1e6) if self._action else NEVER_US

    def changed(self, now_us: int, heard_us: int) -> bool:
        """Whether it has become silent, or is heard again."""
        return (now_us - heard_us > self._patience_us) != self.lost

    def changes_us(self, heard_us: int) -> int:
        """When it will have become silent, if it was not lost; it is not heard meanwhile."""
        return NEVER_US if self.lost else heard_us + self._patience_us + 1

    def request(self, phase: Phase) -> tuple[Any, str] | None:
        """What to ask of the vehicle, and the word for it; None in a phase that needs nothing."""
        homing = phase in LANDING or phase == Phase.RETURN
        return None if phase not in IN_AIR or homing else _ACTIONS[self._action]
