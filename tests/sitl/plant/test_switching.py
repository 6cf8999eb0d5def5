"""Slack flight, coming taut, going slack: where it happens and what it conserves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks import plant_convergence as convergence
from sitl.plant.by_value import advance, advance_many, initial_state
from sitl.plant.impact import at_cable_length
from sitl.plant.records import Motion

CALM = (0.0, 0.0, 0.0)
OFF = (0.0, 0.0, 0.0, 0.0)

# required: 1e-6. The motion before is a parabola, which a fourth-order step integrates without error
IMPACT = 1e-10
# momentum and energy across an impact: rounding of sums of about 100
ROUNDING = 1e-11
# fourth order through releases and impacts, measured over steps of 4 ... 0.5 ms
ORDER_LOW, ORDER_HIGH = 3.7, 4.5


@pytest.fixture(scope="module")
def worked(thesis):
    """Vehicle of 1 kg held by its thrust, load of 0.5 kg dropped half a metre below it, L = 2 m."""
    truth = thesis._replace(quad_mass=1.0, load_mass=0.5, cable_length=2.0)
    start = initial_state(truth)._replace(
        x_quad=(0.0, 0.0, 50.0), x_load=(0.0, 0.0, 49.5), q_cable=(0.0, 0.0, -1.0)
    )
    return truth, start, (truth.quad_mass * truth.gravity / 4.0,) * 4


def test_worked_taut_impact(worked, momentum):
    truth, start, hold = worked
    instant = math.sqrt(2.0 * 1.5 / truth.gravity)
    speed = truth.gravity * instant
    common = truth.load_mass * speed / (truth.load_mass + truth.quad_mass)
    assert (round(instant, 4), round(common, 3)) == (0.5530, 1.808)

    ticks = int(instant / 4e-3)
    state = advance_many(start, truth, hold, CALM, 4e-3, ticks)
    assert state.taut == 0.0
    # the instant, found from outside: the shortest step that ends taut
    low, high = 0.0, 4e-3
    while high - low > 1e-14:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if advance(state, truth, hold, CALM, middle).taut else (middle, high)
    assert ticks * 4e-3 + high == pytest.approx(instant, abs=IMPACT)
    before, after = advance(state, truth, hold, CALM, low), advance(state, truth, hold, CALM, high)
    assert before.v_load[2] == pytest.approx(-speed, abs=IMPACT)
    assert before.v_quad[2] == pytest.approx(0.0, abs=IMPACT)
    assert after.v_load[2] == pytest.approx(-common, abs=IMPACT)
    assert after.v_quad[2] == pytest.approx(-common, abs=IMPACT)
    assert math.dist(after.x_load, after.x_quad) == pytest.approx(truth.cable_length, abs=IMPACT)
    # the whole step: total momentum at t is m_L g t downward
    end = advance(state, truth, hold, CALM, 4e-3)
    time = (ticks + 1) * 4e-3
    assert momentum(end, truth)[2] == pytest.approx(-truth.load_mass * truth.gravity * time, abs=IMPACT)


def test_the_vehicle_hangs_on_after_the_impact(worked):
    """Thrust m_Q g after it: the pair falls with m_L g / (m_Q + m_L) and T = m_L m_Q g / (m_Q + m_L)."""
    truth, start, hold = worked
    state = advance_many(start, truth, hold, CALM, 4e-3, 200)
    share = truth.load_mass / (truth.load_mass + truth.quad_mass)
    assert state.taut == 1.0
    assert state.accel_quad[2] == pytest.approx(-share * truth.gravity, abs=1e-12)
    assert state.tension == pytest.approx(share * truth.quad_mass * truth.gravity, abs=1e-12)


def test_slack_flight_is_a_parabola(thesis):
    start = initial_state(thesis)._replace(
        x_quad=(0.0, 0.0, 60.0), x_load=(0.1, 0.0, 59.8), v_quad=(1.0, -2.0, 3.0), v_load=(1.2, -2.1, 3.1)
    )
    state = advance_many(start, thesis, OFF, CALM, 4e-3, 250)
    assert state.taut == 0.0
    assert state.tension == 0.0
    for x, v, x0, v0 in (
        (state.x_quad, state.v_quad, start.x_quad, start.v_quad),
        (state.x_load, state.v_load, start.x_load, start.v_load),
    ):
        fall = np.array([0.0, 0.0, thesis.gravity])
        assert np.array(x) == pytest.approx(np.array(x0) + np.array(v0) - 0.5 * fall, abs=1e-11)
        assert np.array(v) == pytest.approx(np.array(v0) - fall, abs=1e-11)
    distance = math.dist(state.x_load, state.x_quad)
    assert np.array(state.q_cable) * distance == pytest.approx(
        np.array(state.x_load) - np.array(state.x_quad), abs=1e-11
    )


def test_cable_goes_slack_when_the_tension_passes_zero(bebop, aloft):
    """Thrown upwards with the rotors stopping, the vehicle is braked by its drag and the load flies on."""
    state = aloft(bebop, v_load=(0.0, 0.0, 6.0), rotor_force=(1.9,) * 4)
    state = state._replace(v_quad=(0.0, 0.0, 6.0))
    while state.taut:
        before, state = state, advance(state, bebop, OFF, CALM, 4e-3)
    assert before.tension > 0.0
    assert (state.slack_events, state.tension) == (1.0, 0.0)
    # T = m_L/(m_L+m_Q) (f - drag_Q) + m_Q/(m_L+m_Q) drag_L = 0 in the vertical
    low, high = 0.0, 4e-3
    while high - low > 1e-12:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if advance(before, bebop, OFF, CALM, middle).taut else (low, middle)
    last = advance(before, bebop, OFF, CALM, low)
    v = last.v_load[2]
    drag_quad = bebop.quad_drag * v + bebop.quad_drag_quadratic * v * v
    drag_load = bebop.load_drag * v + bebop.load_drag_quadratic * v * v
    balance = bebop.load_mass * (sum(last.rotor_force) - drag_quad) + bebop.quad_mass * drag_load
    assert balance == pytest.approx(0.0, abs=1e-9)


def test_instant_rotors_release_the_cable_at_once(thesis, aloft):
    """Rotors that pull down faster than the load falls: slack from the first instant of the step on."""
    state = advance(aloft(thesis), thesis, (-0.1,) * 4, CALM, 4e-3)
    assert (state.taut, state.slack_events) == (0.0, 1.0)
    assert state.v_load[2] == pytest.approx(-thesis.gravity * 4e-3, abs=1e-14)
    assert state.v_quad[2] == pytest.approx(-(thesis.gravity + 0.4 / thesis.quad_mass) * 4e-3, abs=1e-14)


@pytest.mark.parametrize(("speed", "taut"), [(0.5, 1.0), (-0.5, 0.0)])
def test_a_stretched_cable_is_taken_up_at_once_unless_it_shortens(thesis, speed, taut):
    """What a step with too many impacts may leave behind: a distance a little above the cable length."""
    start = initial_state(thesis)._replace(
        x_quad=(0.0, 0.0, 50.0),
        x_load=(0.0, 0.0, 50.0 - thesis.cable_length - 1e-6),
        v_load=(0.0, 0.0, -speed),
        q_cable=(0.0, 0.0, -1.0),
    )
    state = advance(start, thesis, OFF, CALM, 1e-6)
    assert state.taut == taut
    if taut:
        assert math.dist(state.x_load, state.x_quad) == pytest.approx(thesis.cable_length, abs=1e-12)


def test_a_step_tells_at_which_speed_the_cable_came_taut(thesis):
    """0.5 m/s apart, both in free fall: nothing changes that speed before the distance is the length."""
    start = initial_state(thesis)._replace(
        x_quad=(0.0, 0.0, 50.0),
        x_load=(0.0, 0.0, 50.0 - thesis.cable_length + 1e-3),
        v_load=(0.0, 0.0, -0.5),
        q_cable=(0.0, 0.0, -1.0),
    )
    before = advance(start, thesis, OFF, CALM, 1e-3)
    assert (before.taut, before.snap_speed) == (0.0, 0.0)
    snapped = advance(before, thesis, OFF, CALM, 4e-3)
    assert snapped.taut == 1.0
    assert snapped.snap_speed == pytest.approx(0.5, abs=1e-9)
    assert advance(snapped, thesis, OFF, CALM, 4e-3).snap_speed == 0.0


@pytest.mark.parametrize("case", ["taut", "slack", "switching"])
def test_order_of_the_step_in_the_air(case):
    errors, order = convergence.study(case, (4e-3, 2e-3, 1e-3, 5e-4))
    assert ORDER_LOW < order < ORDER_HIGH
    assert errors[4e-3] < 1e-7  # m: far below any sensor


def test_the_switching_case_switches():
    _, end = convergence.fly(convergence.CASES["switching"](), 4e-3)
    assert end.slack_events >= 2.0


vectors = st.tuples(*[st.floats(-5.0, 5.0, allow_subnormal=False)] * 3)


@given(
    direction=vectors.filter(lambda v: math.hypot(*v) > 0.1),
    v_load=vectors,
    v_quad=vectors,
    mass_quad=st.floats(0.05, 20.0),
    mass_load=st.floats(0.01, 20.0),
)
def test_impact_keeps_momentum_and_never_gains_energy(
    thesis, direction, v_load, v_quad, mass_quad, mass_load
):
    truth = thesis._replace(quad_mass=mass_quad, load_mass=mass_load)
    u = np.array(direction) / math.hypot(*direction)
    v_load, v_quad = np.array(v_load), np.array(v_quad)
    motion = Motion(
        (0.0, 0.0, 10.0),
        tuple(map(float, v_load)),
        tuple(map(float, truth.cable_length * u)),
        tuple(map(float, v_load - v_quad)),
        (1.0, 0.0, 0.0, 0.0),
        CALM,
        truth.cable_length,
        0.0,
    )
    after = at_cable_length(motion, truth)
    v_load_after = np.array(after.v_load)
    v_quad_after = v_load_after - np.array(after.separation_dot)
    momentum = mass_load * v_load + mass_quad * v_quad
    assert mass_load * v_load_after + mass_quad * v_quad_after == pytest.approx(momentum, abs=ROUNDING)
    gained = mass_load * (v_load_after @ v_load_after - v_load @ v_load) + mass_quad * (
        v_quad_after @ v_quad_after - v_quad @ v_quad
    )
    assert gained <= ROUNDING * 100.0
    # along the cable both have the common speed, across it nothing changed
    common = (mass_load * v_load @ u + mass_quad * v_quad @ u) / (mass_load + mass_quad)
    for v_after, v in ((v_load_after, v_load), (v_quad_after, v_quad)):
        assert v_after @ u == pytest.approx(common, abs=ROUNDING)
        assert v_after - u * (v_after @ u) == pytest.approx(v - u * (v @ u), abs=ROUNDING)


@settings(max_examples=60)
@given(
    offset=vectors.filter(lambda v: math.hypot(*v) > 0.1),
    slackness=st.floats(0.0, 0.3),
    v_load=vectors,
    v_quad=vectors,
    command=st.tuples(*[st.floats(0.0, 2.0)] * 4),
)
def test_no_step_without_rotors_gains_energy(bebop, energy, offset, slackness, v_load, v_quad, command):
    """With any impacts and releases; with rotors, the ends are never farther apart than the length of the
    cable."""
    u = np.array(offset) / math.hypot(*offset)
    x_quad = np.array([0.0, 0.0, 100.0])
    x_load = x_quad + (1.0 - slackness) * bebop.cable_length * u
    state = initial_state(bebop)._replace(
        x_quad=tuple(map(float, x_quad)), x_load=tuple(map(float, x_load)), v_quad=v_quad, v_load=v_load
    )
    last = energy(state, bebop)
    for _ in range(100):
        state = advance(state, bebop, OFF, CALM, 4e-3)
        now = energy(state, bebop)
        # the integrator's own error at 4 ms: 1e-8 of about 500 J
        assert now < last + 1e-6
        last = now
    for _ in range(150):
        state = advance(state, bebop, command, CALM, 4e-3)
        assert math.dist(state.x_load, state.x_quad) < bebop.cable_length + 1e-9
