"""The law `plumbline`: its derivatives against differences along the independent model, its feed-forward
against the flat trajectory, its rotors against rotors, and what it flies.
"""

from __future__ import annotations

import ast
import importlib.util
import math
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import autopilot
from autopilot import rotor_lag
from autopilot.control import direction_jet, load_motion, plumbline
from autopilot.control.command_filter import filter_constants
from autopilot.control.load_motion import Drag
from autopilot.control.records import Jet, Reference, State, Vehicle
from autopilot.geometry.so3 import rotation_from_quat
from autopilot.laws import PlumblineLaw, build_law
from autopilot.mixer import mix
from autopilot.vehicle.belief import BeliefError, load_belief
from autopilot.vehicle.parameters import LAWS, autopilot_parameters
from missions.fileformat import load_mission
from missions.flatness import flat_outputs
from missions.model import Signals
from missions.signals import evaluate, signal_table
from sitl.plant.records import PlantState, Truth
from sitl.plant.step import advance, initial_state
from sitl.truth import load_truth

Array = NDArray[np.float64]
ROOM = Path(autopilot.__file__).parent
HERE = Path(__file__).parent
FILES = ("control/load_motion.py", "control/direction_jet.py", "control/plumbline.py", "rotor_lag.py")

ZERO, EAST = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)
TICK = 0.004
CALM_AIR = Drag(0.0, 0.0)
BEBOP_DRAG = Drag(0.02, 0.012)
FILTER = filter_constants(plumbline.OMEGA_FORCE, plumbline.ZETA, TICK)
GAINS = plumbline.PLUMBLINE_GAINS
H = 1e-3  # s, of the differences
# five-point differences: H^4/30 times a fifth derivative of up to 1e5; rounding 1e-15 / H^2 times 10 N
DIFFERENCE = 1e-7
SECOND_DIFFERENCE = 5e-6
ROUNDING = 1e-9  # sixth derivatives of 1e3, a hundred operations
# m, largest load error on the true vehicle, the state known: measured 3 and 19 mm
FLOWN = {"case-b": 0.010, "case-c": 0.025}


def imported(name: str, path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


def compiled() -> SimpleNamespace:
    return SimpleNamespace(
        load_motion=load_motion.load_motion,
        air_force=load_motion.air_force,
        position_jet=direction_jet.position_jet,
        direction_jet=direction_jet.direction_jet,
        start=plumbline.start,
        load_position=plumbline.load_position,
        lag_constants=rotor_lag.lag_constants,
        hasten=rotor_lag.hasten,
    )


def polynomial(coefficients: Array, t: float) -> Jet:
    """Position and six derivatives of the path with these derivatives at 0, (n, 3)."""
    jet = []
    for k in range(7):
        value = np.zeros(3)
        for n in range(k, len(coefficients)):
            value = value + coefficients[n] * t ** (n - k) / math.factorial(n - k)
        jet.append((float(value[0]), float(value[1]), float(value[2])))
    return (jet[0], jet[1], jet[2], jet[3], jet[4], jet[5], jet[6])


def differences(f: Callable[[float], Any]) -> tuple[Array, Array]:
    """First and second derivative of f at 0, by five points."""
    a, b, c, d, e = (np.asarray(f(k * H)) for k in (-2, -1, 0, 1, 2))
    return (a - 8 * b + 8 * d - e) / (12 * H), (-a + 16 * b - 30 * c + 16 * d - e) / (12 * H * H)


def random_path(
    rng: np.random.Generator, model: SimpleNamespace, vehicle: Vehicle
) -> tuple[Callable[[float], State], float, float]:
    """State of the model at t near 0 under a thrust f + f' t and a moment; with f and f'."""
    f, f_rate = 5.0 + rng.normal(), 8.0 * rng.normal()
    M = 0.01 * rng.normal(size=3)
    q = model.unit(0.5 * rng.normal(size=3) - [0.0, 0.0, 1.0])
    w = np.cross(q, 1.5 * rng.normal(size=3))
    R = model.rodrigues(0.4 * rng.normal(size=3))
    y0 = model.pack(rng.normal(size=3), rng.normal(size=3), q, w, R, rng.normal(size=3))

    def at(t: float) -> State:
        y, n = y0, 2
        h = t / n
        for k in range(n):
            begin, middle, end = (f + f_rate * (k + part) * h for part in (0.0, 0.5, 1.0))
            k1 = model.rates(y, begin, M, vehicle)
            k2 = model.rates(y + 0.5 * h * k1, middle, M, vehicle)
            k3 = model.rates(y + 0.5 * h * k2, middle, M, vehicle)
            k4 = model.rates(y + h * k3, end, M, vehicle)
            y = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        state: State = model.state_of(y, vehicle)
        return state

    return at, f, f_rate


def agree(found: Any, expected: Array, tolerance: float) -> None:
    np.testing.assert_allclose(found, expected, atol=tolerance * (1.0 + np.abs(expected).max()), rtol=0.0)


# ---- proofs; each takes the law's functions, so that altered ones can be tried


def motion_is_that_of_the_model(law: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """Second and third derivatives of x_L and q against differences of v_L and q' along the model."""
    for seed in range(3):
        at, f, f_rate = random_path(np.random.default_rng([21, seed]), model, vehicle)
        motion = law.load_motion(at(0.0), f, f_rate, ZERO, vehicle)
        states = {k * H: at(k * H) for k in range(-2, 3)}
        a, j = differences(lambda t, s=states: s[t].v_load)  # type: ignore[misc]
        q2, q3 = differences(lambda t, s=states: s[t].q_cable_dot)  # type: ignore[misc]
        agree(motion.a_load, a, DIFFERENCE)
        agree(motion.q_ddot, q2, DIFFERENCE)
        agree(motion.j_load, j, SECOND_DIFFERENCE)
        agree(motion.q_dddot, q3, SECOND_DIFFERENCE)


def direction_is_differentiated(law: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """A, q_c and their two derivatives, with feedback and a moving reference, against differences."""
    k_x, k_v = (6.0, 5.0, 7.0), (2.75, 2.0, 3.0)
    for seed in range(3):
        rng = np.random.default_rng([22, seed])
        at, f, f_rate = random_path(rng, model, vehicle)
        path = rng.normal(size=(7, 3))
        positions = {}
        for k in range(-2, 3):
            t = k * H
            motion = law.load_motion(at(t), f + f_rate * t, f_rate, ZERO, vehicle)
            positions[t] = law.position_jet(at(t), motion, polynomial(path, t), k_x, k_v, vehicle)
        here, state = positions[0.0], at(0.0)
        command = law.direction_jet(here, state)
        A_dot, A_ddot = differences(lambda t, p=positions: p[t].A)  # type: ignore[misc]
        c_dot, c_ddot = differences(lambda t, p=positions: -model.unit(p[t].A))  # type: ignore[misc]
        agree(command.q_c, -model.unit(here.A), ROUNDING)
        agree(here.e_x, np.array(state.x_load) - path[0], ROUNDING)
        agree(here.e_v, np.array(state.v_load) - path[1], ROUNDING)
        agree(here.A_dot, A_dot, DIFFERENCE)
        agree(command.q_c_dot, c_dot, DIFFERENCE)
        agree(here.A_ddot, A_ddot, SECOND_DIFFERENCE)
        agree(command.q_c_ddot, c_ddot, SECOND_DIFFERENCE)


def level_state(model: SimpleNamespace) -> State:
    return State(ZERO, ZERO, (0.0, 0.0, -1.0), ZERO, (0.0, 0.0, 0.7), ZERO, model.mat(np.eye(3)), ZERO)


def drag_is_flown_against(law: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """It opposes the velocity, moves the load as a force does, and is made up for by thrust."""
    v = (1.0, -2.0, 2.0)
    agree(law.air_force(v, Drag(0.1, 0.2)), -0.7 * np.array(v), ROUNDING)
    at, f, _ = random_path(np.random.default_rng(23), model, vehicle)
    state = at(0.0)
    b3, air = np.array(state.R)[:, 2], 0.3
    pushed = law.load_motion(state, f, 0.0, model.vec(air * b3), vehicle)
    stronger = law.load_motion(state, f + air, 0.0, ZERO, vehicle)
    agree(pushed.a_load, np.array(stronger.a_load), ROUNDING)
    agree(pushed.q_ddot, np.array(stronger.q_ddot), ROUNDING)

    reference = Reference((ZERO,) * 7, EAST)
    level = level_state(model)
    climbing = level._replace(v_quad=(0.0, 0.0, 2.0))
    thrusts = []
    for s, drag in ((level, BEBOP_DRAG), (climbing, BEBOP_DRAG), (climbing, CALM_AIR)):
        _, command = law.load_position(law.start(), s, reference, 4.905, GAINS, FILTER, drag, vehicle)
        thrusts.append(command.thrust)
    # along the cable nothing depends on the load's acceleration
    assert thrusts[1] - thrusts[0] == pytest.approx((0.02 + 0.012 * 2.0) * 2.0, abs=ROUNDING)
    assert thrusts[2] == pytest.approx(thrusts[0], abs=ROUNDING)


def on_the_path_it_asks_for_what_the_path_needs(
    law: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle
) -> None:
    """On its reference, everything as flatness says, it gives the flat thrust, moment and thrust rate."""
    for seed in range(3):
        path = 0.6 * np.random.default_rng([24, seed]).normal(size=(7, 3))
        m_Q, m_L, L, J, g = vehicle[:5]

        def flat(t: float, path: Array = path) -> Any:
            return flat_outputs(polynomial(path, t), 0.0, m_Q, m_L, L, J, g)  # noqa: B023

        rate = float(differences(lambda t, flat=flat: flat(t).thrust)[0])  # type: ignore[misc]
        there, jet = flat(0.0), polynomial(path, 0.0)
        state = State(
            jet[0],
            jet[1],
            there.q_cable,
            there.q_cable_dot,
            there.x_quad,
            there.v_quad,
            there.R,
            there.omega_body,
        )
        memory, command = law.load_position(
            law.start()._replace(thrust_rate=rate),
            state,
            Reference(jet, EAST),
            there.thrust,
            GAINS,
            FILTER,
            CALM_AIR,
            vehicle,
        )
        agree(memory.force.u, np.zeros(3), DIFFERENCE)  # nothing is left for the filter
        assert memory.thrust_rate == pytest.approx(rate, abs=DIFFERENCE * (1.0 + abs(rate)))
        assert command.thrust == pytest.approx(there.thrust, abs=DIFFERENCE)
        agree(command.moment, np.array(there.moment), DIFFERENCE)


def thrust_rate_counts_the_turn_of_the_body(
    law: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle
) -> None:
    """A force at rest, seen by a body that turns: f' = F . R hat(Omega) e_3."""
    rng = np.random.default_rng(25)
    R, W = model.rodrigues(0.4 * rng.normal(size=3)), rng.normal(size=3)
    state = level_state(model)._replace(R=model.mat(R), omega_body=model.vec(W))
    reference = Reference((ZERO,) * 7, EAST)
    memory, command = law.load_position(
        law.start(), state, reference, 4.905, GAINS, FILTER, CALM_AIR, vehicle
    )
    axis = np.array(command.R_c)[:, 2]
    F = command.thrust / (axis @ R[:, 2]) * axis
    assert memory.thrust_rate == pytest.approx(F @ R @ model.hat(W)[:, 2], abs=ROUNDING)


def rotors_follow_as_wanted(law: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """Rotors of 20 ms asked as `hasten` says follow a changing wish as rotors of 8 ms would."""
    lag, wanted = 0.020, 0.008
    constants = law.lag_constants(lag, wanted, TICK)
    held, fast = math.exp(-TICK / lag), math.exp(-TICK / wanted)
    rng = np.random.default_rng(26)
    rotors, believed = np.array([4.9, 0.0, 0.0, 0.0]), rotor_lag.Rotating(4.9, ZERO)
    for _ in range(30):
        wish = np.array([4.9, 0.0, 0.0, 0.0]) + np.array([0.2, 0.005, 0.005, 0.005]) * rng.normal(size=4)
        believed, thrust, moment = law.hasten(
            believed, float(wish[0]), model.vec(wish[1:]), constants, vehicle, 1.0
        )
        expected = wish + fast * (rotors - wish)
        asked = np.array([thrust, *moment])
        rotors = asked + held * (rotors - asked)
        agree(rotors, expected, ROUNDING)
        agree([believed.thrust, *believed.moment], rotors, ROUNDING)


def it_comes_back(law: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """From 0.18 m off and a swinging cable the model is at rest at its place after 5 s."""
    dt = 0.008
    force_filter = filter_constants(plumbline.OMEGA_FORCE, plumbline.ZETA, dt)
    q = model.unit([0.03, -0.02, -1.0])
    y = model.pack((0.15, -0.1, 0.05), ZERO, q, np.cross(q, (0.1, 0.1, 0.0)), np.eye(3), ZERO)
    memory, thrust, reference = law.start(), 4.905, Reference((ZERO,) * 7, EAST)
    for _ in range(600):
        state = model.state_of(y, vehicle)
        memory, command = law.load_position(
            memory, state, reference, thrust, GAINS, force_filter, CALM_AIR, vehicle
        )
        thrust = command.thrust
        y = model.rk4(y, thrust, command.moment, vehicle, dt)
        assert np.isfinite(y).all()
        assert np.abs(y[:3]).max() < 0.4
    assert np.abs(y[:6]).max() < 0.01


PROOFS: tuple[Callable[..., None], ...] = (
    thrust_rate_counts_the_turn_of_the_body,
    drag_is_flown_against,
    motion_is_that_of_the_model,
    direction_is_differentiated,
    on_the_path_it_asks_for_what_the_path_needs,
    rotors_follow_as_wanted,
    it_comes_back,
)
# flips that change nothing, each with the reason
HARMLESS = {
    "control/plumbline.py: commanded_attitude: cross(F, b1_d) [0]": "only its length is used",
}


@pytest.mark.parametrize("proved", PROOFS, ids=lambda function: function.__name__)
def test_proved(proved: Callable[..., None], model: SimpleNamespace, bebop: Vehicle) -> None:
    proved(compiled(), model, bebop)


def test_each_flip_fails_a_proof(model: SimpleNamespace, bebop: Vehicle) -> None:
    """Every sign of the law's own files, turned over one at a time, makes a proof fail."""
    flipper = imported("flipper_of_plumbline", HERE / "test_proofs.py")
    texts = {name: (ROOM / name).read_text() for name in FILES}
    survivors, count = [], 0
    for file, text in texts.items():
        for name, altered in flipper.flips(ast.parse(text)):
            label = f"{file}: {name}"
            if label in HARMLESS:
                continue
            count += 1
            law = model.plain_laws({**texts, file: ast.unparse(altered)})
            if flipper.survives(law, model, bebop, PROOFS):
                survivors.append(label)
    assert not survivors, "\n".join(survivors)
    assert count > 40, f"only {count} flips were found"


def test_compiled_and_plain_agree_to_the_bit(model: SimpleNamespace, bebop: Vehicle) -> None:
    plain, fast = model.plain_laws({name: (ROOM / name).read_text() for name in FILES}), compiled()
    constants = rotor_lag.lag_constants(0.02, 0.01, TICK)
    rng = np.random.default_rng(27)
    memories = [(law.start(), rotor_lag.Rotating(4.9, ZERO)) for law in (plain, fast)]
    for _ in range(10):
        at, f, _ = random_path(rng, model, bebop)
        state, reference = at(0.0), Reference(polynomial(rng.normal(size=(7, 3)), 0.0), EAST)
        said = []
        for n, law in enumerate((plain, fast)):
            memory, rotors = memories[n]
            memory, command = law.load_position(memory, state, reference, f, GAINS, FILTER, BEBOP_DRAG, bebop)
            rotors, *asked = law.hasten(rotors, command.thrust, command.moment, constants, bebop, 1.0)
            memories[n] = memory, rotors
            said.append(repr((memory, command, rotors, asked)))
        assert said[0] == said[1]


# ---- the edges


@pytest.mark.parametrize("a_d", [(0.0, 0.0, -9.81), (50.0, 0.0, -9.81), (-50.0, 0.0, -9.81)])
def test_no_reference_gives_a_command_that_is_no_number(
    a_d: tuple[float, float, float], model: SimpleNamespace, bebop: Vehicle
) -> None:
    """Free fall, and a force along the heading."""
    reference = Reference((ZERO, ZERO, a_d, ZERO, ZERO, ZERO, ZERO), EAST)
    for q in ((0.0, 0.0, -1.0), (-1.0, 0.0, 0.0)):
        state = level_state(model)._replace(q_cable=q)
        _, command = plumbline.load_position(
            plumbline.start(), state, reference, 4.9, GAINS, FILTER, CALM_AIR, bebop
        )
        assert np.isfinite([command.thrust, *command.moment]).all()


def test_rotors_that_are_fast_enough_are_left_alone() -> None:
    assert rotor_lag.lag_constants(0.02, 0.02, TICK).gain == 1.0
    assert rotor_lag.lag_constants(0.0, 0.01, TICK) == (1.0, 1.0)
    # at once: a whole lag made up for in one period
    assert rotor_lag.lag_constants(0.02, 0.0, TICK).gain == pytest.approx(1.0 / (1.0 - math.exp(-0.2)))


def test_what_the_mixer_cuts_off_is_known(bebop: Vehicle) -> None:
    constants = rotor_lag.lag_constants(0.02, 0.01, TICK)
    rotors = rotor_lag.Rotating(7.0, ZERO)
    for _ in range(200):
        rotors, _, _ = rotor_lag.hasten(rotors, 20.0, ZERO, constants, bebop, 1.0)
    assert rotors.thrust == pytest.approx(4.0 * bebop.rotor_max)


def built(**values: float) -> PlumblineLaw:
    table = autopilot_parameters(load_belief("bebop"))
    table.set("CTL_LAW", float(LAWS.index("plumbline")))
    for name, value in values.items():
        table.set(name, value)
    law = build_law(table)
    assert isinstance(law, PlumblineLaw)
    return law


def test_it_is_selected_by_its_number_and_set_by_its_parameters() -> None:
    law = built(PLB_KX=5.0)
    assert law.gains == GAINS._replace(k_x=(5.0, 5.0, 5.0))
    assert law.drag == BEBOP_DRAG
    assert law.lag == rotor_lag.lag_constants(0.02, 0.01, TICK)
    assert law.force_filter == FILTER
    assert law.ramp_lag_s == 0.0


def test_every_mode_flies_through_one_interface(model: SimpleNamespace) -> None:
    law, state = built(), level_state(model)
    memory = law.start(state, ZERO, ZERO)
    memory, one = law.load_position(memory, state, Reference((ZERO,) * 7, EAST))
    memory, two = law.load_attitude(memory, state, state.q_cable, EAST, 4.905)
    memory, three = law.quad_attitude(memory, state, state.R, 4.905)
    above = Reference((state.x_quad, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO), EAST)
    memory, four = law.quad_position(memory, state, above)
    assert [c.thrust for c in (one, two, three, four)] == pytest.approx([4.905] * 3 + [3.924])
    for command in (one, two, three, four):
        agree(command.moment, np.zeros(3), ROUNDING)


def test_a_vehicle_file_may_leave_out_rotor_lag_and_drag(tmp_path: Path) -> None:
    believed = load_belief("thesis")
    assert (believed.rotor_tau_s, believed.quad_drag_n_s_m, believed.quad_drag_quadratic_n_s2_m2) == (0, 0, 0)
    text = (ROOM / "vehicle" / "thesis.toml").read_text() + "rotor_tau_s = -0.01\n"
    (tmp_path / "backwards.toml").write_text(text)
    with pytest.raises(BeliefError, match=r"rotor_tau_s = -0.01; must be >= 0"):
        load_belief(str(tmp_path / "backwards.toml"))


# ---- margins and flights


def test_margins_and_noise_are_what_the_filter_was_chosen_for() -> None:
    """docs/control.md: 45 deg, factors of 2 up and 1.75 down, 15 ms, three deviations within the limits."""
    tool = imported("margin_of_plumbline", HERE.parents[1] / "benchmarks" / "cascade_margin.py")
    settings = tool.Settings(rotor_tau=0.02, loop="plumbline")
    margin = tool.margin(settings)
    assert margin.stable
    assert margin.phase_deg > 45.0
    assert margin.gain_up > 2.0
    assert margin.gain_down < 1.0 / 1.75
    assert margin.delay > 0.015
    deviation = math.sqrt(sum(newtons**2 for _, _, newtons in tool.rotor_noise(settings)))
    assert 3.0 * deviation < tool.BEBOP.rotor_max - tool.HOVER


def aloft(truth: Truth) -> PlantState:
    return initial_state(truth)._replace(
        x_load=(0.0, 0.0, 10.0),
        q_cable=(0.0, 0.0, -1.0),
        x_quad=(0.0, 0.0, 10.0 + truth.cable_length),
        rotor_force=(1.22625, 1.22625, 1.22625, 1.22625),
        taut=1.0,
        vehicle_on_ground=0.0,
        load_on_ground=0.0,
    )


def sensed(state: PlantState) -> State:
    return State(
        state.x_load,
        state.v_load,
        state.q_cable,
        state.q_cable_dot,
        state.x_quad,
        state.v_quad,
        rotation_from_quat(state.quat_wxyz),
        state.omega_body,
    )


@pytest.mark.parametrize("mission", FLOWN)
def test_cases_are_flown_within_true_limits(mission: str, bebop: Vehicle) -> None:
    """Rotor limits, 20 ms of rotor lag and drag as they are; the state is known."""
    law, truth = built(), load_truth("bebop")
    signals = next(s for s in load_mission(mission).steps if isinstance(s, Signals))
    rows = signal_table(signals.terms)
    state = aloft(truth)
    memory = law.start(sensed(state), state.x_load, ZERO)
    worst = 0.0
    for k in range(round(signals.duration_s / TICK)):
        x, v, a, j, snap, c, p = evaluate(rows, k * TICK)
        reference = Reference(((x[0], x[1], x[2] + 10.0), v, a, j, snap, c, p), EAST)
        memory, command = law.load_position(memory, sensed(state), reference)
        worst = max(worst, math.dist(state.x_load, reference.jet[0]))
        forces = mix(command.thrust, command.moment, bebop, 1.0).forces
        state = advance(state, truth, forces, ZERO, TICK)
        assert state.taut == 1.0
    assert worst < FLOWN[mission]
