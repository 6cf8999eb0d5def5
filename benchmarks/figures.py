"""The figures that README and docs/control.md state, flown anew: docs/figures.json.

    python benchmarks/figures.py [--seeds 20] [--flights 10000] [--jobs 2]

Figures are those of `fit_to_fly.py`: worst of the seeds, from telemetry; and of one sweep of Case B over many
seeds. `tests/documentation/test_figures.py` puts them into the pages, and fails where a page says anything
else. `make figures` does both.
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
from fit_to_fly import ROWS, Row, flown

DOCS = Path(__file__).resolve().parents[1] / "docs"
RECORD = DOCS / "figures.json"
PLAIN = (
    Row("B lab", "case-b", {}),
    Row("B lab, wind 4", "case-b", {}, settings={"SIM_WIND_E": 4.0}),
    Row("B lab, wind 8", "case-b", {}, settings={"SIM_WIND_E": 8.0}),
    Row("B lab, law thesis", "case-b", {}, settings={"CTL_LAW": 0.0}),
)


def worst(row: Row, seeds: int, pool: multiprocessing.pool.Pool) -> dict[str, float]:
    """The worst of each figure over the seeds; a flight that was not completed ends the program."""
    flights = pool.starmap(flown, [(row, "plumbline", seed) for seed in range(1, seeds + 1)], chunksize=1)
    lost = [flight for flight in flights if flight.outcome != "completed"]
    if lost:
        sys.exit(f"{row.name}: {len(lost)} of {seeds} not completed ({lost[0].reason})")
    names = [name for name, value in flights[0].figures.items() if value is not None]
    return {name: max(flight.figures[name] or 0.0 for flight in flights) for name in names}


def many(flights: int) -> dict[str, float]:
    """Case B with motion capture, a seed a flight: how many completed, and their greatest load errors."""
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
    options = parser.parse_args()
    record: dict[str, dict[str, float]] = {}
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        for row in (*PLAIN, *ROWS):
            found = worst(row, options.seeds, pool)
            record[row.name] = {name: float(f"{value:.4g}") for name, value in found.items()}
            print(row.name, record[row.name], flush=True)
    made = {"seeds": options.seeds, "rows": record, "sweep": many(options.flights)}
    RECORD.write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
