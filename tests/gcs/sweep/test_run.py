"""A sweep from plan to table and report: complete, stopped, killed, continued."""

from __future__ import annotations

import errno
import json
import math
import re
import shlex
import shutil
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pyarrow
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from scipy.stats import binomtest

from autopilot.own.own_code import OwnCode
from autopilot.shell.compiling import Part
from gcs.analysis.definitions import METRICS
from gcs.batch import pool
from gcs.cli import gcs
from gcs.errors import GcsError, InputError
from gcs.sweep import run, work
from gcs.sweep.plan import SweepPlan
from gcs.sweep.plan_file import store_plan, sweep_files, sweep_origin
from gcs.sweep.plan_values import PlanError, VariedParameter
from gcs.sweep.report import write_report
from gcs.sweep.results import cells, completion_range, flights_by_law, interval_text, law_record
from gcs.sweep.standouts import repeat_command, stored_standouts
from gcs.sweep.store import Row, Store, cause_of, columns
from tests.doubles.browser import Browser
from tests.gcs.sweep.conftest import AtOnce, stored_plan


def swept(plan: SweepPlan, directory: Path, stopped: object = False) -> run.SweepResult:
    workers = nullcontext((AtOnce(), 1))
    return run.sweep(plan, directory, "gcs sweep", workers, lambda: bool(stopped), quiet=True, fresh=False)


class AfterOne:
    """False when first asked, then true: the sweep stops after it has flown something."""

    def __init__(self) -> None:
        self.asked = 0

    def __bool__(self) -> bool:
        self.asked += 1
        return self.asked > 1


def without_clock(path: Path) -> list[dict[str, Any]]:
    table = pq.read_table(path / "flights.parquet")
    # repr: NaN is not equal to itself
    return [{k: repr(v) for k, v in row.items() if k != "wall_s"} for row in table.to_pylist()]


@pytest.fixture(scope="module")
def whole(short: str, tmp_path_factory: pytest.TempPathFactory) -> tuple[SweepPlan, Path, run.SweepResult]:
    delays = VariedParameter("SIM_ACT_DELAY_MS", (0.0, 4.0, 60.0), True)
    plan = SweepPlan(short, "bebop", "lab", ("thesis",), (1, 2), (delays,), ())
    directory = tmp_path_factory.mktemp("whole")
    return plan, directory, swept(plan, directory)


@cache
def page_of(plan: SweepPlan, directory: Path) -> Path:
    """The page of a sweep that stays as it is, written once."""
    return write_report(directory, plan)


def test_table_has_a_row_for_each_flight(whole: tuple[SweepPlan, Path, run.SweepResult]) -> None:
    plan, directory, done = whole
    assert (done.flights, done.flown, done.completed, done.is_complete) == (6, 6, 4, True)
    table = pq.read_table(directory / "flights.parquet")
    assert tuple(table.column_names) == columns(plan)
    assert table.column("index").to_pylist() == list(range(6))
    assert table.column("SIM_ACT_DELAY_MS").to_pylist() == [0.0, 0.0, 4.0, 4.0, 60.0, 60.0]
    assert table.column("outcome").to_pylist() == ["completed"] * 4 + ["diverged"] * 2
    assert table.column("cause").to_pylist() == list(map(cause_of, table.column("reason").to_pylist()))
    assert all(table.column("reason").to_pylist()[4:]) and all(table.column("lost_phase").to_pylist()[4:])
    errors = table.column("load_error_max_m").to_pylist()[:4]
    assert all(0.001 < error < 0.3 for error in errors)
    assert not (directory / "parts").exists()
    assert stored_plan(directory) == plan


def test_a_sweep_that_was_stopped_goes_on(
    whole: tuple[SweepPlan, Path, run.SweepResult], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, complete, _ = whole
    monkeypatch.setattr(work, "batch_size", lambda flights, workers: 1)
    first = swept(plan, tmp_path, AfterOne())
    assert not first.is_complete and 0 < first.flights < 6
    rest = swept(plan, tmp_path)
    assert rest.is_complete and rest.flown == 6 - first.flights
    assert without_clock(tmp_path) == without_clock(complete)
    assert swept(plan, tmp_path).flown == 0


def test_a_sweep_that_was_killed_goes_on(
    whole: tuple[SweepPlan, Path, run.SweepResult], tmp_path: Path
) -> None:
    plan, complete, _ = whole
    rows = pq.read_table(complete / "flights.parquet").to_pylist()
    store_plan(tmp_path, plan, "gcs sweep", sweep_origin(plan))
    store = Store(tmp_path, plan)
    store.add(rows[:2])
    store.merge()
    # killed after merging, before the parts were removed; and while a part was being written
    store.add(rows[1:3])
    (tmp_path / "parts" / "000000005-1.99.unfinished").write_bytes(b"PAR1")
    assert store.stored_indices() == {0, 1, 2}
    done = swept(plan, tmp_path)
    assert (done.flights, done.flown) == (6, 3)
    assert without_clock(tmp_path) == without_clock(complete)


def test_a_full_disk_is_told_with_the_folder_and_loses_no_flight(
    whole: tuple[SweepPlan, Path, run.SweepResult], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, complete, _ = whole
    monkeypatch.setattr(work, "batch_size", lambda flights, workers: 1)
    add = Store.add

    def add_until_full(store: Store, rows: Sequence[Row]) -> None:
        if store.stored_indices():
            raise OSError(errno.ENOSPC, "wrapped by a library")
        add(store, rows)

    with monkeypatch.context() as patch:
        patch.setattr(run, "STORE_INTERVAL_S", 0.0)
        patch.setattr(Store, "add", add_until_full)
        with pytest.raises(GcsError) as error:
            swept(plan, tmp_path)
    told = "no space left on device; its flights are kept, and the same command continues"
    assert str(error.value) == f"{tmp_path}: {told}"
    stored = len(Store(tmp_path, plan).stored_indices())
    assert 0 < stored < 6 and swept(plan, tmp_path).flown == 6 - stored
    assert without_clock(tmp_path) == without_clock(complete)


@pytest.mark.parametrize("stopped", [False, True], ids=["after its end", "after a stop"])
def test_a_sweep_is_extended_by_seeds_and_values(
    whole: tuple[SweepPlan, Path, run.SweepResult],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    stopped: bool,
) -> None:
    plan, complete, _ = whole
    monkeypatch.setattr(work, "batch_size", lambda flights, workers: 1)
    less = replace(plan, seeds=(2,), varied=(replace(plan.varied[0], values=(60.0, 0.0)),))
    first = swept(less, tmp_path, AfterOne() if stopped else False)
    if stopped:  # killed before its parts were merged
        rows = pq.read_table(tmp_path / "flights.parquet").to_pylist()
        (tmp_path / "flights.parquet").unlink()
        Store(tmp_path, less).add(rows)
        (tmp_path / "parts" / ".000000005-1.parquet.new").write_bytes(b"PAR1")  # it was writing another part
    rest = swept(plan, tmp_path)
    assert (rest.flights, rest.flown) == (6, 6 - first.flights)
    assert not (tmp_path / "parts").exists()
    assert without_clock(tmp_path) == without_clock(complete)
    assert stored_plan(tmp_path) == plan
    with pytest.raises(PlanError, match="another sweep, with other --seeds, --vary"):
        swept(less, tmp_path)


@pytest.fixture
def of_a_file(short: str, tmp_path: Path) -> tuple[work.Work, Path]:
    """Flights of a vehicle in a file of the user's own."""
    file = tmp_path / "mine.toml"
    file.write_text('believed = "bebop"\nload_mass_kg = 0.11\n')
    plan = SweepPlan(short, str(file), "lab", ("plumbline",), (1, 2), (), ())
    return work.prepare(plan, sweep_files(plan), lambda parts: None), file


def test_a_worker_that_has_other_files_flies_nothing(of_a_file: tuple[work.Work, Path]) -> None:
    prepared, file = of_a_file
    cases, clock = list(prepared.plan.cases()), time.monotonic
    assert [row["outcome"] for row in work.fly_cases(prepared, cases, clock)] == ["completed"] * 2
    file.write_text('believed = "bebop"\nload_mass_kg = 0.12\n')
    with pytest.raises(GcsError, match=r"mine\.toml: another file than as the sweep began, for a worker in "):
        work.fly_cases(prepared, cases, clock)
    file.unlink()
    with pytest.raises(GcsError, match=r"mine\.toml.*no such file.*need the same files at the same paths"):
        work.fly_cases(prepared, cases, clock)


def test_flights_during_which_a_file_was_changed_do_not_count(
    of_a_file: tuple[work.Work, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    prepared, file = of_a_file

    def fly_one(_: object, case: Any, clock: object) -> Row:
        file.write_text('believed = "bebop"\nload_mass_kg = 0.12\n')
        return {"index": case.index}

    monkeypatch.setattr(work, "fly_one", fly_one)
    with pytest.raises(GcsError, match="another file than as the sweep began"):
        work.fly_cases(prepared, list(prepared.plan.cases()), time.monotonic)


def test_a_retrained_policy_is_another_law(tmp_path: Path) -> None:
    law = tmp_path / "mine.py"
    law.write_text(
        "from pathlib import Path\nfrom plumbline.learning.law import PolicyLaw\n"
        "class Mine(PolicyLaw):\n    file = Path(__file__).with_name('hover.npz')\n"
    )
    (tmp_path / "hover.npz").write_bytes(b"first")
    before = OwnCode(law=str(law)).digests
    assert OwnCode(law=str(law)).digests == before
    (tmp_path / "hover.npz").write_bytes(b"second")
    assert OwnCode(law=str(law)).digests != before


def test_a_folder_with_a_colon_is_a_folder(
    whole: tuple[SweepPlan, Path, run.SweepResult], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, complete, _ = whole
    monkeypatch.chdir(tmp_path)
    folder = Path("run-14:30")
    assert swept(replace(plan, seeds=(1,)), folder).is_complete
    assert swept(plan, folder).is_complete
    assert without_clock(tmp_path / folder) == without_clock(complete)


def test_flights_are_stored_without_what_imports_pandas(
    whole: tuple[SweepPlan, Path, run.SweepResult], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, complete, _ = whole
    rows = pq.read_table(complete / "flights.parquet").to_pylist()
    for module, name in ((pyarrow, "array"), (pyarrow, "table"), (pq, "read_table")):
        monkeypatch.delattr(module, name)
    store = Store(tmp_path, plan)
    store.add(rows[3:])
    store.add(rows[:3])
    assert str(store.merge().to_pylist()) == str(rows)  # nan is not equal to itself


def test_a_report_without_flights_says_so(
    whole: tuple[SweepPlan, Path, run.SweepResult], tmp_path: Path
) -> None:
    plan, _, _ = whole
    assert swept(plan, tmp_path, lambda: True).flights == 0
    page = write_report(tmp_path, plan).read_text(encoding="utf-8")
    assert "No flight has ended yet." in page and "<h2>" not in page


def test_report_holds_map_curve_and_margin(whole: tuple[SweepPlan, Path, run.SweepResult]) -> None:
    plan, directory, _ = whole
    page = page_of(plan, directory).read_text(encoding="utf-8")
    assert (directory / "curve-sim_act_delay_ms.png").stat().st_size > 5000
    assert "SIM_ACT_DELAY_MS" in page and "0 … 4" in page and "data:image/png" in page


def test_shares_and_reach(whole: tuple[SweepPlan, Path, run.SweepResult]) -> None:
    plan, directory, _ = whole
    (flights,) = flights_by_law(Store(directory, plan).read(), plan)
    found = cells(flights, plan, ("SIM_ACT_DELAY_MS",))
    assert found.success.tolist() == [1.0, 1.0, 0.0]
    assert found.flown.tolist() == [2.0, 2.0, 2.0]
    assert found.error_worst_m[0] >= found.error_median_m[0] > 0.0
    assert found.error_worst_m[2] != found.error_worst_m[2]
    reached = completion_range(flights, plan, "SIM_ACT_DELAY_MS", 0.0)
    assert (reached.all_from, reached.all_to) == (reached.some_from, reached.some_to) == (0.0, 4.0)


def test_no_range_is_claimed_of_what_was_not_flown(
    whole: tuple[SweepPlan, Path, run.SweepResult], tmp_path: Path
) -> None:
    """Stopped after the first of two seeds at 4 ms, with nothing flown at 60 ms."""
    plan, complete, _ = whole
    rows = pq.read_table(complete / "flights.parquet").to_pylist()
    store = Store(tmp_path, plan)
    store.add(rows[:3])
    store.merge()
    (flights,) = flights_by_law(store.read(), plan)
    reached = completion_range(flights, plan, "SIM_ACT_DELAY_MS", 0.0)
    assert (reached.all_from, reached.all_to) == (reached.some_from, reached.some_to) == (0.0, 0.0)
    store_plan(tmp_path, plan, "gcs sweep", sweep_origin(plan))
    page = write_report(tmp_path, plan).read_text(encoding="utf-8")
    assert "Not finished: 6 are planned." in page
    cells = re.sub("<td [^>]*>", "<td>", page)
    assert "<td>0 … 4</td><td>0</td><td>0</td>" in cells, "flown, all complete, all seeds complete"


def test_flights_that_stand_out_are_those_of_the_table(
    whole: tuple[SweepPlan, Path, run.SweepResult],
) -> None:
    plan, directory, _ = whole
    rows = pq.read_table(directory / "flights.parquet").to_pylist()
    completed = sorted((row["load_error_max_m"], row["index"]) for row in rows[:4])
    found = {one.kind: one for one in stored_standouts(directory, plan)}
    assert {kind: one.index for kind, one in found.items()} == {
        "worst": completed[-1][1],
        "median": completed[1][1],
        "lost": 4,
    }
    words = shlex.split(repeat_command(plan, found["lost"], directory))
    assert words[:3] == ["gcs", "fly", plan.mission]
    assert words[words.index("--seed") + 1] == "1"
    assert "SIM_ACT_DELAY_MS=60.0" in words
    assert {"--force", "--overwrite"} <= set(words), "it flies whatever it is, and as often as it is given"


def open_page(browser: Browser, whole: tuple[SweepPlan, Path, object], width: int) -> None:
    """Open the page of the sweep and wait until its maps are drawn."""
    plan, directory, _ = whole
    browser.open(page_of(plan, directory).as_uri(), width, 844)
    browser.wait("document.documentElement.dataset.ready === '1'")


def test_a_click_on_a_cell_gives_the_command_of_its_flight(
    browser: Browser, whole: tuple[SweepPlan, Path, run.SweepResult]
) -> None:
    plan, directory, _ = whole
    open_page(browser, whole, 1280)
    assert browser.run("return document.querySelectorAll('rect.cell').length") == 3
    browser.find("rect.cell[data-cell='2']").click()
    assert (
        "SIM_ACT_DELAY_MS 60 ms: 2 flights, 0 % completed (95 % interval 0 … 84 %)"
        in browser.find(".said").text
    )
    lost = next(one for one in stored_standouts(directory, plan) if one.kind == "lost")
    whole_command = shlex.split(repeat_command(plan, lost, directory))
    assert shlex.split(browser.find("#chosen code").text) == whole_command[: whole_command.index("--out")]
    browser.listen()
    assert browser.errors == []
    assert [url for url in browser.requests if not url.startswith(("file:", "data:"))] == []


@pytest.mark.parametrize("width", [360, 390, 800, 1280])
def test_what_is_wider_than_the_window_scrolls_and_no_button_is_out_of_it(
    browser: Browser, whole: tuple[SweepPlan, Path, run.SweepResult], width: int
) -> None:
    open_page(browser, whole, width)
    browser.find("rect.cell[data-cell='2']").click()
    assert browser.run("return document.documentElement.scrollWidth") <= width
    out = browser.run(
        """return [...document.querySelectorAll("main *")]
            .filter((one) => !one.closest(".scrolls *, .frame *"))
            .filter((one) => one.getBoundingClientRect().right > innerWidth)
            .map((one) => one.outerHTML.slice(0, 80))"""
    )
    assert out == []
    assert browser.run("return document.querySelectorAll('.copy').length") > 2
    assert browser.run("return document.querySelector('figure img').getBoundingClientRect().width") >= 800
    size = browser.run("return parseFloat(getComputedStyle(document.querySelector('.map text')).fontSize)")
    scale = browser.run("return document.querySelector('.map svg').getScreenCTM().a")
    assert size * scale >= 11.0, "the map is read on a phone"


@pytest.fixture(scope="module")
def steps(stepped: str, tmp_path_factory: pytest.TempPathFactory) -> tuple[SweepPlan, Path]:
    """Six flights of a step, of which those with the long delay are lost."""
    delays = VariedParameter("SIM_ACT_DELAY_MS", (0.0, 4.0, 60.0), True)
    plan = SweepPlan(stepped, "bebop", "lab", ("thesis",), (1, 2), (delays,), ())
    directory = tmp_path_factory.mktemp("steps")
    swept(plan, directory)
    return plan, directory


def test_the_step_response_is_in_table_record_and_page(steps: tuple[SweepPlan, Path]) -> None:
    plan, directory = steps
    rows = pq.read_table(directory / "flights.parquet").to_pylist()
    (flights,) = flights_by_law(Store(directory, plan).read(), plan)
    record: Any = law_record(flights)
    assert (record["law"], record["flights"], record["completed"]) == ("thesis", 6, 4)
    interval = binomtest(4, 6).proportion_ci(0.95, method="exact")
    shares = [record[key] for key in ("completed_fraction", "completed_low_95", "completed_high_95")]
    assert shares == pytest.approx([4 / 6, interval.low, interval.high], rel=1e-9)
    page = page_of(plan, directory).read_text(encoding="utf-8")
    for name, decimals in (("rise_time_90_s", 3), ("overshoot_pct", 1), ("settling_time_5pct_s", 3)):
        middle = statistics.median(row[name] for row in rows[:4])
        assert record["medians"][name] == pytest.approx(middle)
        assert f'median ({METRICS[name].unit})">{middle:.{decimals}f}</td>' in page
    found = cells(flights, plan, ("SIM_ACT_DELAY_MS",)).step_medians["rise_time_90_s"]
    assert found[1] == pytest.approx(statistics.median(row["rise_time_90_s"] for row in rows[2:4]))
    assert math.isnan(found[2]), "of lost flights"


@pytest.mark.parametrize(
    ("completed", "flights", "text"),
    [(4, 4, "40 … 100"), (0, 2, "0 … 84"), (9, 10, "55 … 99.75"), (10_000, 10_000, "99.963 … 100")],
)
def test_the_interval_of_a_share_as_people_read_it(completed: int, flights: int, text: str) -> None:
    assert interval_text(completed, flights) == text


def test_flights_that_never_settle_count_in_the_median(
    steps: tuple[SweepPlan, Path], whole: tuple[SweepPlan, Path, run.SweepResult]
) -> None:
    plan, directory = steps
    table = Store(directory, plan).read()
    settling = table.column("settling_time_5pct_s").to_pylist()
    for never, known in ((1, True), (3, False)):
        column = pyarrow.array([math.nan] * never + settling[never:])
        place = table.schema.get_field_index("settling_time_5pct_s")
        (flights,) = flights_by_law(table.set_column(place, "settling_time_5pct_s", column), plan)
        medians: Any = law_record(flights)["medians"]
        assert (medians["settling_time_5pct_s"] is not None) == known
    plan, directory, _ = whole
    (flights,) = flights_by_law(Store(directory, plan).read(), plan)
    medians = law_record(flights)["medians"]
    assert medians["settling_time_5pct_s"] is None, "the mission is no step"
    assert "overshoot" not in page_of(plan, directory).read_text(encoding="utf-8")


def test_a_map_shows_the_step_response(browser: Browser, steps: tuple[SweepPlan, Path]) -> None:
    plan, directory = steps
    open_page(browser, (plan, directory, None), 1280)
    buttons = browser.run(
        "return [...document.querySelectorAll('.choice button')].map((one) => one.textContent)"
    )
    assert buttons[3:] == ["rise to 90 %, median (s)", "overshoot, median (%)", "settling to 5 %, median (s)"]
    browser.run("document.querySelectorAll('.choice button')[3].click()")
    (flights,) = flights_by_law(Store(directory, plan).read(), plan)
    rise = cells(flights, plan, ("SIM_ACT_DELAY_MS",)).step_medians["rise_time_90_s"]
    shown = browser.run(
        "return [...document.querySelectorAll('rect.cell + text')].map((one) => one.textContent)"
    )
    assert shown == [*(f"{one:#.3g}" for one in rise[:2]), "–"]
    browser.find("rect.cell[data-cell='0']").click()
    assert f"rise to 90 % {rise[0]:#.3g} s, overshoot " in browser.find(".said").text
    browser.listen()
    assert browser.errors == []


def test_the_map_is_drawn_anew_in_a_window_of_another_width(
    browser: Browser, whole: tuple[SweepPlan, Path, run.SweepResult]
) -> None:
    open_page(browser, whole, 1280)
    browser.find("rect.cell[data-cell='2']").click()
    browser.resize(390, 844)
    browser.wait("document.querySelector('.map svg').getBoundingClientRect().width < 390")
    assert browser.run("return document.querySelector('rect.chosen').dataset.cell") == "2"


def test_command_line_prints_one_object(short: str, tmp_path: Path) -> None:
    arguments = [
        "sweep",
        short,
        "--law",
        "thesis",
        "--seeds",
        "2",
        "--jobs",
        "1",
        "--out",
        str(tmp_path),
        "--json",
    ]
    required = ["--require", "completed_fraction >= 0.99", "--require", "load_error_max_m < 1e-6"]
    result = CliRunner().invoke(gcs, [*arguments, "--json", *required], prog_name="gcs")
    assert result.exit_code == 4, "a load is not held so well"
    assert "required load_error_max_m < 1e-6; found " in result.stderr
    record = json.loads(result.stdout)
    assert (record["flights"], record["completed"], record["failed"]) == (2, 2, 0)
    (law,) = record["laws"]
    assert (law["law"], law["completed"]) == ("thesis", 2) and law["medians"]["rise_time_90_s"] is None
    assert 0.0 < law["medians"]["load_error_max_m"] <= record["load_error_max_m"]
    assert record["completed_fraction"] == 1.0 and 1e-6 < record["load_error_max_m"] < 0.3
    assert record["out"] == str(tmp_path) and record["flights_per_s"] > 0.0
    assert (tmp_path / "report.html").exists()


def test_any_seeds_are_flown_continued_and_repeated(short: str, tmp_path: Path) -> None:
    """Seed 3 is the same flight in whatever sweep."""
    words = ["sweep", short, "--law", "thesis", "--jobs", "1", "--json", "--out"]

    def flown(out: str, seeds: str) -> tuple[dict[str, Any], list[dict[str, Any]]]:
        result = CliRunner().invoke(gcs, [*words, str(tmp_path / out), "--seeds", seeds], prog_name="gcs")
        assert result.exit_code == 0, result.output
        return json.loads(result.stdout), without_clock(tmp_path / out)

    record, rows = flown("some", "3,5:6")
    assert [row["seed"] for row in rows] == ["3", "5", "6"]
    assert {one["seed"] for one in record["standouts"]} <= {3, 5, 6}
    assert f"--seed {record['standouts'][0]['seed']} " in record["standouts"][0]["command"]
    page = (tmp_path / "some" / "report.html").read_text(encoding="utf-8")
    assert "3 seeds (3,5:6)." in page
    assert stored_plan(tmp_path / "some").seeds == (3, 5, 6)
    record, more = flown("some", "6")
    assert (record["flights"], record["flown"]) == (6, 3)
    record, alone = flown("alone", "3:3")
    by_seed = [[{**row, "index": ""} for row in found if row["seed"] == "3"] for found in (rows, more, alone)]
    assert by_seed[0] == by_seed[1] == by_seed[2]


def test_the_table_alone_is_written_where_that_is_asked_for(short: str, tmp_path: Path) -> None:
    words = ["sweep", short, "--jobs", "1", "--out", str(tmp_path), "--table-only", "--quiet"]
    result = CliRunner().invoke(gcs, words, prog_name="gcs")
    assert (result.exit_code, result.stdout) == (0, f"table: {tmp_path / 'flights.parquet'}\n")
    assert {path.name for path in tmp_path.iterdir() if path.suffix} == {"flights.parquet", "plan.json"}


def test_a_table_that_is_not_of_a_sweep_is_left_alone(short: str, tmp_path: Path) -> None:
    table = tmp_path / "flights.parquet"
    table.write_bytes(b"mine")
    told = refused_sweep(short, tmp_path)
    assert "holds a flights.parquet that is not of a sweep; name another folder by --out" in told
    assert [path.name for path in tmp_path.iterdir()] == [table.name] and table.read_bytes() == b"mine"


@pytest.mark.parametrize("damage", ["truncated", "in a column", "of another program"])
def test_a_damaged_table_is_told_in_one_line(
    whole: tuple[SweepPlan, Path, run.SweepResult], tmp_path: Path, damage: str
) -> None:
    plan, complete, _ = whole
    shutil.copytree(complete, tmp_path, dirs_exist_ok=True)
    table = tmp_path / "flights.parquet"
    stored = table.read_bytes()
    if damage == "truncated":
        table.write_bytes(stored[:-7])
    elif damage == "in a column":
        table.write_bytes(stored[:4] + bytes(200) + stored[204:])
    else:
        pq.write_table(pq.read_table(table).replace_schema_metadata(None), table)
    says = "not the flights of a sweep" if damage == "of another program" else "damaged, or no Parquet file"
    with pytest.raises(InputError, match=f"^{table}: {says}; .*name another folder by --out$"):
        swept(plan, tmp_path)


def test_a_disk_that_is_full_before_or_after_the_flights_is_told_with_the_folder(
    short: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ["sweep", short, "--law", "thesis", "--jobs", "1", "--out", str(tmp_path / "out"), "--quiet"]

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "wrapped by a library")

    def told(where: str) -> str:
        with monkeypatch.context() as patch:
            patch.setattr(where, full)
            result = CliRunner().invoke(gcs, words, prog_name="gcs")
        assert (result.exit_code, result.stderr.count("\n")) == (1, 1), result.output
        return result.stderr.removeprefix(f"gcs: {tmp_path / 'out'}: ")

    before = "No space left on device; free some space, or name another folder by --out\n"
    assert told("gcs.sweep.run.store_plan") == before
    after = "no space left on device; its flights are kept, and the same command continues\n"
    assert told("gcs.workflows.sweep.write_report") == after
    result = CliRunner().invoke(gcs, words, prog_name="gcs")
    assert result.exit_code == 0 and (tmp_path / "out" / "report.html").is_file()


def refused_sweep(short: str, directory: Path) -> str:
    """The line with which a sweep into this folder is refused."""
    words = ["sweep", short, "--jobs", "1", "--out", str(directory), "--quiet"]
    result = CliRunner().invoke(gcs, words, prog_name="gcs")
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1), result.output
    return result.stderr


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (
            ["--vary", "SIM_WIND=1,2"],
            "--vary SIM_WIND: no such parameter; did you mean SIM_WIND_",
        ),
        (["--set", "MIS_SPED=1"], "--set MIS_SPED: no such parameter; did you mean MIS_SPEED? docs/"),
        (["--vary", "FOO=1,2"], "--vary FOO: no such parameter; names begin with one of BAT_, COM_, "),
        (["--vary", "SIM_WIND_E=0:999:3"], "SIM_WIND_E"),
        (["--jobs", "2", "--scheduler", "tcp://nowhere:1"], "--jobs"),
        (["--sample", "5"], "--vary"),
    ],
)
def test_wrong_usage_is_one_line_and_exit_code_2(short: str, arguments: list[str], says: str) -> None:
    result = CliRunner().invoke(gcs, ["sweep", short, *arguments], prog_name="gcs")
    assert result.exit_code == 2
    assert says in result.stderr and result.stderr.count("\n") == 1


def test_a_cluster_that_does_not_answer_changes_nothing(
    short: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def silent(address: str) -> Iterator[Any]:
        raise GcsError(f"--scheduler {address}: no Dask scheduler answers: timed out")
        yield

    monkeypatch.setattr("gcs.workflows.sweep.dask_cluster", silent)
    flown = tmp_path / "flown"
    flown.mkdir()
    (flown / "plan.json").write_text("{}", encoding="utf-8")
    for out, fresh in ((tmp_path / "new", []), (flown, ["--fresh"])):
        words = ["sweep", short, "--scheduler", "tcp://nowhere:1", "--out", str(out), *fresh]
        result = CliRunner().invoke(gcs, words, prog_name="gcs")
        assert (result.exit_code, result.stdout) == (1, "")
        assert "tcp://nowhere:1: no Dask scheduler answers" in result.stderr
    assert [path.name for path in sorted(tmp_path.rglob("*"))] == ["flown", "plan.json"]


def test_a_dask_cluster_flies_the_same(
    whole: tuple[SweepPlan, Path, run.SweepResult], tmp_path: Path
) -> None:
    distributed = pytest.importorskip("distributed")
    plan, complete, _ = whole

    @contextmanager
    def cluster() -> Iterator[Any]:
        with (
            distributed.LocalCluster(
                n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
            ) as local,
            pool.dask_cluster(local.scheduler_address) as workers,
        ):
            yield workers

    done = run.sweep(plan, tmp_path, "gcs sweep", cluster(), lambda: False, quiet=True, fresh=False)
    assert done.is_complete and done.flown == 6
    assert without_clock(tmp_path) == without_clock(complete)


@pytest.mark.processes
def test_flights_that_stand_out_are_the_same_when_they_are_flown_again(short: str, tmp_path: Path) -> None:
    arguments = [
        "sweep",
        short,
        "--vary",
        "SIM_NOISE_SCALE=0.5,3.1415",
        "--seeds",
        "2",
        "--set",
        "SIM_WIND_E=0.7",
    ]
    result = CliRunner().invoke(
        gcs, [*arguments, "--reports", "--out", str(tmp_path), "--json"], prog_name="gcs"
    )
    assert result.exit_code == 0, result.output
    rows = {row["index"]: row for row in pq.read_table(tmp_path / "flights.parquet").to_pylist()}
    found = json.loads(result.stdout)["standouts"]
    assert [one["kind"] for one in found] == ["worst", "median"]
    for one in found:
        record = json.loads((Path(one["report"]).parent / "summary.json").read_text())
        assert record["seed"] == one["seed"]
        # the sweep evaluates every tick, the report at 125 samples a second
        assert record["load_error_max_m"] == pytest.approx(rows[one["index"]]["load_error_max_m"], rel=5e-3)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert 'href="flights/plumbline-worst/report.html"' in page


@pytest.mark.parametrize("quiet", [False, True])
def test_a_sweep_with_a_part_that_is_not_compiled_says_that_it_compiles(
    short: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, quiet: bool
) -> None:
    made: list[str] = []
    command = ("-n", "1", "-r", "1", "pass")  # of the standard library
    cold = Part("the sweep's flight", "timeit", command, Path(__file__), "cold", 8.0)

    def prepare(plan: object, files: object, warm: Callable[[list[Part]], None], quiet: bool) -> None:
        warm([cold])
        raise PlanError("not flown")

    monkeypatch.setattr(Part, "ready", property(lambda part: part.mark in made))
    monkeypatch.setattr(Part, "mark_done", lambda part: made.append(part.mark))
    monkeypatch.setattr(run, "prepare", prepare)
    words = ["sweep", short, "--law", "thesis", "--seeds", "1", "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(gcs, [*words, *(["--quiet"] if quiet else [])], prog_name="gcs")
    *said, last = result.stderr.splitlines()
    assert (made, last) == (["cold"], "gcs: not flown")
    assert bool(said) is not quiet
    if said:
        assert said[0].startswith("gcs: compiling the flight software, once: the sweep's flight, about ")


@pytest.mark.parametrize(
    ("reason", "cause"),
    [
        ("", ""),
        (
            "Flight given up: tilt 120.3 deg exceeds FS_TILT_DEG 120; Rotor 2 failed; Rotor 3 failed",
            "Flight given up: tilt # deg exceeds FS_TILT_DEG #; Rotor # failed",
        ),
        (
            "EKF2 lost the load; at -1.5e-3 m, item 7 (items[2] of the mission)",
            "EKF2 lost the load; at # m, item # (items[#] of the mission)",
        ),
    ],
)
def test_flights_that_end_alike_have_one_cause(reason: str, cause: str) -> None:
    assert cause_of(reason) == cause
