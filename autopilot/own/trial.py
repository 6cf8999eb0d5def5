"""Custom classes are tried before they fly: their methods are called a few times, as if near hover."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from autopilot.control.law_exchange import Asked, Believed, Held, Now
from autopilot.control.records import Cable, Reference, State
from autopilot.estimation.estimator_exchange import (
    NO_FORCES,
    DirectionSample,
    Driven,
    FieldSample,
    FixSample,
    HeightSample,
    InertialSample,
    LoadSample,
    PoseSample,
    Sensed,
)
from autopilot.geometry.linear import E1, IDENTITY, ZERO, Vec3, axpy
from autopilot.own.estimator import OwnEstimator, load_estimator
from autopilot.own.estimator_host import EstimatorHost
from autopilot.own.host import Host
from autopilot.own.law import OwnLaw, load_law
from autopilot.own.own_code import OwnCode, naming_option
from autopilot.own.planner import OwnPlanner, load_planner
from autopilot.own.planning import plan_function
from autopilot.own.source import OwnError
from autopilot.trajectory.feasibility import VehicleLimits
from autopilot.trajectory.route import PlanError, Route
from autopilot.vehicle.file import load_vehicle

TICKS = 3
_Q_CABLE: Vec3 = (0.0199986667, 0.0, -0.99980000)
_X_LOAD: Vec3 = (0.03, -0.02, 1.01)
_CORNER_POINTS: tuple[Vec3, ...] = ((0.0, 0.0, 1.0), (2.0, 0.0, 1.0), (2.0, 2.0, 1.5))
_X_D: Vec3 = (0.0, 0.0, 1.0)


def try_law(
    law: OwnLaw,
    parameters: Mapping[str, float],
    ticks: int = TICKS,
    on_command: Callable[[Asked], None] = lambda _: None,
) -> None:
    """Call each mode for a few ticks; `on_command` is called with each command.

    OwnError, with file and line, if the law cannot be made with these parameters, or commands something
    invalid.
    """
    host = Host(law)
    host.configure(parameters)
    for mode in law.modes:
        for tick in range(ticks):
            if not host.fault:
                on_command(host.command_once(mode, _hover_input(tick, parameters)))
    host.guard.raise_interruption()
    if host.fault:
        raise OwnError(f"{law.reference}: {host.fault}")


def try_estimator(estimator: OwnEstimator, parameters: Mapping[str, float], ticks: int = TICKS) -> None:
    """Call an estimator for a few ticks, with a new reading of every sensor at each.

    OwnError, with file and line, if it cannot be made with these parameters, or returns an invalid estimate.
    """
    host = EstimatorHost(estimator)
    host.configure(parameters)
    for tick in range(ticks):
        if not host.guard.fault:
            host.estimate_once(_hover_readings(tick, parameters))
    host.guard.raise_interruption()
    if host.guard.fault:
        raise OwnError(f"{estimator.reference}: {host.guard.fault}")


def try_planner(planner: OwnPlanner, parameters: Mapping[str, float]) -> None:
    """Let a planner plan a transfer, and a path through three points. OwnError, with file and line, if it
    fails or its path is invalid."""
    plan = plan_function(planner, parameters)
    vehicle = load_vehicle("bebop")
    limits = VehicleLimits(vehicle).shaping
    for points in (_CORNER_POINTS[:2], _CORNER_POINTS):
        route = Route(points, limits.speed_m_s, limits.accel_m_s2, False, limits.body, limits.bounds)
        try:
            plan(route)
        except PlanError as error:
            route_text = ", ".join(f"({', '.join(f'{x:g}' for x in point)})" for point in points)
            raise OwnError(f"{planner.reference}: on a trial route {route_text}: {error}") from None


def try_all(own: OwnCode, parameters: Mapping[str, float]) -> None:
    """Try all custom classes. OwnError, with file and line, if one of them cannot fly."""
    if own.law:
        with naming_option("law"):
            try_law(load_law(own.law), parameters)
    if own.estimator:
        with naming_option("estimator"):
            try_estimator(load_estimator(own.estimator), parameters)
    if own.planner:
        with naming_option("planner"):
            try_planner(load_planner(own.planner), parameters)


def _hover_input(tick: int, parameters: Mapping[str, float]) -> Now:
    length, period = parameters["VEH_CABLE_LEN"], 1.0 / parameters["CTL_RATE_HZ"]
    mass, load = parameters["VEH_QUAD_MASS"], parameters["VEH_LOAD_MASS"]
    inertia = (parameters["VEH_J_XX"], parameters["VEH_J_YY"], parameters["VEH_J_ZZ"])
    gravity = parameters["VEH_GRAVITY"]
    weight = (mass + load) * gravity
    state = _hover_state(length)
    reference = Reference((_X_D, (0.1, 0.0, 0.0), ZERO, ZERO, ZERO, ZERO, ZERO), E1)
    believed = Believed(mass, load, inertia, gravity, ZERO, weight, ZERO, False, False)
    held = Held((0.0, 0.0, -1.0), load * gravity, IDENTITY, weight)
    return Now(tick == 0, tick * period, period, state, reference, held, Cable(length), believed)


def _hover_state(length: float) -> State:
    return State(
        _X_LOAD,
        (0.01, 0.02, -0.01),
        _Q_CABLE,
        (0.0, 0.01, 0.0),
        axpy(-length, _Q_CABLE, _X_LOAD),
        (0.01, 0.01, -0.01),
        IDENTITY,
        (0.01, -0.02, 0.01),
    )


def _hover_readings(tick: int, parameters: Mapping[str, float]) -> Sensed:
    period = 1.0 / parameters["CTL_RATE_HZ"]
    length, gravity = parameters["VEH_CABLE_LEN"], parameters["VEH_GRAVITY"]
    weight = (parameters["VEH_QUAD_MASS"] + parameters["VEH_LOAD_MASS"]) * gravity
    state, now_s = _hover_state(length), tick * period
    rotor_force = 0.25 * weight
    return Sensed(
        tick == 0,
        now_s,
        period if tick else 0.0,
        InertialSample(True, now_s, state.omega_body, (0.0, 0.0, gravity)),
        PoseSample(True, now_s - 0.005, state.x_quad, state.R, state.v_quad, 1e-3, 2e-3, 0.02),
        LoadSample(True, now_s - 0.005, state.x_load, state.v_load, 1e-3, 0.02),
        DirectionSample(True, now_s - 0.02, _Q_CABLE, 5e-3),
        FixSample(True, now_s - 0.1, state.x_quad, state.v_quad, 0.02, 0.03, True),
        FieldSample(True, now_s, (0.2, 0.0, -0.4)),
        HeightSample(True, now_s, state.x_quad[2]),
        Driven(
            weight, ZERO, (rotor_force, rotor_force, rotor_force, rotor_force, *NO_FORCES[4:]), weight, ZERO
        ),
        Cable(length),
        True,
        state,
    )
