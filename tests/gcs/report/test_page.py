"""report.html in a browser, from disk: the scene, the time line, the plots and what must not happen."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.tlog import TlogWriter, read_tlog
from gcs.analysis.record import FlightMeta
from gcs.report.build import build_report
from tests.doubles import recorded_flights as flights
from tests.doubles.browser import Browser

MOST_BYTES = 3_000_000
SIMULATOR = 26  # component
HOSTILE = "</script><script>window.hostile=1</script><img src=x onerror=window.hostile=1>"
READY = "document.documentElement.dataset.ready === '1'"
# the colour of the canvas where a place [N, E, D] is drawn
PIXEL = """
const scene = replay.stage.scene, gl = scene.renderer.getContext(), out = new Uint8Array(4);
scene.render();
const [x, y] = scene.project(arguments[0]);
gl.readPixels(Math.round(x), scene.canvas.height - 1 - Math.round(y), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, out);
return [...out].slice(0, 3);
"""
VEHICLE = "return replay.flight.at(arguments[0]).vehicle"


def report(flight: flights.Flight, folder: Path, meta: FlightMeta | None = None) -> Path:
    build_report(flight.write(folder / "flight.tlog"), folder, meta or FlightMeta())
    return folder / "report.html"


@pytest.fixture(scope="module")
def case_b(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a Case B of full length with hostile texts from its vehicle and mission."""
    flight = flights.case_b()
    flight.texts.append((20.0, 2, HOSTILE))
    meta = FlightMeta(
        title=HOSTILE, mission=HOSTILE, reason=HOSTILE, command=HOSTILE, settings={HOSTILE: HOSTILE}
    )
    return report(flight, tmp_path_factory.mktemp("case-b"), meta)


@pytest.fixture(scope="module")
def delivered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a flight that releases its load."""
    return report(flights.delivery(), tmp_path_factory.mktemp("delivery"))


@pytest.fixture
def page(browser: Browser, case_b: Path) -> Browser:
    browser.open(case_b.as_uri())
    browser.wait(READY)
    return browser


def quiet(page: Browser) -> None:
    """Check that the console has no error and nothing but the page itself was requested."""
    page.listen()
    assert page.errors == []
    assert [url for url in page.requests if not url.startswith(("file:", "data:"))] == []


def apart(one: list[int], other: list[int]) -> float:
    return float(np.abs(np.subtract(one, other)).max())


def between(one: list[float], other: list[float], share: float) -> list[float]:
    return [a + share * (b - a) for a, b in zip(one, other, strict=True)]


def test_vehicle_cable_and_load_are_where_they_should_be(page: Browser) -> None:
    page.run("replay.transport.set(20); replay.stage.scene.camera('follow')")
    vehicle = page.run(VEHICLE, 20)
    load, body = vehicle["load"]["position"], vehicle["position"]
    empty = page.run(PIXEL, [load[0], load[1] + 0.5, load[2]])
    red, green, blue = page.run(PIXEL, load)
    assert red > green > blue and red - blue > 60  # amber
    assert apart(page.run(PIXEL, between(body, load, 0.5)), empty) > 60  # the cable
    assert apart(page.run(PIXEL, body), empty) > 40
    quiet(page)


def test_the_slider_moves_the_flight(page: Browser) -> None:
    move = """const slider = document.querySelector('.slider');
        slider.value = arguments[0];
        slider.dispatchEvent(new Event('input'))"""
    places = []
    for t in (18.0, 18.75):
        page.run(move, t)
        assert page.run("return replay.transport.time") == pytest.approx(t)
        load = page.run("return replay.stage.scene.vehicles.get(1).load.position")
        assert page.run(VEHICLE, t)["load"]["position"] == pytest.approx(load)
        places.append(load)
    assert np.linalg.norm(np.subtract(*places)) > 0.05
    quiet(page)


def test_it_plays_and_stops_by_the_space_bar(page: Browser) -> None:
    page.run("replay.transport.set(20, true)")
    page.find("body").send_keys(" ")
    page.wait("replay.transport.time > 20.2")
    page.find("body").send_keys(" ")
    assert page.run("return replay.transport.playing") is False
    stopped = page.run("return replay.transport.time")
    page.find("body").send_keys("\ue014")  # arrow right
    assert page.run("return replay.transport.time") == pytest.approx(stopped + 0.1)


def test_the_space_bar_presses_a_button_that_the_keyboard_reached(page: Browser) -> None:
    page.run("replay.transport.set(8, true)")
    page.find(".controls .speed").send_keys("\t")  # to the next button
    page.driver.switch_to.active_element.send_keys(" ")
    assert page.run("return replay.transport.playing") is False
    assert page.run("return replay.transport.time === replay.flight.worst.time")


def test_the_greatest_error_is_one_click_away(page: Browser, case_b: Path) -> None:
    page.run("replay.transport.set(8, true)")
    page.find("button.figure").click()
    time = page.run("return replay.transport.time")
    distance = page.run("return replay.flight.at(arguments[0]).readings.error", time)
    worst = page.run(
        "const f = replay.flight; return Math.max(...f.distance.filter((d, i) => f.column('scored')[i]))"
    )
    assert distance == pytest.approx(worst, abs=1e-5)
    shown = page.find("button.figure b").text
    assert shown == f"{1e3 * worst:.1f} mm"


def test_all_plots_zoom_together_and_share_a_cursor(page: Browser) -> None:
    page.run("replay.group.reset()")
    whole = page.run("return replay.group.charts[0].shown")
    page.driver.execute_script("document.querySelector('.u-over').scrollIntoView({block: 'center'})")
    box = page.run(
        "const b = document.querySelector('.u-over').getBoundingClientRect(); return [b.x, b.y, b.width]"
    )
    for kind, share in (
        ("mousePressed", 0.25),
        ("mouseMoved", 0.4),
        ("mouseMoved", 0.5),
        ("mouseReleased", 0.5),
    ):
        event = {
            "type": kind,
            "x": box[0] + share * box[2],
            "y": box[1] + 40,
            "button": "left",
            "clickCount": 1,
        }
        page.driver.execute_cdp_cmd("Input.dispatchMouseEvent", {**event, "buttons": 1})
    shown = page.run("return replay.group.charts.map((chart) => chart.shown)")
    assert len(shown) >= 8
    span = whole["to"] - whole["from"]
    for one in shown:
        assert one["from"] == pytest.approx(whole["from"] + 0.25 * span, abs=0.02 * span)
        assert one["to"] == pytest.approx(whole["from"] + 0.5 * span, abs=0.02 * span)
    page.run("replay.transport.set(arguments[0], true)", shown[0]["from"] + 1.0)
    heads = page.run("return [...document.querySelectorAll('.chart-playhead')].map((e) => e.style.transform)")
    assert len(set(heads)) == 1 and heads[0]
    quiet(page)


def test_what_came_over_a_link_is_text(page: Browser) -> None:
    said = page.run("return document.querySelector('#texts').textContent")
    assert HOSTILE in said
    assert page.run("return document.title").startswith(HOSTILE)
    assert page.run("return typeof window.hostile") == "undefined"
    assert page.run("return document.images.length") == 1
    quiet(page)


def test_a_text_leads_to_its_moment(page: Browser) -> None:
    page.run(
        """const buttons = [...document.querySelectorAll('#texts button')];
        buttons.find((button) => button.textContent.includes('Take-off')).click()"""
    )
    assert page.run("return replay.transport.time") == pytest.approx(0.5, abs=0.05)


def test_a_case_b_is_small(case_b: Path) -> None:
    assert case_b.stat().st_size < MOST_BYTES


@pytest.mark.parametrize("width", [360, 500, 1280, 1920])
def test_nothing_stands_out_of_the_window(browser: Browser, case_b: Path, width: int) -> None:
    browser.open(case_b.as_uri(), width, 800, "light")
    browser.wait(READY)
    assert browser.run("return document.documentElement.scrollWidth") <= width


def test_nothing_over_the_scene_lies_on_anything_else(page: Browser) -> None:
    for width in (360, 500, 800, 1280):
        page.resize(width, 800)
        boxes = page.run(
            """return [".scene-legend", ".cameras", ".readings", ".timeline"].map((one) => {
                const { left, right, top, bottom } = document.querySelector(one).getBoundingClientRect();
                return [one, left, right, top, bottom];
            })"""
        )
        assert all(right > left and bottom > top for _, left, right, top, bottom in boxes)
        over = [
            (one[0], other[0])
            for one, other in combinations(boxes, 2)
            if min(one[2], other[2]) > max(one[1], other[1]) and min(one[4], other[4]) > max(one[3], other[3])
        ]
        assert not over, width


def test_no_two_buttons_have_one_name(page: Browser) -> None:
    names = page.run(
        "const buttons = [...document.querySelectorAll('.cameras button, .plots-bar button')];"
        "return buttons.map((one) => one.textContent)"
    )
    assert len(names) == 6
    assert len(set(names)) == 6


def test_what_stands_over_the_scene_can_be_read_in_a_narrow_window(page: Browser) -> None:
    page.resize(500, 800)
    sizes = page.run(
        """return [...document.querySelectorAll("#stage *, .readings *, .timeline *")]
            .filter((one) => [...one.childNodes].some((part) => part.nodeType === 3 && part.data.trim()))
            .map((one) => [one.textContent, parseFloat(getComputedStyle(one).fontSize)])"""
    )
    assert len(sizes) > 10
    assert [(text, size) for text, size in sizes if size < 10.0] == []


def test_labels_of_an_axis_fit_beside_it(page: Browser) -> None:
    for ticks, labels in (
        ([0, 0.00005, 0.0001, 0.00015], ["0", "0.5·10⁻⁴", "1·10⁻⁴", "1.5·10⁻⁴"]),
        ([0, 0.0005, 0.001], ["0", "0.0005", "0.001"]),
        ([-0.5, 0, 0.5], ["-0.5", "0", "0.5"]),
        ([0, 1500000], ["0", "1.5·10⁶"]),
        ([0], ["0"]),
    ):
        assert page.run("return Plumbline.tickLabels(arguments[0])", ticks) == labels
        most, place = page.run(
            """const context = document.createElement("canvas").getContext("2d");
            context.font = "11px system-ui, sans-serif";
            const { size, gap } = replay.group.charts[0].plot.axes[1];
            return [Math.max(...arguments[0].map((one) => context.measureText(one).width)), size() - gap]""",
            labels,
        )
        assert most <= place


def test_no_cable_is_drawn_to_a_load_that_was_let_go(browser: Browser, delivered: Path) -> None:
    browser.open(delivered.as_uri())
    browser.wait(READY)
    end = browser.run("return replay.flight.span[1] - 3")
    for t, attached in ((7.0, True), (end, False)):
        browser.run("replay.transport.set(arguments[0])", t)
        craft = browser.run(
            "const c = replay.stage.scene.crafts.get(1); return [c.cable.visible, c.load.visible]"
        )
        assert craft == [attached, True]
    assert "load released" in browser.run("return document.querySelector('.note').textContent")
    ways = browser.run("return replay.flight.tracks().map((track) => track.flown.length / 3)")
    assert len(ways) == 2
    assert min(ways) > 100  # points, of the load and of the vehicle that flies home
    swing = browser.run("return replay.flight.at(arguments[0]).readings.swing", end)
    assert swing is None  # NaN
    quiet(browser)


def test_a_lost_link_leaves_a_gap(browser: Browser, tmp_path: Path) -> None:
    flight = flights.case_b(duration_s=12.0)
    flight.drop = lambda i, kind: 8.0 < flight.time_s[i] < 11.0
    browser.open(report(flight, tmp_path).as_uri())
    browser.wait(READY)
    browser.run("replay.transport.set(9.5)")
    assert "no telemetry" in browser.run("return document.querySelector('.note').textContent")
    assert browser.run("return document.querySelectorAll('.band.gap').length") == 1
    assert len(browser.run("return replay.flight.tracks()")) == 2
    quiet(browser)


def test_without_the_truth_it_shows_what_the_vehicle_believed(browser: Browser, tmp_path: Path) -> None:
    whole = flights.case_b(duration_s=6.0).write(tmp_path / "whole.tlog")
    with (tmp_path / "flight.tlog").open("wb") as file:
        log = TlogWriter(file)
        for unix_us, received in read_tlog(whole):
            if received.component != SIMULATOR:
                log.write(unix_us, received.frame)
    build_report(tmp_path / "flight.tlog", tmp_path, FlightMeta())
    browser.open((tmp_path / "report.html").as_uri())
    browser.wait(READY)
    assert browser.run("return replay.flight.source") == "estimate"
    assert browser.run("return replay.stage.scene.crafts.size") == 1
    assert "believed" in browser.find(".keys").text
    quiet(browser)


def test_a_flight_without_a_position_to_follow_says_why_it_has_no_error(
    browser: Browser, tmp_path: Path
) -> None:
    flight = flights.without_a_lift(mavlink.PLUMBLINE_PHASE_TAUTEN)
    browser.open(report(flight, tmp_path).as_uri())
    browser.wait(READY)
    cards = browser.run("return [...document.querySelectorAll('#plots .card')].map((one) => one.textContent)")
    assert cards[0] == "Load error: the load was not lifted: no position of the load was asked for."
    assert any(card.startswith("Error functions of the cascade") for card in cards)  # that of the vehicle
    assert not any("dashed: asked" in card for card in cards)
    assert "greatest error" not in browser.find(".keys").text
    quiet(browser)
