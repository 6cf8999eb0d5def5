"""The dialect's telemetry: load, setpoint, errors of the cascade, rotors, wind.

Builders return the fields as they are sent.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from autopilot.geometry.frames import enu_from_ned, flu_from_frd
from autopilot.geometry.linear import Vec3
from autopilot.wire.codec import Fields, layout_of
from autopilot.wire.convert.axes import frd_from_flu, ned_from_enu
from autopilot.wire.convert.scaling import uint16
from autopilot.wire.convert.simulator import Forces, padded_forces
from autopilot.wire.dialect import plumbline as mavlink

_LOAD_STATE = layout_of(mavlink.MAVLink_load_state_message)
_FILTER_STATE = layout_of(mavlink.MAVLink_filter_state_message)
_LOAD_SETPOINT = layout_of(mavlink.MAVLink_load_setpoint_message)
_CASCADE_ERRORS = layout_of(mavlink.MAVLink_cascade_errors_message)
_WIND_STATE = layout_of(mavlink.MAVLink_wind_state_message)
_ROTOR_STATE = layout_of(mavlink.MAVLink_rotor_state_message)


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


def load_state_message(*record: Any) -> Fields:
    """LOAD_STATE, see `LoadState`."""
    return _LOAD_STATE, load_state_values(*record)


def filter_state_message(time_us: int, x_load: Vec3, v_load: Vec3, x_quad: Vec3) -> Fields:
    """FILTER_STATE: the estimate of the built-in filter while a custom estimator flies."""
    positions = (*ned_from_enu(x_load), *ned_from_enu(v_load), *ned_from_enu(x_quad))
    return _FILTER_STATE, (time_us, *positions)


def read_load_state(m: Any) -> LoadState:
    """Inverse of `load_state_message`."""
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


class LoadSetpoint(NamedTuple):
    """LOAD_SETPOINT: the load's setpoint; PLUMBLINE_PHASE of the flight, PLUMBLINE_CONTROL_MODE tracked."""

    time_us: int
    phase: int
    control_mode: int
    seq: int  # mission item
    position: Vec3
    velocity: Vec3
    acceleration: Vec3
    q_cable_c: Vec3  # commanded direction of the cable
    elapsed: float  # s since the item or phase began
    duration: float  # s, NaN if open
    requested_position: Vec3  # what the mission specifies; `position` is as near to it as can be flown
    requested_velocity: Vec3


@register_jitable
def load_setpoint_values(
    time_us: int,
    phase: int,
    control_mode: int,
    seq: int,
    position: Vec3,
    velocity: Vec3,
    acceleration: Vec3,
    q_cable_c: Vec3,
    elapsed: float,
    duration: float,
    requested_position: Vec3,
    requested_velocity: Vec3,
) -> tuple[float, ...]:
    """LOAD_SETPOINT, see `LoadSetpoint`: the numbers in the order of the wire."""
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


def load_setpoint_message(*record: Any) -> Fields:
    """LOAD_SETPOINT, see `LoadSetpoint`."""
    return _LOAD_SETPOINT, load_setpoint_values(*record)


def read_load_setpoint(m: Any) -> LoadSetpoint:
    """Inverse of `load_setpoint_message`."""
    return LoadSetpoint(
        m.time_usec,
        m.phase,
        m.control_mode,
        m.seq,
        enu_from_ned((m.x, m.y, m.z)),
        enu_from_ned((m.vx, m.vy, m.vz)),
        enu_from_ned((m.ax, m.ay, m.az)),
        enu_from_ned((m.qx, m.qy, m.qz)),
        m.elapsed,
        m.duration,
        enu_from_ned((m.asked_x, m.asked_y, m.asked_z)),
        enu_from_ned((m.asked_vx, m.asked_vy, m.asked_vz)),
    )


class CascadeErrors(NamedTuple):
    """CASCADE_ERRORS: (3-1) ... (3-25) as the autopilot computes them, and its commands to the mixer."""

    time_us: int
    control_mode: int
    e_x: Vec3
    e_v: Vec3
    e_q: Vec3
    e_q_dot: Vec3
    e_R: Vec3  # body
    e_Omega: Vec3  # body, rad/s
    psi_R: float
    psi_q: float
    thrust: float  # N
    moment: Vec3  # body, N m


@register_jitable
def cascade_errors_values(
    time_us: int,
    control_mode: int,
    e_x: Vec3,
    e_v: Vec3,
    e_q: Vec3,
    e_q_dot: Vec3,
    e_R: Vec3,
    e_Omega: Vec3,
    psi_R: float,
    psi_q: float,
    thrust: float,
    moment: Vec3,
) -> tuple[float, ...]:
    """CASCADE_ERRORS, see `CascadeErrors`: the numbers in the order of the wire."""
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


def cascade_errors_message(*record: Any) -> Fields:
    """CASCADE_ERRORS, see `CascadeErrors`."""
    return _CASCADE_ERRORS, cascade_errors_values(*record)


def read_cascade_errors(m: Any) -> CascadeErrors:
    """Inverse of `cascade_errors_message`."""
    return CascadeErrors(
        m.time_usec,
        m.control_mode,
        enu_from_ned(tuple(m.e_x)),
        enu_from_ned(tuple(m.e_v)),
        enu_from_ned(tuple(m.e_q)),
        enu_from_ned(tuple(m.e_q_dot)),
        flu_from_frd(tuple(m.e_r)),
        flu_from_frd(tuple(m.e_omega)),
        m.psi_r,
        m.psi_q,
        m.thrust,
        flu_from_frd(tuple(m.moment)),
    )


class WindState(NamedTuple):
    """WIND_STATE: mean wind and gust pulse in force from `time_us` on, m/s; random gusts are in neither."""

    time_us: int
    wind: Vec3
    gust: Vec3


def wind_state_message(time_us: int, wind: Vec3, gust: Vec3) -> Fields:
    """WIND_STATE, see `WindState`."""
    return _WIND_STATE, (time_us, *ned_from_enu(wind), *ned_from_enu(gust))


def read_wind_state(m: Any) -> WindState:
    """Inverse of `wind_state_message`."""
    return WindState(m.time_usec, enu_from_ned(tuple(m.wind)), enu_from_ned(tuple(m.gust)))


class RotorState(NamedTuple):
    """ROTOR_STATE: commanded (source estimate) or true forces; bit i of `saturated`: rotor i+1 is limited."""

    time_us: int
    source: int
    forces: Forces  # N
    force_min: float  # N
    force_max: float  # N, inf if unlimited
    saturated: int
    rotors: int = 4  # how many there are


@register_jitable
def rotor_state_values(
    time_us: int,
    source: int,
    forces: Forces,
    force_min: float,
    force_max: float,
    saturated: int,
    rotors: int = 4,
) -> tuple[float, ...]:
    """ROTOR_STATE, see `RotorState`: the numbers in the order of the wire."""
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


def rotor_state_message(*record: Any) -> Fields:
    """ROTOR_STATE, see `RotorState`."""
    return _ROTOR_STATE, rotor_state_values(*record)


def read_rotor_state(m: Any) -> RotorState:
    """Inverse of `rotor_state_message`."""
    forces = padded_forces((*m.force, *m.more_force))
    saturated = m.saturated | m.more_saturated << 8
    return RotorState(m.time_usec, m.source, forces, m.force_min, m.force_max, saturated, m.rotors or 4)
