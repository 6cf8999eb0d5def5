"""The files of a report."""

import base64
import hashlib
import io
import json
import math
import multiprocessing
import os
import re
import signal
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pyarrow
import pytest
from click.testing import CliRunner
from PIL import Image
from pyarrow import parquet
from rich.console import Console

from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.definitions import GROUPS, METRICS
from gcs.analysis.record import FlightMeta, Record, flight_record, jsonable
from gcs.analysis.samples import PHASE_NAMES, samples_of
from gcs.analysis.telemetry import load_telemetry
from gcs.cli import gcs
from gcs.report import plots, style
from gcs.report.build import ReportError, build_report, load_meta
from gcs.report.plots import PICTURES, View
from gcs.report.table import record_table
from gcs.report.track import draw_track, snapshots
from tests.doubles import recorded_flights as flights

META = FlightMeta(
    mission="case-b",
    title="Case <B> & more",
    law="thesis",
    sensors="lab",
    vehicle="bebop",
    seed=7,
    wall_s=2.0,
    command="gcs fly case-b --seed 7 --set SIM_WIND_E=2",
    settings={"SIM_WIND_E": 2.0},
    version="0.1.0",
)
FILES = {"meta.json", "summary.json", "flight.parquet", "report.html", *(p.file for p in PICTURES)}


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """(directory, record, progress) of a short Case B."""
    out = tmp_path_factory.mktemp("report")
    told = []
    tlog = flights.case_b(duration_s=12.0).write(out / "flight.tlog")
    record = build_report(tlog, out, META, lambda *step: told.append(step), picture_formats=["png"])
    return out, record, told


CROSS = np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])


def strict(text):
    """JSON as the standard defines it: no NaN, no Infinity."""

    def refuse(constant):
        raise AssertionError(constant)

    return json.loads(text, parse_constant=refuse)


def test_all_files_are_there(built):
    out, _, _ = built
    assert {path.name for path in out.iterdir()} == FILES | {"flight.tlog"}


def test_the_record_has_every_key_in_order(built):
    out, record, _ = built
    assert list(record) == [*METRICS, "report_dir"]
    assert strict((out / "summary.json").read_text()) == record
    assert record["outcome"] == "completed"
    assert record["report_dir"] == str(out)
    assert record["mission"] == "case-b"
    assert record["seed"] == 7
    assert record["real_time_factor"] == pytest.approx(record["recorded_s"] / 2.0)


def test_progress_counts_up_to_the_end(built):
    _, _, told = built
    done, totals, texts = zip(*told, strict=True)
    assert list(done) == list(range(totals[0] + 1))
    assert set(totals) == {len(PICTURES) + 3}
    assert texts[-1] == "done"


def test_the_same_log_gives_the_same_report_without_what_imports_pandas(built, tmp_path, monkeypatch):
    out, record, _ = built
    for name in ("array", "table"):
        monkeypatch.delattr(pyarrow, name)
    # meta.json beside the log is read when no meta is passed
    again = build_report(out / "flight.tlog", tmp_path, picture_formats=["png"])
    assert again == {**record, "report_dir": str(tmp_path)}
    for name in FILES - {"summary.json", "flight.parquet"}:
        assert (tmp_path / name).read_bytes() == (out / name).read_bytes(), name
    assert parquet.read_table(tmp_path / "flight.parquet").equals(
        parquet.read_table(out / "flight.parquet"), check_metadata=True
    )


@pytest.mark.parametrize("file", [picture.file for picture in PICTURES])
def test_pictures_show_something(built, file):
    out, _, _ = built
    with Image.open(out / file) as image:
        pixels = np.asarray(image.convert("RGB"), dtype=np.float64)
        assert "Software" not in image.info
    height, width, _ = pixels.shape
    assert width >= 1000
    assert height >= 400
    assert pixels.std() > 10.0
    # each quarter shows something, so nothing was drawn outside the picture
    for rows in (slice(0, height // 2), slice(height // 2, None)):
        for columns in (slice(0, width // 2), slice(width // 2, None)):
            assert pixels[rows, columns].std() > 3.0


class Page(HTMLParser):
    """References, policies, texts and unclosed elements of a page; scripts separately."""

    VOID = frozenset(("meta", "img", "br", "link", "input", "hr"))

    def __init__(self):
        super().__init__()
        self.references, self.policies, self.open, self.text, self.scripts = [], [], [], [], []

    def handle_starttag(self, tag, attributes):
        self.references += [v for k, v in attributes if k in ("src", "href", "srcset", "data", "action")]
        assert not any(name.startswith("on") for name, _ in attributes)
        assert tag not in ("link", "iframe", "object")
        if ("http-equiv", "Content-Security-Policy") in attributes:
            self.policies.append(dict(attributes)["content"])
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        (self.scripts if self.open and self.open[-1] == "script" else self.text).append(data)


@pytest.fixture(scope="module")
def page(built):
    parser = Page()
    parser.feed((built[0] / "report.html").read_text())
    return parser


def test_the_page_asks_for_nothing_from_elsewhere(page):
    assert page.open == []
    assert len(page.references) == 1  # the still picture
    assert page.references[0].startswith("data:image/png;base64,")
    assert "url(" not in "".join(page.text)
    assert "@import" not in "".join(page.text)
    (policy,) = page.policies
    assert "default-src 'none'" in policy


def test_no_script_runs_but_those_that_the_policy_names(page):
    (policy,) = page.policies
    allowed = set(re.findall(r"'sha256-([^']+)'", policy))
    ours = {base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in page.scripts[1:]}
    assert ours == allowed  # the first script is data
    assert "unsafe-inline" not in policy.split("script-src")[1]
    assert "unsafe-eval" not in policy


def test_the_page_says_what_matters_and_escapes_what_it_was_given(page):
    text = " ".join(page.text)
    for part in (META.title, META.command, "completed", "SIM_WIND_E"):
        assert part in text
    assert "<" not in page.scripts[0]
    said = [one["text"] for one in json.loads(page.scripts[0])["texts"]]
    assert "Rotor 2 at its limit <b>&amp;" in said


def printed(record: Record) -> str:
    console = Console(width=100, record=True, file=io.StringIO())
    console.print(record_table(record))
    return console.export_text()


def test_figures_say_of_which_part_of_the_flight_they_are(page, built):
    text, table = " ".join(page.text), printed(built[1])
    for group in ("Load position error", "Vehicle and cable", "Rotors"):
        assert re.search(rf"{group}\s+over the mission", text)
        assert re.search(rf"{group} .*\n *over the mission", table)
    assert "given up" not in text


def test_figures_of_a_lost_flight_say_that_they_end_with_the_loss(built, tmp_path):
    out, record, _ = built
    table = printed({**record, "outcome": "diverged"})
    meta = replace(META, outcome="diverged", reason="the load fell")
    lost = build_report(out / "flight.tlog", tmp_path, meta)
    parser = Page()
    parser.feed((tmp_path / "report.html").read_text(encoding="utf-8"))
    text = " ".join(parser.text)
    for group in ("Load position error", "Vehicle and cable", "Rotors"):
        assert re.search(rf"{group} .*\n *until the flight was lost", table)
        assert re.search(rf"{group}\s+until the flight was lost", text)
    for label in ("greatest load error", "RMS load error"):
        assert f"{label} until the loss" in text
    assert lost["load_error_max_m"] == record["load_error_max_m"]


@pytest.mark.parametrize("outcome", ["landed", "lost"])
def test_figures_of_a_flight_that_failed_say_that_they_end_with_the_failure(built, outcome):
    table = printed({**built[1], "outcome": outcome, "failure_s": 12.0, "failure_error_max_m": 0.4})
    for group in ("Load position error", "Vehicle and cable", "Rotors"):
        assert re.search(rf"{group} .*\n *until the failure", table)


def test_groups_in_which_nothing_happened_are_left_out(page, built):
    for text in (" ".join(page.text), printed(built[1])):
        for group, metrics in GROUPS:
            known = [metric for metric in metrics if built[1][metric.name] is not None]
            happened = any(built[1][metric.name] for metric in known)
            assert (f"{group.title}" in text) == happened, group.title
            assert all(metric.label in text for metric in known if happened)


def test_parquet_has_units_phases_and_the_record(built):
    out, record, _ = built
    table = parquet.read_table(out / "flight.parquet")
    columns = set(table.column_names)
    telemetry = load_telemetry(out / "flight.tlog")
    assert table.num_rows == len(telemetry.load_truth.time_s)
    assert {"time_s", "phase", "load_true_x_m", "load_desired_z_m", "rotor_command_4_n", "psi_R"} <= columns
    error = table["load_error_y_m"].to_numpy()
    np.testing.assert_array_equal(
        error, table["load_true_y_m"].to_numpy() - table["load_asked_y_m"].to_numpy()
    )
    inside = table["in_mission"].to_numpy(zero_copy_only=False)
    norm = np.linalg.norm([table[f"load_error_{axis}_m"].to_numpy()[inside] for axis in "xyz"], axis=0)
    assert norm.max() == pytest.approx(record["load_error_max_m"])
    assert set(table["phase"].to_pylist()) >= {"hold", "mission", "lower"}
    about = strict(table.schema.metadata[b"plumbline"])
    assert about["record"]["load_error_max_m"] == record["load_error_max_m"]
    assert about["settings"] == META.settings


def test_the_table_shows_what_is_known(built):
    _, record, _ = built
    text = printed({**record, "mission": "[red]odd[/red]"})
    assert "completed" in text
    assert "Step response" not in text
    assert "[red]odd[/red]" in text
    assert f"{1e3 * record['load_error_max_m']:.1f} mm" in text


# --- logs that are not whole ---------------------------------------------------------------------


@pytest.mark.parametrize("content", [b"", b"no telemetry at all, but a text" * 9])
def test_a_log_without_a_flight_gives_a_report(tmp_path, content):
    (tmp_path / "flight.tlog").write_bytes(content)
    record = build_report(tmp_path / "flight.tlog", tmp_path, picture_formats=["png"])
    assert record["outcome"] == "no telemetry"
    assert record["load_error_max_m"] is None
    assert {path.name for path in tmp_path.iterdir()} == FILES | {"flight.tlog"}
    assert strict((tmp_path / "summary.json").read_text()) == record


def test_a_flight_that_is_lost_gives_a_report(tmp_path):
    flight = flights.case_b(duration_s=6.0)
    lost = np.flatnonzero(flight.mission)[300:]
    for column in (flight.actual, flight.quat, flight.q_cable, flight.tension, flight.force, flight.psi_r):
        column[lost] = np.nan
    flight.actual[lost[0]] = (np.inf, -np.inf, 1e30)
    flight.actual_v[lost] = np.inf
    flight.desired[lost[9]] = np.nan
    flight.phase[lost[5] :] = 9
    flight.tension[lost[0]] = np.inf
    path = flight.write(tmp_path / "flight.tlog")
    path.write_bytes(path.read_bytes()[:-11])  # and the last record is cut off
    told = FlightMeta(outcome="diverged", reason="no finite state")
    record = build_report(path, tmp_path, told, picture_formats=["png"])
    assert record["outcome"] == "diverged"
    assert "end where the flight was given up" in (tmp_path / "report.html").read_text(encoding="utf-8")
    text = (tmp_path / "summary.json").read_text()
    assert strict(text) == record
    assert all(math.isfinite(v) for v in record.values() if isinstance(v, float))
    assert record["load_error_rms_m"] is not None
    assert "no finite state" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize("silent", ["load_setpoint", "load_state", "hil_state_quaternion", "rotor_state"])
def test_a_message_that_never_came_gives_a_report(tmp_path, silent):
    flight = flights.flight(1.0, flights.still)
    flight.drop = lambda i, kind: kind == silent
    record = build_report(flight.write(tmp_path / "flight.tlog"), tmp_path, picture_formats=["png"])
    missing = {
        "load_setpoint": "load_error_max_m",
        "load_state": "load_error_max_m",
        "hil_state_quaternion": "tilt_max_deg",
        "rotor_state": "saturated_fraction",
    }
    assert record[missing[silent]] is None
    assert (tmp_path / "report.html").is_file()


# --- what is beside the log ----------------------------------------------------------------------


def test_meta_goes_to_a_file_and_back(tmp_path):
    path = tmp_path / "meta.json"
    path.write_text(json.dumps({**META.to_json(), "of_a_later_version": 1}))
    assert load_meta(path) == META
    assert load_meta(tmp_path / "none.json") == FlightMeta()


@pytest.mark.parametrize("content", ['{"mission": ', "[1, 2]", '"text"'])
def test_a_broken_meta_file_is_one_clear_line(tmp_path, content):
    path = tmp_path / "meta.json"
    path.write_text(content)
    with pytest.raises(ReportError, match=r"meta\.json: .*must be") as caught:
        load_meta(path)
    assert "\n" not in str(caught.value)


def test_a_log_that_is_not_there_is_one_clear_line(tmp_path):
    with pytest.raises(ReportError, match=r"none\.tlog: no such file"):
        build_report(tmp_path / "none.tlog", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_json_knows_no_nan():
    found = jsonable(
        {"a": math.nan, "b": [math.inf, 1.0], "c": {"d": -math.inf, "e": "x"}, "f": 1, "g": True}
    )
    assert found == {"a": None, "b": [None, 1.0], "c": {"d": None, "e": "x"}, "f": 1, "g": True}


def test_the_manual_names_every_file_key_and_column(built):
    out, record, _ = built
    manual = (Path(__file__).parents[3] / "docs" / "report.md").read_text()
    for name in (*FILES, "flight.tlog", *record):
        assert f"`{name}`" in manual, name
    for name in parquet.read_schema(out / "flight.parquet").names:
        # columns of one family are listed as load_true_*_m
        family = re.sub(r"^(.*)_(x|y|z|[1-4]|w|roll|pitch|yaw|phi|theta)(?=_|$)", r"\1_*", name)
        assert f"`{name}`" in manual or f"`{family}`" in manual, name
    (phases,) = (line for line in manual.splitlines() if line.startswith("| `phase` |"))
    assert set(PHASE_NAMES.values()) <= set(re.findall(r"\w+", phases))


# --- drawing -------------------------------------------------------------------------------------


def test_thinned_lines_keep_every_peak():
    t = np.arange(100_000) * 0.01
    v = np.zeros(100_000)
    v[[3, 50_001, 99_000]] = (5.0, -7.0, 9.0)
    v[70_000:70_100] = np.nan
    thin_t, thin_v = style.thinned(t, v)
    assert len(thin_t) < 5000
    assert (np.diff(thin_t) >= 0.0).all()
    for value, at in ((5.0, 0.03), (-7.0, 500.01), (9.0, 990.0)):
        assert thin_t[thin_v == value] == pytest.approx(at)


def test_phase_spans_meet():
    t = np.arange(6) * 1.0
    spans = style.phase_spans(t, np.array((4, 4, 5, 5, 5, 7)))
    assert spans == [(0.0, 2.0, 4), (2.0, 5.0, 5), (5.0, 5.0, 7)]
    assert style.phase_spans(t[:0], np.zeros(0, dtype=int)) == []


def test_flags_become_spans_that_can_be_seen():
    t = np.arange(6) * 1.0
    assert style.flagged_spans(t, np.array((0, 1, 1, 0, 0, 1)) == 1, 0.5) == [(1.0, 2.0), (5.0, 0.5)]
    assert style.flagged_spans(t[:0], np.zeros(0, dtype=bool), 0.5) == []


def test_snapshots_stand_apart():
    path = np.stack((np.linspace(0.0, 1.0, 101), np.zeros(101), np.zeros(101)), axis=1)
    assert sorted(snapshots(path, 0.2)) == [0, 25, 50, 75, 100]
    assert snapshots(path[:1], 0.2) == [0]
    assert snapshots(path[:0], 0.2) == []


def test_the_track_shows_the_whole_desired_path_however_far_the_load_is_from_it(tmp_path):
    tlog = flights.case_b(duration_s=6.0).write(tmp_path / "flight.tlog")
    samples = samples_of(load_telemetry(tlog))
    desired_m = samples.desired_m + np.linspace(0.0, 9.0, len(samples.desired_m))[:, None]
    far = replace(samples, desired_m=desired_m)
    figure = style.new_figure(6.0, 6.0)
    draw_track(figure, far, far.in_mission, CROSS, (0.0, 0.0, 0.9, 0.9), (0.92, 0.2, 0.02, 0.5))
    axes = figure.axes[0]
    limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    drawn = desired_m[far.in_mission]
    drawn = drawn[np.isfinite(drawn).all(axis=1)]
    assert len(drawn) > 100
    assert (drawn >= limits[:, 0]).all() and (drawn <= limits[:, 1]).all()


@pytest.mark.parametrize(("vehicle", "rotors"), [("bebop", 4), ("hexarotor", 6)])
def test_the_track_shows_as_many_rotors_as_the_vehicle_has(tmp_path, vehicle, rotors):
    view = view_of(flights.case_b(duration_s=6.0), tmp_path / "flight.tlog")
    view = replace(view, meta=replace(META, vehicle=vehicle))
    figure = style.new_figure(6.0, 6.0)
    draw_track(figure, view.samples, view.shown, view.rotors, (0.0, 0.0, 0.9, 0.9), (0.92, 0.2, 0.02, 0.5))
    lines = figure.axes[0].lines
    vehicles = sum(line.get_marker() == "o" and len(line.get_data_3d()[0]) == 1 for line in lines)
    arms = [np.array(line.get_data_3d()) for line in lines if line.get_markevery() == [1]]
    assert vehicles > 1
    assert len(arms) == vehicles * rotors
    ends = np.array([arm[:, 1] - arm[:, 0] for arm in arms[:rotors]])
    ends /= np.linalg.norm(ends, axis=1)[:, None]
    nearest = np.sort(ends @ ends.T, axis=1)[:, -2]
    assert nearest == pytest.approx(np.cos(2.0 * np.pi / rotors), abs=0.01)


def view_of(flight, path):
    """What the pictures of a recorded flight are drawn from."""
    telemetry = load_telemetry(flight.write(path))
    samples = samples_of(telemetry)
    return View(telemetry, samples, flight_record(telemetry, META, samples), META)


def test_the_errors_of_a_load_that_was_released_are_not_drawn(tmp_path, monkeypatch):
    """The estimator does not follow it: the curve would hide all others."""
    view = view_of(flights.delivery(), tmp_path / "flight.tlog")
    drawn = {}
    monkeypatch.setattr(
        plots, "draw", lambda ax, t, values, **style: drawn.setdefault(style["label"], values)
    )
    plots.error(view, io.BytesIO())
    lost = ~view.samples.attached[view.visible(view.samples.time_s)]
    assert 0 < lost.sum() < len(lost)
    assert np.isnan(drawn["estimate − true"][lost]).all()
    assert np.isfinite(drawn["estimate − true"][~lost]).any()


def test_pictures_show_a_failure_and_the_landing_after_it(tmp_path):
    flight = flights.landing_after_a_failure(0.03)
    view = view_of(flight, tmp_path / "flight.tlog")
    failed_s = view.record["failure_s"]
    assert view.window[1] == view.whole_flight[1]
    assert view.samples.time_s[view.shown].max() > failed_s + 1.0
    # the setpoint goes 90 mm into the ground when the load is down
    assert np.nanmax(np.abs(view.error_m)) == pytest.approx(0.03, abs=1e-6)
    _, axes = style.new_axes_grid(6.0, 4.0, 2)
    view.shade(axes[:, 0])
    assert [text.get_text() for text in axes[0, 0].texts].count("failure") == 1
    assert all(failed_s in line.get_xdata() for ax in axes[:, 0] for line in ax.lines)
    line = plots.summary_line(view.record)
    assert f"load error until the failure at {failed_s:.1f} s max 0.0 mm, RMS 0.0 mm" in line
    assert line.endswith("after it max 30.0 mm")
    whole = view_of(flights.case_b(duration_s=6.0), tmp_path / "whole.tlog")
    assert whole.window[1] < whole.whole_flight[1]
    assert "failure" not in plots.summary_line(whole.record)


@pytest.mark.parametrize(
    ("phase", "reason"),
    [
        (mavlink.PLUMBLINE_PHASE_DISARMED, "the vehicle did not take off"),
        (mavlink.PLUMBLINE_PHASE_TAUTEN, "the load was not lifted: no position of the load was asked for"),
        (mavlink.PLUMBLINE_PHASE_HOLD, "no position of the load was asked for"),
    ],
)
def test_a_picture_without_data_says_why(tmp_path, monkeypatch, phase, reason):
    view = view_of(flights.without_a_lift(phase), tmp_path / "flight.tlog")
    figures = []
    monkeypatch.setattr(plots, "save", lambda figure, path: figures.append(figure))
    for draw_it in (plots.overview, plots.error, plots.psi):
        draw_it(view, io.BytesIO())
    overview, error, psi = ([{one.get_text() for one in ax.texts} for ax in f.axes] for f in figures)
    assert sum(reason in texts for texts in overview) == 1
    assert [reason in texts for texts in error] == [True, True, False, True, False, True]
    took_off = phase != mavlink.PLUMBLINE_PHASE_DISARMED
    assert ("no attitude of the load was asked for" if took_off else reason) in psi[1]


def test_a_lost_flight_without_a_mission_window_is_drawn_from_its_begin(tmp_path):
    flight = flights.without_a_lift(mavlink.PLUMBLINE_PHASE_TAUTEN)
    flight.texts.append((3.0, 3, "Failsafe: carried off by the wind, landing"))
    view = view_of(flight, tmp_path / "flight.tlog")
    assert view.record["failure_s"] == 3.0
    assert view.shown.all()


def test_the_page_says_which_figures_end_at_a_failure(tmp_path):
    tlog = flights.landing_after_a_failure(0.03).write(tmp_path / "flight.tlog")
    build_report(tlog, tmp_path, META)
    text = (tmp_path / "report.html").read_text()
    for label in ("greatest load error until the failure", "greatest load error after the failure"):
        assert label in text
    assert "of flight until the failure" not in text


def test_the_figures_are_told_before_the_pictures_are_drawn(tmp_path):
    made = flights.case_b(duration_s=2.0).write(tmp_path / "flight.tlog")
    told = []

    def figures(record):
        told.append((dict(record), (tmp_path / "summary.json").exists(), (tmp_path / "report.html").exists()))

    record = build_report(made, tmp_path, figures=figures)
    assert told == [(record, True, False)]


def draw_by(monkeypatch, draw):
    """Draw pictures by `draw` (target): for tests of who draws which of them, and when."""
    for picture in PICTURES:
        monkeypatch.setattr(picture, "draw", lambda view, target: draw(target))


def test_pictures_beside_the_one_of_the_page_are_drawn_on_demand_and_are_of_the_last_flight(
    tmp_path, monkeypatch
):
    draw_by(monkeypatch, lambda target: target.write_bytes(b"drawn"))
    made = flights.flight(1.0, flights.still).write(tmp_path / "flight.tlog")
    build_report(made, tmp_path, META, picture_formats=["png"])
    earlier = [tmp_path / name for name in ("flight.mcap", "flight.common.tlog")]
    for path in earlier:
        path.write_bytes(b"of an earlier flight")
    build_report(made, tmp_path)
    assert {path.name for path in tmp_path.glob("*.png")} == {picture.file for picture in PICTURES}
    assert all(path.exists() for path in earlier), "it is still the same flight"

    build_report(made, tmp_path, META)
    assert [path.name for path in tmp_path.glob("*.png")] == ["overview.png"]
    assert not any(path.exists() for path in earlier)


@pytest.mark.parametrize(("picture_format", "begin"), [("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_pictures_for_papers_are_the_same_each_time_and_go_with_the_report(tmp_path, picture_format, begin):
    files = [f"{picture.name}.{picture_format}" for picture in PICTURES]
    made = flights.case_b(duration_s=3.0).write(tmp_path / "flight.tlog")
    build_report(made, tmp_path, META, picture_formats=[picture_format])
    drawn = [(tmp_path / file).read_bytes() for file in files]
    assert all(data.startswith(begin) for data in drawn)
    assert (tmp_path / "overview.png").exists()
    build_report(made, tmp_path, picture_formats=[picture_format])
    assert [(tmp_path / file).read_bytes() for file in files] == drawn
    build_report(made, tmp_path, META)
    assert not any((tmp_path / file).exists() for file in files)


def test_the_formats_of_pictures_add_up(tmp_path, monkeypatch):
    draw_by(monkeypatch, lambda target: target.write_bytes(b"drawn"))
    log = flights.flight(1.0, flights.still).write(tmp_path / "flight.tlog")
    arguments = [
        "report",
        str(log),
        "--pictures-svg",
        "--pictures",
        "--pictures-pdf",
        "--pictures",
        "--quiet",
    ]
    assert CliRunner().invoke(gcs, arguments).exit_code == 0
    drawn = {path.name for path in tmp_path.iterdir() if path.suffix in (".png", ".pdf", ".svg")}
    assert drawn == {f"{picture.name}.{one}" for picture in PICTURES for one in ("png", "pdf", "svg")}


def test_a_helper_that_dies_leaves_its_pictures_to_us(tmp_path, monkeypatch):
    ours, others, taken = os.getpid(), multiprocessing.active_children(), tmp_path / "taken"

    def only_here(target):
        if os.getpid() != ours:
            taken.touch()
            signal.raise_signal(signal.SIGKILL)
        for child in multiprocessing.active_children():  # the helper takes a picture of its own
            if child not in others:
                child.join(60.0)
        target.write_bytes(b"drawn here")

    draw_by(monkeypatch, only_here)
    made = flights.case_b(duration_s=2.0).write(tmp_path / "flight.tlog")
    build_report(made, tmp_path, picture_formats=["png"])
    assert taken.exists()
    assert all((tmp_path / picture.file).read_bytes() == b"drawn here" for picture in PICTURES)
