"""The law's errors with noisy sensors, delay, rotor lag, wind and a wrong load mass, over many seeds.

Each flight runs in one process, with all MAVLink messages between its parts; its telemetry equals that of
`gcs fly` byte for byte, and every figure comes from it. A row is met when its worst seed is within the limits
and no flight was lost. Exit code 1 if a row is not met.

    python benchmarks/fit_to_fly.py [--seeds 20] [--law plumbline] [--rows B ...] [--jobs 2] [--json FILE]
"""

from __future__ import annotations

import argparse
import io
import json
import multiprocessing
import os
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from autopilot.vehicle.parameters import LAWS
from autopilot.wire.tlog import TlogWriter, read_tlog
from gcs.analysis.metrics import step_window
from gcs.analysis.record import FlightMeta, flight_record
from gcs.analysis.samples import Samples, samples_of
from gcs.analysis.step import find_step
from gcs.analysis.telemetry import telemetry_of
from gcs.closed_loop import Conditions, fly
from missions.fileformat import load_mission

Figures = dict[str, float | None]


@dataclass(frozen=True)
class Row:
    """A required flight, and the greatest value that each of its figures may have."""

    name: str
    mission: str
    limits: dict[str, float]
    sensors: str = "lab"
    settings: dict[str, float] = field(default_factory=dict)
    vehicle: str = "bebop"


SLOW = {"SIM_ACT_DELAY_MS": 12.0, "SIM_ROTOR_TAU_MS": 30.0}
ROWS = (
    Row("B ideal", "case-b", {"load_error_max_m": 0.010}, "ideal"),
    Row("B lab 12/30 ms", "case-b", {"load_error_max_m": 0.020}, settings=SLOW),
    Row("C lab 12/30 ms", "case-c", {"load_error_max_m": 0.040}, settings=SLOW),
    Row("B rtk", "case-b", {"load_error_max_m": 0.150}, "rtk"),
    Row("C rtk", "case-c", {"load_error_max_m": 0.150}, "rtk"),
    Row(
        "A lab",
        "case-a",
        {
            "rise_time_90_s": 0.61,
            "overshoot_pct": 5.0,
            "settling_time_5pct_s": 1.0,
            "before_step_max_m": 0.010,
        },
    ),
    Row("C lab load -50 %", "case-c", {"load_error_max_m": 0.100}, settings={"SIM_LOAD_MASS": 0.05}),
    Row("C lab load +50 %", "case-c", {"load_error_max_m": 0.100}, settings={"SIM_LOAD_MASS": 0.15}),
    Row(
        "gust lab",
        "hover",
        {"gust_recovery_50mm_s": 3.0},
        settings={"SIM_GUST_E": 5.0, "SIM_GUST_AT_S": 18.0, "SIM_GUST_FOR_S": 2.0},
    ),
    Row("B lab 72 ms", "case-b", {"load_error_max_m": 0.040}, settings={"SIM_ACT_DELAY_MS": 72.0}),
    Row("B lab 72, told 62", "case-b", {}, settings={"SIM_ACT_DELAY_MS": 72.0, "VEH_ACT_DELAY": 62.0}),
    Row("B lab 72, told 82", "case-b", {}, settings={"SIM_ACT_DELAY_MS": 72.0, "VEH_ACT_DELAY": 82.0}),
)


@dataclass(frozen=True)
class FlightResult:
    """The result of one flight."""

    outcome: str
    reason: str
    figures: Figures


def before_step_max(samples: Samples) -> float | None:
    """Greatest distance (m) of the true load from the origin of the requested step, before the step."""
    window = step_window(samples)
    step = find_step(samples.time_s[window], samples.requested_m[window], samples.requested_m_s[window])
    if step is None:
        return None
    before = window & (samples.time_s <= step.start_s)
    return float(np.linalg.norm(samples.actual_m[before] - step.origin_m, axis=1).max())


def fly_row(row: Row, law: str, seed: int) -> FlightResult:
    """Fly the row once."""
    settings = {"CTL_LAW": float(LAWS.index(law)), **row.settings}
    file = io.BytesIO()
    outcome = fly(
        load_mission(row.mission), Conditions(row.vehicle, row.sensors, seed, settings), TlogWriter(file)
    )
    file.seek(0)
    telemetry = telemetry_of(read_tlog(file))
    samples = samples_of(telemetry)
    record: dict[str, Any] = flight_record(telemetry, FlightMeta(outcome=outcome.name), samples)
    record["before_step_max_m"] = before_step_max(samples)
    figures = {"load_error_max_m", "saturated_fraction", "psi_q_max", *row.limits}
    return FlightResult(outcome.name, outcome.reason, {name: record.get(name) for name in sorted(figures)})


def is_met(row: Row, flights: list[FlightResult]) -> bool:
    """Whether every seed completed within every limit."""
    if any(flight.outcome != "completed" for flight in flights):
        return False
    values = [(flight.figures[name], limit) for flight in flights for name, limit in row.limits.items()]
    return all(value is not None and value <= limit for value, limit in values)


def result_line(row: Row, flights: list[FlightResult]) -> str:
    """One line: the worst and the median of each figure."""
    lost = [flight for flight in flights if flight.outcome != "completed"]
    text = f"{row.name:20} {'met' if is_met(row, flights) else 'MISSED':7}"
    if lost:
        text += f" {len(lost)} of {len(flights)} lost ({lost[0].reason})"
    for name in sorted({*row.limits, "load_error_max_m"}):
        values = [v for v in (flight.figures[name] for flight in flights) if v is not None]
        if values:
            limit = f" <= {row.limits[name]:g}" if name in row.limits else ""
            text += f"  {name} {max(values):.4g} (median {float(np.median(values)):.4g}){limit}"
    return text


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--law", choices=LAWS, default="plumbline")
    parser.add_argument("--rows", nargs="*", default=[], help="only rows whose names contain one of these")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--json", type=Path, help="every figure of every flight goes here")
    options = parser.parse_args()
    rows = [row for row in ROWS if not options.rows or any(word in row.name for word in options.rows)]
    if not rows:
        parser.error(f"no such row; they are: {', '.join(row.name for row in ROWS)}")
    results: dict[str, Any] = {}
    missed = 0
    start_s = time.perf_counter()
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        for row in rows:
            flights = pool.starmap(
                fly_row, [(row, options.law, seed) for seed in range(1, options.seeds + 1)], chunksize=1
            )
            missed += not is_met(row, flights)
            results[row.name] = [vars(flight) for flight in flights]
            print(result_line(row, flights), flush=True)
    print(f"{len(rows)} rows, {options.seeds} seeds, {time.perf_counter() - start_s:.0f} s")
    if options.json:
        options.json.write_text(json.dumps(results, indent=1))
    sys.exit(missed > 0)


if __name__ == "__main__":
    main()
