"""What may be swept, and in which order it is flown."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import pytest

from autopilot.trajectory.timeline import min_move_duration
from autopilot.wire.convert.geodesy import Home
from gcs.batch.reuse import Origin
from gcs.closed_loop import build_onboard
from gcs.sweep.cell import cell_of
from gcs.sweep.margin import CUSTOM_LAW, linear_range
from gcs.sweep.plan import SweepPlan, from_json, make_plan
from gcs.sweep.plan_file import default_directory, load_command, store_plan, sweep_origin
from gcs.sweep.plan_values import PlanError, VariedParameter, parse_seeds, parse_varied, seeds_text
from gcs.sweep.report import write_report
from gcs.sweep.standouts import base_command, flight_settings
from missions.fileformat import load_mission
from tests.gcs.sweep.conftest import stored_plan


def test_ranges_and_lists() -> None:
    assert parse_varied("sim_noise_scale=0.5:4:8", False).values == (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0)
    assert parse_varied("SIM_DROP_PCT=0:0.3:4", False).values == (0.0, 0.1, 0.2, 0.3)
    assert parse_varied("SIM_SENS_LAT_MS=0,5,10", False) == VariedParameter(
        "SIM_SENS_LAT_MS", (0.0, 5.0, 10.0), False
    )
    assert parse_varied("SIM_SENS_LAT_MS=0:10", True) == VariedParameter("SIM_SENS_LAT_MS", (0.0, 10.0), True)
    assert parse_varied("SIM_CABLE_LEN = veh_cable_len = 0.5,1", False) == VariedParameter(
        "SIM_CABLE_LEN", (0.5, 1.0), False, ("VEH_CABLE_LEN",)
    )


@pytest.mark.parametrize(
    "text",
    [
        "SIM_WIND_E",
        "=1,2",
        "SIM_WIND_E=",
        "SIM_WIND_E=1,x",
        "SIM_WIND_E=1,,2",
        "SIM_WIND_E=1,nan",
        "SIM_WIND_E=0,1,0",
        "SIM_WIND_E=2:1:3",
        "SIM_WIND_E=1:2:1",
        "SIM_WIND_E=1:2:2.5",
        "SIM_WIND_E=1:2:3:4",
        "SIM_WIND_E=1:2",
        "SIM_WIND_E==1,2",
        "SIM_WIND_E=SIM_WIND_N=",
    ],
)
def test_what_is_no_variation_is_refused_with_its_text(text: str) -> None:
    with pytest.raises(PlanError, match=f"--vary {text}") as caught:
        parse_varied(text, False)
    assert caught.value.exit_code == 2


def test_a_range_that_is_written_in_another_form_is_answered_with_its_form() -> None:
    with pytest.raises(PlanError, match="'0-4' is no finite number; must be NAME=LOW:HIGH:COUNT or NAME=A,"):
        parse_varied("SIM_WIND_E=0-4", False)


def test_a_count_where_values_are_drawn_is_refused_with_what_to_give() -> None:
    with pytest.raises(PlanError, match=r"without a count; give SIM_WIND_E=0:4$") as caught:
        parse_varied("SIM_WIND_E=0:4:3", True)
    assert caught.value.exit_code == 2


def planned(
    short: str, varied: list[VariedParameter], settings: dict[str, float], sample: int = 0
) -> SweepPlan:
    return make_plan(short, "bebop", "lab", ["thesis"], [1], varied, settings, sample)


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("SIM_NOISE_SCAL", 1.0, "did you mean SIM_NOISE_SCALE"),
        ("SIM_NOISE_SCALE", -1.0, "SIM_NOISE_SCALE"),
        ("SIM_LOSS_PCT", 1.0, "ground link"),
        ("CTL_LAW", 1.0, "--law"),
        ("SIM_RATE_HZ", 300.0, "take one of"),
        ("NGC_KX", 1e9, "NGC_KX"),
    ],
)
def test_wrong_parameters_are_refused(short: str, name: str, value: float, says: str) -> None:
    with pytest.raises(PlanError, match=says):
        planned(short, [VariedParameter(name, (value,), False)], {})
    with pytest.raises(PlanError, match=says):
        planned(short, [], {name: value})


def test_wrong_combinations_are_refused(short: str) -> None:
    wind = VariedParameter("SIM_WIND_E", (1.0, 2.0), False)
    with pytest.raises(PlanError, match="twice"):
        planned(short, [wind, wind], {})
    with pytest.raises(PlanError, match="--vary SIM_WIND_E is given twice"):
        planned(short, [wind, VariedParameter("SIM_WIND_N", (1.0,), False, ("SIM_WIND_E",))], {})
    with pytest.raises(PlanError, match="varied and set"):
        planned(short, [wind], {"SIM_WIND_E": 1.0})
    with pytest.raises(PlanError, match="SIM_WIND_N is both varied and set"):
        planned(short, [replace(wind, followers=("SIM_WIND_N",))], {"SIM_WIND_N": 1.0})
    with pytest.raises(PlanError, match="--vary SIM_CABLE_LEN = 80"):
        planned(short, [VariedParameter("VEH_CABLE_LEN", (1.0, 80.0), False, ("SIM_CABLE_LEN",))], {})
    with pytest.raises(PlanError, match="there is none"):
        planned(short, [], {}, sample=3)
    with pytest.raises(PlanError, match="nowhere"):
        make_plan("nowhere", "bebop", "lab", ["thesis"], [1], [], {}, 0)


def test_every_setting_is_flown_with_every_law_and_seed(short: str) -> None:
    varied = [
        VariedParameter("SIM_WIND_E", (1.0, 2.0), False),
        VariedParameter("NGC_KX", (5.0, 6.0, 7.0), False),
    ]
    plan = make_plan(short, "bebop", "lab", ["thesis", "lqr"], [1, 2], varied, {"SIM_WIND_N": 1.0}, 0)
    cases = list(plan.cases())
    assert [case.index for case in cases] == list(range(plan.flights)) and plan.flights == 24
    assert len({(case.law, case.seed, case.varied) for case in cases}) == 24
    conditions = plan.conditions(cases[-1])
    assert conditions.seed == 2
    assert conditions.settings == {"SIM_WIND_E": 2.0, "NGC_KX": 7.0, "SIM_WIND_N": 1.0, "CTL_LAW": 1.0}


def test_parameters_that_are_varied_together_have_the_same_value(short: str) -> None:
    length = VariedParameter("SIM_CABLE_LEN", (0.5, 1.0), False, ("VEH_CABLE_LEN",))
    plan = planned(short, [length], {})
    assert plan.points == 2 and from_json(plan.to_json()) == plan
    settings = plan.conditions(next(plan.cases())).settings
    assert (settings["SIM_CABLE_LEN"], settings["VEH_CABLE_LEN"]) == (0.5, 0.5)
    told = flight_settings(plan, "thesis", {"SIM_CABLE_LEN": 0.5})
    assert told == ("SIM_CABLE_LEN=0.5", "VEH_CABLE_LEN=0.5")
    assert not plan.contains(replace(plan, varied=(replace(length, followers=()),)))
    rotors = VariedParameter("SIM_WIND_E", (0.0, 4.0), True, ("SIM_ENGINE_FAIL",))
    drawn = planned(short, [rotors], {}, sample=5)
    assert sorted(case.varied[0] for case in drawn.cases()) == [0.0, 1.0, 2.0, 3.0, 4.0]


OWN_LAW = """
from plumbline.laws import Parameter, force

class Mine:
    parameters = {"MY_GAIN": Parameter(2.0, 0.0, 5.0), "MY_OFFSET": Parameter(0.0, -1.0, 1.0)}

    def load_position(self, memory, now):
        return memory, force((0.0, 0.0, 4.9))
"""


def test_parameters_of_a_custom_law_are_for_the_laws_that_have_them(short: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(OWN_LAW, encoding="utf-8")
    laws = ["thesis", f"{path}:Mine"]
    gain = VariedParameter("MY_GAIN", (1.0, 3.0), False)
    plan = make_plan(short, "bebop", "lab", laws, [1], [gain], {"MY_OFFSET": 0.5, "SIM_WIND_E": 1.0}, 0)
    flown = [plan.conditions(case).settings for case in plan.cases()]
    assert flown[0] == flown[1] == {"SIM_WIND_E": 1.0, "CTL_LAW": 0.0}
    assert [settings["MY_GAIN"] for settings in flown[2:]] == [1.0, 3.0]
    assert [settings["MY_OFFSET"] for settings in flown[2:]] == [0.5, 0.5]
    assert flight_settings(plan, laws[0], {"MY_GAIN": 3.0}) == ("SIM_WIND_E=1.0",)
    assert "MY_OFFSET=0.5" in base_command(plan, laws[1]) and "MY_" not in base_command(plan, laws[0])
    assert linear_range(plan, laws[0], "MY_GAIN", 2.0, (1.0, 3.0)) == ""
    assert linear_range(plan, laws[1], "SIM_ACT_DELAY_MS", 0.0, (0.0, 5.0)) == CUSTOM_LAW
    with pytest.raises(PlanError, match=r"MY_GAIN = 9\.0; must be 0 \.\.\. 5"):
        make_plan(short, "bebop", "lab", laws, [1], [], {"MY_GAIN": 9.0}, 0)
    with pytest.raises(PlanError, match="MY_GAIM: no such parameter"):
        make_plan(short, "bebop", "lab", laws, [1], [], {"MY_GAIM": 1.0}, 0)
    with pytest.raises(PlanError, match="MY_GAIN: no such parameter"):
        planned(short, [gain], {})


def test_the_parameters_of_a_law_whose_file_has_changed_are_those_that_it_has_now(
    short: str, tmp_path: Path
) -> None:
    path = tmp_path / "mine.py"

    def foreign(source: str) -> frozenset[str]:
        path.write_text(source, encoding="utf-8")
        plan = make_plan(short, "bebop", "lab", ["thesis", f"{path}:Mine"], [1], [], {}, 0)
        return plan.foreign_to("thesis")

    assert foreign(OWN_LAW) == {"MY_GAIN", "MY_OFFSET"}
    assert foreign(OWN_LAW.replace("MY_OFFSET", "MY_BIAS")) == {"MY_GAIN", "MY_BIAS"}


def test_a_vehicle_is_delivered_with_the_parameters_of_one_law_among_others(
    short: str, tmp_path: Path
) -> None:
    """The built-in laws fly it without them, and the law that has them with them."""
    law, vehicle = f"{tmp_path / 'mine.py'}:Mine", str(tmp_path / "tuned.toml")
    (tmp_path / "mine.py").write_text(OWN_LAW, encoding="utf-8")
    bebop = files("autopilot.vehicle").joinpath("vehicles", "bebop.toml").read_text(encoding="utf-8")

    def plan_with(line: str, *laws: str) -> SweepPlan:
        Path(vehicle).write_text(f"{bebop}[parameters]\n{line}\n", encoding="utf-8")
        return make_plan(short, vehicle, "lab", laws, [1], [], {}, 0)

    plan = plan_with("MY_GAIN = 3.0", "thesis", law)
    conditions = [plan.conditions(case) for case in plan.cases()]
    assert [sorted(one.ignored) for one in conditions] == [["MY_GAIN", "MY_OFFSET"], []]
    built_in, own = (build_onboard(one, Home()).parameters for one in conditions)
    assert "MY_GAIN" not in built_in and own["MY_GAIN"] == 3.0
    cell_of(load_mission(short), conditions[0])
    store_plan(tmp_path / "sweep", plan, "gcs sweep", origin(plan))
    assert write_report(tmp_path / "sweep", plan).is_file()
    assert "--ignore MY_GAIN" in base_command(plan, "thesis") and "--ignore" not in base_command(plan, law)
    with pytest.raises(PlanError, match=r"MY_GAIN = 9\.0; must be 0 \.\.\. 5"):
        plan_with("MY_GAIN = 9.0", "thesis", law)
    with pytest.raises(PlanError, match="MY_GAIN: no such parameter"):
        plan_with("MY_GAIN = 3.0", "thesis")
    with pytest.raises(PlanError, match="MY_GAIM: no such parameter"):
        plan_with("MY_GAIM = 3.0", "thesis", law)


def test_the_time_limit_is_that_of_the_option_or_follows_from_the_cable(short: str) -> None:
    def limit_s(settings: dict[str, float], limit: float | None = None) -> float:
        plan = make_plan(short, "bebop", "lab", ["thesis"], [1], [], settings, 0, limit_s=limit)
        assert from_json(plan.to_json()) == plan
        assert ("--timeout" in base_command(plan, "thesis")) == (limit is not None)
        return 1e-6 * cell_of(load_mission(short), plan.conditions(next(plan.cases()))).limit_us

    assert limit_s({}, 17.5) == 17.5
    # measured: 58 s and 58 s with a slack cable at 20 m, 7 s and 7 s at 0.7 m; at 20 m, 5 s more are expected
    # than flown; lift and descent take the least time of a move
    moves_s = 2.0 * (min_move_duration(20.0, 9.81) - min_move_duration(0.7, 9.81))
    longer_s = limit_s({"VEH_CABLE_LEN": 20.0}) - limit_s({})
    assert longer_s == pytest.approx(1.5 * (116.0 + 5.0 - 14.0 + moves_s), rel=0.02)


def test_drawn_settings_fill_their_ranges_and_are_always_the_same(short: str) -> None:
    varied = [
        VariedParameter("SIM_WIND_E", (1.0, 3.0), True),
        VariedParameter("SIM_DROP_PCT", (0.0, 10.0), False),
    ]
    plan = planned(short, varied, {}, sample=40)
    cases = list(plan.cases())
    wind = sorted(case.varied[0] for case in cases)
    # one in each fortieth of the range: that is what makes it a Latin hypercube
    assert [int((value - 1.0) / 2.0 * 40) for value in wind] == list(range(40))
    assert sorted(case.varied[1] for case in cases) == [0.0] * 20 + [10.0] * 20
    assert list(from_json(plan.to_json()).cases()) == cases


def test_of_a_parameter_that_takes_whole_numbers_only_such_are_drawn(short: str) -> None:
    rotors, wind = ("SIM_ENGINE_FAIL", (0.0, 4.0)), ("SIM_WIND_E", (1.0, 3.0))
    varied = [VariedParameter(name, ends, True) for name, ends in (rotors, wind)]
    plan = planned(short, varied, {}, sample=20)
    drawn = [case.varied[0] for case in plan.cases()]
    assert sorted(drawn) == [one for one in (0.0, 1.0, 2.0, 3.0, 4.0) for _ in range(4)]
    with pytest.raises(PlanError, match=r"SIM_ENGINE_FAIL = 0.5; must be a whole number"):
        planned(short, [VariedParameter("SIM_ENGINE_FAIL", (0.5, 4.0), True)], {}, sample=20)


@pytest.mark.parametrize("sample", [6, 10, 14, 15])
def test_of_listed_values_no_setting_is_drawn_twice(short: str, sample: int) -> None:
    """Three and five values: a Latin hypercube of 15 has 10 to 13 of the 15 pairs, and others twice."""
    varied = [
        VariedParameter("SIM_WIND_E", (0.0, 1.0, 2.0), False),
        VariedParameter("SIM_ENGINE_FAIL", (0.0, 4.0), True),
    ]
    plan = planned(short, varied, {}, sample=sample)
    drawn = [case.varied for case in plan.cases()]
    assert len(drawn) == len(set(drawn)) == sample
    for k in range(2):
        counts = Counter(setting[k] for setting in drawn).values()
        assert max(counts) - min(counts) <= 1, "each value about as often"
    assert list(from_json(plan.to_json()).cases()) == list(plan.cases())


def test_more_settings_than_there_are_cannot_be_drawn(short: str) -> None:
    varied = [VariedParameter(name, (0.0, 1.0), False) for name in ("SIM_WIND_E", "SIM_WIND_N")]
    assert len(list(planned(short, varied, {}, sample=4).cases())) == 4
    with pytest.raises(PlanError, match="--sample 5: these values make 4 settings only"):
        planned(short, varied, {}, sample=5)


@pytest.mark.parametrize(
    ("text", "seeds", "short"),
    [
        ("3", (1, 2, 3), "3"),
        ("1:3", (1, 2, 3), "3"),
        ("11:14", (11, 12, 13, 14), "11:14"),
        ("7:7", (7,), "7:7"),
        ("0:0", (0,), "0:0"),
        ("20:22, 7,3", (3, 7, 20, 21, 22), "3,7,20:22"),
        ("1,2,4", (1, 2, 4), "1:2,4"),
    ],
)
def test_seeds_are_a_number_ranges_or_a_list(text: str, seeds: tuple[int, ...], short: str) -> None:
    assert parse_seeds(text) == seeds
    assert seeds_text(seeds) == short
    assert parse_seeds(short) == seeds


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "'nothing' is no seed; must be a number N for the seeds 1 ... N, a range or a list, as 11:20"),
        ("-3", "'-3' is no seed"),
        ("1.5", "'1.5' is no seed"),
        ("1:5:2", "'5:2' is no seed"),
        ("3,", "'nothing' is no seed"),
        ("0", "--seeds 0: flies nothing; --seeds 0:0 flies the seed 0"),
        ("5:1", "the first end must not be above the second"),
        ("3,1:5", "3 is there twice"),
        ("10000001", "too many, 10000000 flights at most"),
        ("9223372036854775808:9223372036854775809", "a seed is 9223372036854775807 at most"),
        ("1" * 5000, "is no seed"),
    ],
)
def test_what_are_no_seeds(text: str, says: str) -> None:
    with pytest.raises(PlanError) as error:
        parse_seeds(text)
    assert says in str(error.value)


def test_a_plan_contains_those_with_fewer_seeds_and_values(plan: SweepPlan) -> None:
    delays = VariedParameter("SIM_ACT_DELAY_MS", (0.0, 12.0, 24.0), True)
    wind = VariedParameter("SIM_WIND_E", (0.0, 2.0), True)
    grid = replace(plan, seeds=(1, 2, 3), varied=(delays, wind), sample=0)
    assert grid.contains(grid)
    assert grid.contains(replace(grid, seeds=(3, 1), varied=(replace(delays, values=(24.0, 0.0)), wind)))
    for other in (
        replace(grid, seeds=(1, 4)),
        replace(grid, varied=(replace(delays, values=(6.0,)), wind)),
        replace(grid, varied=(delays,)),
        replace(grid, varied=(wind, delays)),
        replace(grid, sensors="ideal"),
        replace(grid, settings=(("SIM_GUST_E", 1.0),)),
    ):
        assert not grid.contains(other)
    drawn = replace(grid, sample=8)
    assert drawn.contains(replace(drawn, seeds=(2,)))
    assert not drawn.contains(replace(drawn, varied=(replace(delays, values=(0.0, 24.0)), wind)))
    assert not drawn.contains(replace(drawn, sample=4))


def origin(plan: SweepPlan, version: str = "1", code: str = "code") -> Origin:
    return Origin({"plan": plan.to_json(), "files": {}}, version, code)


def test_a_directory_holds_one_plan(plan: SweepPlan, tmp_path: Path) -> None:
    store_plan(tmp_path, plan, "gcs sweep", origin(plan))
    store_plan(tmp_path, plan, "gcs sweep again", origin(plan))
    assert stored_plan(tmp_path) == plan
    assert load_command(tmp_path) == ("gcs sweep", "1")
    other = SweepPlan(plan.mission, "bebop", "lab", ("lqr",), (1,), (), ())
    with pytest.raises(PlanError, match=r"another sweep, with other --law, --seeds, --vary; name"):
        store_plan(tmp_path, other, "gcs sweep", origin(other))
    with pytest.raises(PlanError, match="this sweep as flown by another version or other code"):
        store_plan(tmp_path, plan, "gcs sweep", origin(plan, code="changed"))
    with pytest.raises(PlanError, match="another version"):
        store_plan(tmp_path, plan, "gcs sweep", origin(plan, version="2"))
    with pytest.raises(PlanError, match="no sweep"):
        load_command(tmp_path / "empty")


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"plan": {}, "code": "x"}'])
def test_a_plan_that_cannot_be_read_is_not_overwritten(plan: SweepPlan, tmp_path: Path, text: str) -> None:
    (tmp_path / "plan.json").write_text(text, encoding="utf-8")
    with pytest.raises(PlanError, match="--fresh"):
        store_plan(tmp_path, plan, "gcs sweep", origin(plan))
    with pytest.raises(PlanError, match="no sweep"):
        load_command(tmp_path)
    assert (tmp_path / "plan.json").read_text(encoding="utf-8") == text


def test_a_mission_file_that_changed_is_another_sweep(plan: SweepPlan, tmp_path: Path) -> None:
    mission = tmp_path / "mission.toml"
    mission.write_bytes(Path(plan.mission).read_bytes())
    moved = replace(plan, mission=str(mission))
    before = sweep_origin(moved)
    assert sweep_origin(moved).differences(before.to_json()) == ()
    mission.write_text(mission.read_text(encoding="utf-8").replace("0.4", "0.5"), encoding="utf-8")
    assert sweep_origin(moved).differences(before.to_json()) == ("settings",)


def test_a_file_that_changed_is_named_and_not_the_seeds_that_are_added(
    plan: SweepPlan, tmp_path: Path
) -> None:
    mission = tmp_path / "mission.toml"
    mission.write_bytes(Path(plan.mission).read_bytes())
    moved = replace(plan, mission=str(mission), seeds=(1, 2))
    store_plan(tmp_path, moved, "gcs sweep", sweep_origin(moved))
    mission.write_text(mission.read_text(encoding="utf-8").replace("0.4", "0.5"), encoding="utf-8")
    more = replace(moved, seeds=(1, 2, 3))
    with pytest.raises(PlanError, match=r"another sweep, with other content of .*mission\.toml"):
        store_plan(tmp_path, more, "gcs sweep", sweep_origin(more))


def test_sweeps_without_a_name_do_not_get_into_each_others_way(
    plan: SweepPlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    stem = Path(plan.mission).stem
    other = replace(plan, sensors="rtk" if plan.sensors == "lab" else "lab")
    for number, one in enumerate((plan, other), start=1):
        for _ in range(2):  # and each continues in its folder
            directory = default_directory(one, origin(one), fresh=False)
            assert directory == Path("sweeps") / (stem if number == 1 else f"{stem}-{number}")
            store_plan(directory, one, "gcs sweep", origin(one))
    changed = origin(plan, code="changed")
    assert default_directory(plan, changed, fresh=False) == Path("sweeps") / f"{stem}-3"
    assert default_directory(plan, changed, fresh=True) == Path("sweeps") / stem
    third, fourth = (Path("sweeps") / f"{stem}-{number}" for number in (3, 4))
    third.write_text("a file", encoding="utf-8")
    fourth.mkdir()
    assert default_directory(plan, changed, fresh=False) == fourth


def test_each_mistake_in_a_file_is_a_line(tmp_path: Path) -> None:
    mission = tmp_path / "mission.toml"
    mission.write_text('titel = "T"\ncolour = 1\n[[items]]\ntype = "land"\n', encoding="utf-8")
    with pytest.raises(PlanError) as told:
        make_plan(str(mission), "bebop", "lab", ["thesis"], [1], [], {}, 0)
    assert len(told.value.lines) == 2
