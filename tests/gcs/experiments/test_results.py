"""From telemetry to records, tables, figures and the page."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from gcs.analysis.definitions import METRICS
from gcs.cli import gcs
from gcs.errors import EXIT_USAGE, InputError
from gcs.experiments import thesis
from gcs.experiments.figures.canvas import Scene
from gcs.experiments.figures.catalogue import FIGURES, DrawnFigure, draw_figures, figures_of
from gcs.experiments.page import render_page
from gcs.experiments.plan import CASES, LAWS, VEHICLES, Experiment, experiments, printed_results
from gcs.experiments.results import ERROR_FUNCTIONS, experiment_record, write_results
from gcs.experiments.table import (
    better,
    comparison_table,
    decay_table,
    error_table,
    markdown,
    step_table,
    tables,
)
from tests.doubles import recorded_flights
from tests.gcs.experiments import tolerances

NGC = Experiment("case-a", "thesis", "thesis")
LQR = Experiment("case-a", "lqr", "thesis")


@pytest.fixture(scope="module")
def scene(step_flight):
    return Scene("case-a", "thesis", step_flight(NGC), step_flight(LQR, runs_away=True))


@pytest.fixture(scope="module")
def records(scene):
    return [experiment_record(scene.ngc, "flights/a"), experiment_record(scene.lqr, "flights/b")]


@pytest.fixture(scope="module")
def drawn(scene, tmp_path_factory):
    """(directory, figures) of one step, one of whose flights is lost."""
    directory = tmp_path_factory.mktemp("figures")
    found = []
    draw_figures(scene, directory, found.append)
    return directory, found


def test_a_flight_is_cut_where_the_signals_begin_and_the_reference_rests(scene):
    flown = scene.ngc
    assert flown.start_s == pytest.approx(recorded_flights.BEFORE_S, abs=tolerances.TICK_S * 1.1)
    assert flown.rest_s - flown.start_s == pytest.approx(0.78, abs=2.0 * tolerances.TICK_S)
    assert not flown.lost


def test_a_flight_that_is_lost_ends_where_it_is(scene):
    assert scene.lqr.lost
    assert scene.lqr.duration_s < scene.ngc.duration_s
    s = scene.lqr.samples
    error = np.linalg.norm(s.error_m[scene.lqr.signal_window(s.time_s)], axis=1)
    assert error[-1] > 2.0 and error[:-1].max() <= 2.0


def test_a_record_has_case_law_vehicle_the_flight_record_and_the_printed_values(records):
    for r in records:
        assert list(r)[:2] == ["case", "law"]
        assert METRICS.keys() < set(r)
        assert {"vehicle", "report_dir", "lost_after_s", "error_functions", "printed", "difference"} < set(r)
        assert set(r["error_functions"]) == set(ERROR_FUNCTIONS)
        for decay in r["error_functions"].values():
            assert set(decay) == {"unit", "greatest", "final", "decays", "rate_1_s", "scale"}
        assert r["difference"].keys() == r["printed"].keys()
    ngc = records[0]
    assert ngc["printed"] == {"rise_time_90_s": 0.61, "overshoot_pct": 15.0, "settling_time_5pct_s": 1.26}
    assert ngc["difference"]["rise_time_90_s"] == pytest.approx(ngc["rise_time_90_s"] - 0.61)
    assert ngc["error_functions"]["e_x"]["decays"] is True
    assert ngc["error_functions"]["e_x"]["rate_1_s"] == pytest.approx(1.5, rel=0.1)
    assert records[1]["error_functions"]["e_x"]["decays"] is False


def test_results_are_json_without_nan(records, tmp_path):
    write_results(tmp_path / "results.json", records)
    text = (tmp_path / "results.json").read_text()
    assert json.loads(text) == records
    assert "NaN" not in text and "Infinity" not in text


def test_the_thesis_prints_what_it_prints_for_both_vehicles():
    for vehicle in VEHICLES:
        assert printed_results(Experiment("case-b", "lqr", vehicle)) == {"load_error_max_m": 1.1}
    assert printed_results(Experiment("case-c", "thesis", "thesis")) == {}


def test_tables_show_the_printed_value_and_the_difference(records):
    row = step_table(records).rows[0]
    rise = records[0]["rise_time_90_s"]
    assert row[:3] == ("Case A", "idealised", "NGC")
    assert row[3] == f"{rise:.2f} (0.61; {rise - 0.61:+.2f})"
    assert error_table(records).rows[1][2:4] == ("LQR", "completed")
    assert decay_table(records).rows[0][5].startswith("→ 0, 1.")
    assert decay_table(records).rows[1][5].startswith("no, ")
    for table in tables(records):
        assert all(len(row) == len(table.header) for row in table.rows)


def test_less_is_better_and_a_lost_flight_is_worst(records):
    ngc, lqr = records
    assert better(ngc, lqr, "overshoot_pct") == "NGC"
    assert better({**ngc, "outcome": "diverged"}, lqr, "overshoot_pct") == "LQR"
    assert better(ngc, ngc, "overshoot_pct") == "–"
    lost = comparison_table([ngc, {**lqr, "outcome": "diverged"}])
    assert [row[4] for row in lost.rows] == ["diverged"] * 3


def test_every_figure_family_is_there_for_every_case_and_vehicle():
    numbers = [figure.number for figure in FIGURES]
    expected = [f"4-{n}" for n in (*range(1, 5), *range(7, 26))] + [f"A-{n}" for n in range(1, 6)]
    assert sorted(numbers) == sorted(expected)
    files = [f.file(v) for v in VEHICLES for c in CASES for f in figures_of(c, v)]
    assert len(set(files)) == len(files) == 50
    assert "fig-4-07-tracking-case-a.png" in files
    assert "fig-a-5-inputs-case-c-bebop.png" in files


def test_every_figure_of_a_step_is_drawn_also_when_one_flight_is_lost(drawn):
    directory, found = drawn
    assert [d.figure.number for d in found] == ["4-1", "4-7", "4-8", "4-9", "4-10", "4-11", "4-12", "A-2"]
    for one in found:
        assert (directory / one.file).read_bytes().startswith(b"\x89PNG")


def test_the_page_holds_every_table_and_figure_and_nothing_from_elsewhere(records):
    drawn = [DrawnFigure(f, v, f.file(v)) for v in VEHICLES for c in CASES for f in figures_of(c, v)]
    page = render_page(records, drawn, "figures", "1.0", "abc")
    assert all(f'src="figures/{d.file}"' in page for d in drawn)
    assert all(table.title in page for table in tables(records))
    assert "http" not in page.replace("http-equiv", "")


@pytest.mark.parametrize("text", ["", "no markers", f"{thesis.BEGIN} only"])
def test_a_page_without_markers_is_refused(tmp_path, records, text):
    page = tmp_path / "page.md"
    page.write_text(text)
    with pytest.raises(InputError, match="must hold the lines"):
        thesis.write_docs(page, tmp_path, records)
    assert page.read_text() == text


def test_tables_and_key_figures_go_into_the_page(tmp_path, records, drawn):
    figures = tmp_path / "figures"
    figures.mkdir()
    some = (drawn[0] / "fig-4-07-tracking-case-a.png").read_bytes()
    for file in thesis.KEY_FIGURES:
        (figures / file).write_bytes(some)
    page = tmp_path / "docs" / "page.md"
    page.parent.mkdir()
    page.write_text(f"before\n{thesis.BEGIN}\nold\n{thesis.END}\nafter\n")
    thesis.write_docs(page, tmp_path, records)
    text = page.read_text()
    assert text.startswith("before\n") and text.endswith("after\n")
    assert markdown(records) in text and "old" not in text
    for file in thesis.KEY_FIGURES:
        assert (page.parent / "images" / "thesis" / file).stat().st_size < 150_000


def test_reading_order_is_case_vehicle_law():
    from gcs.experiments.plan import in_reading_order

    ordered = sorted(experiments(), key=in_reading_order)
    assert ordered[:3] == [NGC, LQR, Experiment("case-a", "thesis", "bebop")]
    assert {e.law for e in ordered} == set(LAWS)


def test_a_page_that_cannot_take_the_tables_is_told_before_anything_is_flown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gcs.workflows.experiments.fly_missing", lambda *_: pytest.fail("flown"))
    bare, out = tmp_path / "page.md", tmp_path / "out"
    bare.write_text("no markers", encoding="utf-8")
    for page, told in ((tmp_path / "none.md", "No such file or directory"), (bare, "must hold the lines")):
        words = ["experiments", "thesis", "--docs", str(page), "--out", str(out)]
        result = CliRunner().invoke(gcs, words, prog_name="gcs")
        assert result.exit_code == EXIT_USAGE
        assert result.stderr.startswith(f"gcs: --docs {page}: {told}")
    assert not out.exists()
