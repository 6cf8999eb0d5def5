"""Flies the sweeps of docs/robustness.md, and renews the maps in docs/images/robustness and the record
docs/robustness.json, from which `tests/documentation/test_robustness.py` writes the text of the page.

    python benchmarks/robustness.py [--out DIR] [--docs DIR] [--only NAME ...] [--whole]

Each is a `gcs sweep` into its own directory below DIR. Flights that the same code has already flown are kept,
and after Ctrl-C the same command continues. `--whole` adds the sweep of 10 000 flights that varies all
parameters together.
"""

from __future__ import annotations

import argparse
import json
import shlex
import shutil
import statistics
import sys
from collections import Counter
from itertools import groupby
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from gcs.cli import gcs

ROOT = Path(__file__).resolve().parents[1]
RECORD = ROOT / "docs" / "robustness.json"
BOTH = "--law plumbline --law thesis"
NOISE = "--vary SIM_NOISE_SCALE=0.5,1,2,4,8"
DELAY = "--vary SIM_ACT_DELAY_MS=0:96:9"
# name: what is flown
SWEEPS = {
    "delay-noise": f"case-b {BOTH} --seeds 3 {DELAY} {NOISE}",
    "latency-noise": f"case-b {BOTH} --seeds 3 --vary SIM_SENS_LAT_MS=0:80:9 {NOISE}",
    "delay-lag": f"case-b {BOTH} --seeds 3 {DELAY} --vary SIM_ROTOR_TAU_MS=0,10,20,30,40,60",
    "long-delay": "case-b --seeds 10 --vary SIM_ACT_DELAY_MS=0:500:11",
    "long-latency": "case-b --seeds 10 --vary SIM_SENS_LAT_MS=0:500:11",
    "delay-unknown": "case-b --seeds 10 --set VEH_ACT_DELAY=40 --vary SIM_ACT_DELAY_MS=0:96:25",
    "mass-length": "case-c --seeds 3 --vary SIM_LOAD_MASS=0.025:0.25:10 --vary SIM_CABLE_LEN=0.6:0.8:9",
    "wind-gusts": "case-b --seeds 3 --vary SIM_WIND_E=0:10:11 --vary SIM_GUST_STD=0,0.5,1,2,3",
    "dropouts": f"case-b {BOTH} --seeds 10 --vary SIM_DROP_PCT=0:95:20",
}
ALL_TOGETHER = {
    "everything": (
        "case-b --sample 2000 --seeds 5 --vary SIM_ACT_DELAY_MS=0:40 --vary SIM_ROTOR_TAU_MS=0:40"
        " --vary SIM_SENS_LAT_MS=0:30 --vary SIM_NOISE_SCALE=0:4 --vary SIM_DROP_PCT=0:30"
        " --vary SIM_LOAD_MASS=0.05:0.15 --vary SIM_WIND_E=0:4 --vary SIM_GUST_STD=0:1"
    )
}


def cells(directory: Path, names: list[str]) -> list[dict[str, Any]]:
    """The results of each setting with each law: how many flights, how many of them completed with which
    errors (mm), and in which phases the others were lost."""
    rows = pq.read_table(directory / "flights.parquet").to_pylist()

    def setting(row: dict[str, Any]) -> tuple[Any, ...]:
        return (row["law"], *(row[name] for name in names))

    found = []
    for (law, *values), group in groupby(sorted(rows, key=setting), key=setting):
        flights = list(group)
        errors = [1e3 * row["load_error_max_m"] for row in flights if row["outcome"] == "completed"]
        lost = Counter(row["lost_phase"] for row in flights if row["outcome"] != "completed")
        found.append(
            {
                "law": law,
                **dict(zip(names, values, strict=True)),
                "flown": len(flights),
                "completed": len(errors),
                "median_mm": round(statistics.median(errors), 1) if errors else None,
                "worst_mm": round(max(errors), 1) if errors else None,
                "lost": dict(sorted(lost.items())),
            }
        )
    return found


def store_results(record: dict[str, list[dict[str, Any]]]) -> None:
    """Write the results into the record, a line for each cell."""
    stored = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.is_file() else {}
    parts = []
    for name, found in {**stored, **record}.items():
        lines = ",\n".join(f"  {json.dumps(cell)}" for cell in found)
        parts.append(f" {json.dumps(name)}: [\n{lines}\n ]")
    RECORD.write_text("{\n" + ",\n".join(parts) + "\n}\n", encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("sweeps/robustness"))
    parser.add_argument("--docs", type=Path, default=ROOT / "docs/images/robustness")
    parser.add_argument("--only", nargs="*", choices=[*SWEEPS, *ALL_TOGETHER])
    parser.add_argument("--whole", action="store_true")
    options = parser.parse_args()
    chosen = options.only or [*SWEEPS, *(ALL_TOGETHER if options.whole else ())]
    for name in chosen:
        arguments = shlex.split({**SWEEPS, **ALL_TOGETHER}[name])
        directory = options.out / name
        sys.argv = ["gcs", "sweep", *arguments, "--out", str(directory)]
        print(f"== {name}: {shlex.join(sys.argv)}", flush=True)
        try:
            gcs(sys.argv[1:], prog_name="gcs")
        except SystemExit as end:
            if end.code:
                return int(end.code)
        if name in SWEEPS:
            varied = [arguments[i + 1].split("=")[0] for i, word in enumerate(arguments) if word == "--vary"]
            store_results({name: cells(directory, varied)})
        options.docs.mkdir(parents=True, exist_ok=True)
        maps = sorted(directory.glob("map-*.png")) if name in SWEEPS else []
        for picture in maps or sorted(directory.glob("curve-*.png")):
            shutil.copy(picture, options.docs / f"{name}-{picture.name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
