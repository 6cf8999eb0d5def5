"""Linear quadratic regulator of the vehicle's position and the load's swing: (4-4)-(4-7), (A-1)-(A-5).

| symbol    | code name  | frame         | unit                         | equation |
|-----------|------------|---------------|------------------------------|----------|
| x - x_ref | error      | along heading | m, rad and per s             | (4-6)    |
| K         | K          |               | N, N m per unit of the state | (4-7)    |
| u0        | f0         | body          | N                            | (A-4)    |
| Q, R      | LqrWeights |               |                              | A-2      |

u = u0 - K (x - x_ref). The law steers the vehicle, not the load: x_ref is the load's reference one cable
length higher, at rest and level, with the cable straight down. No derivative of the reference position is
used.

The angles of (4-6) and their rates are the exact ones of R and q, in the conventions of `linear_model`. They
are undefined for a vehicle on edge (theta = 90 deg) and for a level cable; their rates are bounded there. The
linear model holds for a heading along x; for any other heading, positions and directions are first rotated
into the frame of this heading.
"""

from __future__ import annotations

from functools import lru_cache
from math import asin, atan2, sqrt
from typing import NamedTuple

import numpy as np

from autopilot.control.linear_model import Z, hover_thrust, state_space
from autopilot.control.records import Command, Reference, State, Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import (
    E3,
    IDENTITY,
    Mat3,
    Vec3,
    apply_transposed,
    axpy,
    mul_transposed,
    neg,
    sub,
)
from autopilot.geometry.s2 import direction_error, direction_rate_error, psi_direction
from autopilot.geometry.so3 import attitude_error, psi_attitude

Row = tuple[  # of K, or the state: sixteen numbers
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
]
Gain = tuple[Row, Row, Row, Row]

# cosines and squared lengths below which a rate of an angle is no longer the exact one
_MIN_COSINE = 1e-3
_MIN_SQUARE = 1e-6


class LqrWeights(NamedTuple):
    """Diagonals of Q and R in (4-7), one number for each kind of state and input."""

    position: float
    tilt: float  # roll and pitch
    yaw: float
    swing: float  # both angles of the cable
    rate: float  # all eight rates
    thrust: float
    moment: float


#
LQR_WEIGHTS = LqrWeights(
    position=50000.0, tilt=0.001, yaw=1.0, swing=25000.0, rate=0.001, thrust=1000.0, moment=100.0
)


class Lqr(NamedTuple):
    """What the law needs at each tick."""

    K: Gain
    f0: float  # N
    cable_length: float  # m
    ramp_lag: float  # s, lag of the vehicle behind a reference that rises or sinks steadily


@lru_cache(maxsize=8)
def lqr(vehicle: Vehicle, weights: LqrWeights = LQR_WEIGHTS) -> Lqr:
    """The regulator of this vehicle: its gain minimises (4-7)."""
    from control import lqr as solve_lqr  # takes a second to import; other laws do not need it

    w = weights
    Q = np.diag([w.position] * 3 + [w.tilt] * 2 + [w.yaw] + [w.swing] * 2 + [w.rate] * 8)
    R = np.diag([w.thrust, w.moment, w.moment, w.moment])
    K, _, _ = solve_lqr(*state_space(vehicle), Q, R)
    thrust, roll, pitch, yaw = (tuple(float(k) for k in row) for row in K)
    # on a ramp the thrust is that of hovering, so K_z e_z + K_z' v = 0
    ramp_lag = thrust[8 + Z] / thrust[Z]
    return Lqr((thrust, roll, pitch, yaw), hover_thrust(vehicle), vehicle.cable_length, ramp_lag)  # type: ignore[arg-type]


@kernel
def heading_frame(b1_d: Vec3) -> Mat3:
    """Rotation about the vertical that takes e1 to the level part of b1_d; the identity if there is none."""
    n = sqrt(b1_d[0] * b1_d[0] + b1_d[1] * b1_d[1])
    if n * n < _MIN_SQUARE:
        return IDENTITY
    c, s = b1_d[0] / n, b1_d[1] / n
    return ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))


@kernel
def attitude_angles(R: Mat3, omega_body: Vec3) -> tuple[Vec3, Vec3]:
    """(phi, theta, psi) in rad of R = Rz(psi) Ry(theta) Rx(phi), and their rates in rad/s."""
    sine = min(1.0, max(-1.0, -R[2][0]))
    cosine = max(_MIN_COSINE, sqrt(1.0 - sine * sine))
    phi, psi = atan2(R[2][1], R[2][2]), atan2(R[1][0], R[0][0])
    # sine and cosine of phi, from the elements of R
    s_phi, c_phi = R[2][1] / cosine, R[2][2] / cosine
    about_level = s_phi * omega_body[1] + c_phi * omega_body[2]
    psi_dot = about_level / cosine
    phi_dot = omega_body[0] + sine * psi_dot
    theta_dot = c_phi * omega_body[1] - s_phi * omega_body[2]
    return (phi, asin(sine), psi), (phi_dot, theta_dot, psi_dot)


@kernel
def swing_angle(sideways: float, up: float, sideways_dot: float, up_dot: float) -> tuple[float, float]:
    """Angle (rad) from straight down of a direction in a vertical plane, and its rate (rad/s)."""
    square = max(_MIN_SQUARE, sideways * sideways + up * up)
    return atan2(sideways, -up), (sideways * up_dot - up * sideways_dot) / square


@kernel
def state_error(state: State, x_ref: Vec3, b1_d: Vec3, heading_rate: float) -> Row:
    """x - x_ref of (4-6), for a vehicle that is to rest at x_ref with its nose along b1_d, a heading that
    turns at `heading_rate` rad/s about the vertical."""
    H = heading_frame(b1_d)
    x = apply_transposed(H, sub(state.x_quad, x_ref))
    v = apply_transposed(H, state.v_quad)
    q = apply_transposed(H, state.q_cable)
    q_dot = apply_transposed(H, state.q_cable_dot)
    angles, angle_rates = attitude_angles(mul_transposed(H, state.R), state.omega_body)
    phi_L, phi_L_dot = swing_angle(q[1], q[2], q_dot[1], q_dot[2])
    theta_L, theta_L_dot = swing_angle(q[0], q[2], q_dot[0], q_dot[2])
    return (
        x[0],
        x[1],
        x[2],
        angles[0],
        angles[1],
        angles[2],
        phi_L,
        theta_L,
        v[0],
        v[1],
        v[2],
        angle_rates[0],
        angle_rates[1],
        angle_rates[2] - heading_rate,
        phi_L_dot,
        theta_L_dot,
    )


@kernel
def feedback(row: Row, error: Row) -> float:
    """One row of K times the error."""
    total = 0.0
    for k in range(16):
        total += row[k] * error[k]
    return total


@kernel
def load_position(state: State, reference: Reference, regulator: Lqr) -> Command:
    """The vehicle is steered to a point one cable length above the load's reference.

    In the command, e_x and e_v are the errors of the load against the reference and its first derivative.
    e_q, e_q_dot and Psi_q compare the cable with q_c, straight down and at rest; e_R, e_Omega and Psi_R
    compare the vehicle with R_c, level with the nose along b1_d, and at rest.
    """
    x_d, v_d = reference.jet[0], reference.jet[1]
    b1_d, b1_d_dot = reference.b1_d, reference.b1_d_dot
    heading_rate = b1_d[0] * b1_d_dot[1] - b1_d[1] * b1_d_dot[0]
    error = state_error(state, axpy(regulator.cable_length, E3, x_d), b1_d, heading_rate)
    K = regulator.K
    down, zero = neg(E3), (0.0, 0.0, 0.0)
    R_c = heading_frame(b1_d)
    return Command(
        regulator.f0 - feedback(K[0], error),
        (-feedback(K[1], error), -feedback(K[2], error), -feedback(K[3], error)),
        sub(state.x_load, x_d),
        sub(state.v_load, v_d),
        direction_error(state.q_cable, down),
        direction_rate_error(state.q_cable, state.q_cable_dot, down, zero),
        attitude_error(state.R, R_c),
        state.omega_body,
        psi_attitude(state.R, R_c),
        psi_direction(state.q_cable, down),
        down,
        R_c,
    )
