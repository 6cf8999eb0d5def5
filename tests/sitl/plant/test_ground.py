"""The ground: standing, landing, tumbling, sliding, and a cable that lifts the load off it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.geometry.so3 import quat_exp
from benchmarks import plant_convergence as convergence
from sitl.plant.by_value import advance, advance_many, initial_state

CALM = (0.0, 0.0, 0.0)
OFF = (0.0, 0.0, 0.0, 0.0)

# equilibrium of spring and weight up to rounding, held for ten seconds
AT_REST = 1e-12
# stopped for every purpose: friction below its limit leaves an exponential of 500 1/s
STOPPED = 1e-6
# order of a step whose force has kinks at touch, lift and slip; measured 1.8
ORDER_LOW = 1.4
# friction begins with a ramp of slip speed mu g / slip_rate = 12 mm/s, and the landing spring with a wobble
SLIDE = 0.02


def _rest(state):
    return max(map(abs, (*state.v_quad, *state.v_load, *state.omega_body)))


def _lowest(state, truth, rotation_of):
    """Height of the lowest foot or blade tip above the ground, m."""
    s, r = truth.gear_spread, truth.rotor_reach
    points = [(a * s, b * s, -truth.gear_height) for a in (1, -1) for b in (1, -1)]
    points += [(r * a, r * b, truth.rotor_height) for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    return state.x_quad[2] + min((rotation_of(state) @ np.array(p))[2] for p in points)


@pytest.mark.parametrize("name", ["bebop", "thesis"])
def test_what_stands_stays(name, request):
    truth = request.getfixturevalue(name)
    start = initial_state(truth)
    state = start
    for _ in range(2500):
        state = advance(state, truth, OFF, CALM, 4e-3)
        assert (state.vehicle_on_ground, state.load_on_ground, state.taut) == (1.0, 1.0, 0.0)
    for field in ("x_load", "v_load", "x_quad", "v_quad", "quat_wxyz", "omega_body", "accel_quad"):
        assert getattr(state, field) == pytest.approx(getattr(start, field), abs=AT_REST), field


def test_start_is_at_home_with_the_cable_slack(bebop):
    state = initial_state(bebop)
    assert state.x_load == (0.0, 0.0, bebop.load_radius)
    assert state.x_quad == (-0.35, 0.0, bebop.gear_height)
    assert math.dist(state.x_load, state.x_quad) < bebop.cable_length


@pytest.mark.parametrize("quad_mass", [0.1, 0.4, 4.0])
def test_other_masses_stand_as_firmly(bebop, quad_mass):
    truth = bebop._replace(quad_mass=quad_mass, load_mass=0.5 * quad_mass)
    state = advance_many(initial_state(truth)._replace(v_quad=(0.1, 0.0, -0.2)), truth, OFF, CALM, 4e-3, 500)
    assert _rest(state) < STOPPED
    assert state.x_quad[2] == pytest.approx(truth.gear_height, abs=STOPPED)


@pytest.mark.parametrize("speed", [0.3, 2.0, 5.0, 20.0])
@pytest.mark.parametrize("tilt", [CALM, (0.3, -0.2, 0.5), (1.3, 0.2, 0.0), (math.pi, 0.05, 0.0)])
def test_every_landing_comes_to_rest_on_the_ground(bebop, rotation_of, speed, tilt):
    start = initial_state(bebop)._replace(
        x_quad=(-0.35, 0.0, 0.35),
        v_quad=(0.5, 0.3, -speed),
        quat_wxyz=quat_exp(tilt),
        omega_body=(1.0, 2.0, 3.0),
    )
    state = advance_many(start, bebop, OFF, CALM, 4e-3, 1500)
    assert state.diverged == 0.0
    assert _rest(state) < STOPPED
    # on its feet or on blade tips, each no deeper than the static deflection of three springs instead of four
    assert abs(_lowest(state, bebop, rotation_of)) < 2e-3
    assert state.vehicle_on_ground == 1.0


def test_a_gentle_landing_ends_upright(bebop):
    start = initial_state(bebop)._replace(
        x_quad=(-0.35, 0.0, 0.1), v_quad=(0.1, 0.1, -0.5), quat_wxyz=quat_exp((0.05, -0.05, 0.3))
    )
    state = advance_many(start, bebop, OFF, CALM, 4e-3, 500)
    assert state.x_quad[2] == pytest.approx(bebop.gear_height, abs=STOPPED)
    assert state.quat_wxyz[1:3] == pytest.approx((0.0, 0.0), abs=STOPPED)


def test_landing_takes_energy(bebop, energy):
    """After a drop nothing bounces above a tenth of the height it came from."""
    start = initial_state(bebop)._replace(x_quad=(-0.35, 0.0, 0.56), x_load=(0.0, 0.0, 0.52))
    state = advance_many(start, bebop, OFF, CALM, 4e-3, 90)
    peak_quad = peak_load = 0.0
    for _ in range(200):
        state = advance(state, bebop, OFF, CALM, 4e-3)
        peak_quad = max(peak_quad, state.x_quad[2] - bebop.gear_height)
        peak_load = max(peak_load, state.x_load[2] - bebop.load_radius)
    assert max(peak_quad, peak_load) < 0.05
    assert energy(state, bebop) < energy(start, bebop)


def test_friction_stops_a_slide_after_v2_over_2_mu_g(bebop):
    """The load alone, on a cable too long to matter."""
    truth = bebop._replace(cable_length=20.0, load_drag_quadratic=0.0)
    start = initial_state(bebop)._replace(v_load=(0.0, 2.0, 0.0))
    state = advance_many(start, truth, OFF, CALM, 4e-3, 250)
    expected = 2.0**2 / (2.0 * truth.friction * truth.gravity)
    assert state.x_load[1] == pytest.approx(expected, rel=SLIDE)
    assert _rest(state) < STOPPED


def test_wind_does_not_push_a_standing_vehicle_away(bebop):
    start = initial_state(bebop)
    state = advance_many(start, bebop, OFF, (4.0, 0.0, 0.0), 4e-3, 2500)
    # creep of friction below its limit: 0.27 N of drag over slip_rate m = 200 N s/m, ten seconds
    assert 0.0 < state.x_quad[0] - start.x_quad[0] < 0.02
    assert state.x_quad[2] == pytest.approx(bebop.gear_height, abs=1e-4)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6])
def test_hovering_with_part_of_a_load_that_stays_on_the_ground(thesis, share):
    """Vertical cable: T = f - m_Q g, and the ground carries what the cable does not."""
    height = thesis.load_radius + thesis.cable_length
    state = initial_state(thesis)._replace(
        x_quad=(0.0, 0.0, height), q_cable=(0.0, 0.0, -1.0), taut=1.0, vehicle_on_ground=0.0
    )
    carried = share * thesis.load_mass * thesis.gravity
    # slightly more, so that the cable stays taut where the load carries itself
    lift = thesis.quad_mass * thesis.gravity + carried + 1e-3
    state = advance_many(state, thesis, (0.25 * lift,) * 4, CALM, 4e-3, 750)
    assert (state.taut, state.load_on_ground, state.vehicle_on_ground) == (1.0, 1.0, 0.0)
    assert state.tension == pytest.approx(carried + 1e-3, abs=1e-6)
    assert state.x_load[2] - thesis.load_radius < 1e-3
    assert _rest(state) < 1e-5


def test_take_off_with_the_load(bebop):
    """From standing: the cable comes taut, drags and lifts the load, and both leave the ground."""
    state = initial_state(bebop)
    hover = 0.25 * (bebop.quad_mass + bebop.load_mass) * bebop.gravity
    state = advance_many(state, bebop, (1.1 * hover,) * 4, CALM, 4e-3, 200)
    assert state.vehicle_on_ground == 0.0
    assert state.diverged == 0.0
    state = advance_many(state, bebop, (1.1 * hover,) * 4, CALM, 4e-3, 200)
    assert (state.taut, state.load_on_ground) == (1.0, 0.0)
    assert state.slack_events < 10.0


def test_order_of_the_step_near_the_ground():
    errors, order = convergence.study("contact", (5e-4, 2.5e-4, 1.25e-4, 6.25e-5))
    assert order > ORDER_LOW
    assert errors[5e-4] < 1e-3


@settings(max_examples=40)
@given(
    height=st.floats(0.06, 0.6),
    v=st.tuples(*[st.floats(-4.0, 4.0)] * 3),
    spin=st.tuples(*[st.floats(-10.0, 10.0)] * 3),
    tilt=st.tuples(*[st.floats(-2.0, 2.0)] * 3),
)
def test_any_throw_comes_to_rest(bebop, height, v, spin, tilt):
    start = initial_state(bebop)._replace(
        x_quad=(-0.3, 0.0, height), v_quad=v, omega_body=spin, quat_wxyz=quat_exp(tilt)
    )
    state = advance_many(start, bebop, OFF, CALM, 4e-3, 1500)
    assert state.diverged == 0.0
    assert _rest(state) < 1e-4
    assert -0.01 < state.x_load[2] - bebop.load_radius < 0.01
