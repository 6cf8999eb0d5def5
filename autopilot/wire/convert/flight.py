"""The dialect's telemetry: load, setpoint, errors of the cascade, rotors, wind.

`x_message` returns the fields as they are sent, `x_values` only their numbers, for the messages that machine
code writes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from autopilot.geometry.frames import enu_from_ned
from autopilot.geometry.linear import Vec3
from autopilot.wire.codec import Fields, layout_of
from autopilot.wire.convert.axes import frd_from_flu, ned_from_enu
from autopilot.wire.convert.scaling import uint16
from autopilot.wire.convert.simulator import Forces
from autopilot.wire.dialect import plumbline as mavlink

_FILTER_STATE = layout_of(mavlink.MAVLink_filter_state_message)
_WIND_STATE = layout_of(mavlink.MAVLink_wind_state_message)


class LoadState(NamedTuple):
    """LOAD_STATE: load and cable, `source` one of PLUMBLINE_SOURCE."""

    time_us: int
    source: int
    x_load: Vec3
    v_load: Vec3
    q_cable: Vec3  # unit vector from vehicle to load
    q_cable_dot: Vec3
    distance: float  # m, vehicle to load
    tension: float  # N
    taut: bool
    slack_events: int


@register_jitable
def load_state_values(
    time_us: int,
    source: int,
    x_load: Vec3,
    v_load: Vec3,
    q_cable: Vec3,
    q_cable_dot: Vec3,
    distance: float,
    tension: float,
    taut: bool,
    slack_events: int,
) -> tuple[float, ...]:
    """LOAD_STATE, see `LoadState`: the numbers in the order of the wire."""
    taut_flag = 1 if taut else 0
    return (
        time_us,
        *ned_from_enu(x_load),
        *ned_from_enu(v_load),
        *ned_from_enu(q_cable),
        *ned_from_enu(q_cable_dot),
        distance,
        tension,
        uint16(slack_events),
        taut_flag,
        source,
    )


def filter_state_message(time_us: int, x_load: Vec3, v_load: Vec3, x_quad: Vec3) -> Fields:
    """FILTER_STATE: the estimate of the built-in filter while a custom estimator flies."""
    positions = (*ned_from_enu(x_load), *ned_from_enu(v_load), *ned_from_enu(x_quad))
    return _FILTER_STATE, (time_us, *positions)


def read_load_state(m: Any) -> LoadState:
    """Inverse of `load_state_values`."""
    return LoadState(
        m.time_usec,
        m.source,
        enu_from_ned((m.x, m.y, m.z)),
        enu_from_ned((m.vx, m.vy, m.vz)),
        enu_from_ned((m.qx, m.qy, m.qz)),
        enu_from_ned((m.qx_dot, m.qy_dot, m.qz_dot)),
        m.distance,
        m.tension,
        bool(m.taut),
        m.slack_events,
    )


@register_jitable
def load_setpoint_values(
    time_us: int,
    phase: int,
    control_mode: int,
    seq: int,  # mission item
    position: Vec3,
    velocity: Vec3,
    acceleration: Vec3,
    q_cable_c: Vec3,  # commanded direction of the cable
    elapsed: float,  # s since the item or phase began
    duration: float,  # s, NaN if open
    requested_position: Vec3,  # what the mission specifies; `position` is as near to it as can be flown
    requested_velocity: Vec3,
) -> tuple[float, ...]:
    """LOAD_SETPOINT, the load's setpoint: the numbers in the order of the wire. `phase` is a PLUMBLINE_PHASE,
    `control_mode` the PLUMBLINE_CONTROL_MODE tracked."""
    return (
        time_us,
        *ned_from_enu(position),
        *ned_from_enu(velocity),
        *ned_from_enu(acceleration),
        *ned_from_enu(q_cable_c),
        elapsed,
        duration,
        uint16(seq),
        phase,
        control_mode,
        *ned_from_enu(requested_position),
        *ned_from_enu(requested_velocity),
    )


@register_jitable
def cascade_errors_values(
    time_us: int,
    control_mode: int,
    e_x: Vec3,
    e_v: Vec3,
    e_q: Vec3,
    e_q_dot: Vec3,
    e_R: Vec3,  # body
    e_Omega: Vec3,  # body, rad/s
    psi_R: float,
    psi_q: float,
    thrust: float,  # N
    moment: Vec3,  # body, N m
) -> tuple[float, ...]:
    """CASCADE_ERRORS, (3-1) ... (3-25) as the autopilot computes them, and its commands to the mixer: the
    numbers in the order of the wire."""
    return (
        time_us,
        *ned_from_enu(e_x),
        *ned_from_enu(e_v),
        *ned_from_enu(e_q),
        *ned_from_enu(e_q_dot),
        *frd_from_flu(e_R),
        *frd_from_flu(e_Omega),
        psi_R,
        psi_q,
        thrust,
        *frd_from_flu(moment),
        control_mode,
    )


def wind_state_message(time_us: int, wind: Vec3, gust: Vec3) -> Fields:
    """WIND_STATE: mean wind and gust pulse in force from `time_us` on, m/s; random gusts are in neither."""
    return _WIND_STATE, (time_us, *ned_from_enu(wind), *ned_from_enu(gust))


@register_jitable
def rotor_state_values(
    time_us: int,
    source: int,
    forces: Forces,  # N
    force_min: float,  # N
    force_max: float,  # N, inf if unlimited
    saturated: int,
    rotors: int = 4,  # how many there are
) -> tuple[float, ...]:
    """ROTOR_STATE, commanded (source estimate) or true forces: the numbers in the order of the wire. Bit i of
    `saturated`: rotor i+1 is limited."""
    first_saturated, more_saturated = saturated & 255, saturated >> 8
    # zero for a quadrotor, as when there were only quadrotors, so that their logs do not change
    count = 0 if rotors == 4 else rotors
    return (
        time_us,
        *forces[:4],
        force_min,
        force_max,
        first_saturated,
        source,
        *forces[4:],
        more_saturated,
        count,
    )
