"""docs/thesis.md does not become outdated unnoticed: its figures of Case A are those of the present code."""

from __future__ import annotations

from pathlib import Path

import pytest

from autopilot.vehicle.parameters import LAWS
from autopilot.wire.codec import decode
from gcs.analysis.record import FlightMeta, flight_record
from gcs.analysis.telemetry import telemetry_of
from gcs.closed_loop import Conditions, fly
from gcs.experiments import thesis
from gcs.experiments.plan import LAW_NAMES
from missions.fileformat import load_mission
from tests.gcs.experiments import tolerances

PAGE = Path(__file__).parents[3] / "docs" / "thesis.md"
KEYS = ("rise_time_90_s", "overshoot_pct", "settling_time_5pct_s")
RENEW = "renew it: gcs experiments thesis --docs docs/thesis.md"


class Frames:
    """A log that keeps frames."""

    def __init__(self):
        self.records = []

    def write(self, unix_us, *frames):
        self.records += [(unix_us, decode(frame)[0][0]) for frame in frames]


def documented(law):
    """The three numbers of the idealised vehicle in the first table."""
    start = f"| Case A | idealised | {LAW_NAMES[law]} |"
    row = next(line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith(start))
    return [float(cell.split()[0]) for cell in row.split("|")[4:7]]


@pytest.mark.parametrize("law", ["thesis", "lqr"])
def test_case_a_is_what_the_page_says(law):
    log = Frames()
    conditions = Conditions("thesis", "ideal", settings={"CTL_LAW": float(LAWS.index(law))})
    fly(load_mission("case-a"), conditions, log)
    record = flight_record(telemetry_of(log.records), FlightMeta())
    for key, value in zip(KEYS, documented(law), strict=True):
        assert record[key] == pytest.approx(value, abs=tolerances.ROUNDED[key]), RENEW


def test_the_page_shows_only_pictures_that_are_there():
    text = PAGE.read_text(encoding="utf-8")
    assert thesis.BEGIN in text and thesis.END in text
    for file in thesis.KEY_FIGURES:
        assert f"images/thesis/{file}" in text
        assert 0 < (PAGE.parent / "images" / "thesis" / file).stat().st_size < 150_000
