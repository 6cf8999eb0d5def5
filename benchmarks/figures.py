"""Flies anew the figures that README and docs/control.md state, and writes docs/figures.json.

    python benchmarks/figures.py [--seeds 20] [--flights 10000] [--jobs 2]

The figures are those of `fit_to_fly.py`, from telemetry, worst over the seeds; the same with realistic
sensors and vehicles in a lab and outdoors, over the completed flights; and those of one sweep of Case B over
many seeds. `tests/documentation/test_figures.py` writes them into the pages, and fails if a page states
anything else. `make figures` does both.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from fit_to_fly import ROWS, Row, fly_row

DOCS = Path(__file__).resolve().parents[1] / "docs"
RECORD = DOCS / "figures.json"
BASIC = (
    Row("B lab", "case-b", {}),
    Row("B lab, wind 4", "case-b", {}, settings={"SIM_WIND_E": 4.0}),
    Row("B lab, wind 8", "case-b", {}, settings={"SIM_WIND_E": 8.0}),
    Row("B lab, law thesis", "case-b", {}, settings={"CTL_LAW": 0.0}),
)
REAL_LAB, REAL_FIELD = ("lab-real", "bebop-real"), ("field", "bebop-real")
HEAVY_FIELD = ("field", "heavy-real")
WINDY = {"SIM_ACT_DELAY_MS": 0.0, "SIM_WIND_E": 5.0, "SIM_GUST_STD": 1.0}
DELAY = {"SIM_ACT_DELAY_MS": 12.0}
STEP = {"rise_time_90_s": 0.0, "overshoot_pct": 0.0, "settling_time_5pct_s": 0.0}


def _real(
    name: str, mission: str, limits: dict[str, float], sensors_and_vehicle: tuple[str, str], **settings: float
) -> Row:
    sensors, vehicle = sensors_and_vehicle
    return Row(f"{name}, real", mission, limits, sensors, {**DELAY, **settings}, vehicle)


REAL = (
    _real("B lab 12/30 ms", "case-b", {}, REAL_LAB),
    _real("B lab 72 ms", "case-b", {}, REAL_LAB, SIM_ACT_DELAY_MS=72.0),
    _real("C lab 12/30 ms", "case-c", {}, REAL_LAB),
    _real("C lab load -50 %", "case-c", {}, REAL_LAB, SIM_LOAD_MASS=0.05),
    _real("C lab load +50 %", "case-c", {}, REAL_LAB, SIM_LOAD_MASS=0.15),
    _real("B rtk", "case-b", {}, REAL_FIELD),
    _real("C rtk", "case-c", {}, REAL_FIELD),
    _real("B field heavy", "case-b", {}, HEAVY_FIELD, **WINDY),
    _real("C field heavy", "case-c", {}, HEAVY_FIELD, **WINDY),
    _real("gust lab", "hover", {}, REAL_LAB, SIM_GUST_E=5.0, SIM_GUST_AT_S=18.0, SIM_GUST_FOR_S=2.0),
    _real("A lab", "case-a", STEP, REAL_LAB),
)


def worst(row: Row, seeds: int, pool: multiprocessing.pool.Pool) -> dict[str, float]:
    """The worst of each figure over the seeds, and how many flights were lost; outside REAL a lost flight
    ends the program."""
    flights = pool.starmap(fly_row, [(row, "plumbline", seed) for seed in range(1, seeds + 1)], chunksize=1)
    lost = [flight for flight in flights if flight.outcome != "completed"]
    if lost and row not in REAL:
        sys.exit(f"{row.name}: {len(lost)} of {seeds} not completed ({lost[0].reason})")
    completed = [flight.figures for flight in flights if flight.outcome == "completed"]
    found: dict[str, float] = {"lost": len(lost)} if lost else {}
    for name in completed[0] if completed else ():
        values = [figures[name] for figures in completed]
        if not any(value is None for value in values):
            found[name] = max(value for value in values if value is not None)
    return found


def sweep_quantiles(flights: int) -> dict[str, float]:
    """Case B with motion capture, one seed per flight: how many completed, and quantiles of their errors."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "gcs", "sweep", "case-b", "--seeds", str(flights), "--out", folder]
        subprocess.run(command, check=True)
        table = pq.read_table(Path(folder) / "flights.parquet").to_pydict()
    errors = np.array(table["load_error_max_m"])
    found = {f"error_{share:g}": float(np.quantile(errors, 0.01 * share)) for share in (50, 99, 99.9, 100)}
    found = {name: float(f"{value:.4g}") for name, value in found.items()}
    return {"flights": flights, "completed": table["outcome"].count("completed"), **found}


def main() -> None:
    """Fly, and write the record."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--flights", type=int, default=10_000)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--rows", nargs="+", metavar="NAME", help="fly these alone, and keep the rest")
    options = parser.parse_args()
    rows = [row for row in (*BASIC, *ROWS, *REAL) if options.rows is None or row.name in options.rows]
    stored = json.loads(RECORD.read_text(encoding="utf-8")) if options.rows is not None else {"rows": {}}
    record: dict[str, dict[str, float]] = stored["rows"]
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        for row in rows:
            found = worst(row, options.seeds, pool)
            record[row.name] = {name: float(f"{value:.4g}") for name, value in found.items()}
            print(row.name, record[row.name], flush=True)
    record_file = {
        "seeds": options.seeds,
        "rows": record,
        "sweep": stored.get("sweep") or sweep_quantiles(options.flights),
    }
    RECORD.write_text(json.dumps(record_file, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
