"""What the live page shows once its server has ended, in a page from disk whose web sockets are doubles."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import gcs.web
from tests.doubles.browser import Browser

SOCKETS = """<script>
globalThis.sockets = [];
globalThis.WebSocket = class extends EventTarget {
  static OPEN = 1;
  readyState = 0;
  constructor() { super(); sockets.push(this); }
  send() {}
  open() { this.readyState = 1; this.dispatchEvent(new Event("open")); }
  end() { this.readyState = 3; this.dispatchEvent(new Event("close")); }
  say(record) { this.dispatchEvent(new MessageEvent("message", { data: JSON.stringify(record) })); }
};
</script>"""
CHIP = "document.getElementById('phase').textContent"
BANNER = "document.getElementById('banner')"
ENDED = "the server of this page has ended"
HOVERING = {
    "id": 1,
    "time": 12.0,
    "phase": "hold",
    "armed": True,
    "load": None,
    "unavailable": {"arm": "armed already", "takeoff": "in the air"},
    "link": {"lost": False, "age": 0.1, "rate": 50, "pace": 1.0, "loss": 0.0},
}


@pytest.fixture
def page(browser: Browser, tmp_path: Path) -> Browser:
    """The live page, connected to a server that knows no vehicle yet."""
    source = Path(gcs.web.__file__).with_name("live.html")
    head = f'<head><base href="{source.parent.as_uri()}/">{SOCKETS}'
    path = tmp_path / "live.html"
    path.write_text(source.read_text(encoding="utf-8").replace("<head>", head), encoding="utf-8")
    browser.open(path.as_uri())
    browser.run("sockets[0].open()")
    say(browser, {"type": "hello", "controls": []}, {"type": "session", "kind": "view"})
    return browser


def say(page: Browser, *records: dict[str, Any]) -> None:
    """Let the server send records over the last socket."""
    page.run(f"for (const record of {json.dumps(records)}) sockets.at(-1).say(record)")


def wait_for_panels(page: Browser) -> None:
    """Wait until the loop of frames has shown the panels several times."""
    page.run(
        """const panels = Plumbline.live.panels, show = Object.getPrototypeOf(panels).show;
        globalThis.shows = 0;
        panels.show = (state) => { shows += 1; show.call(panels, state); };"""
    )
    page.wait("shows >= 3")


def test_a_page_says_that_its_server_has_ended_until_there_is_one_again(page: Browser) -> None:
    say(page, {"type": "state", "vehicles": [HOVERING], "samples": {}})
    page.wait(f"{CHIP} === 'hold'")
    page.run("sockets[0].end()")
    for attempts in (2, 3):
        wait_for_panels(page)
        assert page.run(f"return {CHIP}") == ENDED
        assert page.run(f"return !{BANNER}.hidden && {BANNER}.textContent").startswith(
            "The server of this page"
        )
        assert page.find("#link").text == ENDED and page.find("#hint").text == ""
        assert page.run("return document.querySelector('[data-action=hold]').disabled")
        page.wait(f"sockets.length === {attempts}")
        if attempts == 2:
            page.run("sockets[1].end()")
    page.run("sockets[2].open()")
    say(page, {"type": "state", "vehicles": [HOVERING], "samples": {}})
    page.wait(f"{CHIP} === 'hold'")
    assert page.run(f"return {BANNER}.hidden && document.body.className === ''")
    assert "50 messages/s" in page.find("#link").text
    assert not page.run("return document.querySelector('[data-action=hold]').disabled")


def test_a_page_without_a_vehicle_says_so_too(page: Browser) -> None:
    page.run("sockets[0].end()")
    assert page.run(f"return [{CHIP}, {BANNER}.hidden]") == [ENDED, False]
    page.wait("sockets.length === 2")
    page.run("sockets[1].open()")
    assert page.run(f"return [{CHIP}, {BANNER}.hidden]") == ["waiting for a vehicle", True]


FLOWN = {"type": "session", "kind": "fly", "outcome": "completed", "reason": "", "report": "report.html"}


def test_a_flight_that_is_over_keeps_its_outcome_and_links_to_no_report_of_a_server_that_has_ended(
    page: Browser,
) -> None:
    say(page, {"type": "state", "vehicles": [HOVERING], "samples": {}}, FLOWN)
    shown = f"return [{CHIP}, {BANNER}.textContent, {BANNER}.querySelectorAll('a').length]"
    assert page.run(shown) == ["completed", "completedOpen the report", 1]
    page.run("sockets[0].end()")
    wait_for_panels(page)
    assert page.run(shown) == ["completed", f"completed; {ENDED}", 0]


def test_a_flight_that_is_over_without_a_state_says_that_the_server_has_ended(page: Browser) -> None:
    say(page, FLOWN)
    page.run("sockets[0].end()")
    assert page.run(f"return {BANNER}.textContent") == f"completed; {ENDED}"


BUTTONS = """
return Object.fromEntries([...document.querySelectorAll("#flight-buttons button")].map(
  (one) => [one.dataset.action, one.disabled ? one.title : ""]))
"""


def test_a_button_that_the_vehicle_would_refuse_is_disabled_and_says_why(page: Browser) -> None:
    assert set(page.run(BUTTONS).values()) == {"no vehicle has reported yet"}
    say(page, {"type": "state", "vehicles": [HOVERING], "samples": {}})
    shown = page.run(BUTTONS)
    assert {action: why for action, why in shown.items() if why} == HOVERING["unavailable"]
    assert "hold" in shown
    assert page.find("#hint").text.startswith("Double-click: take the load there.")
    grounded = {"hold": "on the ground", "goto": "on the ground"}
    landed = {**HOVERING, "phase": "disarmed", "armed": False, "unavailable": grounded}
    say(page, {"type": "state", "vehicles": [landed], "samples": {}})
    assert page.find("#hint").text == "Drag: turn. Wheel: zoom."
    assert {action: why for action, why in page.run(BUTTONS).items() if why} == {"hold": "on the ground"}
    say(page, {"type": "session", "kind": "fly", "outcome": "completed", "reason": ""})
    assert set(page.run(BUTTONS).values()) == {"the flight is over"}
    page.run("sockets[0].end()")
    assert set(page.run(BUTTONS).values()) == {ENDED}
