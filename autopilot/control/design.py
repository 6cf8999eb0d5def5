"""The gains of the law `plumbline`, computed from the assumed vehicle.

| symbol | code name | frame | unit | equation |
|---|---|---|---|---|
| omega_x, omega_q, omega_R | omega_x, omega_q, omega_R | | rad/s | of load, cable, vehicle |
| omega_i | omega_i | | rad/s | at which the load's steady error fades |
| zeta | zeta | | | damping ratio of the three |
| J, m_Q, m_L, L | vehicle | | | Table 4-1 |
| k_x | k_x | I | N/m | m (omega_x^2 + 2 zeta omega_x omega_i), m = m_Q + m_L |
| k_v | k_v | I | N s/m | m (2 zeta omega_x + omega_i) |
| k_i | k_i | I | N/m/s | m omega_x^2 omega_i |
| k_q, k_w | k_q, k_omega | | N, N s | m_Q L omega_q^2, 2 zeta omega_q m_Q L |
| k_R, k_Omega | k_R, k_Omega | B | N m, N m s | J omega_R^2, 2 zeta omega_R J |
| d, delta | delay, tolerance | | s | assumed delay; unknown delay to tolerate |
| tau_a, T | lag, period | | s | lag that the rotors show; period of the control law |
| tau_d | torque_time | | s | time constant of the estimate of a torque on the vehicle (`torque_observer`) |
| K, A, b | K, A, b | | | below |

Near hover the law is u = -K x on the chain e_i, x_L, v_L, q, q', theta, Omega of one level axis,

    v_L' = -g q    q'' = -(m g / m_Q L)(q + theta)    Omega' = M / J    M' = (u - M) / tau_a

and the poles are those of three loops, one inside the other, and omega_i. With prediction over d the loop
holds for every delay between d - delta and d + delta, by the small-gain theorem, if

    delta omega |S(i omega)| < 1 at all omega,
    S(s) = K exp(A d) G (1 - Q exp(-s d)) / (1 + K G) + Q,
    G(s) = (s - A)^-1 b exp(-s T / 2),    Q(s) = 1 / (1 + s tau_d)

S is the response of the commanded moment to a torque: by the feedback after the torque has moved the vehicle,
and by the estimate of the torque.

delta is specified, and the ratios of the bandwidths are given. All three bandwidths are as high as five
conditions allow:

* the loop tolerates delta;
* three standard deviations of each rotor's command, for the assumed noise of the estimate, fit between hover
  and the nearest limit of a rotor;
* 1.5 of them fit into the share of the range that paths leave to control, because gusts cannot use what noise
  takes of this share;
* the loop is stable with `SATURATED_LAG_SHARE` of the rotors' lag even without lag compensation: rotors at
  their limits cannot be compensated, and after a large error a loop that depends on it goes on from limit to
  limit;
* omega_x is at most `MAX_SWING_RATIO` times sqrt(m g / m_Q L), the frequency of the load on its cable. The
  force across the cable is limited (`MAX_ACROSS_SHARE`), so the cable's rate changes by at most 0.7 of this
  frequency squared, and a loop that asks for more after a large error overshoots by more each time.
"""

from __future__ import annotations

import math
import warnings
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgWarning, expm, solve_discrete_lyapunov

from autopilot.control.plumbline_cascade import PlumblineGains
from autopilot.control.records import Vehicle
from autopilot.vehicle.rotors import ROTOR_MARGIN

Array = NDArray[np.float64]

# standard deviations of e_i, x_L, v_L, q, q', theta, Omega, white from tick to tick, from an estimator with
# motion capture
NOISE = (0.0, 0.0005, 0.003, 0.0007, 0.008, 0.002, 0.005)
SIGMAS, SIGMAS_RESERVED = 3.0, 1.5
# of omega_x and the frequency of the load on its cable (docs/control-log.md)
MAX_SWING_RATIO = 1.4
# of the rotors' lag, with which the loop must be stable without compensation (docs/control-log.md)
SATURATED_LAG_SHARE = 0.9
# rad/s, range of omega_R in which the greatest is searched
_MIN_OMEGA_R, _MAX_OMEGA_R = 0.5, 200.0
_MIN_LAG = 1e-4  # s; rotors without lag are treated as rotors of this lag
_STATES = 7


class Requirements(NamedTuple):
    """The requirements of the design."""

    tolerance: float  # s, of delay
    integral_ratio: float  # omega_i / omega_x
    cable_ratio: float  # omega_q / omega_x
    attitude_ratio: float  # omega_R / omega_q
    zeta: float
    noise: float  # factor on NOISE


class Timing(NamedTuple):
    """Assumed times between a command and its force; seconds."""

    delay: float
    lag: float  # of the rotors
    effective_lag: float  # after lag compensation
    period: float
    torque_time: float = 0.0  # time constant of the torque estimate; 0: none


class Design(NamedTuple):
    """Gains, with the bandwidths and the tolerance of delay that they were computed for."""

    gains: PlumblineGains
    omega_i: float  # rad/s
    omega_x: float
    omega_q: float
    omega_R: float
    tolerance: float  # s


def swing_stiffness(vehicle: Vehicle) -> float:
    """Square of the frequency (rad/s) of the load on its cable, below a vehicle that is free and level."""
    return (
        (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity / (vehicle.quad_mass * vehicle.cable_length)
    )


def yaw_bandwidth_ratio(vehicle: Vehicle) -> float:
    """Ratio of the bandwidth of yaw to that of roll and pitch at which equal errors demand the same share of
    what the rotors can give about the axis. About the thrust axis they turn the vehicle by their drag alone.
    """
    moment_per_inertia = vehicle.moment_per_force * vehicle.arm / max(vehicle.inertia[0], vehicle.inertia[1])
    return min(
        1.0,
        math.sqrt(vehicle.thrust_per_force * vehicle.torque_ratio / vehicle.inertia[2] / moment_per_inertia),
    )


def gains_of(
    omega_i: float, omega_x: float, omega_q: float, omega_R: float, zeta: float, vehicle: Vehicle
) -> PlumblineGains:
    """Gains that give the three loops these bandwidths (rad/s) and damping."""
    mass, m_Q_L = vehicle.quad_mass + vehicle.load_mass, vehicle.quad_mass * vehicle.cable_length
    J_x, J_y, J_z = vehicle.inertia
    yaw_ratio = yaw_bandwidth_ratio(vehicle)
    stiffness, damping = omega_R * omega_R, 2.0 * zeta * omega_R
    k_x = mass * omega_x * (omega_x + 2.0 * zeta * omega_i)
    k_v = mass * (2.0 * zeta * omega_x + omega_i)
    k_i = mass * omega_x * omega_x * omega_i
    return PlumblineGains(
        k_R=(J_x * stiffness, J_y * stiffness, yaw_ratio * yaw_ratio * J_z * stiffness),
        k_Omega=(J_x * damping, J_y * damping, yaw_ratio * J_z * damping),
        k_q=m_Q_L * omega_q * omega_q,
        k_omega=2.0 * zeta * omega_q * m_Q_L,
        k_x=(k_x, k_x, k_x),
        k_v=(k_v, k_v, k_v),
        k_i=(k_i, k_i, k_i),
    )


def level_axis_model(vehicle: Vehicle, J: float, lag: float) -> tuple[Array, Array]:
    """(A, b) of e_i, x_L, v_L, q, q', theta, Omega, M along a level axis; u, N m, is the commanded moment."""
    stiffness = swing_stiffness(vehicle)
    A, b = np.zeros((_STATES + 1, _STATES + 1)), np.zeros(_STATES + 1)
    A[0, 1] = A[1, 2] = A[3, 4] = A[5, 6] = 1.0
    A[2, 3] = -vehicle.gravity
    A[4, 3] = A[4, 5] = -stiffness
    A[6, 7] = 1.0 / J
    A[7, 7], b[7] = -1.0 / lag, 1.0 / lag
    return A, b


def frequency_response(
    vehicle: Vehicle, J: float, lag: float, period: float, omegas: Array
) -> NDArray[np.complex128]:
    """(s - A)^-1 b exp(-s T / 2) at s = i omega, one row for each omega (rad/s)."""
    s = 1j * omegas
    stiffness = swing_stiffness(vehicle)
    M = np.exp(-0.5 * s * period) / (lag * s + 1.0)
    Omega = M / (J * s)
    theta = Omega / s
    q = -stiffness * theta / (s * s + stiffness)
    v = -vehicle.gravity * q / s
    return np.stack([v / (s * s), v / s, v, q, s * q, theta, Omega, M], axis=1)


def ackermann_gain(A: Array, J: float, polynomial: Array) -> Array:
    """K that gives the chain this polynomial of poles if the rotors have no lag (Ackermann)."""
    n = _STATES
    chain, b = A[:n, :n], np.zeros(n)
    b[n - 1] = 1.0 / J
    powers = [np.eye(n)]
    for _ in range(n):
        powers.append(powers[-1] @ chain)
    controllability = np.array([power @ b for power in powers[:n]])
    last = np.linalg.solve(controllability, np.eye(n)[n - 1])
    closed = sum((polynomial[n - i] * powers[i] for i in range(n + 1)), np.zeros((n, n)))
    return np.append(last @ closed, 0.0)


def sampled_loop(A: Array, b: Array, K: Array, period: float) -> tuple[Array, Array]:
    """Of x' = A x + b u with u = -K x, held for a period (s): the matrix of the loop, and that of u."""
    n = len(A)
    discrete = expm(np.block([[A, b[:, None]], [np.zeros((1, n + 1))]]) * period)
    b_d = discrete[:n, n]
    return discrete[:n, :n] - np.outer(b_d, K), b_d


def _is_stable(loop: Array) -> bool:
    return bool(np.abs(np.linalg.eigvals(loop)).max() < 1.0)


def evaluate(
    omega_i: float,
    omega_x: float,
    omega_q: float,
    omega_R: float,
    zeta: float,
    noise: float,
    timing: Timing,
    vehicle: Vehicle,
) -> tuple[float, float]:
    """(tolerance of delay in s, standard deviation of a rotor's command in N); (0, inf) if unstable, with the
    rotors' lag compensated or not."""
    lag, T = max(_MIN_LAG, timing.effective_lag), timing.period
    J = min(vehicle.inertia[0], vehicle.inertia[1])
    A, b = level_axis_model(vehicle, J, lag)
    polynomial = np.array([1.0, omega_i])
    for omega in (omega_x, omega_q, omega_R):
        polynomial = np.convolve(polynomial, [1.0, 2.0 * zeta * omega, omega * omega])
    K = ackermann_gain(A, J, polynomial)
    K_ahead = K @ expm(A * timing.delay)

    closed, b_d = sampled_loop(A, b, K, T)
    if not _is_stable(closed):
        return 0.0, math.inf
    saturated_lag = SATURATED_LAG_SHARE * timing.lag
    if saturated_lag > lag and not _is_stable(
        sampled_loop(*level_axis_model(vehicle, J, saturated_lag), K, T)[0]
    ):
        return 0.0, math.inf
    omegas = np.geomspace(0.02 * omega_x, 0.99 * math.pi / T, 300)
    G = frequency_response(vehicle, J, lag, T, omegas)
    S = (G @ K_ahead) / (1.0 + G @ K)
    if timing.torque_time > 0.0:
        Q = 1.0 / (1.0 + 1j * omegas * timing.torque_time)
        S = S * (1.0 - Q * np.exp(-1j * omegas * timing.delay)) + Q
    tolerance = 1.0 / float(np.max(omegas * np.abs(S)))

    W = np.zeros_like(A)
    W[:_STATES, :_STATES] = np.diag((noise * np.array(NOISE)) ** 2)
    input_variance = float(K_ahead @ W @ K_ahead)
    with warnings.catch_warnings():
        # badly scaled: the integral of a position beside angular rates; only K P K' of P is used
        warnings.simplefilter("ignore", LinAlgWarning)
        P = solve_discrete_lyapunov(closed, input_variance * np.outer(b_d, b_d))
    moment = math.sqrt(float(K @ P @ K) + input_variance)
    amplification = (1.0 - math.exp(-T / lag)) / (1.0 - math.exp(-T / max(lag, timing.lag)))
    return tolerance, amplification * moment / (vehicle.moment_per_force * vehicle.arm)


@lru_cache(maxsize=16)
def design(requirements: Requirements, timing: Timing, vehicle: Vehicle) -> Design:
    """The fastest gains that meet the requirements; the slowest of the searched range if none do."""
    hover = (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity / vehicle.thrust_per_force
    headroom = min(vehicle.rotor_max - hover, hover - vehicle.rotor_min)
    reserved = ROTOR_MARGIN * (vehicle.rotor_max - vehicle.rotor_min)
    max_deviation = min(headroom / SIGMAS, reserved / SIGMAS_RESERVED)

    def bandwidths(omega_R: float) -> tuple[float, float, float, float]:
        omega_q = omega_R / requirements.attitude_ratio
        omega_x = omega_q / requirements.cable_ratio
        return requirements.integral_ratio * omega_x, omega_x, omega_q, omega_R

    def evaluate_at(omega_R: float) -> tuple[float, float]:
        return evaluate(*bandwidths(omega_R), requirements.zeta, requirements.noise, timing, vehicle)

    low, high = math.log(_MIN_OMEGA_R), math.log(_MAX_OMEGA_R)
    for _ in range(20):
        middle = 0.5 * (low + high)
        tolerance, deviation = evaluate_at(math.exp(middle))
        if tolerance >= requirements.tolerance and deviation <= max_deviation:
            low = middle
        else:
            high = middle
    max_omega_q = requirements.cable_ratio * MAX_SWING_RATIO * math.sqrt(swing_stiffness(vehicle))
    omegas = bandwidths(min(math.exp(low), requirements.attitude_ratio * max_omega_q))
    tolerance, _ = evaluate_at(omegas[-1])
    return Design(gains_of(*omegas, requirements.zeta, vehicle), *omegas, tolerance)
