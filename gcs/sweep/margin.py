"""The range of a parameter by linear theory: until an eigenvalue of hovering leaves the unit circle.

The loop is that of load position: the vehicle of (2-30)-(2-35) about hover with first-order rotors and a
transport delay, sampled with a zero-order hold, and the flown law, linearised by central differences of its
own tick. The state is assumed to be known: the effects of estimator and sensors are seen only in flights.
Mass and wind are not estimated meanwhile.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from scipy.linalg import expm

from autopilot.control.actuators.disturbance_observer import nominal_in_flight
from autopilot.control.actuators.rotor_model import Actuation, advance, queue_rows, steady_actuation
from autopilot.control.laws.interface import kernels_of
from autopilot.control.linear_model import LOAD_STATES, hover_thrust, load_state_space
from autopilot.control.records import Cable, Reference, State, Vehicle
from autopilot.core.flight_core import Setup
from autopilot.geometry.linear import E1, ZERO, Vec3
from autopilot.onboard.onboard import build_setup
from autopilot.vehicle.file import load_belief
from autopilot.vehicle.parameters import LAWS, apply_settings, autopilot_parameters
from autopilot.vehicle.rates import RateError
from autopilot.wire.parameter_table import ParameterError
from gcs.analysis.axes import Floats
from gcs.sweep.plan import SweepPlan, own_parameter_names, simulator_settings
from sitl.settings import settings_of
from sitl.vehicles.sim_parameters import apply as apply_parameters
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import load_truth

STEP = 1e-5  # central differences: truncation and rounding both below 1e-9
STABILITY_LIMIT = (
    1.0 + 1e-7
)  # spectral radius; numbers that the law stores but does not use have eigenvalue 1
SEARCH_STEPS = 12  # steps of the search from the default value to the end of the range
BISECTIONS = 6
CUSTOM_LAW = "not computed"  # in place of the range of a custom law
SETTLE_TICKS = 500  # in which the memory of a law settles while hovering


def sampled_plant(
    A: Floats, B: Floats, tau: float, delay: float, period: float
) -> tuple[Floats, Floats, Floats]:
    """(A, B, C) from one tick to the next of x' = A x + B u with held commands u = (f, M): exact.

    States are x (n), the rotors if their lag `tau` is not zero, and the delayed commands, oldest first; C
    gives x. A command of tick k acts from t_k + `delay` until that of tick k + 1 acts. Times in seconds.
    """
    n = len(A)
    if tau > 0.0:
        A = np.block([[A, B], [np.zeros((4, n)), -np.eye(4) / tau]])
        B = np.vstack([np.zeros((n, 4)), np.eye(4) / tau])
    full_periods = math.floor(delay / period + 1e-9)
    remainder = max(0.0, delay - full_periods * period)

    def hold(duration: float) -> tuple[Floats, Floats]:
        E = expm(np.block([[A, B], [np.zeros((4, len(A) + 4))]]) * duration)
        return E[: len(A), : len(A)], E[: len(A), len(A) :]

    Phi, _ = hold(period)
    Phi_new, Gamma_new = hold(period - remainder)
    Gamma_old = Phi_new @ hold(remainder)[1]
    m, queue = len(A), full_periods + 1
    size = m + 4 * queue
    A_d, B_d = np.zeros((size, size)), np.zeros((size, 4))
    A_d[:m, :m] = Phi
    A_d[:m, m : m + 4] = Gamma_old
    if full_periods == 0:
        B_d[:m] = Gamma_new
    else:
        A_d[:m, m + 4 : m + 8] = Gamma_new
    A_d[m : size - 4, m + 4 :] = np.eye(4 * (queue - 1))
    B_d[size - 4 :] = np.eye(4)
    C_d = np.zeros((n, size))
    C_d[:, :n] = np.eye(n)
    return A_d, B_d, C_d


def state_near_hover(motion: Floats, vehicle: Vehicle) -> State:
    """The state near hover with these LOAD_STATES, on the manifolds of q and R to second order."""
    q_x, q_y = float(motion[6]), float(motion[7])
    q_z = -math.sqrt(1.0 - q_x * q_x - q_y * q_y)
    q = np.array([q_x, q_y, q_z])
    q_dot = np.array([motion[8], motion[9], -(q_x * motion[8] + q_y * motion[9]) / q_z])
    a, b, c = motion[10:13]
    R = expm(np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]]))
    x, v, L = motion[0:3], motion[3:6], vehicle.cable_length
    return State(
        _vec(x),
        _vec(v),
        _vec(q),
        _vec(q_dot),
        _vec(x - L * q),
        _vec(v - L * q_dot),
        (_vec(R[0]), _vec(R[1]), _vec(R[2])),
        _vec(motion[13:16]),
    )


def _vec(a: Floats) -> Vec3:
    return (float(a[0]), float(a[1]), float(a[2]))


def _numbers(record: Any) -> Iterator[float]:
    """Every number of a record of records, vectors and arrays."""
    if isinstance(record, np.ndarray):
        yield from record.ravel().tolist()
    elif isinstance(record, tuple):
        for part in record:
            yield from _numbers(part)
    else:
        yield float(record)


def _same_form(record: Any, numbers: Iterator[float]) -> Any:
    """A record of the same form with other numbers."""
    if isinstance(record, np.ndarray):
        return np.array([next(numbers) for _ in range(record.size)]).reshape(record.shape)
    if isinstance(record, tuple):
        parts = [_same_form(part, numbers) for part in record]
        return type(record)(*parts) if hasattr(record, "_fields") else tuple(parts)
    return next(numbers)


def linearised_law(setup: Setup) -> tuple[Floats, Floats, Floats, Floats]:
    """(A, B, C, D) of the law at hover: states are its memory, inputs the motion, outputs (f, M)."""
    vehicle, law = setup.vehicle, setup.law
    reference = Reference((ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO), E1)
    observed = nominal_in_flight(vehicle)
    kernels, cable = kernels_of(law), Cable(vehicle.cable_length)
    motion = np.zeros(LOAD_STATES)
    hover = state_near_hover(motion, vehicle)

    def tick(memory: Any, actuation: Actuation, state: State) -> tuple[Any, Actuation, Floats]:
        memory, command = kernels.load_position(law, memory, state, reference, actuation, observed, cable)
        after = advance(actuation, command.thrust, command.moment, setup.actuation)
        return memory, after, np.array([command.thrust, *command.moment])

    actuation = steady_actuation(hover_thrust(vehicle), queue_rows(setup.actuation))
    memory = kernels.start(law, hover, ZERO, ZERO)
    for _ in range(SETTLE_TICKS):
        memory, actuation, _ = tick(memory, actuation, hover)
    form = (memory, actuation)
    equilibrium = np.array(list(_numbers(form)))
    n = len(equilibrium)

    def step(point: Floats) -> Floats:
        memory, actuation = _same_form(form, iter(point[:n].tolist()))
        after, next_actuation, command = tick(memory, actuation, state_near_hover(point[n:], vehicle))
        return np.array([*_numbers((after, next_actuation)), *command])

    point = np.concatenate([equilibrium, motion])
    jacobian = np.empty((n + 4, n + LOAD_STATES))
    for j in range(n + LOAD_STATES):
        offset = np.zeros(n + LOAD_STATES)
        offset[j] = STEP
        jacobian[:, j] = (step(point + offset) - step(point - offset)) / (2.0 * STEP)
    return jacobian[:n, :n], jacobian[:n, n:], jacobian[n:, :n], jacobian[n:, n:]


def eigenvalue_moduli(vehicle: str, settings: Mapping[str, float]) -> list[float]:
    """Moduli of the eigenvalues of hovering, sorted, under settings by name."""
    import control

    table = autopilot_parameters(load_belief(vehicle))
    apply_settings(table, settings.items())
    truth = load_truth(vehicle)
    sim_table = sim_parameters(truth)
    for name, value in simulator_settings(settings).items():
        sim_table.set(name, value)
    true, period = apply_parameters(truth, sim_table), 1.0 / table["CTL_RATE_HZ"]
    setup = build_setup(table, 1)
    true_vehicle = setup.vehicle._replace(
        quad_mass=true.quad_mass,
        load_mass=true.load_mass,
        cable_length=true.cable_length,
        inertia=true.inertia,
        gravity=true.gravity,
    )
    delay = settings_of(sim_table).actuator_delay_us * 1e-6
    A, B, C = sampled_plant(*load_state_space(true_vehicle), true.rotor_tau, delay, period)
    world = control.ss(A, B, C, np.zeros((LOAD_STATES, 4)), period)
    law = control.ss(*linearised_law(setup), period)
    # feedback is already negative in the law itself
    return sorted(np.abs(control.feedback(world, law, sign=1).poles()).tolist())


def linear_range(
    plan: SweepPlan, law: str, name: str, nominal_value: float, limits: tuple[float, float]
) -> str:
    """The range of the parameter, within `limits`, in which the linear loop is stable; empty if the parameter
    is not part of the loop, or takes only some of the values in between; CUSTOM_LAW if the law is a custom
    one, which is not linearised. All other parameters have their defaults, or the values set for all
    flights."""
    # parameters of custom laws, of the estimator and of the planner
    own_parameters = frozenset().union(*(own_parameter_names(plan.own(other)) for other in plan.laws))
    if law not in LAWS:
        return CUSTOM_LAW
    if name in own_parameters:
        return ""
    fixed = {known: value for known, value in plan.settings if known not in own_parameters}
    fixed["CTL_LAW"] = float(LAWS.index(law))

    def moduli(value: float) -> list[float]:
        varied = plan.with_followers({name: value})
        known = {one: value for one in varied if one not in own_parameters}
        return eigenvalue_moduli(plan.vehicle, {**fixed, **known})

    try:
        return _stable_range(moduli, nominal_value, limits)
    except (ParameterError, RateError):  # of whole numbers, or of parameters varied together
        return ""


def _stable_range(
    moduli: Callable[[float], list[float]], nominal_value: float, limits: tuple[float, float]
) -> str:
    """The range around the nominal value in which the greatest of these moduli says that the loop is
    stable."""

    def is_stable(value: float) -> bool:
        return moduli(value)[-1] < STABILITY_LIMIT

    nominal, low, high = (moduli(value) for value in (nominal_value, *limits))
    if nominal == low == high:
        return ""
    if nominal[-1] >= STABILITY_LIMIT:
        return "nowhere"
    lowest, below = _boundary(is_stable, nominal_value, limits[0])
    highest, above = _boundary(is_stable, nominal_value, limits[1])
    return f"{'< ' if below else ''}{lowest:.4g} … {'> ' if above else ''}{highest:.4g}"


def _boundary(is_stable: Callable[[float], bool], inside: float, outside: float) -> tuple[float, bool]:
    """The last value on the way from `inside` to `outside` before it ceases to hold, and whether it held all
    the way (False if `outside` is zero, which is a natural end)."""
    if outside == inside:
        return inside, False
    low = inside
    for value in np.linspace(inside, outside, SEARCH_STEPS + 1)[1:].tolist():
        if not is_stable(value):
            high = value
            for _ in range(BISECTIONS):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if is_stable(middle) else (low, middle)
            return low, False
        low = value
    return outside, outside != 0.0
