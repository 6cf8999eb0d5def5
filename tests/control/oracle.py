"""A published closed loop (Sreenath, Lee, Kumar): its numbers, and its cascade built from our laws."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from autopilot.control.records import Vehicle
from tests.control.model import pack, state_of, vec

INF = float("inf")
ORACLE = json.loads((Path(__file__).parent / "gcdf_circle.json").read_text())


def oracle_vehicle() -> Vehicle:
    p = ORACLE["params"]
    J = np.diag(np.array(p["J"]))
    return Vehicle(p["mQ"], p["mL"], p["l"], vec(J), p["g"], 0.1, 0.01, -INF, INF)


def oracle_start() -> np.ndarray:
    y0 = ORACLE["y0"]
    R = np.array(y0["R_colmajor"]).reshape(3, 3).T
    return pack(y0["xL"], y0["vL"], y0["q"], y0["omega"], R, y0["Omega"])


def oracle_command(laws: Any, t: float, y: np.ndarray) -> tuple[float, Any, Any]:
    """Thrust, attitude result and direction result of the published cascade: the laws without filters, and
    the derivatives of q_c and R_c taken from the path (its flatness), as in the publication.

    On x_d = 3 [sin t, cos t, 1] the tension per mass has constant length n = sqrt(9 + g^2), so that q and the
    nominal force are a few sines.
    """
    gains, vehicle = ORACLE["gains"], oracle_vehicle()
    g, m_Q, m_L, L = vehicle.gravity, vehicle.quad_mass, vehicle.load_mass, vehicle.cable_length
    # derivatives of the path, 0 to 6
    d = [
        3.0 * np.array([np.sin(t + k * np.pi / 2), np.cos(t + k * np.pi / 2), 1.0 if k == 0 else 0.0])
        for k in range(7)
    ]
    n = np.sqrt(9.0 + g * g)
    up = np.array([0.0, 0.0, g])
    q_dot, q_ddot = -d[3] / n, -d[4] / n
    # F = m_Q (a - L q'' + g e3) + m_L (a + g e3), with a = x_d'' and q'' = -x_d^(4)/n
    F = [(m_Q + m_L) * (d[2 + k] + (up if k == 0 else 0.0)) + m_Q * L / n * d[4 + k] for k in range(3)]
    e1, zero = (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    nominal = laws.attitude_from_axes(*(vec(F_k) for F_k in F), e1, zero, zero)

    s = state_of(y, vehicle)
    position = laws.load_position_force(
        s.x_load,
        s.v_load,
        s.q_cable,
        s.q_cable_dot,
        *(vec(d[k]) for k in range(3)),
        vec(np.diag(np.array(gains["k1"]))),
        vec(np.diag(np.array(gains["k2"]))),
        m_Q,
        m_L,
        L,
        g,
    )
    direction = laws.load_attitude_force(
        s.q_cable,
        s.q_cable_dot,
        laws.DirectionCommand(laws.computed_direction(position.A), vec(q_dot), vec(q_ddot)),
        laws.normal_force_tracking(s.q_cable, position.A),
        -gains["kq"],  # printed there with the opposite sign
        -gains["kom"],
        m_Q,
        L,
    )
    R_c = laws.attitude_towards(direction.F, e1, s.R)
    result = laws.attitude_moment(
        s.R,
        s.omega_body,
        laws.AttitudeCommand(R_c, nominal.Omega_c, nominal.Omega_c_dot),
        vec(np.diag(np.array(gains["kR"]))),
        vec(np.diag(np.array(gains["kO"]))),
        1.0,
        vehicle.inertia,
    )
    return laws.thrust_along(direction.F, s.R), result, direction
