"""A flight in real time that failed because the machine was too slow for it: the outcome says so."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from autopilot.wire.codec import FrameWriter
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.tlog import TlogWriter
from gcs.clients.flight import Outcome
from gcs.folders import TLOG_FILE
from gcs.workflows import fly as workflow
from gcs.workflows import started_flight
from gcs.workflows.flight_options import FlightOptions
from gcs.workflows.too_slow import slowness_reason

OWN_REASON = "the load is lost"


def write(log: TlogWriter, missed: int, seconds: int = 40, speed: float = 1.0, slow: float = 1.0) -> None:
    """Write what a simulator of 250 ticks a second reports each second; `slow`: factor of the first half."""
    writer = FrameWriter(1, 27)
    for second in range(1, seconds + 1):
        rate_hz = 250.0 * speed * (slow if second <= seconds // 2 else 1.0)
        now = missed * second // seconds
        status = mavlink.MAVLink_sim_status_message(second * 10**6, speed, rate_hz, 50, 900, 9000, now, 0, 0)
        log.write(second * 10**6, writer.frame(status))


def told(path: Path, **counted: Any) -> str:
    with (path / TLOG_FILE).open("wb") as file:
        write(TlogWriter(file), **counted)
    return slowness_reason(path / TLOG_FILE)


@pytest.mark.parametrize(
    "counted",
    [{}, {"speed": 4.0}, {"speed": 0.5}, {"slow": 0.4}],
    ids=["real time", "four times as fast", "half as fast", "and slower at first"],
)
def test_commands_that_came_too_late_are_told_with_how_many_there_were(tmp_path: Path, counted: Any) -> None:
    text = "the machine was too slow: 500 of some 10000 commands came too late; try without --real-time"
    assert told(tmp_path, missed=500, **counted) == text


def test_custom_code_that_is_too_slow_is_the_cause_and_not_the_machine(tmp_path: Path) -> None:
    """As the vehicle reports it (tests/own/test_host.py)."""
    assert told(tmp_path, missed=500).startswith("the machine was too slow: 500 of")
    named = "Law Slow failed: load_position takes 9.1 ms, and there are 4.0 ms: too slow (slow.py:3); landing"
    assert slowness_reason(tmp_path / TLOG_FILE, named) == ""
    assert slowness_reason(tmp_path / TLOG_FILE, "Law Slow failed: ZeroDivisionError (slow.py:3)")
    shared = slowness_reason(tmp_path / TLOG_FILE, OWN_REASON, "slow.py:Slow")
    assert shared.startswith("the machine was too slow for slow.py:Slow: 500 of some 10000")


@pytest.mark.parametrize(
    "counted", [{"missed": 10}, {"missed": 0}, {"missed": 3, "seconds": 0}, {"missed": 0, "speed": 0.0}]
)
def test_a_machine_that_missed_no_more_than_one_of_a_thousand_was_fast_enough(
    tmp_path: Path, counted: Any
) -> None:
    assert told(tmp_path, **counted) == ""


@pytest.mark.parametrize(
    ("real_time", "name", "says"),
    [(True, "diverged", True), (True, "completed", False), (False, "diverged", False)],
)
def test_the_outcome_of_a_flight_in_real_time_says_that_the_machine_was_too_slow(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, real_time: bool, name: Any, says: bool
) -> None:
    @contextmanager
    def no_vehicle(options: FlightOptions, home: Home, out: Path, processes: None) -> Iterator[None]:
        yield

    def flown(mission: Any, options: Any, log: TlogWriter, own: Any, stop: Any, watch: Any, page: Any) -> Any:
        watch.start()
        write(log, missed=500)
        return SimpleNamespace(outcome=Outcome(name, OWN_REASON), started=True)

    monkeypatch.setattr(workflow, "start_vehicle", no_vehicle)
    monkeypatch.setattr(workflow, "warm_up", lambda parts, quiet: None)
    monkeypatch.setattr(workflow, "make_report", lambda tlog, out, meta, quiet, figures, pictures: meta)
    monkeypatch.setattr(started_flight, "fly_started_vehicle", flown)
    options = FlightOptions(
        **{"mission": "hover", "law": "thesis", "sensors": "lab", "vehicle": "bebop", "seed": 1},
        **{"speed": 1.0, "real_time": real_time, "out": tmp_path / "out", "settings": (), "connect": None},
        **{"quiet": True, "force": True, "overwrite": False, "limit_s": None},
    )
    flight: Any = workflow.fly(options, lambda record, outcome: None)
    slow = "the machine was too slow: 500 of some 10000 commands came too late; try without --real-time; "
    assert flight.outcome == Outcome(name, says * slow + OWN_REASON)
    assert flight.record.reason == flight.outcome.reason, "in what is kept of it too"
