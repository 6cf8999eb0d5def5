"""The latest known state of a running vehicle."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import hypot, pi, remainder
from typing import Any

from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.vehicle_view import VehicleView
from gcs.workflows.status import status_record

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class State:
    """The latest values that the vehicle has reported; None for a value not reported yet, or never reported.

    Positions, velocities and angles are the vehicle's own estimates: east, north and up from home. Roll,
    pitch and yaw are those of the tables of a flight: positive pitch puts the nose down, and yaw counts from
    east towards north.
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
    load_velocity_m_s: Vector | None
    vehicle_m: Vector | None  # position
    vehicle_velocity_m_s: Vector | None
    vehicle_angles_rad: Vector | None  # roll, pitch, yaw
    vehicle_rate_rad_s: Vector | None  # of the body: forward, left, up
    battery_a: float | None
    battery_left_pct: float | None  # of the charge

    @property
    def load_m(self) -> Vector | None:
        """Position of the load: east, north and up from home, m."""
        if self.load_east_m is None or self.load_north_m is None or self.load_up_m is None:
            return None
        return (self.load_east_m, self.load_north_m, self.load_up_m)


_NAMES = {field.name for field in fields(State)}


def state_of(view: VehicleView) -> State:
    """The state according to the latest messages."""
    record = {name: value for name, value in status_record(view).items() if name in _NAMES}
    load, winch = view.latest.get("LOAD_STATE"), view.latest.get("WINCH_STATUS")
    load_velocity = None if load is None else (load.vy, load.vx, -load.vz)
    is_measured = record["load_up_m"] is not None
    motion, attitude = view.latest.get("LOCAL_POSITION_NED"), view.latest.get("ATTITUDE")
    battery = view.latest.get("SYS_STATUS")
    return State(
        **record,
        holding=view.holding,
        load_speed_m_s=None if load_velocity is None else hypot(*load_velocity),
        cable_length_m=None if winch is None else float(winch.line_length),
        winch_moving=None if winch is None else bool(winch.status & mavlink.MAV_WINCH_STATUS_MOVING),
        load_velocity_m_s=load_velocity if is_measured else None,
        vehicle_m=None if motion is None else (motion.y, motion.x, -motion.z),
        vehicle_velocity_m_s=None if motion is None else (motion.vy, motion.vx, -motion.vz),
        vehicle_angles_rad=None if attitude is None else _angles(attitude),
        vehicle_rate_rad_s=None if attitude is None else _rates(attitude),
        battery_a=None if battery is None else _known(battery.current_battery, 0.01),
        battery_left_pct=None if battery is None else _known(battery.battery_remaining, 1.0),
    )


def _angles(attitude: Any) -> Vector:
    """Roll, pitch and yaw of an ATTITUDE, whose yaw counts from north towards east."""
    return (attitude.roll, -attitude.pitch, remainder(0.5 * pi - attitude.yaw, 2.0 * pi))


def _rates(attitude: Any) -> Vector:
    """The body rates of an ATTITUDE, whose axes are forward, right and down."""
    return (attitude.rollspeed, -attitude.pitchspeed, -attitude.yawspeed)


def _known(number: int, unit: float) -> float | None:
    """A number of SYS_STATUS in this unit; -1: not known."""
    return None if number < 0 else number * unit
