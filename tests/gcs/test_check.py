"""What `gcs check` reports and warns of where a mission can be flown."""

from __future__ import annotations

import re
from importlib.resources import files
from math import radians
from operator import attrgetter
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from autopilot.control.laws import LAWS
from autopilot.own.own_code import OwnCode
from autopilot.supervisor.settings import path_limits
from autopilot.trajectory import feasibility
from autopilot.trajectory.feasibility import PathReport
from autopilot.trajectory.prepare import ShapingResult
from autopilot.trajectory.shaping import unshaped_signals
from autopilot.trajectory.transfer import PEAK_SPEED
from autopilot.vehicle.file import load_belief
from autopilot.vehicle.parameters import autopilot_parameters
from gcs.cli import gcs
from gcs.errors import EXIT_DONE, EXIT_ERROR, EXIT_USAGE, GcsError, InputError
from gcs.expected_flight import expected_entries, expected_flight_s, time_limit_s
from gcs.mission_files import load
from gcs.workflows import flyable
from gcs.workflows.before_flight import law_problem
from gcs.workflows.check_mission import (
    CheckResult,
    check_mission,
    cut_off_notes,
    flown_s,
    margin_warnings,
    notes_after_release,
    path_reports,
    slowness_notes,
    timeout_warnings,
    unreached_speed_notes,
    winch_notes,
)
from gcs.workflows.flight_inputs import check_flight_inputs
from gcs.workflows.flight_options import parse_setting
from gcs.workflows.flyable import winch_violations
from gcs.workflows.vehicle_limits import load_limits, with_settings
from missions.fileformat import shipped
from missions.model import Land, Mission, Release, Signals, Speed, Step, Takeoff, Term, Waypoint, Winch

HEAVY, BEBOP_LIMITS = load_belief("heavy-real"), load_limits("bebop")
BEBOP = autopilot_parameters(BEBOP_LIMITS.vehicle)
CASE_C = PathReport(2, "signals", 50.5, 0.0003, 1.86, 8.16, 3.87, 27.0)  # for `heavy`, rotors of 12 N each


def test_a_path_that_leaves_little_to_a_vehicle_that_is_not_as_believed_is_warned_of() -> None:
    (warning,) = margin_warnings([CASE_C], "heavy-real", HEAVY)
    assert warning.startswith("warning: items[2] (signals): 16 % of the rotors' range is left for control")
    assert "heavy-real differs from what the autopilot assumes (heavy)" in warning
    assert "--set MIS_ROTOR_MARG=40 --set MIS_INFEASIBLE=1" in warning
    assert CheckResult("case-c", "heavy-real", (), (CASE_C,), (warning,)).lines()[-1] == warning


@pytest.mark.parametrize(
    ("low_n", "high_n", "warned_of"), [(2.9, 8.0, True), (4.0, 9.1, True), (3.1, 8.9, False)]
)
def test_either_limit_counts(low_n: float, high_n: float, warned_of: bool) -> None:
    path = PathReport(2, "signals", 50.5, 0.0, low_n, high_n, 3.9, 20.0)
    assert bool(list(margin_warnings([path], "heavy-real", HEAVY))) == warned_of


def test_nothing_is_feared_of_a_vehicle_that_is_as_it_is_believed() -> None:
    assert list(margin_warnings([CASE_C], "heavy", HEAVY)) == []


@pytest.mark.parametrize(("by_m", "cable_m", "limit_m"), [(-5.0, -4.3, 0.3), (2.31, 3.01, 3.0)])
def test_a_cable_that_the_winch_does_not_make_is_found_before_the_flight(
    by_m: float, cable_m: float, limit_m: float
) -> None:
    mission = Mission("deep", "Deep", "", (), (Takeoff(5.0), Winch(0.2), Winch(-0.2), Winch(by_m), Land()))
    (found,) = winch_violations(mission, BEBOP)
    assert (found.item, found.quantity, found.limit) == (3, "cable length", limit_m)
    assert found.value == pytest.approx(cable_m)
    within = Mission("less", "Less", "", (), (Takeoff(5.0), Winch(-0.4), Land()))  # 0.7 - 0.4 < limit
    assert list(winch_violations(within, BEBOP)) == []
    assert str(found).startswith(f"items[3] (winch): a cable of {cable_m:.2f} m; must be 0.3 ... 3 m")


def test_a_plan_that_cannot_be_read_is_told_by_what_is_wrong_with_it(tmp_path: Path) -> None:
    plan = tmp_path / "a.plan"
    plan.write_text("{}", encoding="utf-8")
    with pytest.raises(GcsError, match=r'a\.plan: "fileType" must be "Plan"'):
        load(str(plan))
    with pytest.raises(InputError, match=r"unknown mission|No such file|no such file"):
        load(str(tmp_path / "b.plan"))


def test_paths_as_asked_are_told_with_what_the_check_does_not_judge() -> None:
    asked, shaped = (check_mission("case-a", "bebop", as_asked) for as_asked in (True, False))
    (note,) = asked.warnings
    assert note.endswith("only a flight tells: gcs fly case-a --law thesis")
    assert shaped.warnings == ()
    assert [path.distance_m > 0.0 for path in (asked.paths[-1], shaped.paths[-1])] == [False, True]
    assert ", as asked; load to " in str(asked.paths[-1])
    assert "mm from the path asked; load to " in str(shaped.paths[-1])


def test_how_fast_the_load_becomes_is_told() -> None:
    steps = (Takeoff(2.0), Speed(9.0), Waypoint(1.0, 0.0, 2.0), Land())
    *_, path = feasibility.paths(Mission("quick", "", "", (), steps), load_limits("bebop"))
    # at the set acceleration 1 m is too short to reach the speed; the peak, in the middle, is sampled
    assert path.speed_m_s == pytest.approx(PEAK_SPEED * 1.0 / path.duration_s, rel=1e-9)
    assert path.speed_m_s < 2.0
    assert f"; load to {path.speed_m_s:.2f} m/s, rotors" in str(path)


def test_waypoints_that_are_too_close_for_their_speed_are_told() -> None:
    """On the grid of mission items a diagonal row is crooked; the file itself is straight."""
    row = [Waypoint(0.048 * i, 0.036 * i, 2.0) for i in range(1, 31)]
    close = Mission("close", "", "", (), (Takeoff(2.0), Speed(1.0), *row, Land()))
    reports = path_reports(close, BEBOP_LIMITS)
    (note,) = slowness_notes(reports)
    assert note.startswith("note: items[2] to items[31]: too close together, or turns too sharp, for 1 m/s")
    assert {report.asked_m_s for report in reports[1:]} == {1.0}
    assert max(report.speed_m_s for report in reports[1:]) < 0.5
    wide = Mission("wide", "", "", (), (Takeoff(2.0), Speed(1.0), row[-1], Waypoint(5.0, 0.0, 2.0), Land()))
    assert list(slowness_notes(path_reports(wide, BEBOP_LIMITS))) == []


def test_a_path_that_leaves_the_lines_between_its_waypoints_tells_how_far() -> None:
    """At a speed that its lines are too short for."""
    round_trip = [Waypoint(20.0 * x, 20.0 * y, 9.0) for x, y in ((1, 0), (1, 1), (0, 1), (0, 0))]
    corner = (Takeoff(9.0), Speed(5.0), *round_trip, Land())
    up, *beside = path_reports(Mission("corner", "", "", (), corner), BEBOP_LIMITS)
    assert up.beside_m == 0.0
    assert 0.3 < (widest := max(beside, key=attrgetter("beside_m"))).beside_m < 6.0
    assert f" s, up to {widest.beside_m:.1f} m beside the straight line; load to " in str(widest)
    single = Mission("single", "", "", (), (Takeoff(2.0), round_trip[0], Land()))
    assert "beside" not in str(path_reports(single, BEBOP_LIMITS)[-1])


def test_attitude_runs_tell_of_no_speed() -> None:
    runs = [path for path in check_mission("quad-attitude", "bebop", False).paths if path.kind == "attitude"]
    assert runs and all("m/s" not in str(path) for path in runs)


def test_what_is_flown_without_the_load_is_told_to_have_no_path() -> None:
    steps = (Takeoff(2.0), Release(), Waypoint(1.0, 0.0, 2.0), Land())
    mission = Mission("m", "M", "", (), steps)
    (note,) = notes_after_release(mission, BEBOP)
    *_, way, landing = expected_entries(mission, BEBOP)
    both_s = way.duration_s + landing.duration_s
    assert note.startswith(f"note: items[2] to items[3]: about {both_s:.0f} s, flown without the load")
    (note,) = notes_after_release(Mission("m", "M", "", (), (Takeoff(2.0), Release(), Land())), BEBOP)
    assert note.startswith("note: items[2]: about ")
    for nothing_behind in ((Takeoff(2.0), Land()), (Takeoff(2.0), Release())):
        assert list(notes_after_release(Mission("m", "M", "", (), nothing_behind), BEBOP)) == []


def test_the_whole_duration_is_told_with_the_time_limit_of_a_flight() -> None:
    found = check_mission("square", "bebop", False)
    mission = load("square")
    assert found.time_limit_s == time_limit_s(expected_flight_s(mission, BEBOP))
    assert found.expected_s == pytest.approx(flown_s(mission, found.paths, BEBOP))
    told = f"in all: about {found.expected_s:.0f} s from arming to the end; gcs fly gives up after "
    assert found.lines()[len(found.paths) + 1].startswith(told)
    refused = check_mission("case-c", "bebop", False, settings=[("MIS_ROTOR_MARG", 45.0)])
    assert refused.problems and refused.expected_s is None


def test_a_lift_at_another_speed_is_in_the_whole_duration() -> None:
    slow = with_settings(autopilot_parameters(BEBOP_LIMITS.vehicle), [("MIS_LIFT_SPEED", 0.2)])
    mission = Mission("up", "Up", "", (), (Takeoff(2.0), Land()))
    reports = path_reports(mission, BEBOP_LIMITS)
    assert flown_s(mission, reports, slow) == pytest.approx(expected_flight_s(mission, slow))


def test_a_speed_that_no_way_reaches_is_told() -> None:
    def notes(*steps: Step) -> list[str]:
        mission = Mission("m", "M", "", (), (Takeoff(2.0), *steps, Land()))
        return list(unreached_speed_notes(mission, path_reports(mission, BEBOP_LIMITS), BEBOP))

    near, far = Waypoint(8.0, 0.0, 2.0, hold_s=1.0), Waypoint(60.0, 0.0, 2.0, hold_s=1.0)
    (note,) = notes(Speed(9.0), near)
    reached = path_reports(Mission("m", "M", "", (), (Takeoff(2.0), Speed(9.0), near)), BEBOP_LIMITS)[-1]
    reaches = f"items[2]: reaches {reached.speed_m_s:.1f} of the 9 m/s asked"
    assert note == f"note: {reaches}: too short at MIS_ACCEL 1.5 m/s^2"
    assert notes(Speed(4.0), near, far) == []  # one of the ways reaches it
    assert notes(near) == notes(Waypoint(0.1, 0.0, 2.0)) == []  # the usual speed is not the mission's
    assert notes(Speed(9.0), Speed(2.0), near) == []  # nothing is flown at the first
    (note,) = notes(Speed(9.0), near, Release(), Waypoint(0.0, 0.0, 2.0))
    assert note.startswith("note: items[2] to items[4]: reach ")


def test_a_speed_that_turns_prevent_is_told() -> None:
    zigzag = [Waypoint(3.0 * (i // 2), 3.0 * (i % 2), 2.0) for i in range(1, 17)]
    mission = Mission("m", "M", "", (), (Takeoff(2.0), Speed(5.0), *zigzag, Land()))
    reports = path_reports(mission, BEBOP_LIMITS)
    (note,) = [*unreached_speed_notes(mission, reports, BEBOP), *slowness_notes(reports)]
    assert "turns" in note


def test_a_cable_that_is_reeled_is_told_with_its_duration() -> None:
    steps = (Takeoff(5.0), Winch(0.6), Winch(-0.6, 0.1), Release(), Winch(0.1), Land())
    longer, shorter = winch_notes(Mission("m", "M", "", (), steps), BEBOP)
    assert longer == (
        "note: items[1] (winch): 5.9 s, to a cable of 1.30 m; the vehicle stays in place, no path to report"
    )
    assert shorter.startswith("note: items[2] (winch): 17.6 s, to a cable of 0.70 m")


def test_paths_are_checked_as_a_law_flies_them_and_a_custom_law_is_not() -> None:
    def checked(*options: str) -> tuple[int, str]:
        found = CliRunner().invoke(gcs, ["check", "case-a", *options], prog_name="gcs")
        return found.exit_code, found.stdout or found.stderr

    assert checked("--law", "thesis") == checked("--as-asked") != checked("--law", "plumbline") == checked()
    code, text = checked("--law", "mine.py")
    assert code == EXIT_USAGE and "paths are checked and not your own law: with --as-asked" in text


WINCHED = """title = "Short cable"
description = "A mission for tests."

[[items]]
type = "takeoff"
altitude_m = 1.0

[[items]]
type = "winch"
length_m = -0.65

[[items]]
type = "signals"
duration_s = 8.0
[[items.terms]]
axis = "z"
amplitude_m = -2.0
rise_s = 4.0
hold_s = 1.0
fall_s = 3.0

[[items]]
type = "land"
"""


@pytest.fixture
def winched(tmp_path: Path) -> Path:
    """A winch that makes the cable too short, and a path that comes too low above the ground."""
    path = tmp_path / "winched.toml"
    path.write_text(WINCHED)
    return path


def test_what_follows_from_an_impossible_cable_is_not_told(winched: Path) -> None:
    line = f"{winched}:8: items[1] (winch): a cable of 0.05 m; must be 0.3 ... 3 m"
    (found,) = check_mission(str(winched), "bebop", as_asked=False).lines()
    assert found.startswith(line)
    with pytest.raises(GcsError, match=re.escape(line)):
        flyable.require_flyable(load(str(winched)), "bebop")
    winched.write_text(WINCHED.replace("-0.65", "-0.25"))
    lines = check_mission(str(winched), "bebop", as_asked=False).lines()
    assert all(one.startswith(f"{winched}:12: items[2] (signals): at ") for one in lines)


def test_a_step_that_cannot_be_flown_is_told_with_file_and_line(winched: Path) -> None:
    winched.write_text(WINCHED.replace("altitude_m = 1.0", "altitude_m = 0.1"))
    lines = check_mission(str(winched), "bebop", as_asked=False).lines()
    assert [line.partition(" (")[0] for line in lines] == [f"{winched}:4: items[0]", f"{winched}:8: items[1]"]


def test_a_law_that_cannot_fly_a_winch_is_told_before_a_flight(winched: Path) -> None:
    line = f"{winched}:8: items[1] (winch): the law lqr flies one length of the cable"
    (found,) = check_mission(str(winched), "bebop", as_asked=True, law="lqr").lines()
    assert found.startswith(line)
    for law in LAWS.values():
        assert bool(law_problem(load(str(winched)), law.name)) != law.supports_reeling
    for force in ([], ["--force"]):
        flown = CliRunner().invoke(gcs, ["fly", str(winched), "--law", "lqr", *force], prog_name="gcs")
        assert flown.exit_code == EXIT_ERROR
        assert line in flown.stderr


def test_a_path_that_cannot_be_had_is_told_with_what_it_must_keep_to_and_what_mends_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        feasibility, "shaped_path", lambda step, _: ShapingResult(unshaped_signals(step), "no way")
    )
    (line,) = check_mission("case-a", "bebop", as_asked=False).lines()
    assert line.startswith(
        "missions/case-a.toml:20: items[2] (signals): no way; a path must leave 15 % of the rotors' range"
    )
    for mends in ("amplitude_m", "rise_s", "MIS_ROTOR_MARG", "MIS_INFEASIBLE 1"):
        assert mends in line


def test_a_vehicle_is_judged_by_the_parameters_it_is_delivered_with(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    given = {"MIS_TILT_DEG": 5, "MIS_SPEED": 1.0, "MIS_ACCEL": 0.5, "MIS_TENSION": 40, "MIS_SHAPE_ERR": 0.1}
    given |= {"MIS_ROTOR_MARG": 30, "MIS_INFEASIBLE": 1, "MIS_TIME_OPT": 1}
    lines = "\n".join(f"{name} = {value}" for name, value in given.items())
    file.write_text(f'believed = "bebop"\n[parameters]\n{lines}\n', encoding="utf-8")
    found = load_limits(str(file))
    assert found.tilt_max_rad == pytest.approx(radians(5.0))
    table = autopilot_parameters(load_belief(file))
    assert found.shaping == path_limits(table, True)


def test_limits_are_those_that_the_autopilot_shapes_to(tmp_path: Path) -> None:
    """To the last bit: the paths that are checked are those that are flown."""
    odd = tmp_path / "odd.toml"
    odd.write_text('believed = "heavy"\n[parameters]\nMIS_ROTOR_MARG = 33.3\n', encoding="utf-8")
    slow = tmp_path / "slow.toml"
    slow.write_text(
        (files("autopilot.vehicle") / "vehicles" / "bebop.toml")
        .read_text()
        .replace("rotor_tau_s = 0.020", "rotor_tau_s = 0.02325609888173066"),
        encoding="utf-8",
    )
    for vehicle in ("heavy-real", str(odd), str(slow)):
        assert load_limits(vehicle).shaping == path_limits(autopilot_parameters(load_belief(vehicle)), True)


@pytest.mark.parametrize("vehicle", ["bebop", "heavy-real"])
def test_limits_follow_the_parameters_of_the_assumed_vehicle_that_are_set(vehicle: str) -> None:
    settings = [("VEH_QUAD_MASS", 1.5), ("VEH_LOAD_MASS", 0.4), ("VEH_CABLE_LEN", 1.2), ("VEH_ARM_LEN", 0.3)]
    settings += [("VEH_J_YY", 0.05), ("VEH_ROTOR_MAX", 9.0), ("VEH_ROTOR_TAU", 40.0), ("VEH_GRAVITY", 9.7)]
    for given in (settings, [*settings, ("VEH_ROTOR_LIM", 0.0)]):
        table = with_settings(autopilot_parameters(load_belief(vehicle)), given)
        assert load_limits(vehicle, given).shaping == path_limits(table, True)


def test_a_load_that_is_set_too_heavy_is_found_before_the_flight() -> None:
    heavy = parse_setting("VEH_LOAD_MASS=0.5")
    (line,) = check_mission("hover", "bebop", False, settings=[heavy]).lines()
    assert "load (0.5 kg) weigh 8.83 N; four rotors give 7.84 N" in line and "cannot hover" in line
    with pytest.raises(GcsError, match=r"bebop with VEH_LOAD_MASS=0\.5; --force tries: .*cannot hover"):
        flyable.require_flyable(load("hover"), "bebop", settings=[heavy])


def test_a_vehicle_whose_rotors_are_too_slow_to_hover_is_refused() -> None:
    slow = parse_setting("VEH_ROTOR_TAU=300")
    (line,) = check_mission("hover", "heavy", False, settings=[slow]).lines()
    assert line.startswith(
        "rotor_tau_s = 0.3: rotors this slow let the vehicle control its attitude at 3.6 rad/s"
    )
    assert line.endswith("4.2 rad/s are needed to hold its position: it cannot hover; use faster rotors")
    with pytest.raises(GcsError, match="cannot hover"):
        flyable.require_flyable(load("hover"), "heavy", settings=[slow])
    assert (
        "can fly it" in check_mission("hover", "heavy", False, settings=[("VEH_ROTOR_TAU", 200.0)]).lines()[0]
    )


PLANNERS = """
from plumbline.examples.minimum_snap import MinimumSnap
from plumbline.planners import slower

class Leisurely(MinimumSnap):
    def plan(self, route):
        path = super().plan(route)
        return slower(path, 2000.0 * (len(route.points) - 1) / path.passes_s[-1])

class Slow(MinimumSnap):
    def plan(self, route):
        return slower(super().plan(route), 40.0)
"""


@pytest.fixture
def planners(tmp_path: Path) -> Path:
    path = tmp_path / "mine.py"
    path.write_text(PLANNERS, encoding="utf-8")
    return path


def test_a_planner_is_refused_as_a_flight_refuses_it(planners: Path) -> None:
    """Each leg of `square` alone takes 2000 s, which a path may; a flight first tries a path of two legs."""
    planner = f"{planners}:Leisurely"
    with pytest.raises(InputError) as refusal:
        check_flight_inputs("bebop", "lab", [], OwnCode(planner=planner))
    result = CliRunner().invoke(gcs, ["check", "square", "--planner", planner], prog_name="gcs")
    assert (result.exit_code, result.stderr) == (EXIT_USAGE, f"gcs: {refusal.value}\n")
    assert "on a trial route (0, 0, 1), (2, 0, 1), (2, 2, 1.5): Planner Leisurely failed: " in result.stderr
    assert "the path ends at 4000 s" in result.stderr


def test_paths_that_outlast_the_time_limit_of_a_flight_are_told_with_what_to_add(planners: Path) -> None:
    result = CliRunner().invoke(gcs, ["check", "square", "--planner", f"{planners}:Slow"], prog_name="gcs")
    assert result.exit_code == EXIT_DONE
    warning = result.stdout.splitlines()[-1]
    assert warning.startswith(
        "warning: along these paths the flight takes about 931 s, and gcs fly gives up "
    )
    assert warning.endswith("add --timeout 1456")
    assert not list(timeout_warnings(load("square"), path_reports(load("square"), BEBOP_LIMITS), BEBOP))


@pytest.mark.parametrize(("value", "flies"), [("20", True), ("45", False)])
def test_paths_are_checked_with_the_parameters_that_are_set(value: str, flies: bool) -> None:
    """The reserve of the vehicle's file counted whatever was set, and was named."""
    found = CliRunner().invoke(gcs, ["check", "case-c", "--set", f"MIS_ROTOR_MARG={value}"])
    assert found.exit_code == (EXIT_DONE if flies else EXIT_ERROR)
    assert (f"must leave {value} % of the rotors' range" in found.output) == (not flies)


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("SIM_LOAD_MASS=3", "SIM_LOAD_MASS: must be a parameter of the autopilot, or SIM_WIND_E"),
        ("MIS_ROTOR_MARGE=3", "MIS_ROTOR_MARGE: no such parameter; did you mean MIS_ROTOR_MARG"),
        ("MIS_NOTHING=1", "MIS_NOTHING: no such parameter; there are MIS_ACCEL, "),
    ],
)
def test_what_no_check_judges_is_not_set(setting: str, told: str) -> None:
    with pytest.raises(InputError, match=f"^--set {told}"):
        check_mission("hover", "bebop", False, settings=[parse_setting(setting)])


@pytest.mark.parametrize(
    ("law", "shape", "shaped"),
    [
        *(("plumbline", None, True), ("plumbline", 0.0, False), ("plumbline", 2.0, True)),
        *(("thesis", None, False), ("thesis", 1.0, False), ("thesis", 2.0, True)),
    ],
)
def test_the_check_before_a_flight_follows_what_shapes_paths(
    law: str, shape: float | None, shaped: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    monkeypatch.setattr(flyable, "check", lambda mission, limits, shaped: asked.append(shaped) or [])
    settings = () if shape is None else (("MIS_SHAPE", shape),)
    assert flyable.violations(load("hover"), "bebop", BEBOP_LIMITS, law == "plumbline", settings) == []
    assert asked == [shaped]


def test_a_term_that_the_end_of_its_item_cuts_off_is_noted(tmp_path: Path) -> None:
    def notes(**changes: Any) -> list[str]:
        signals = Signals(7.0, (Term("x", 0.5, **{"rise_s": 1.2, **changes}),))
        return list(cut_off_notes(Mission("cut", "", "", (), (Takeoff(2.0), signals, Land()))))

    end = "duration_s 7 of the item"
    assert notes() == notes(start_s=6.0) == notes(hold_s=1.0, fall_s=2.0) == []  # 93 % of the rise at 6 s
    cut = f"note: items[1].terms[0]: rise_s = 1200 is cut off by the {end}, after 0.0084 % of its rise"
    assert notes(rise_s=1200.0) == [cut]
    cut = f"note: items[1].terms[0]: fall_s = 7 is cut off by the {end}, after 78 % of its fall"
    assert notes(hold_s=1.0, fall_s=7.0) == [cut]
    late = f"note: items[1].terms[0]: has no effect: start_s = 7 is not before the {end}"
    assert notes(start_s=7.0) == [late]
    path = tmp_path / "cut.toml"
    term = '{axis = "x", amplitude_m = 0.5, rise_s = 1200.0}'
    items = (
        '{type = "takeoff", altitude_m = 2.0}',
        f'{{type = "signals", duration_s = 7.0, terms = [{term}]}}',
    )
    path.write_text(f'title = "Cut"\nitems = [{", ".join(items)}, {{type = "land"}}]')
    assert any(
        "rise_s = 1200 is cut off" in line for line in check_mission(str(path), "bebop", False).lines()
    )


def test_no_shipped_mission_cuts_off_a_term() -> None:
    assert not any(list(cut_off_notes(load(name))) for name in shipped())
