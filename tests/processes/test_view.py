"""The live page of real flights, in a browser: it shows the flight, and a person's requests are executed."""

from __future__ import annotations

import json
import re
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import connect

import missions
import plumbline
from autopilot.wire.codec import FrameWriter
from autopilot.wire.dialect import plumbline as mavlink
from gcs.shell.link import free_port
from tests.doubles.browser import Browser

pytestmark = pytest.mark.processes

FLYING = "/^(hold|mission|lift)/.test(document.getElementById('phase').textContent)"
STATE = "Plumbline.live.page.vehicles.get(1).state"
ANSWER = "document.getElementById('answer').textContent"

# the colours of the pixels around some places, as the scene shows the vehicle at this moment
SEEN = """
const scene = Plumbline.live.scene, vehicle = scene.vehicles.get(1), gl = scene.renderer.getContext();
const load = vehicle.load.position, top = vehicle.position;
const around = (place, reach) => {
  const [x, y] = scene.project(place).map(Math.round), side = 2 * reach + 1;
  const out = new Uint8Array(4 * side * side);
  gl.readPixels(x - reach, scene.canvas.height - 1 - y - reach, side, side, gl.RGBA, gl.UNSIGNED_BYTE, out);
  return Array.from({ length: side * side }, (_, i) => [...out.slice(4 * i, 4 * i + 3)]);
};
scene.render();
return {
  load: around(load, 0)[0],
  cable: around(load.map((value, axis) => 0.5 * (value + top[axis])), 3),
  vehicle: around(top, 5),
  nothing: around([load[0] + 0.9, load[1], load[2]], 0)[0],
};
"""


def page_of(program: Any) -> str:
    """The address that a program prints."""
    program.says(rb"live page: http://\S+/\n")
    found = re.search(r"live page: (http://\S+)", program.log.read_text())
    assert found
    return found[1]


def test_a_flight_is_seen_and_led_by_hand(
    start: Callable[..., Any], browser: Browser, tmp_path: Path
) -> None:
    # it hovers until it is commanded elsewhere, however slowly this machine draws the page
    patient = tmp_path / "patient.toml"
    hover = Path(missions.__file__).with_name("hover.toml").read_text(encoding="utf-8")
    patient.write_text(hover.replace("duration_s = 10.0", "duration_s = 600.0"))
    out = str(tmp_path / "out")
    flight = start("gcs", "fly", str(patient), "--view", "--speed", "2", "--out", out, "--quiet")
    address = page_of(flight)
    browser.open(address)
    browser.wait(f"{FLYING} && {STATE}.load.position[2] < -0.5 && {STATE}.taut", 60.0)

    seen = browser.run(SEEN)
    red, green, blue = seen["load"]
    assert red > 150 > blue, seen["load"]  # amber, like nothing else there
    assert red > green > blue
    # white, but a line one pixel wide may be spread over two; the ground's least component is below 60
    assert max(min(pixel) for pixel in seen["cable"]) > 80
    assert max(min(pixel) for pixel in seen["vehicle"]) > 150
    red, green, blue = seen["nothing"]  # ground, or a line on it: dim and bluish
    assert red < green < blue < 150, seen["nothing"]

    browser.find("[data-action=hold]").click()
    browser.wait(f"{ANSWER} === 'pause: accepted' && {STATE}.phase === 'hold'")
    disabled = "document.querySelectorAll('#flight-buttons button:disabled')"
    assert browser.run(
        f"return Object.fromEntries([...{disabled}].map((one) => [one.textContent, one.title]))"
    ) == {
        "Lift": "in the air",
        "Arm": "armed already",
        "Disarm": "in the air: land first",
    }
    browser.run("Plumbline.live.ask('disarm', {})")  # as if telemetry had been too late for the button
    browser.wait(f"{ANSWER}.includes('denied') && {ANSWER}.includes('in the air')")

    browser.find("[data-camera=top]").click()
    # one metre east of the load, as seen from above
    x, y = browser.run(
        f"const p = {STATE}.load.position; return Plumbline.live.scene.project([p[0], p[1] + 1, p[2]])"
    )
    browser.click_at("#scene", x, y, clicks=2)
    browser.wait(f"{ANSWER} === 'goto: accepted'")
    browser.wait(f"{STATE}.load.position[1] > 0.9 && {STATE}.error < 0.05")

    slider = "document.querySelector('[data-parameter=SIM_WIND_E]')"
    browser.run(f"{slider}.value = 4; {slider}.dispatchEvent(new Event('change'))")
    browser.wait(f"{ANSWER} === 'SIM_WIND_E = 4' && {STATE}.wind[1] === 4")
    browser.wait("document.getElementById('wind').textContent === 'wind 4.0 m/s'")

    browser.find("[data-signal=height]").click()
    assert browser.run("return document.querySelectorAll('.strip canvas').length") == 4
    assert browser.run("return Plumbline.live.plots.samples.length") > 100

    browser.find("[data-action=land]").click()
    browser.wait("document.querySelector('#banner a')", 90.0)
    outcome = browser.find("#phase").text
    assert browser.find("#banner").text.startswith(outcome)
    assert browser.run("return document.querySelector('[data-action=hold]').disabled")
    browser.listen()
    assert browser.errors == []
    ours = (address, address.replace("http:", "ws:") + "socket", "data:,")
    assert [url for url in browser.requests if not url.startswith(ours)] == []

    browser.run("Plumbline.live.scene.renderer.forceContextLoss()")
    browser.wait("document.getElementById('hint').textContent.startsWith('The browser has stopped drawing')")

    browser.open(browser.run("return document.querySelector('#banner a').href"))
    assert "report" in browser.run("return document.title")
    browser.driver.get("about:blank")
    # the page is closed: the command ends with the exit code of the flight
    assert flight.process.wait(30.0) == {"completed": 0, "interrupted": 3}[outcome]


def test_a_lockstep_flight_is_the_same_with_the_page_open(start: Callable[..., Any], tmp_path: Path) -> None:
    out = tmp_path / "out"
    flight = start("gcs", "fly", "hover", "--view", "--seed", "7", "--out", str(out), "--quiet")
    address = page_of(flight)
    host = address.split("/")[2]
    with connect(address.replace("http:", "ws:") + "socket", origin=f"http://{host}") as page:  # type: ignore[arg-type]
        heights = []
        while True:
            record = json.loads(page.recv(60.0))
            for samples in record.get("samples", {}).values() if record["type"] == "state" else ():
                heights += [-sample[1][2] for sample in samples if sample[1]]
            if record["type"] == "session" and "outcome" in record:
                break
    assert record["outcome"] == "completed"
    assert flight.process.wait(30.0) == 0
    flown = plumbline.fly("hover", sensors="lab", seed=7, quiet=True)
    assert (out / "flight.tlog").read_bytes() == flown.tlog
    assert max(heights) > 0.9  # the page has seen it fly


def test_without_a_page_that_was_opened_the_command_ends_with_the_flight(
    start: Callable[..., Any], tmp_path: Path
) -> None:
    flight = start("gcs", "fly", "hover", "--view", "--out", str(tmp_path / "out"), "--quiet")
    page_of(flight)
    assert flight.process.wait(100.0) == 0
    assert "gcs: no page was opened" in flight.log.read_text()


def test_ctrl_c_after_the_flight_ends_the_page_and_says_so(
    start: Callable[..., Any], browser: Browser, tmp_path: Path
) -> None:
    flight = start("gcs", "fly", "hover", "--view", "--out", str(tmp_path / "out"), "--quiet")
    browser.open(page_of(flight))
    browser.wait("document.querySelector('#banner a')", 90.0)
    flight.says(rb"the page stays until it is closed")
    assert flight.interrupt() == 0
    assert flight.log.read_text().endswith("gcs: ending the live page; the report is complete\n")
    browser.wait("!document.querySelector('#banner a')")
    assert "the server of this page has ended" in browser.find("#banner").text


@contextmanager
def viewed_vehicle(
    start: Callable[..., Any], browser: Browser
) -> Iterator[tuple[Any, Callable[[bytes], object]]]:
    """`gcs view` with its page open, and what sends a datagram to it as a vehicle does."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.bind(("127.0.0.1", 0))
        port = free_port()
        view = start("gcs", "view", "--connect", str(port), "--no-open", "--no-truth")
        browser.open(page_of(view))
        browser.wait("Plumbline.live.page.socket.readyState === WebSocket.OPEN")
        yield view, lambda datagram: vehicle.sendto(datagram, ("127.0.0.1", port))


def test_what_comes_over_a_link_is_text_and_a_silent_vehicle_is_told(
    start: Callable[..., Any], browser: Browser
) -> None:
    with viewed_vehicle(start, browser) as (view, send):
        markup = "<img src=x onerror='document.title=0'>"
        writer = FrameWriter(4, 1)
        for message in (
            mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, 29, 0x03040000, 3, 3),
            mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_WARNING, markup.encode()),
        ):
            send(writer.frame(message))
        browser.wait("document.querySelector('#texts span')")
        assert browser.find("#texts span").text == markup
        assert browser.run("return document.querySelectorAll('img').length") == 0
        browser.wait("document.getElementById('phase').textContent === 'link lost'")
        assert "Nothing heard" in browser.find("#banner").text
        browser.listen()
        assert browser.errors == []
    assert view.interrupt() == 0


def test_a_page_says_that_its_server_was_killed(start: Callable[..., Any], browser: Browser) -> None:
    with viewed_vehicle(start, browser) as (view, send):
        beat = mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, 29, 0x03040000, 3, 3)
        send(FrameWriter(4, 1).frame(beat))
        browser.wait("document.getElementById('phase').textContent === 'link lost'")
        view.process.kill()
        browser.wait("document.getElementById('phase').textContent === 'the server of this page has ended'")
        # the page tries to connect again, which changes nothing that it shows
        browser.run(
            """const chip = document.getElementById("phase");
            globalThis.seen = [];
            new MutationObserver(() => seen.push(chip.textContent)).observe(chip, { childList: true });
            globalThis.last = Plumbline.live.page.socket;"""
        )
        browser.wait("Plumbline.live.page.socket !== last && Plumbline.live.page.socket.readyState === 3")
        assert browser.run("return seen") == []
        assert browser.find("#banner").text.startswith("The server of this page has ended")
