"""The values of one instant that telemetry and flight log report many times a second, as a record.

Its fields are those of `Snapshot` with the same names. The functions below take either record: the numbers
that a message contains are defined once, for the streams that are written in machine code and for all others.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba.extending import register_jitable

from autopilot.geometry.linear import ZERO, Vec3
from autopilot.geometry.so3 import Quat
from autopilot.wire.convert.axes import ned_from_enu
from autopilot.wire.convert.flight import (
    cascade_errors_values,
    load_setpoint_values,
    load_state_values,
    rotor_state_values,
)
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.convert.scaling import saturated
from autopilot.wire.convert.simulator import ROTOR_FMAX, Forces
from autopilot.wire.convert.telemetry import (
    altitude_values,
    attitude_quaternion_values,
    attitude_target_values,
    attitude_values,
    global_position_int_values,
    heading_cdeg,
    local_position_ned_values,
    position_target_local_ned_values,
    vfr_hud_values,
)
from autopilot.wire.dialect import plumbline as mavlink

_UINT32 = 0xFFFFFFFF
_PWM_STOP, _PWM_FULL = 1000, 2000  # SERVO_OUTPUT_RAW as most tools expect it, us
# names of DEBUG_VECT and NAMED_VALUE_FLOAT, in the order in which they are sent
DEBUG_VECTORS = (b"LOAD_POS", b"LOAD_VEL", b"CABLE_Q", b"LOAD_ERR")
NAMED_VALUES = (b"TENSION", b"SWING", b"LOAD_ERR", b"PSI_R", b"PSI_Q")
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
    x_load_requested: Vec3
    v_load_requested: Vec3
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
    rotors: int


@register_jitable
def attitude_of(s: Any) -> tuple[float, ...]:
    """ATTITUDE of an instant: its numbers in the order of the wire, as in all functions below."""
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
def global_position_int_of(s: Any, home: Home) -> tuple[float, ...]:
    """GLOBAL_POSITION_INT of the vehicle."""
    return global_position_int_values(s.now_us, s.x_quad, s.v_quad, heading_cdeg(s.quat_wxyz), home)


@register_jitable
def altitude_of(s: Any, home: Home) -> tuple[float, ...]:
    """ALTITUDE of the vehicle."""
    return altitude_values(s.now_us, s.x_quad[2], home)


@register_jitable
def force_share(force: float, s: Any) -> float:
    """A force as a share of a rotor's maximum; for a rotor without limit, of the nominal maximum."""
    return force / (s.rotor_max if 0.0 < s.rotor_max < math.inf else ROTOR_FMAX)


@register_jitable
def vfr_hud_of(s: Any, home: Home) -> tuple[float, ...]:
    """VFR_HUD."""
    total = 0.0
    for i in range(s.rotors):
        total += s.forces[i]
    mean = 1.0 / s.rotors * total
    return vfr_hud_values(s.v_quad, s.quat_wxyz, s.x_quad[2], force_share(mean, s), home)


@register_jitable
def position_target_local_ned_of(s: Any) -> tuple[float, ...]:
    """POSITION_TARGET_LOCAL_NED; not sent while there is no position setpoint of the vehicle (NaN)."""
    return position_target_local_ned_values(s.now_us, s.x_quad_d, ZERO, ZERO)


@register_jitable
def attitude_target_of(s: Any) -> tuple[float, ...]:
    """ATTITUDE_TARGET."""
    return attitude_target_values(s.now_us, s.quat_c_wxyz, ZERO, force_share(1.0 / s.rotors * s.thrust, s))


@register_jitable
def _pulse_us(i: int, s: Any) -> int:
    if i >= s.rotors:
        return 0
    force = s.forces[i]
    return saturated(_PWM_STOP + (_PWM_FULL - _PWM_STOP) * force_share(force, s), _PWM_STOP, _PWM_FULL)


@register_jitable
def servo_output_raw_of(s: Any) -> tuple[float, ...]:
    """SERVO_OUTPUT_RAW."""
    pulses = pulses_of(s)
    return (s.now_us & _UINT32, *pulses[:8], 0, *pulses[8:], 0, 0)


@register_jitable
def pulses_of(s: Any) -> tuple[int, ...]:
    """The pulse of each of the 14 possible rotors, us; 0 for a rotor that the vehicle does not have."""
    return (
        _pulse_us(0, s),
        _pulse_us(1, s),
        _pulse_us(2, s),
        _pulse_us(3, s),
        _pulse_us(4, s),
        _pulse_us(5, s),
        _pulse_us(6, s),
        _pulse_us(7, s),
        _pulse_us(8, s),
        _pulse_us(9, s),
        _pulse_us(10, s),
        _pulse_us(11, s),
        _pulse_us(12, s),
        _pulse_us(13, s),
    )


@register_jitable
def debug_vectors_of(s: Any) -> tuple[Vec3, Vec3, Vec3, Vec3]:
    """The vectors of the DEBUG_VECT messages named in `DEBUG_VECTORS`, NED."""
    return (
        ned_from_enu(s.x_load),
        ned_from_enu(s.v_load),
        ned_from_enu(s.q_cable),
        ned_from_enu(s.e_x),
    )


@register_jitable
def named_values_of(s: Any) -> tuple[float, float, float, float, float]:
    """The values of the NAMED_VALUE_FLOAT messages named in `NAMED_VALUES`."""
    down = -s.q_cable[2]
    if not down < 1.0:
        down = 1.0
    elif not down > -1.0:
        down = -1.0
    x, y, z = s.e_x
    return (s.tension, math.degrees(math.acos(down)), math.sqrt(x * x + y * y + z * z), s.psi_R, s.psi_q)


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
        s.x_load_requested,
        s.v_load_requested,
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
    return rotor_state_values(s.now_us, _ESTIMATED, s.forces, s.rotor_min, s.rotor_max, s.saturated, s.rotors)
