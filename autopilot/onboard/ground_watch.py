"""The reaction to a ground station that becomes silent in flight: NAV_DLL_ACT, as in PX4."""

from __future__ import annotations

from typing import Any

from autopilot.services.requests import Land, Pause, ReturnHome
from autopilot.services.streams import NEVER_US
from autopilot.supervisor.state import IN_AIR, Flight, Phase, is_landing
from autopilot.wire.parameter_table import ParameterTable

LOST_TEXT, BACK_TEXT = "Ground station lost: {}", "Ground station heard again"
_ACTIONS: dict[int, tuple[Any, str]] = {
    1: (Pause(), "holding"),
    2: (ReturnHome(), "returning"),
    3: (Land(), "landing"),
}


class GroundWatch:
    """Whether the ground station was heard recently, and what the vehicle is to do if it was not."""

    def __init__(self) -> None:
        self._timeout_us = NEVER_US
        self._action = 0
        self.lost = False  # the ground station is lost, and the vehicle has reacted

    def update_parameters(self, table: ParameterTable) -> None:
        """Take over changed parameters; without a reaction nothing counts as lost."""
        self._action = int(table["NAV_DLL_ACT"])
        self.lost = self.lost and self._action != 0
        self._timeout_us = round(table["COM_DL_LOSS_T"] * 1e6) if self._action else NEVER_US

    def has_changed(self, now_us: int, heartbeat_us: int) -> bool:
        """Whether the ground station has become silent, or is heard again."""
        return (now_us - heartbeat_us > self._timeout_us) != self.lost

    def lost_at_us(self, heartbeat_us: int) -> int:
        """When it counts as silent if nothing is heard meanwhile; never if it is already lost."""
        return NEVER_US if self.lost else heartbeat_us + self._timeout_us + 1

    def request(self, flight: Flight) -> tuple[Any, str] | None:
        """The request to the vehicle, and the word for it; None in a flight that needs no reaction."""
        homing = is_landing(flight) or flight.phase == Phase.RETURN
        return None if flight.phase not in IN_AIR or homing else _ACTIONS[self._action]
