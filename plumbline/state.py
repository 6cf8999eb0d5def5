"""The latest known state of a running vehicle."""

from __future__ import annotations

from dataclasses import dataclass, fields

from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.vehicle_view import VehicleView
from gcs.workflows.status import status_record


@dataclass(frozen=True)
class State:
    """The latest values that the vehicle has reported; None for a value not reported yet, or never reported.

    The position of the load is the vehicle's own estimate, relative to home.
    """

    mode: str | None  # in plain words: hold, mission, land ...
    armed: bool | None
    ready_to_arm: bool | None
    landed: str | None  # on the ground, in the air, taking off, landing
    phase: str | None  # as docs/architecture.md names them, in lower case
    holding: bool | None  # at rest in phase hold: the stop, or the way to a place, has ended
    time_s: float | None  # since boot, by the vehicle's clock
    mission: str | None  # none, not started, active, paused, complete
    mission_item: int | None
    mission_items: int | None
    load_east_m: float | None
    load_north_m: float | None
    load_up_m: float | None
    cable_tension_n: float | None
    cable_taut: bool | None
    load_error_m: float | None  # distance from the desired position, as the autopilot estimates it
    rotor_use: float | None  # the greatest rotor force, divided by its limit
    battery_v: float | None
    load_speed_m_s: float | None
    cable_length_m: float | None  # from vehicle to load; as set by the winch while the cable is slack
    winch_moving: bool | None

    @property
    def load_m(self) -> tuple[float, float, float] | None:
        """Position of the load: east, north and up from home, m."""
        if self.load_east_m is None or self.load_north_m is None or self.load_up_m is None:
            return None
        return (self.load_east_m, self.load_north_m, self.load_up_m)


_NAMES = {field.name for field in fields(State)}


def state_of(view: VehicleView) -> State:
    """The state according to the latest messages."""
    record = {name: value for name, value in status_record(view).items() if name in _NAMES}
    load = view.latest.get("LOAD_STATE")
    speed = None if load is None else float((load.vx**2 + load.vy**2 + load.vz**2) ** 0.5)
    winch = view.latest.get("WINCH_STATUS")
    return State(
        **record,
        holding=view.holding,
        load_speed_m_s=speed,
        cable_length_m=None if winch is None else float(winch.line_length),
        winch_moving=None if winch is None else bool(winch.status & mavlink.MAV_WINCH_STATUS_MOVING),
    )
