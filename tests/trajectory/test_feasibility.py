"""What four rotors cannot fly is reported with limit, excess, time and remedy; what they can fly passes."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from math import cos, degrees, inf, pi, radians, sqrt

import pytest

from autopilot.trajectory.feasibility import VehicleLimits, check, paths, peaks
from autopilot.trajectory.slack_cable import set_down_duration_s, tauten_duration_s
from autopilot.trajectory.timeline import (
    DETECTION_S,
    USUAL_CABLE_M,
    MissionState,
    expected_duration_s,
    min_move_duration,
    timeline,
)
from autopilot.trajectory.transfer import pace, transfer_duration
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.model import OneRotor
from missions.fileformat import load_mission, shipped
from missions.model import (
    AttitudeRun,
    Delay,
    Land,
    Mission,
    Release,
    ReturnHome,
    Signals,
    Sine,
    Speed,
    Step,
    Takeoff,
    Term,
    Waypoint,
    Winch,
)

WITHOUT_DRAG = load_vehicle("bebop").model_copy(
    update={"quad_drag_n_s_m": 0.0, "quad_drag_quadratic_n_s2_m2": 0.0}
)
LIMITS = VehicleLimits(WITHOUT_DRAG)
WithAmplitude = Callable[[str, str, float], Mission]


def mission(*steps: Step) -> Mission:
    return Mission("m", "M", "", (), (Takeoff(2.0), *steps, Land()))


@pytest.mark.parametrize("name", shipped())
def test_shipped_missions_can_be_flown(name: str) -> None:
    assert [str(violation) for violation in check(load_mission(name), LIMITS)] == []


def test_more_height_than_gravity_gives(with_amplitude: WithAmplitude) -> None:
    (violation,) = check(with_amplitude("case-c", "z", 0.6), LIMITS)
    assert violation.quantity == "tension"
    # 0.6 m at 2 pi / 1.5 rad/s
    assert violation.value == pytest.approx(0.6 * (2.0 * pi / 1.5) ** 2, rel=1e-3)
    assert violation.text == (
        "items[2] (signals): at 22.9 s the load would have to fall at 10.5 m/s^2 with the cable taut; "
        "gravity gives 9.81 m/s^2 (7 % over); lower amplitude_m of z or lengthen its period_s"
    )


def test_more_than_the_rotors_give(with_amplitude: WithAmplitude) -> None:
    found = check(with_amplitude("case-c", "z", 0.3), LIMITS)
    assert [violation.quantity for violation in found] == ["thrust", "rotor force", "rotor force"]
    thrust = found[0]
    assert thrust.limit == pytest.approx(0.9 * 4.0 * 1.96)
    assert thrust.value > thrust.limit
    assert thrust.text == (
        "items[2] (signals): at 22.1 s the flight needs 7.65 N of thrust; four rotors give 7.84 N, 7.06 N "
        "with the reserve of 10 % (8 % over); lower amplitude_m of z or lengthen its period_s"
    )


def test_a_tilt_beyond_the_limit(with_amplitude: WithAmplitude) -> None:
    found = check(with_amplitude("case-b", "y", 1.0), replace(LIMITS, tilt_max_rad=radians(15.0)))
    assert [violation.text for violation in found] == [
        f"items[2] (signals): at {found[0].time_s:.1f} s the vehicle leans 19 deg; the limit is 15 deg "
        "(4 deg over); lower amplitude_m of y or lengthen its period_s"
    ]


def test_without_rotor_limits_only_gravity_and_tilt_bind(with_amplitude: WithAmplitude) -> None:
    vehicle = WITHOUT_DRAG.model_copy(update={"rotor_max_n": inf, "rotor_min_n": -inf})
    unlimited = replace(LIMITS, vehicle=vehicle, tilt_max_rad=pi)
    assert check(with_amplitude("case-c", "z", 0.3), unlimited) == []


def test_under_the_ground() -> None:
    slow = Term("z", -3.0, 0.0, 10.0, None, 0.0)
    (violation,) = check(mission(Signals(12.0, (slow,))), LIMITS)
    assert violation.text == (
        "items[1] (signals): at 10.0 s the load would be 1.00 m under the ground; it must be at least 0.3 m "
        "above; begin higher (altitude_m) or lower amplitude_m of z"
    )


def test_signals_carry_the_load_no_lower_than_a_waypoint_may() -> None:
    """With its centre at the height of the ground it was 2 cm in it, and the check passed."""
    for amplitude_m, problems in ((-1.7, 0), (-1.71, 1), (-2.0, 1)):
        found = check(mission(Signals(12.0, (Term("z", amplitude_m, 0.0, 10.0, None, 0.0),))), LIMITS)
        assert [one.quantity for one in found] == ["height"] * problems
    assert "the load would be 0.00 m above the ground; it must be at least 0.3 m above" in found[0].text


def test_a_winch_that_reels_the_load_into_the_ground_is_told_of_its_length() -> None:
    (violation,) = check(mission(Winch(2.5, 1.0)), LIMITS)
    assert violation.text.endswith("0.50 m under the ground; begin higher (altitude_m) or lower length_m")


def test_a_large_excess_is_a_multiple_of_the_limit() -> None:
    (violation, *_) = check(mission(AttitudeRun("load", radians(3.0), 0.0, 0.1)), LIMITS)
    assert re.search(r"\([\d.]+ times the limit\)", violation.text), violation.text


def test_a_cable_too_long_for_a_path_is_named() -> None:
    """A load on 8 m of cable swings in 5.7 s, and Case C in 1.5 s."""
    case_c, cable = load_mission("case-c"), "shorten cable_length_m, 8 m"
    long_cable = replace(LIMITS, vehicle=LIMITS.vehicle.model_copy(update={"cable_length_m": 8.0}))
    assert all(cable in violation.text for violation in check(case_c, long_cable))
    fast = mission(Signals(1.0, (Term("x", 5.0, rise_s=0.5, hold_s=0.0, fall_s=0.5),)))
    found = check(fast, LIMITS)
    assert found and not any("cable_length_m" in violation.text for violation in found)


def test_a_path_that_no_cable_makes_possible_gets_no_advice_about_the_cable() -> None:
    """The load on 8 m of cable swings too slowly for it too, but no vehicle accelerates as fast."""
    far = mission(Signals(7.0, (Term("x", 500.0, rise_s=1.2),)))
    found = check(far, LIMITS)
    assert found and all(
        violation.text.endswith("lower amplitude_m of x or lengthen its rise_s") for violation in found
    )
    assert not any("cable_length_m" in violation.text for violation in found)


def test_drag_that_makes_everything_impossible_is_named() -> None:
    def draggy(**drag: float) -> VehicleLimits:
        return replace(LIMITS, vehicle=LIMITS.vehicle.model_copy(update=drag))

    up = Mission("up", "Up", "", (), (Takeoff(2.0), Delay(1.0), Land()))
    for key in ("quad_drag_n_s_m", "quad_drag_quadratic_n_s2_m2"):
        found = check(up, draggy(**{key: 60.0}))
        assert found and all(f"; check {key}: the drag is " in violation.text for violation in found)
    shaped = check(load_mission("case-a"), draggy(quad_drag_n_s_m=6.0), shaped=True)
    assert shaped and all("; check quad_drag_n_s_m: " in violation.text for violation in shaped)
    # a fast transfer is impossible without drag too
    hasty = replace(draggy(quad_drag_n_s_m=0.2), accel_m_s2=14.0)
    found = check(mission(Speed(20.0), Waypoint(30.0, 0.0, 2.0)), hasty)
    assert found and not any("quad_drag" in violation.text for violation in found)


def test_a_jump_of_position_and_of_velocity() -> None:
    jump = Term("x", 0.5, 1.0, 0.0, None, 0.0)
    kick = Term("y", 0.5, 2.0, 0.0, 6.0, 0.0, (Sine(3.0, 0.0, 2.0),))
    found = {v.quantity: v for v in check(mission(Signals(9.0, (jump, kick))), LIMITS)}
    assert found["position jump"].value == pytest.approx(0.5)
    assert found["position jump"].time_s == 1.0
    assert found["velocity jump"].value == pytest.approx(0.5 * 2.0 * pi / 3.0)
    assert "lengthen rise_s and fall_s" in found["velocity jump"].text


def test_an_end_in_mid_swing_names_the_duration_it_takes() -> None:
    (signals,) = [step for step in load_mission("case-b").steps if isinstance(step, Signals)]
    found = check(mission(replace(signals, duration_s=40.0)), LIMITS)
    assert [violation.quantity for violation in found] == ["velocity at the end"]
    assert found[0].text.endswith("it must be at rest: change duration_s to 50")


def test_a_swing_for_ever_never_comes_to_rest() -> None:
    forever = Term("y", 0.5, 0.0, 5.0, None, 0.0, (Sine(3.0),))
    (violation,) = check(mission(Signals(9.0, (forever,))), LIMITS)
    assert violation.text.endswith("change the signals so that all come to rest")


def test_peaks_of_a_sine_held_are_those_of_the_formula() -> None:
    along = peaks(load_mission("case-b"), LIMITS)[2]
    omega = 2.0 * pi / 3.0
    # the envelope's slope adds less than this share
    assert along.speed.value == pytest.approx(omega, rel=2e-3)
    assert along.accel.value == pytest.approx(omega**2, rel=2e-3)
    assert along.tension_low.value == pytest.approx(0.1 * 9.81, rel=1e-6)


def test_transfers_keep_the_speed_and_acceleration_they_are_given() -> None:
    along = peaks(mission(Speed(1.5), Waypoint(4.0, 3.0, 2.0)), replace(LIMITS, accel_m_s2=0.7))[2]
    # 201 samples along the transfer
    assert max(along.speed.value / 1.5, along.accel.value / 0.7) == pytest.approx(1.0, rel=1e-3)


def test_a_transfer_too_fast() -> None:
    hasty = replace(LIMITS, accel_m_s2=14.0)
    found = check(mission(Speed(20.0), Waypoint(30.0, 0.0, 2.0)), hasty)
    assert {violation.quantity for violation in found} >= {"thrust", "tilt"}
    assert found[0].text.endswith("lower speed_m_s or the acceleration of transfers")


def test_a_chain_of_waypoints_is_not_judged_as_stops_at_each() -> None:
    """Every law flies one path through them, planned within the limits; from stop to stop it is too fast."""
    hasty = replace(LIMITS, accel_m_s2=8.0)
    chain = (Speed(8.0), Waypoint(4.0, 0.0, 2.0), Waypoint(8.0, 0.0, 2.0), Waypoint(12.0, 0.0, 2.0))
    assert [str(violation) for violation in check(mission(*chain), hasty)] == []
    flown = [path for path in paths(mission(*chain), hasty, shaped=False) if path.item > 1]
    assert max(path.rotor_high_n for path in flown) < hasty.vehicle.rotor_max_n
    stops = [replace(step, hold_s=1.0) if isinstance(step, Waypoint) else step for step in chain]
    assert {violation.item for violation in check(mission(*stops), hasty)} == {2, 3, 4}


@pytest.mark.parametrize("controlled", ["vehicle", "load"])
def test_attitude_runs(controlled: str) -> None:
    gentle = AttitudeRun(controlled, 0.0, radians(10.0), 1.2)
    steep = AttitudeRun(controlled, radians(50.0), 0.0, 4.0)
    sudden = AttitudeRun(controlled, radians(30.0), 0.0, 0.1)
    assert check(mission(gentle), LIMITS) == []
    assert "tilt" in {violation.quantity for violation in check(mission(steep), LIMITS)}
    assert "rotor force" in {violation.quantity for violation in check(mission(sudden), LIMITS)}


def test_an_attitude_run_of_the_vehicle_carries_the_weight_on_a_slope() -> None:
    along = peaks(mission(AttitudeRun("vehicle", radians(20.0), 0.0, 3.0)), LIMITS)[1]
    assert along.tilt.value == pytest.approx(radians(20.0), rel=1e-6)
    assert along.thrust.value == pytest.approx(0.5 * 9.81 / cos(radians(20.0)), rel=1e-6)


def test_the_timeline_follows_the_load() -> None:
    push = Signals(5.0, (Term("x", 3.0, 0.0, 4.0, None, 0.0), Term("y", 1.0, 0.0, 1.0, 1.0, 1.0)))
    plan = mission(Waypoint(1.0, 2.0, 3.0, 4.0), push, Delay(2.0), ReturnHome())
    found = list(timeline(plan.steps, MissionState(speed_m_s=2.0), accel_m_s2=1.0))
    assert [leg.end for leg in found] == [
        (0.0, 0.0, 2.0),
        (1.0, 2.0, 3.0),
        (4.0, 2.0, 3.0),
        (4.0, 2.0, 3.0),
        (0.0, 0.0, 3.0),
        (0.0, 0.0, 0.0),
    ]
    assert [leg.begin for leg in found[1:]] == [leg.end for leg in found[:-1]]
    least_s = min_move_duration(USUAL_CABLE_M, 9.81)
    assert found[1].duration_s == pytest.approx(4.0 + pace(sqrt(6.0), 2.0, 1.0, least_s).duration_s)
    assert found[2].duration_s == 5.0


def test_expected_duration_adds_take_off_and_landing() -> None:
    lift = transfer_duration(2.0, 0.8, 2.0)
    on_the_ground = 2.0 * DETECTION_S + tauten_duration_s(0.7, 0.15) + set_down_duration_s(0.7)
    assert expected_duration_s(load_mission("hover"), 2.0, 2.0) == pytest.approx(
        lift + 10.0 + lift + on_the_ground
    )


def test_a_vehicle_that_cannot_hover_is_not_advised_to_fly_slower() -> None:
    heavy = replace(LIMITS, vehicle=LIMITS.vehicle.model_copy(update={"load_mass_kg": 50.0}))
    (found,) = check(mission(), heavy)
    assert found.value > found.limit == pytest.approx(heavy.usable_thrust_n)
    assert "it cannot hover; lower load_mass_kg, or raise rotor_max_n" in found.text
    assert "speed_m_s" not in found.text


@pytest.mark.parametrize(
    ("forward_m", "front", "quantity"),
    [(-0.3, False, "most"), (-0.7, True, "least"), (0.9, True, "most"), (1.5, False, "least")],
)
def test_a_load_that_tips_the_vehicle_over_is_found_by_the_law_of_the_lever(
    forward_m: float, front: bool, quantity: str
) -> None:
    # two rotors 0.2 m ahead of the centre of mass, two 0.1 m behind it
    places = ((0.2, 0.1, "+"), (-0.1, 0.2, "-"), (-0.1, -0.2, "+"), (0.2, -0.1, "-"))
    rotors = tuple(OneRotor(x_m=x, y_m=y, spin=spin) for x, y, spin in places)
    vehicle = WITHOUT_DRAG.model_copy(update={"rotor": rotors, "attachment_m": (forward_m, 0.0, 0.0)})
    load_n, total_n = (
        mass * vehicle.gravity_m_s2
        for mass in (vehicle.load_mass_kg, vehicle.load_mass_kg + vehicle.quad_mass_kg)
    )
    front_pair_n = (load_n * forward_m + 0.1 * total_n) / (0.2 + 0.1)
    expected_n = (front_pair_n if front else total_n - front_pair_n) / 2.0
    (found,) = check(mission(), VehicleLimits(vehicle))
    assert found.value == pytest.approx(expected_n)
    assert f"gives {found.limit:.2f} N at {quantity}; lower attachment_m" in found.text
    level = vehicle.model_copy(update={"attachment_m": (0.01, 0.01, -0.5)})
    assert check(mission(), VehicleLimits(level)) == []


def test_rotors_that_give_too_much_at_least_are_no_matter_of_the_attachment() -> None:
    vehicle = WITHOUT_DRAG.model_copy(update={"rotor_min_n": 1.5})
    (found,) = check(mission(), VehicleLimits(vehicle))
    each_n = (vehicle.quad_mass_kg + vehicle.load_mass_kg) * vehicle.gravity_m_s2 / 4.0
    told = f"to hover, one rotor must give {each_n:.2f} N and gives 1.50 N at least; lower rotor_min_n"
    assert found.text == told


def test_a_vehicle_that_can_hardly_lift_its_load_is_not_advised_to_change_what_a_takeoff_has_not() -> None:
    limits = replace(LIMITS, vehicle=LIMITS.vehicle.model_copy(update={"gravity_m_s2": 14.0}))
    found = check(Mission("up", "Up", "", (), (Takeoff(2.0), Delay(1.0), Land())), limits)
    assert [one.item for one in found] == [0, 2]
    for one in found:
        assert one.text.endswith(
            "lower load_mass_kg or raise rotor_max_n, or lower MIS_ACCEL in [parameters] of the vehicle"
        )


@pytest.mark.parametrize("shaped", [True, False])
@pytest.mark.parametrize("distance_m", [1e-3, 0.02, 0.06, 0.1])
def test_a_short_move_takes_the_time_of_every_move_and_passes(distance_m: float, shaped: bool) -> None:
    short = mission(Waypoint(distance_m, 0.0, 2.0, 1.0), ReturnHome())
    assert [str(violation) for violation in check(short, LIMITS, shaped)] == []
    move_s = min_move_duration(LIMITS.vehicle.cable_length_m, LIMITS.vehicle.gravity_m_s2)
    reports = paths(short, LIMITS, shaped=shaped)
    assert [report.duration_s for report in reports if report.item in (1, 2)] == [move_s, move_s]


def test_a_vehicle_without_its_load_may_fly_lower_than_one_that_carries_it() -> None:
    low = Waypoint(1.0, 0.0, 0.2)
    assert [violation.quantity for violation in check(mission(low), LIMITS)] == ["height"]
    assert [str(violation) for violation in check(mission(Release(), low), LIMITS)] == []


def test_a_transfer_that_an_autopilot_lengthens_passes() -> None:
    # the vehicle would tilt beyond its limit of 45 degrees, since 12 m/s^2 is more than gravity
    limits = VehicleLimits(load_vehicle("bebop"), accel_m_s2=12.0)
    fast = mission(Speed(15.0), Waypoint(40.0, 0.0, 2.0, 1.0))
    assert "tilt" in [violation.quantity for violation in check(fast, limits)]
    assert [str(violation) for violation in check(fast, limits, shaped=True)] == []
    (straight, lengthened) = (
        next(report for report in paths(fast, limits, shaped=shaped) if report.item == 2)
        for shaped in (False, True)
    )
    assert lengthened.duration_s > straight.duration_s
    assert lengthened.tilt_deg < degrees(limits.tilt_max_rad) < straight.tilt_deg
