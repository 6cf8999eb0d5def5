"""Comparison of flights: what differed, which is best, and the page."""

from __future__ import annotations

import io
import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner
from rich.console import Console

from autopilot.wire.items import encode_steps
from gcs.analysis.record import FlightMeta
from gcs.cli import gcs
from gcs.report.compare import (
    STEPS,
    Run,
    common_start,
    comparison,
    comparison_table,
    differences,
    figures,
    fits_in_columns,
    labels,
    load_run,
)
from gcs.report.overview import overview
from missions.model import Land, Takeoff, Waypoint
from tests.doubles import recorded_flights as flights
from tests.doubles.browser import Browser

HOSTILE = "<img src=x onerror=window.hostile=1>"


def flown(folder: Path, name: str, seed: int = 1, **meta: object) -> Path:
    """The directory of a short Case B."""
    directory = folder / name
    directory.mkdir()
    flights.case_b(seed, duration_s=6.0).write(directory / "flight.tlog")
    told = {"mission": "case-b", "law": "plumbline", "outcome": "completed", "command": "gcs fly case-b"}
    about = FlightMeta(**{**told, "seed": seed, **meta})
    (directory / "meta.json").write_text(json.dumps(about.to_json()))
    return directory


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("runs")
    return [
        flown(folder, "one"),
        flown(folder, "two", seed=2, law="thesis", settings={"SIM_WIND_E": 2.0}),
        flown(folder, HOSTILE.replace("/", ""), seed=3),
    ]


def loaded(directory: Path) -> Run:
    meta = FlightMeta.from_json(json.loads((directory / "meta.json").read_text()))
    return load_run(directory.name, directory / "flight.tlog", meta)


def called(*arguments: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(gcs, ["compare", *map(str, arguments)])
    return result.exit_code, result.stdout, result.stderr


def test_what_differed_is_told_and_nothing_else(runs: list[Path]) -> None:
    found = {one.name: one.values for one in differences([loaded(run) for run in runs[:2]])}
    assert found == {"law": ("plumbline", "thesis"), "seed": ("1", "2"), "SIM_WIND_E": ("0", "2")}


def test_a_character_that_the_output_cannot_have_is_replaced(runs: list[Path]) -> None:
    result = CliRunner(charset="latin-1").invoke(gcs, ["compare", *map(str, runs[:2])])
    assert result.exit_code == 0, result.exception
    assert "?" in result.stdout


def test_what_was_not_changed_is_the_number_that_was_told_or_that_of_the_default(runs: list[Path]) -> None:
    base = loaded(runs[0])
    settings = {"SIM_WIND_E": 2.0, "SIM_LOAD_MASS": 0.25, "OWN_GAIN": 3.0}
    changed = replace(base, meta=replace(base.meta, settings=settings))
    told = replace(base, telemetry=replace(base.telemetry, parameters={"SIM_WIND_E": 0.0, "OWN_GAIN": 1.5}))
    found = {one.name: one.values for one in differences([base, changed, told])}
    assert found["SIM_WIND_E"] == ("0", "2", "0")
    assert found["SIM_LOAD_MASS"] == ("0.1", "0.25", "0.1")
    assert found["OWN_GAIN"] == ("default", "3", "1.5")
    without = replace(base, telemetry=replace(base.telemetry, parameters={"SIM_WIND_E": 0.0}))
    found = {one.name: one.values for one in differences([changed, without])}
    assert found["OWN_GAIN"] == ("3", "–")  # it reported its parameters, without this one
    captured = replace(base, meta=replace(base.meta, command=""))
    assert differences([captured, changed])[0].values == ("–", "3")


def test_own_code_of_one_name_is_told_apart_by_its_file(runs: list[Path]) -> None:
    base = loaded(runs[0])
    record = {**base.record, "law": "mine"}
    flown = [
        replace(base, record=record, meta=replace(base.meta, sources=sources))
        for sources in ({"law": "mine.py 1f0a3b9c"}, {"law": "mine.py 77d2e401"})
    ]
    assert {one.name: one.values for one in differences(flown)} == {
        "law file": ("mine.py 1f0a3b9c", "mine.py 77d2e401")
    }
    assert labels(flown) == ["mine.py 1f0a3b9c", "mine.py 77d2e401"]
    assert not differences([flown[0], flown[0]])


def test_flights_are_called_by_what_differs(runs: list[Path]) -> None:
    base = replace(loaded(runs[0]), name="folder-1")

    def other(name: str, **keys: object) -> Run:
        record = {key: value for key, value in keys.items() if key != "settings"}
        meta = replace(base.meta, settings=keys.get("settings", {}))  # type: ignore[arg-type]
        return replace(base, name=name, meta=meta, record={**base.record, **record})

    slow = other("folder-3", settings={"SIM_ACT_DELAY_MS": 72.0})
    told = labels([base, other("folder-2", law="laws/mine.py:Mine"), slow])
    assert told == ["plumbline", "mine.py:Mine", "plumbline, SIM_ACT_DELAY_MS=72"]
    assert labels([base, slow]) == ["default settings", "SIM_ACT_DELAY_MS=72"]
    assert labels([base, replace(base, name="folder-2")]) == ["folder-1", "folder-2"]
    twice = labels([base, slow, replace(slow, name="folder-2")])
    assert twice[1:] == ["SIM_ACT_DELAY_MS=72, folder-3", "SIM_ACT_DELAY_MS=72, folder-2"]
    many = other("x", seed=7, law="thesis", settings={f"SIM_WIND_{axis}": 1.0 for axis in "NED"})
    assert labels([base, many])[1] == "thesis, seed 7, SIM_WIND_D=1 and 2 more"


def test_what_tells_flights_apart_comes_first_in_their_names(runs: list[Path]) -> None:
    base = loaded(runs[0])

    def other(mission: str, law: str, sensors: str, wind_m_s: float) -> Run:
        meta = replace(base.meta, settings={"SIM_WIND_E": wind_m_s})
        record = {**base.record, "mission": mission, "law": law, "sensors": sensors}
        return replace(base, name=f"{law}-{wind_m_s:g}", meta=meta, record=record)

    first, second = other("tour.toml", "plumbline", "gps", 3.0), other("tour.toml", "plumbline", "gps", 12.0)
    assert labels([first, second, other("case-b", "lqr", "lab", 3.0)]) == [
        "tour.toml, SIM_WIND_E=3, plumbline and 1 more",
        "tour.toml, SIM_WIND_E=12, plumbline and 1 more",
        "case-b, SIM_WIND_E=3, lqr and 1 more",
    ]
    assert labels([first, second]) == ["SIM_WIND_E=3", "SIM_WIND_E=12"]


def test_no_flight_of_several_missions_is_the_best(runs: list[Path]) -> None:
    one, other = [loaded(run) for run in runs[:2]]
    renamed = replace(other, record={**other.record, "mission": "folder/case-b.toml"})
    assert comparison([one, renamed])["best"] == comparison([one, other])["best"] != {}
    items = encode_steps([Takeoff(5.0), Waypoint(0.0, 0.0, 6.0), Land()], one.telemetry.home)
    elsewhere = replace(renamed, telemetry=replace(other.telemetry, mission=items))
    assert comparison([one, elsewhere])["best"] == {}


def test_the_best_is_the_best(runs: list[Path]) -> None:
    found = [loaded(run) for run in runs]
    values = [run.record["load_error_rms_m"] for run in found]
    best = comparison(found)["best"]["load_error_rms_m"]
    assert values.index(min(values)) in best
    assert len(best) < len(runs)
    assert "samples" not in comparison(found)["best"]  # neither less nor more is better


def test_a_flight_that_was_lost_is_no_better_than_one_that_was_completed(runs: list[Path]) -> None:
    found = [loaded(run) for run in runs[:2]]
    values = [run.record["load_error_rms_m"] for run in found]
    found[values.index(min(values))].record["outcome"] = "diverged"
    assert "load_error_rms_m" not in comparison(found)["best"]


def test_what_is_as_good_as_the_best_has_its_star_too(runs: list[Path]) -> None:
    base = loaded(runs[0])

    def best(*values: float | None) -> object:
        found = [replace(base, record={**base.record, "load_error_rms_m": value}) for value in values]
        return comparison(found)["best"].get("load_error_rms_m")

    assert best(0.1, 0.1009, 0.1011) == [0, 1]
    assert best(0.1, 0.1009) is None  # too small a difference
    assert best(0.0001, 0.00012) == [0]
    assert best(0.0, 1e-13) == [0]
    assert best(None, 0.2, 0.1) == [2]


def test_lengths_beside_each_other_are_in_one_unit(runs: list[Path]) -> None:
    base = loaded(runs[0])
    found = [
        replace(base, record={**base.record, "load_error_max_m": value}) for value in (0.0061, 12.3, None)
    ]
    rows = {row.metric.name: row.values for _, rows in figures(found) for row in rows}
    assert rows["load_error_max_m"] == ("0.00610 m", "12.300 m", "–")
    shown = [value for values in rows.values() for value in values]
    assert any(value.endswith(" m") for value in rows["load_error_rms_m"])
    assert not any(value.endswith(" mm") for value in shown)
    in_millimetres = [value for _, rows in figures([base, base]) for row in rows for value in row.values]
    assert not any(value.endswith(" m") for value in in_millimetres)


def test_what_was_set_is_told_before_what_follows_from_it(runs: list[Path]) -> None:
    base = loaded(runs[0])
    told = replace(base.telemetry, parameters={"CTL_LAW": 1.0, "VEH_ACT_DELAY": 0.5})
    set_ = replace(base, telemetry=told, meta=replace(base.meta, settings={"SIM_ACT_DELAY_MS": 72.0}))
    names = [one.name for one in differences([base, set_])]
    assert names == ["SIM_ACT_DELAY_MS", "CTL_LAW", "VEH_ACT_DELAY"]


def test_the_number_of_a_law_is_not_told_beside_its_name(runs: list[Path]) -> None:
    found = [loaded(run) for run in runs[:2]]
    found[1] = replace(found[1], telemetry=replace(found[1].telemetry, parameters={"CTL_LAW": 1.0}))
    assert "CTL_LAW" not in [one.name for one in differences(found)]


def test_of_the_steps_only_those_are_told_that_differ(runs: list[Path]) -> None:
    base = loaded(runs[0])

    def mission(*altitudes: float) -> Run:
        steps = [Takeoff(altitudes[0]), *(Waypoint(0.0, 0.0, one) for one in altitudes[1:]), Land()]
        items = encode_steps(steps, base.telemetry.home)
        return replace(base, telemetry=replace(base.telemetry, mission=items))

    told = {
        one.name: one.values
        for one in differences([mission(5.0, 6.0, 7.0, 8.0), mission(5.0, 6.0, 9.0, 8.0)])
    }
    way = "3. Carry the load to 0 m east, 0 m north, {} m up"
    assert told == {STEPS: (way.format(7), way.format(9))}
    more = differences([mission(5.0, 6.0, 7.0), mission(5.0, 7.0)])[0]
    assert more.values == ("2. Carry the load to 0 m east, 0 m north, 6 m up", "–")


def test_flights_meet_where_all_have_begun(runs: list[Path], tmp_path: Path) -> None:
    grounded = flights.case_b(duration_s=2.0)
    grounded.phase[grounded.mission] = 2  # never beyond TAUTEN
    path = grounded.write(tmp_path / "grounded.tlog")
    one, other = loaded(runs[0]), load_run("grounded", path, FlightMeta())
    assert common_start([one, one]) == ("mission", pytest.approx([flights.BEFORE_S] * 2))
    assert common_start([one, other]) == ("flight", pytest.approx([0.504] * 2))


def test_the_table_has_a_star_at_the_best(runs: list[Path]) -> None:
    found = [loaded(run) for run in runs[:2]]
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(comparison_table(found))
    line = next(line for line in console.export_text().splitlines() if line.split()[:1] == ["RMS"])
    cells = line.split("mm")
    best = comparison(found)["best"]["load_error_rms_m"]
    assert [i for i in (0, 1) if "*" in cells[i]] == best


def test_headings_of_the_table_are_whole_in_a_narrow_terminal(runs: list[Path]) -> None:
    found = [replace(loaded(run), name=f"case-b-20260301-10000{i}") for i, run in enumerate(runs)]
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(comparison_table(found))
    lines = [line.strip() for line in console.export_text().splitlines()]
    titles = {group.title for group, _ in figures(found)}
    assert titles <= set(lines)
    heading = [line.split() for line in lines[1:4]]
    assert heading == [["case-b-"] * 3, ["20260301-"] * 3, ["100000", "100001", "100002"]]
    labels = {row.metric.label for _, rows in figures(found) for row in rows}
    assert all(any(line.startswith(label) for line in lines) for label in labels)


@pytest.mark.parametrize("width", [60, 80, 100, 120])
def test_long_names_are_broken_between_their_parts(runs: list[Path], width: int) -> None:
    folders = ("/tmp/measurements/Größe", "/tmp/measurements/of-another-day", "/tmp/measurements/third")
    found = [replace(loaded(run), name=f"{folder}/a") for run, folder in zip(runs, folders, strict=True)]
    in_columns = fits_in_columns(found, width)
    assert in_columns == (width >= 100)
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(comparison_table(found) if in_columns else overview(found, width)[0])
    said = console.export_text()
    for part in ("measurements/", "Größe/", "another-", "third/", "completed"):
        assert part in said
    assert "…" not in said and max(map(len, said.splitlines())) <= width


@pytest.mark.parametrize("width", [80, 120])
def test_a_dozen_flights_are_a_row_each_in_a_narrow_terminal(runs: list[Path], width: int) -> None:
    three = [loaded(run) for run in runs]
    found = [replace(three[i % 3], name=f"case-b-20260301-1000{i:02}") for i in range(12)]
    assert not fits_in_columns(found, 80) and fits_in_columns(found[:3], 80)
    table, missed = overview(found, width)
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(table)
    lines = [line.strip() for line in console.export_text().splitlines() if line.strip()]
    heading, rows = lines[0].split(), lines[2:]
    assert heading[:6] == ["flight", "outcome", "error", "RMS", "error", "max"]
    assert {"law", "seed"} <= set(heading) and missed == [
        name for name in ("law", "seed", "SIM_WIND_E") if name not in heading
    ]
    assert [row.split()[0] for row in rows] == [run.name for run in found]
    assert all(row.split()[1] == "completed" for row in rows)
    best = comparison(found)["best"]["load_error_rms_m"]
    assert [i for i, row in enumerate(rows) if row.split()[2] == "*"] == best


@pytest.mark.parametrize("width", [60, 80, 100])
def test_no_column_is_cut_where_the_names_of_the_flights_are_short(runs: list[Path], width: int) -> None:
    found = [replace(loaded(run), name=name) for run, name in zip(runs, ("y1", "y2", "y3"), strict=True)]
    table, missed = overview(found, width)
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(table)
    said = console.export_text()
    assert "…" not in said
    shown = said.split()
    assert {"law", "seed", "SIM_WIND_E"} == {
        name for name in shown if name in ("law", "seed", "SIM_WIND_E")
    } | set(missed)


@pytest.mark.parametrize("width", range(50, 90, 8))
def test_what_was_set_has_a_column_before_what_follows_from_it(runs: list[Path], width: int) -> None:
    base = replace(loaded(runs[0]), name="y1")
    told = replace(base.telemetry, parameters={"VEH_LAG": 0.5})
    meta = replace(base.meta, settings={"SIM_ACT_DELAY_MS": 72.0})
    table, missed = overview([base, replace(base, name="y2", telemetry=told, meta=meta)], width)
    titles = [str(column.header) for column in table.columns]
    assert ("SIM_ACT_\nDELAY_MS" in titles) == ("SIM_ACT_DELAY_MS" not in missed)
    assert not ("VEH_LAG" in titles and "SIM_ACT_DELAY_MS" in missed)


def test_the_pages_of_many_flights_have_names_of_their_own(
    runs: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    pages = []
    for last in "ab":
        folders = [tmp_path / f"case-b-20260301-1000{i}{last if i == 9 else 0}" for i in range(10)]
        for folder in folders:
            shutil.copytree(runs[0], folder, dirs_exist_ok=True)
        code, out, _ = called(*folders, "--quiet")
        assert code == 0
        pages.append(out.split()[-1])
    assert len(set(pages)) == 2 and all((tmp_path / page).is_file() for page in pages)
    assert all("/case-b-20260301-100000-and-9-more-" in page for page in pages)


@pytest.mark.parametrize(
    ("named", "written"),
    [("page", "page.html"), ("page-0.1", "page-0.1.html"), ("page.HTML", "page.HTML"), ("a.htm", "a.htm")],
)
def test_a_page_has_the_ending_by_which_a_browser_shows_it(
    runs: list[Path], tmp_path: Path, named: str, written: str
) -> None:
    code, out, _ = called(*runs[:2], "--quiet", "--out", tmp_path / named)
    assert (code, out) == (0, f"comparison: {tmp_path / written}\n")
    assert [path.name for path in tmp_path.iterdir()] == [written]


@pytest.mark.parametrize("width", [390, 1100])
def test_names_and_buttons_do_not_lie_over_each_other(
    browser: Browser, runs: list[Path], tmp_path: Path, width: int
) -> None:
    folders = [tmp_path / f"case-b-20260301-10000{i}" for i in range(3)]
    for run, folder in zip(runs, folders, strict=True):
        shutil.copytree(run, folder)
    meta = json.loads((folders[2] / "meta.json").read_text())
    meta["settings"] = {"SIM_ACT_DELAY_MS": 72.0, "SIM_NOISE_SCALE": 2.0, "SIM_SENS_LAT_MS": 12.5}
    (folders[2] / "meta.json").write_text(json.dumps(meta))  # makes the name long
    page = tmp_path / "page.html"
    assert called(*folders, "--quiet", "--out", page)[0] == 0
    browser.open(page.as_uri(), width=width)
    browser.wait("document.documentElement.dataset.ready === '1'")
    boxes = [
        browser.run(
            f"const b = document.querySelector('{one}').getBoundingClientRect();"
            "return [b.left, b.right, b.top, b.bottom]"
        )
        for one in (".readings", ".cameras")
    ]
    (left, right, top, bottom), (other_left, other_right, other_top, other_bottom) = boxes
    assert right <= other_left or other_right <= left or bottom <= other_top or other_bottom <= top
    assert all(box[0] >= 0 and box[1] <= width for box in boxes)
    heights = browser.run(
        "const names = [...document.querySelectorAll('.readings dt')];"
        "return names.map((one) => one.getBoundingClientRect().height)"
    )
    assert max(heights[1:]) < 1.5 * min(heights[1:]), "a name wraps"


@pytest.mark.parametrize("width", [390, 1280])
def test_tables_of_many_flights_scroll_under_their_first_column(
    browser: Browser, runs: list[Path], tmp_path: Path, width: int
) -> None:
    page = tmp_path / "page.html"
    assert called(*runs, "--quiet", "--out", page)[0] == 0
    browser.open(page.as_uri(), width=width)
    browser.wait("document.documentElement.dataset.ready === '1'")
    assert browser.run("return document.documentElement.scrollWidth") <= width
    cards = browser.run(
        """return [...document.querySelectorAll(".wide")].map((card) => {
            card.scrollLeft = 10000;
            const first = card.querySelector("tr:not(.group) > td:first-child");
            const { left, right } = first.getBoundingClientRect();
            return [card.scrollLeft, left - card.getBoundingClientRect().left, right - left];
        })"""
    )
    assert len(cards) == 2
    for scrolled, left, column in cards:
        assert left <= 1.5, "the first column stays"
        assert column < 0.5 * width
        assert width == 390 or not scrolled, "there is place for all"


def test_the_command_prints_json_and_makes_the_page(runs: list[Path], tmp_path: Path) -> None:
    code, out, _ = called(*runs[:2], "--json", "--out", tmp_path / "page.html")
    assert code == 0
    found = json.loads(out)
    assert [run["name"] for run in found["runs"]] == ["one", "two"]
    assert found["differences"]["law"] == ["plumbline", "thesis"]
    assert (tmp_path / "page.html").is_file()


@pytest.mark.parametrize(
    ("names", "said", "code"),
    [
        (["one"], "one flight was named; name 2 to 12 that are to be compared", 2),
        (["one", "one"], "is named twice", 2),
        (["one", "nowhere"], "nowhere: no such file", 2),
        (["one", "empty.tlog"], "empty.tlog: holds no telemetry", 2),
    ],
)
def test_what_cannot_be_compared_is_one_clear_line(
    runs: list[Path], names: list[str], said: str, code: int
) -> None:
    folder = runs[0].parent
    (folder / "empty.tlog").write_bytes(b"")
    found, _, err = called(*(folder / name for name in names))
    assert found == code
    assert said in err
    assert err.count("\n") == 1


def test_the_page_shows_all_and_runs_nothing_it_was_given(
    browser: Browser, runs: list[Path], tmp_path: Path
) -> None:
    page = tmp_path / "page.html"
    assert called(*runs, "--quiet", "--out", page)[0] == 0
    browser.open(page.as_uri())
    browser.wait("document.documentElement.dataset.ready === '1'")
    assert browser.run("return replay.stage.scene.crafts.size") == 3
    assert browser.run("return replay.stage.scene.tracks.size") == 3
    names = browser.run("return document.querySelector('.chart-head').textContent")
    assert all(label in names for label in labels([loaded(run) for run in runs]))
    folders = browser.run("return document.querySelector('.runs').textContent")
    assert all(run.name in folders for run in runs)
    assert browser.run("return typeof window.hostile") == "undefined"
    assert browser.run("return document.querySelectorAll('td.best').length") > 3
    browser.listen()
    assert browser.errors == []
    assert [url for url in browser.requests if not url.startswith(("file:", "data:"))] == []
