"""What telemetry and the flight log say many times a second of one instant, as a record that kernels read.

Its fields are those of `Snapshot` with the same names. The functions below take either: which numbers of the
flight a message has stands once, for the streams that are written in machine code and for all else.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from autopilot.geometry.linear import Vec3
from autopilot.geometry.so3 import Quat
from autopilot.wire.convert.flight import (
    cascade_errors_values,
    load_setpoint_values,
    load_state_values,
    rotor_state_values,
)
from autopilot.wire.convert.simulator import Forces
from autopilot.wire.convert.telemetry import (
    attitude_quaternion_values,
    attitude_values,
    local_position_ned_values,
)
from autopilot.wire.dialect import plumbline as mavlink

_ESTIMATED = mavlink.PLUMBLINE_SOURCE_ESTIMATED


class Instant(NamedTuple):
    """SI, world ENU from home, body FLU; see `Snapshot`."""

    now_us: int
    phase: int
    seq: int

    x_quad: Vec3
    v_quad: Vec3
    quat_wxyz: Quat
    omega_body: Vec3
    accel_quad: Vec3  # inertial
    estimator_flags: int
    horizontal_std: float
    vertical_std: float

    x_load: Vec3
    v_load: Vec3
    q_cable: Vec3
    q_cable_dot: Vec3
    distance: float
    tension: float
    taut: bool
    slack_events: int

    control_mode: int
    elapsed_s: float
    duration_s: float
    x_load_d: Vec3
    v_load_d: Vec3
    a_load_d: Vec3
    x_load_asked: Vec3
    v_load_asked: Vec3
    q_cable_c: Vec3
    x_quad_d: Vec3
    quat_c_wxyz: Quat

    e_x: Vec3
    e_v: Vec3
    e_q: Vec3
    e_q_dot: Vec3
    e_R: Vec3
    e_Omega: Vec3
    psi_R: float
    psi_q: float
    thrust: float
    moment: Vec3

    forces: Forces
    rotor_min: float
    rotor_max: float
    saturated: int


@register_jitable
def attitude_of(s: Any) -> tuple[float, ...]:
    """ATTITUDE of an instant, its numbers in the order of the wire; so are all of these."""
    return attitude_values(s.now_us, s.quat_wxyz, s.omega_body)


@register_jitable
def attitude_quaternion_of(s: Any) -> tuple[float, ...]:
    """ATTITUDE_QUATERNION."""
    return attitude_quaternion_values(s.now_us, s.quat_wxyz, s.omega_body)


@register_jitable
def local_position_ned_of(s: Any) -> tuple[float, ...]:
    """LOCAL_POSITION_NED."""
    return local_position_ned_values(s.now_us, s.x_quad, s.v_quad)


@register_jitable
def load_state_of(s: Any) -> tuple[float, ...]:
    """LOAD_STATE."""
    return load_state_values(
        s.now_us,
        _ESTIMATED,
        s.x_load,
        s.v_load,
        s.q_cable,
        s.q_cable_dot,
        s.distance,
        s.tension,
        s.taut,
        s.slack_events,
    )


@register_jitable
def load_setpoint_of(s: Any) -> tuple[float, ...]:
    """LOAD_SETPOINT."""
    return load_setpoint_values(
        s.now_us,
        s.phase,
        s.control_mode,
        s.seq,
        s.x_load_d,
        s.v_load_d,
        s.a_load_d,
        s.q_cable_c,
        s.elapsed_s,
        s.duration_s,
        s.x_load_asked,
        s.v_load_asked,
    )


@register_jitable
def cascade_errors_of(s: Any) -> tuple[float, ...]:
    """CASCADE_ERRORS."""
    return cascade_errors_values(
        s.now_us,
        s.control_mode,
        s.e_x,
        s.e_v,
        s.e_q,
        s.e_q_dot,
        s.e_R,
        s.e_Omega,
        s.psi_R,
        s.psi_q,
        s.thrust,
        s.moment,
    )


@register_jitable
def rotor_state_of(s: Any) -> tuple[float, ...]:
    """ROTOR_STATE."""
    return rotor_state_values(s.now_us, _ESTIMATED, s.forces, s.rotor_min, s.rotor_max, s.saturated)
