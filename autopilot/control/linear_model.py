"""The vehicle with its load, linearised about hover: (A-1), (A-3)-(A-5).

| symbol     | code name  | unit             | equation                                          |
|------------|------------|------------------|---------------------------------------------------|
| x          |            | m, rad and per s | (4-6), 16 states: 8 coordinates, then their rates |
| u          |            | N, N m           | (4-6), f, M_phi, M_theta, M_psi                   |
| M1, M2, M3 | M1, M2, M3 |                  | (A-5)                                             |
| A, B       | A, B       |                  | (A-1)                                             |
| m_T, I_L   | m_T, I_L   | kg, kg m^2       | m_Q + m_L, m_L L^2                                |

The coordinates are x, y, z of the vehicle, its roll, pitch and yaw, R = Rz(psi) Ry(theta) Rx(phi), and the
two angles of the cable, phi_L = atan2(q_y, -q_z) and theta_L = atan2(q_x, -q_z): positive where the load is
to the left (y) and ahead (x) of the vehicle. The source prints neither this convention nor M1 ... M3; with
this convention the signs of all its gains are reproduced.

To the second order of small coordinates x_L = x_Q + L (theta_L, phi_L, -1 + (theta_L^2 + phi_L^2)/2), so the
energies in (2-29) are

    T = m_Q |x_Q'|^2 / 2 + m_L |x_Q' + L (theta_L', phi_L', 0)|^2 / 2 + (phi', theta', psi') J (..) / 2
    U = m_T g z + m_L g L (theta_L^2 + phi_L^2) / 2

and f0 = m_T g, which (A-4) needs to hover, does the work f0 (theta, -phi, 0) . delta x_Q once the vehicle is
tilted. This gives the three matrices below.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from autopilot.control.records import Vehicle

Matrix = NDArray[np.float64]

X, Y, Z, PHI, THETA, PSI, PHI_L, THETA_L = range(8)


def hover_thrust(vehicle: Vehicle) -> float:
    """f0 = m_T g of (A-4), N."""
    return (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity


def second_order(vehicle: Vehicle) -> tuple[Matrix, Matrix, Matrix]:
    """M1 (8 x 8), M2 (8 x 8), M3 (8 x 4) of M1 x'' + M2 x = M3 (u - u0), (A-5)."""
    m_L, L = vehicle.load_mass, vehicle.cable_length
    m_T, I_L = vehicle.quad_mass + m_L, m_L * L * L
    f0 = hover_thrust(vehicle)
    M1 = np.diag([m_T, m_T, m_T, *vehicle.inertia, I_L, I_L])
    M1[X, THETA_L] = M1[THETA_L, X] = m_L * L
    M1[Y, PHI_L] = M1[PHI_L, Y] = m_L * L
    M2 = np.zeros((8, 8))
    M2[X, THETA] = -f0
    M2[Y, PHI] = f0
    M2[PHI_L, PHI_L] = M2[THETA_L, THETA_L] = m_L * vehicle.gravity * L
    M3 = np.zeros((8, 4))
    M3[Z, 0] = M3[PHI, 1] = M3[THETA, 2] = M3[PSI, 3] = 1.0
    return M1, M2, M3


def state_space(vehicle: Vehicle) -> tuple[Matrix, Matrix]:
    """A (16 x 16), B (16 x 4) of (A-1)."""
    M1, M2, M3 = second_order(vehicle)
    A, B = np.zeros((16, 16)), np.zeros((16, 4))
    A[:8, 8:] = np.eye(8)
    A[8:, :8] = -np.linalg.solve(M1, M2)
    B[8:, :] = np.linalg.solve(M1, M3)
    return A, B


LOAD_STATES = 16  # x_L, v_L (3 each), q_x, q_y, their rates (2 each), rotation vector, Omega (3 each)


def load_state_space(vehicle: Vehicle) -> tuple[Matrix, Matrix]:
    """A (16 x 16), B (16 x 4) of the same model in the states of the load cascade, LOAD_STATES.

    To first order x_L = x_Q + L (theta_L, phi_L, -1) and q = (theta_L, phi_L, -1).
    """
    L = vehicle.cable_length
    to_load = np.eye(8)  # (x_L, y_L, z_L, phi, theta, psi, q_y, q_x) from the eight coordinates
    to_load[X, THETA_L] = to_load[Y, PHI_L] = L
    from_load = 2.0 * np.eye(8) - to_load  # its inverse: (to_load - I) squared is zero
    A, B = state_space(vehicle)
    stiffness, input_gain = to_load @ A[8:, :8] @ from_load, to_load @ B[8:]
    # indices of (x_L ... q_x) and of their rates among the states
    position, velocity = np.r_[0:3, 10:13, 7, 6], np.r_[3:6, 13:16, 9, 8]
    A_L, B_L = np.zeros((LOAD_STATES, LOAD_STATES)), np.zeros((LOAD_STATES, 4))
    A_L[position, velocity] = 1.0
    A_L[np.ix_(velocity, position)] = stiffness
    B_L[velocity] = input_gain
    return A_L, B_L
