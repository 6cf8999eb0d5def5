"""An instant of the flight, assembled from the rows of the flight core."""

from __future__ import annotations

from functools import cache
from itertools import accumulate
from math import cos, nan, sin
from typing import Any, get_type_hints

import numpy as np
from numpy.typing import NDArray

from autopilot.core.tick import ControlMemory, EstimateSummary
from autopilot.estimation.filter import NO_LOAD, NO_LOAD_DIRECTION, knows_attitude, knows_height, knows_speed
from autopilot.estimation.records import Array, EstimatorState
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import norm, sub
from autopilot.geometry.packed import Row, unpack, width
from autopilot.geometry.so3 import quat_from_rotation
from autopilot.guidance.legs import LOAD_POSITION, QUAD_POSITION
from autopilot.services.instant import Instant
from autopilot.wire.dialect import plumbline as mavlink

NO_LEG = -1  # in place of a leg's control mode
_ATTITUDE_FLAG = mavlink.ESTIMATOR_ATTITUDE
_HEIGHT_FLAGS = mavlink.ESTIMATOR_VELOCITY_VERT | mavlink.ESTIMATOR_POS_VERT_ABS
_HORIZONTAL_FLAGS = (
    mavlink.ESTIMATOR_VELOCITY_HORIZ
    | mavlink.ESTIMATOR_POS_HORIZ_REL
    | mavlink.ESTIMATOR_POS_HORIZ_ABS
    | mavlink.ESTIMATOR_PRED_POS_HORIZ_REL
    | mavlink.ESTIMATOR_PRED_POS_HORIZ_ABS
)
# what is not known without the velocity
_SPEED_FLAGS = (
    mavlink.ESTIMATOR_VELOCITY_HORIZ
    | mavlink.ESTIMATOR_VELOCITY_VERT
    | mavlink.ESTIMATOR_PRED_POS_HORIZ_REL
    | mavlink.ESTIMATOR_PRED_POS_HORIZ_ABS
)


@cache
def _field_offsets(record: Any) -> dict[str, tuple[int, Any]]:
    """Where in a packed record the numbers of each field begin, and the type of the field."""
    hints = get_type_hints(record)
    widths = [width(hints[name]) for name in record._fields]
    offsets = accumulate(widths[:-1], initial=0)
    return {name: (offset, hints[name]) for name, offset in zip(record._fields, offsets, strict=True)}


def _offset(record: Any, path: str) -> int:
    """Where in a packed record the numbers of a field begin, a.b for the field b of the field a."""
    total, kind = 0, record
    for name in path.split("."):
        offset, kind = _field_offsets(kind)[name]
        total += offset
    return total


def _copy_table(record: Any, paths: dict[str, str]) -> NDArray[np.int64]:
    """(n, 2): the place in an `Instant`, and the place in a record from which each number is copied."""
    hints = get_type_hints(Instant)
    return np.array(
        [
            (_offset(Instant, name) + i, _offset(record, path) + i)
            for name, path in paths.items()
            for i in range(width(hints[name]))
        ]
    )


_FROM_SUMMARY = _copy_table(
    EstimateSummary,
    {name: f"state.{name}" for name in ("x_load", "v_load", "q_cable", "q_cable_dot", "x_quad", "v_quad")}
    | {"omega_body": "state.omega_body", "taut": "taut"},
)
_FROM_ESTIMATOR = _copy_table(
    EstimatorState,
    {
        "quat_wxyz": "vehicle.quat_wxyz",
        "accel_quad": "vehicle.accel_quad",
        "horizontal_std": "uncertainty.horizontal",
        "vertical_std": "uncertainty.vertical",
        "tension": "load.tension",
    },
)
_FROM_CONTROL = _copy_table(
    ControlMemory,
    {
        name: f"command.{name}"
        for name in ("e_x", "e_v", "e_q", "e_q_dot", "e_R", "e_Omega", "psi_R", "psi_q", "thrust", "moment")
    }
    | {
        "q_cable_c": "command.q_c",
        "control_mode": "control_mode",
        "slack_events": "slack_events",
        "saturated": "mixed.saturated",
    },
)
_VEHICLE_PROBLEM, _LOAD_PROBLEM = (
    _offset(EstimateSummary, "vehicle_problem"),
    _offset(EstimateSummary, "load_problem"),
)
_R_C, _LOAD_MASS = _offset(ControlMemory, "command.R_c"), _offset(ControlMemory, "observed.load_mass")
_NOW_US, _PHASE, _SEQ = (_offset(Instant, name) for name in ("now_us", "phase", "seq"))
_FLAGS, _DISTANCE = _offset(Instant, "estimator_flags"), _offset(Instant, "distance")
_ELAPSED, _DURATION = _offset(Instant, "elapsed_s"), _offset(Instant, "duration_s")
_X_LOAD, _X_QUAD, _X_QUAD_D = (_offset(Instant, name) for name in ("x_load", "x_quad", "x_quad_d"))
_X_LOAD_D, _V_LOAD_D, _A_LOAD_D = (_offset(Instant, name) for name in ("x_load_d", "v_load_d", "a_load_d"))
_X_LOAD_REQUESTED, _V_LOAD_REQUESTED = (
    _offset(Instant, "x_load_requested"),
    _offset(Instant, "v_load_requested"),
)
_QUAT_C, _E_X, _E_V = (_offset(Instant, name) for name in ("quat_c_wxyz", "e_x", "e_v"))
_TENSION, _TAUT = _offset(Instant, "tension"), _offset(Instant, "taut")
_DISARMED, _ARMED = mavlink.PLUMBLINE_PHASE_DISARMED, mavlink.PLUMBLINE_PHASE_ARMED
_ROTOR_MIN, _ROTOR_MAX = _offset(Instant, "rotor_min"), _offset(Instant, "rotor_max")
_FORCES, _ROTORS = _offset(Instant, "forces"), _offset(Instant, "rotors")


@kernel
def estimator_flags(state: EstimatorState, problem: int) -> int:
    """ESTIMATOR_STATUS_FLAGS of an estimate with this problem of the vehicle or of its inertial unit: the
    parts of the vehicle's state that are known."""
    flags = 0
    if problem == 0:
        flags = _ATTITUDE_FLAG | _HEIGHT_FLAGS | _HORIZONTAL_FLAGS
    elif knows_attitude(state, problem):
        flags = _ATTITUDE_FLAG
        if knows_height(state, problem):
            flags |= _HEIGHT_FLAGS
    return flags if knows_speed(state) else flags & ~_SPEED_FLAGS


@kernel
def put_instant(
    summary: Row,
    estimator: Row,
    control: Row,
    forces: Row,
    targets: Array,
    requested: Array,
    row: int,
    control_mode: int,
    elapsed_s: float,
    duration_s: float,
    now_us: int,
    phase: int,
    seq: int,
    load_tracked: bool,
    assumed_load_kg: float,
    rotor_min: float,
    rotor_max: float,
    rotors: int,
    heading: float,
    instant: Row,
) -> None:
    """Write an `Instant` into its row.

    `summary`, `estimator` and `control` are those of `CoreRows`, `forces` (14) those of the rotors. The
    present leg has this control mode (NO_LEG: there is no leg); `targets[row]` is its setpoint, as
    `layout.jets` returns it, and `requested[row]` the requested path. `load_tracked`: in a phase in which the
    load is tracked. `assumed_load_kg`: mass with which the estimator computes the tension; 0: the tension is
    that of a custom estimator. `heading` (rad): the commanded one, at which a vehicle without a leg stands.
    """
    for i in range(_FROM_SUMMARY.shape[0]):
        instant[_FROM_SUMMARY[i, 0]] = summary[_FROM_SUMMARY[i, 1]]
    for i in range(_FROM_ESTIMATOR.shape[0]):
        instant[_FROM_ESTIMATOR[i, 0]] = estimator[_FROM_ESTIMATOR[i, 1]]
    for i in range(_FROM_CONTROL.shape[0]):
        instant[_FROM_CONTROL[i, 0]] = control[_FROM_CONTROL[i, 1]]
    instant[_NOW_US], instant[_PHASE], instant[_SEQ] = now_us, phase, seq
    instant[_ELAPSED], instant[_DURATION] = elapsed_s, duration_s
    instant[_ROTOR_MIN], instant[_ROTOR_MAX], instant[_ROTORS] = rotor_min, rotor_max, rotors
    for i in range(forces.shape[0]):
        instant[_FORCES + i] = forces[i]
    instant[_FLAGS] = estimator_flags(unpack(EstimatorState, estimator, 0), int(summary[_VEHICLE_PROBLEM]))
    if assumed_load_kg > 0.0:
        instant[_TENSION] *= control[_LOAD_MASS] / assumed_load_kg
    load_undetected = summary[_LOAD_PROBLEM] == NO_LOAD or summary[_LOAD_PROBLEM] == NO_LOAD_DIRECTION
    if load_undetected and instant[_TAUT] != 0.0 and phase in (_DISARMED, _ARMED):
        # in the air the accelerometer detects the pull; on the ground only sight shows that it has ended
        instant[_TENSION], instant[_TAUT] = nan, 0.0
    x_load = (instant[_X_LOAD], instant[_X_LOAD + 1], instant[_X_LOAD + 2])
    x_quad = (instant[_X_QUAD], instant[_X_QUAD + 1], instant[_X_QUAD + 2])
    instant[_DISTANCE] = norm(sub(x_load, x_quad))
    for j in range(3):
        instant[_X_LOAD_D + j] = instant[_X_LOAD_REQUESTED + j] = x_load[j]
        instant[_V_LOAD_D + j] = instant[_A_LOAD_D + j] = instant[_V_LOAD_REQUESTED + j] = 0.0
        instant[_X_QUAD_D + j] = nan
        if control_mode == LOAD_POSITION:
            instant[_X_LOAD_D + j] = targets[row, j]
            instant[_V_LOAD_D + j] = targets[row, 3 + j]
            instant[_A_LOAD_D + j] = targets[row, 6 + j]
            instant[_X_LOAD_REQUESTED + j], instant[_V_LOAD_REQUESTED + j] = (
                requested[row, j],
                requested[row, 3 + j],
            )
        elif control_mode == QUAD_POSITION:
            instant[_X_QUAD_D + j] = targets[row, j]
        if not load_tracked:
            instant[_E_X + j] = instant[_E_V + j] = 0.0
    r = control[_R_C : _R_C + 9]
    q = quat_from_rotation(((r[0], r[1], r[2]), (r[3], r[4], r[5]), (r[6], r[7], r[8])))
    if control_mode == NO_LEG:
        q = (cos(0.5 * heading), 0.0, 0.0, sin(0.5 * heading))
    for i in range(4):
        instant[_QUAT_C + i] = q[i]
