"""Legs: each jet holds its own derivatives, joins do not jump, and legs that must end at rest do."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from autopilot.control.laws import chosen_law
from autopilot.geometry.linear import Vec3, norm
from autopilot.guidance.legs import (
    LOAD_ATTITUDE,
    MAX_LEAN_SINE,
    QUAD_ATTITUDE,
    QUAD_POSITION,
    Brake,
    Creep,
    Hold,
    Leg,
    PathResume,
    PathStop,
    PathStretch,
    Reel,
    SignalRun,
    Swing,
    SwingDamping,
    Transfer,
    brake_leg,
    carry_leg,
    path_stop_leg,
    reel_leg,
    slack_leg,
)
from autopilot.supervisor.settings import path_limits
from autopilot.trajectory.shaping import shape, unshaped_signals
from autopilot.trajectory.slack_cable import LONG_WAY, LONG_WAY_SPEED, SLACK_ACCEL, SLACK_SPEED
from autopilot.trajectory.timeline import min_move_duration
from autopilot.trajectory.transfer import Pace, transfer_duration
from autopilot.trajectory.waypoint_path import PathSegment, plan_waypoint_path
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from missions.model import Signals, Sine, Term

HERE, THERE = (1.0, -2.0, 3.0), (2.0, 1.0, 2.5)
SIGNALS = Signals(4.0, (Term("y", 0.4, 0.3, 0.7, 1.0, 0.7, (Sine(1.3),)),))
TABLE = autopilot_parameters(load_vehicle("bebop"))
LIMITS = path_limits(TABLE, chosen_law(TABLE).follows_shaped)
SHAPED = shape(Signals(3.0, (Term("y", 0.2, 0.2, 0.7, None, 0.0),)), LIMITS.body, LIMITS.bounds)
POINTS = (HERE, THERE, (3.0, 1.0, 3.0))
_PATH, _TIMES = plan_waypoint_path(POINTS, 1.5, 1.5, LIMITS.body, LIMITS.bounds, False)
PASSAGE = PathSegment(_PATH.table(), 0.0, float(_TIMES[1]), HERE)
BRAKE = Brake(HERE, (1.2, -0.4, 0.1), (-0.5, 0.8, 0.2), 2.4)
LEGS: dict[str, Leg] = {
    "hold": Hold(HERE, 5.0),
    "transfer": carry_leg(HERE, THERE, 1.5, 1.5, 0.0),
    "long transfer": carry_leg(HERE, (40.0, -20.0, 9.0), 3.0, 1.5, 0.0),
    "brake": BRAKE,
    "creep": Creep(HERE, (0.0, 0.0, -0.2), QUAD_POSITION),
    "run": SignalRun(HERE, unshaped_signals(SIGNALS)),
    "shaped run": SignalRun(HERE, SHAPED),
    "pass": PathStretch(PASSAGE, (0.02, -0.01, 0.0), 1.7),
    "slow": PathStop(SignalRun(HERE, unshaped_signals(SIGNALS)), 0.9, 2.4),
    "resumed": PathResume(SignalRun(HERE, unshaped_signals(SIGNALS)), 0.9, 1.4),
    "swing": Swing(HERE, 0.1, 0.2, 1.5, QUAD_ATTITUDE),
    "reel": Reel(HERE, HERE[2] + 0.7, 0.4, 2.0, 0.6),
    "calm": SwingDamping(HERE, (0.2, 0.1, 0.0), (1.0, -0.5, 0.0), False, 1.2),
}
LEAST_S = min_move_duration(0.7, 9.81)
STEP_S = 1e-4
# central differences over 0.1 ms: second order, against derivatives that grow by up to 1e2 with each order
DIFFERENCE = 1e-5
# of the polynomial of degree 15, whose coefficients reach 24024
ROUNDING = 1e-10

vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


@pytest.mark.parametrize("name", LEGS)
def test_each_jet_holds_its_own_derivatives(name: str) -> None:
    leg = LEGS[name]
    for t in (0.15, 0.65, 1.1, 1.9):
        before, now, after = (np.array(leg.jet(s)) for s in (t - STEP_S, t, t + STEP_S))
        slope = (after - before) / (2.0 * STEP_S)
        size = np.abs(now[1:]).max(axis=1) + np.abs(now).max() * 1e-3 + 1.0
        assert (np.abs(slope[:-1] - now[1:]).max(axis=1) < DIFFERENCE * size).all(), t


def test_a_brake_is_the_integral_of_its_fading_velocity() -> None:
    u, T = sp.Symbol("u"), sp.Rational(12, 5)
    slope = u**6 * (1 - u) ** 6
    s = sp.integrate(sp.expand(slope / sp.integrate(slope, (u, 0, 1))), u)
    for axis in range(3):
        x0, v0, a0 = (
            sp.nsimplify(value[axis]) for value in (BRAKE.begin, BRAKE.velocity, BRAKE.acceleration)
        )
        velocity = sp.expand((v0 + a0 * T * u) * (1 - s))
        position = x0 + T * sp.integrate(velocity, u)
        expressions = [position] + [sp.diff(velocity, u, n) / T**n for n in range(6)]
        for k in (0, 3, 7, 10):
            jet = BRAKE.jet(2.4 * k / 10)
            for n, expression in enumerate(expressions):
                exact = float(expression.subs(u, sp.Rational(k, 10)))
                assert jet[n][axis] == pytest.approx(exact, abs=ROUNDING * 10.0**n), (axis, k, n)


@given(begin=vectors, velocity=vectors, acceleration=vectors, limit=st.floats(0.2, 5.0))
def test_a_brake_takes_motion_over_and_ends_it(
    begin: Vec3, velocity: Vec3, acceleration: Vec3, limit: float
) -> None:
    leg = brake_leg(begin, velocity, acceleration, limit, LEAST_S)
    start = leg.jet(0.0)
    assert start[0] == begin
    assert start[1] == pytest.approx(velocity, abs=ROUNDING)
    assert start[2] == pytest.approx(acceleration, abs=ROUNDING)
    end = leg.jet(leg.duration_s)
    assert end[0] == leg.end
    assert all(derivative == (0.0, 0.0, 0.0) for derivative in end[1:])
    assert leg.jet(leg.duration_s * (1.0 - 1e-9))[0] == pytest.approx(leg.end, abs=1e-6)
    assert leg.duration_s >= LEAST_S


@given(velocity=vectors, limit=st.floats(0.2, 5.0))
def test_a_brake_out_of_steady_motion_keeps_to_its_limit_and_never_turns_back(
    velocity: Vec3, limit: float
) -> None:
    leg = brake_leg(HERE, velocity, (0.0, 0.0, 0.0), limit, LEAST_S)
    along = [leg.jet(leg.duration_s * k / 50) for k in range(51)]
    assert max(norm(jet[2]) for jet in along) <= limit * (1.0 + 1e-9) or leg.duration_s == LEAST_S
    for jet in along:
        for v, v0 in zip(jet[1], velocity, strict=True):
            assert v * v0 >= -ROUNDING


@given(at=st.floats(0.0, 2.7), limit=st.floats(0.2, 5.0))
def test_a_stop_goes_on_where_its_leg_was_and_keeps_to_its_path(at: float, limit: float) -> None:
    run = SignalRun(HERE, unshaped_signals(SIGNALS))
    leg = path_stop_leg(run, at, limit, LEAST_S)
    assert leg.duration_s >= LEAST_S
    for stopped, going in zip(leg.jet(0.0), run.jet(at), strict=True):
        assert stopped == pytest.approx(going, abs=ROUNDING)
    end = leg.jet(leg.duration_s)
    assert end[0] == leg.end
    assert all(derivative == (0.0, 0.0, 0.0) for derivative in end[1:])
    assert leg.jet(leg.duration_s * (1.0 - 1e-9))[0] == pytest.approx(leg.end, abs=1e-6)


def test_a_stop_flies_no_part_of_its_path_faster() -> None:
    """The run reaches 2 m/s at the peak of its sine; a stop that begins while it accelerates must not become
    faster than that."""
    run = SignalRun(HERE, unshaped_signals(SIGNALS))
    fastest = max(norm(run.jet(0.02 * k)[1]) for k in range(200))
    leg = path_stop_leg(run, 0.75, 1.0, LEAST_S)
    speeds = [norm(leg.jet(leg.duration_s * k / 100)[1]) for k in range(101)]
    assert max(speeds) <= fastest + ROUNDING
    middle = leg.jet(0.5 * leg.duration_s)
    # the integral of 1 - s, a polynomial of degree 13, up to the middle
    passed = 0.75 + leg.duration_s * 0.4476318359375
    assert middle[0] == pytest.approx(run.jet(passed)[0], abs=1e-6)


def test_a_stop_out_of_a_stop_is_the_rest_of_it() -> None:
    first = path_stop_leg(SignalRun(HERE, unshaped_signals(SIGNALS)), 0.9, 1.5, LEAST_S)
    second = path_stop_leg(first, 0.4, 1.5, LEAST_S)
    third = path_stop_leg(second, 0.3, 1.5, LEAST_S)
    assert (third.leg, third.end) == (first.leg, first.end)
    assert third.duration_s == pytest.approx(first.duration_s - 0.7)
    for again, before in zip(third.jet(0.2), first.jet(0.9), strict=True):
        assert again == pytest.approx(before, abs=ROUNDING)


@given(lean=st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4)), rate=vectors)
def test_calming_goes_on_from_the_lean_and_ends_upright(lean: tuple[float, float], rate: Vec3) -> None:
    leg = SwingDamping(HERE, (lean[0], lean[1], 0.0), (rate[0], rate[1], 0.0), False, 1.2)
    up = leg.upward(0.0)
    assert up == pytest.approx((lean[0], lean[1], sqrt(1.0 - lean[0] ** 2 - lean[1] ** 2)))
    soon = leg.upward(STEP_S)
    assert (soon[0] - up[0]) / STEP_S == pytest.approx(rate[0], abs=0.01)
    assert leg.upward(leg.duration_s) == (0.0, 0.0, 1.0)
    for k in range(20):
        direction = leg.upward(leg.duration_s * k / 20)
        assert norm(direction) == pytest.approx(1.0, abs=1e-12)
        assert sqrt(1.0 - direction[2] ** 2) <= MAX_LEAN_SINE + 1e-9
    assert leg.control_mode == LOAD_ATTITUDE


def test_a_swing_leans_where_it_is_told_and_comes_back() -> None:
    leg = LEGS["swing"]
    assert isinstance(leg, Swing)
    assert leg.upward(0.0) == leg.upward(leg.duration_s) == (0.0, 0.0, 1.0)
    middle = leg.upward(0.75)
    assert middle[0] > 0.0, "east"
    assert middle[1] > 0.0, "north"


def test_signals_start_where_the_load_hangs() -> None:
    assert LEGS["run"].jet(0.0)[0] == HERE
    assert LEGS["run"].jet(0.9)[0][0] == HERE[0]
    assert LEGS["run"].jet(0.9)[0][1] != HERE[1]


def test_a_transfer_keeps_to_its_limits() -> None:
    leg = carry_leg(HERE, THERE, 1.5, 0.7, 0.0)
    along = [leg.jet(leg.duration_s * k / 200) for k in range(201)]
    assert max(norm(jet[1]) for jet in along) <= 1.5 * (1.0 + 1e-9)
    assert max(norm(jet[2]) for jet in along) == pytest.approx(0.7, rel=1e-3)


@pytest.mark.parametrize("distance_m", [0.4, LONG_WAY, 1.01 * LONG_WAY, 60.0])
def test_a_slack_vehicle_keeps_to_its_limits_from_rest_to_rest(distance_m: float) -> None:
    end = (HERE[0], HERE[1] - 0.6 * distance_m, HERE[2] + 0.8 * distance_m)
    leg = slack_leg(HERE, end)
    along = [leg.jet(leg.duration_s * k / 2000) for k in range(2001)]
    assert along[0] == (HERE, *[(0.0, 0.0, 0.0)] * 6)
    assert along[-1][0] == pytest.approx(end, abs=ROUNDING) and along[-1][1:] == along[0][1:]
    speed = SLACK_SPEED if distance_m <= LONG_WAY else LONG_WAY_SPEED
    assert max(norm(jet[1]) for jet in along) <= speed * (1.0 + 1e-9)
    assert max(norm(jet[2]) for jet in along) <= SLACK_ACCEL * (1.0 + 1e-9)


def test_however_far_it_climbs_a_slack_vehicle_leaves_the_ground_at_once() -> None:
    """A transfer over 60 m without ramps takes 26 s for its first 5 mm, in which the gear would touch the
    ground again and again."""
    gentle = Pace(transfer_duration(60.0, SLACK_SPEED, SLACK_ACCEL))
    assert Transfer(HERE, moved_up(60.0), gentle).jet(26.0)[0][2] < HERE[2] + 0.005
    assert slack_leg(HERE, moved_up(60.0)).jet(2.0)[0][2] > HERE[2] + 0.2


def moved_up(height_m: float) -> Vec3:
    return (HERE[0], HERE[1], HERE[2] + height_m)


@given(end=vectors, speed=st.floats(0.1, 5.0), accel=st.floats(0.1, 5.0))
def test_carrying_is_never_quicker_than_the_pendulum_and_else_as_quick_as_it_may(
    end: Vec3, speed: float, accel: float
) -> None:
    leg = carry_leg((0.0, 0.0, 0.0), end, speed, accel, LEAST_S)
    bare = carry_leg((0.0, 0.0, 0.0), end, speed, accel, 0.0)
    if norm(end) == 0.0:
        assert leg.duration_s == 0.0
    elif leg.pace.ramp_s == 0.0:
        alone = transfer_duration(norm(end), speed, accel)
        assert leg.duration_s == max(LEAST_S, alone) <= 2.0 * LEAST_S
    else:  # the ramps, too, are moves
        assert leg.pace.ramp_s == max(LEAST_S, bare.pace.ramp_s)
        longer_s = leg.duration_s - bare.duration_s
        assert -1e-9 <= longer_s <= 2.0 * max(LEAST_S - bare.pace.ramp_s, 0.0) + 1e-9


def test_the_least_duration_of_a_move_at_the_cable_of_table_4_1() -> None:
    assert min_move_duration(0.7, 9.81) == pytest.approx(2.0, abs=0.03)
    assert min_move_duration(2.8, 9.81) == pytest.approx(2.0 * min_move_duration(0.7, 9.81))


@pytest.mark.parametrize(("wanted", "speed"), [(1.9, 0.3), (0.75, 0.3), (0.4, 0.05), (0.7005, 0.3)])
def test_a_reel_keeps_to_rate_and_acceleration(wanted: float, speed: float) -> None:
    leg = reel_leg((1.0, 2.0, 3.0), 0.7, wanted, speed, 0.3)
    t = np.linspace(0.0, leg.duration_s, 2001)
    jets = np.array([leg.jet(float(s)) for s in t])
    assert leg.jet(0.0)[0] == (1.0, 2.0, 3.0)
    assert leg.end == pytest.approx((1.0, 2.0, 3.7 - wanted), abs=1e-12)
    assert jets[-2, 0] == pytest.approx(leg.end, abs=1e-6)
    assert np.abs(jets[:, 1, 2]).max() <= speed * (1.0 + 1e-9)
    assert np.abs(jets[:, 2, 2]).max() <= 0.3 * 1.001
    assert np.abs(jets[:, :, :2] - jets[0, :, :2]).max() == 0.0
