"""Samples for pages that open later, and the quality of a link."""

from __future__ import annotations

from typing import Any

import pytest

from autopilot.wire.codec import Received
from gcs.view.history import FIELDS, MAX_SAMPLES, SAMPLE_S, History
from gcs.view.link_quality import LOST_US, LinkQuality


def state(time_s: float) -> dict[str, Any]:
    """The part of a vehicle's state that samples need."""
    nothing = dict.fromkeys(
        ("load", "position", "asked", "error", "tension", "swing", "velocity", "estimator_error")
    )
    return {**nothing, "time": time_s, "rotors": [0.4, 0.6], "link": {"pace": 1.0}}


def test_samples_are_taken_by_the_vehicles_clock_and_name_their_fields() -> None:
    history = History()
    for tick in range(101):
        if history.is_due(tick * 0.01):
            history.add(state(tick * 0.01))
    assert len(history.samples) == round(1.0 / SAMPLE_S) + 1
    assert dict(zip(FIELDS, history.samples[-1], strict=True))["use"] == 0.6


def test_a_clock_that_begins_anew_forgets_what_was() -> None:
    history = History()
    history.add(state(50.0))
    assert history.is_due(0.0)
    assert history.samples == []


def test_a_long_flight_keeps_its_whole_span_in_bounded_memory() -> None:
    history = History()
    for number in range(3 * MAX_SAMPLES):
        history.add(state(number * SAMPLE_S))
    times = [sample[0] for sample in history.samples]
    assert len(times) <= MAX_SAMPLES
    assert times[0] == 0.0
    assert times[-1] == pytest.approx((3 * MAX_SAMPLES - 1) * SAMPLE_S)
    assert times == sorted(times)


def test_losses_are_counted_by_component_and_silence_is_told() -> None:
    link = LinkQuality()
    for number in range(2000):
        now_us = number * 10_000
        sequence = number + number // 9  # every tenth is missing
        link.on_message(Received(30, 1, 1, sequence & 0xFF, b""), now_us)
        link.on_message(Received(60101, 1, 25, number & 0xFF, b""), now_us)
        link.on_clock(number * 5000, now_us)
    record = link.record(now_us)
    assert record["loss"] == pytest.approx(1 / 19, abs=0.01)  # a window ends within a span of nine
    assert record["rate"] == pytest.approx(200, abs=2)
    assert record["pace"] == 0.5
    assert not record["lost"]
    assert link.record(now_us + LOST_US + 1)["lost"]
