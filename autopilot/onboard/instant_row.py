"""An instant of the flight, put together from the rows of the flight core."""

from __future__ import annotations

from math import nan
from typing import Any, get_type_hints

from autopilot.core.tick import Pilot, Seen
from autopilot.estimation.records import Array, EstimatorState
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, norm, sub
from autopilot.geometry.packed import Row, pack, width
from autopilot.geometry.so3 import Quat, quat_from_rotation
from autopilot.guidance.legs import LOAD_POSITION, QUAD_POSITION
from autopilot.services.instant import Instant
from autopilot.wire.dialect import plumbline as mavlink

NO_LEG = -1  # in place of a leg's control mode
_NOWHERE: Vec3 = (nan, nan, nan)
_ESTIMATING = (
    mavlink.ESTIMATOR_ATTITUDE
    | mavlink.ESTIMATOR_VELOCITY_HORIZ
    | mavlink.ESTIMATOR_VELOCITY_VERT
    | mavlink.ESTIMATOR_POS_HORIZ_REL
    | mavlink.ESTIMATOR_POS_HORIZ_ABS
    | mavlink.ESTIMATOR_POS_VERT_ABS
    | mavlink.ESTIMATOR_PRED_POS_HORIZ_REL
    | mavlink.ESTIMATOR_PRED_POS_HORIZ_ABS
)


def _place(record: Any, path: str) -> int:
    """Where in a packed record the numbers of a field begin, a.b for the field b of the field a."""
    first, kind = 0, record
    for name in path.split("."):
        hints = get_type_hints(kind)
        first += sum(width(hints[one]) for one in kind._fields[: kind._fields.index(name)])
        kind = hints[name]
    return first


_X_LOAD, _V_LOAD = _place(Seen, "state.x_load"), _place(Seen, "state.v_load")
_Q_CABLE, _Q_CABLE_DOT = _place(Seen, "state.q_cable"), _place(Seen, "state.q_cable_dot")
_X_QUAD, _V_QUAD = _place(Seen, "state.x_quad"), _place(Seen, "state.v_quad")
_OMEGA, _TAUT = _place(Seen, "state.omega_body"), _place(Seen, "taut")
_VEHICLE_COMPLAINT, _LOAD_COMPLAINT = _place(Seen, "vehicle_complaint"), _place(Seen, "load_complaint")
_QUAT, _ACCEL = _place(EstimatorState, "vehicle.quat_wxyz"), _place(EstimatorState, "vehicle.accel_quad")
_TENSION = _place(EstimatorState, "load.tension")
_HORIZONTAL, _VERTICAL = _place(EstimatorState, "doubt.horizontal"), _place(EstimatorState, "doubt.vertical")
_CONTROL_MODE, _SLACK_EVENTS = _place(Pilot, "control_mode"), _place(Pilot, "slack_events")
_SATURATED, _FORCES = _place(Pilot, "mixed.saturated"), _place(Pilot, "mixed.forces")
_E_X, _E_V = _place(Pilot, "command.e_x"), _place(Pilot, "command.e_v")
_E_Q, _E_Q_DOT = _place(Pilot, "command.e_q"), _place(Pilot, "command.e_q_dot")
_E_R, _E_OMEGA = _place(Pilot, "command.e_R"), _place(Pilot, "command.e_Omega")
_PSI_R, _PSI_Q = _place(Pilot, "command.psi_R"), _place(Pilot, "command.psi_q")
_Q_C, _R_C = _place(Pilot, "command.q_c"), _place(Pilot, "command.R_c")
_THRUST, _MOMENT = _place(Pilot, "command.thrust"), _place(Pilot, "command.moment")


@kernel
def _vector(row: Row, first: int) -> Vec3:
    return (row[first], row[first + 1], row[first + 2])


@kernel
def _four(row: Row, first: int) -> Quat:
    return (row[first], row[first + 1], row[first + 2], row[first + 3])


@kernel
def put_instant(
    seen: Row,
    estimator: Row,
    pilot: Row,
    targets: Array,
    asked: Array,
    at: int,
    control_mode: int,
    elapsed_s: float,
    duration_s: float,
    now_us: int,
    phase: int,
    seq: int,
    carrying: bool,
    carries: bool,
    rotor_min: float,
    rotor_max: float,
    instant: Row,
) -> None:
    """Write an `Instant` into its row.

    `seen`, `estimator` and `pilot` are those of `CoreRows`. The leg in force has this control mode (NO_LEG:
    there is none); `targets[at]` is its setpoint, as `layout.jets` gives it, and `asked[at]` what the
    mission asks for. `carrying`: in a phase in which the load is tracked; `carries`: the load must be known.
    """
    x_load, x_quad = _vector(seen, _X_LOAD), _vector(seen, _X_QUAD)
    x_load_d = x_load_asked = x_load
    v_load_d = a_load_d = v_load_asked = ZERO
    x_quad_d = _NOWHERE
    if control_mode == LOAD_POSITION:
        x_load_d, v_load_d, a_load_d = _vector(targets[at], 0), _vector(targets[at], 3), _vector(targets[at], 6)
        x_load_asked, v_load_asked = _vector(asked[at], 0), _vector(asked[at], 3)
    elif control_mode == QUAD_POSITION:
        x_quad_d = _vector(targets[at], 0)
    e_x = e_v = ZERO
    if carrying:
        e_x, e_v = _vector(pilot, _E_X), _vector(pilot, _E_V)
    r = _R_C
    rotation = (_vector(pilot, r), _vector(pilot, r + 3), _vector(pilot, r + 6))
    flags = _ESTIMATING
    if seen[_VEHICLE_COMPLAINT] != 0.0 or (carries and seen[_LOAD_COMPLAINT] != 0.0):
        flags = 0
    made = Instant(
        now_us,
        phase,
        seq,
        x_quad,
        _vector(seen, _V_QUAD),
        _four(estimator, _QUAT),
        _vector(seen, _OMEGA),
        _vector(estimator, _ACCEL),
        flags,
        estimator[_HORIZONTAL],
        estimator[_VERTICAL],
        x_load,
        _vector(seen, _V_LOAD),
        _vector(seen, _Q_CABLE),
        _vector(seen, _Q_CABLE_DOT),
        norm(sub(x_load, x_quad)),
        estimator[_TENSION],
        seen[_TAUT] != 0.0,
        int(pilot[_SLACK_EVENTS]),
        int(pilot[_CONTROL_MODE]),
        elapsed_s,
        duration_s,
        x_load_d,
        v_load_d,
        a_load_d,
        x_load_asked,
        v_load_asked,
        _vector(pilot, _Q_C),
        x_quad_d,
        quat_from_rotation(rotation),
        e_x,
        e_v,
        _vector(pilot, _E_Q),
        _vector(pilot, _E_Q_DOT),
        _vector(pilot, _E_R),
        _vector(pilot, _E_OMEGA),
        pilot[_PSI_R],
        pilot[_PSI_Q],
        pilot[_THRUST],
        _vector(pilot, _MOMENT),
        _four(pilot, _FORCES),
        rotor_min,
        rotor_max,
        int(pilot[_SATURATED]),
    )
    pack(made, instant, 0)
