"""Real flights of a load on a cable: errors of its prediction, and of its estimate without a tracker.

    python benchmarks/real_flights.py FOLDER [--columns MAP] [--out FILE.json]

FOLDER holds recordings (`*.csv`, `*.csv.gz`); without it the environment variable PLUMBLINE_REAL_FLIGHTS
names it. The parameters are the same for all flights, those of the column map
(`gcs/recorded/maps/motion-capture.toml`); docs/real-flights.md says where the recordings come from and how
the parameters were found. The cable length is identified separately for each flight.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from gcs.recorded.column_map import ColumnMap, MapError, load_map
from gcs.recorded.estimates import filter_rows, filtered_estimates
from gcs.recorded.identification import identify_load, tracked_length
from gcs.recorded.motion import distances, motion_of
from gcs.recorded.recording import RecordingError, read_recording
from gcs.recorded.scoring import Score, score_ahead, score_pose_alone

COLUMNS = (
    "flight",
    "rows",
    "2 s ahead",
    "5 s ahead",
    "pose alone",
    "inside 95 %",
    "tracked length",
    "by prediction",
)


def score_flight(path: Path, columns: ColumnMap) -> tuple[dict[str, Any], tuple[Score, ...]]:
    """The figures of one flight, and the scores from which they are computed."""
    motion = motion_of(read_recording(path, columns), columns)
    model = columns.load_model(float(np.nanmedian(distances(motion))))
    rows = filter_rows(motion, model)
    by_load = filtered_estimates(rows, model, load=True, tilt=True)
    by_pose = filtered_estimates(rows, model, load=False, tilt=True, smoothed=True)
    scores = (*score_ahead(motion, rows, model, by_load), score_pose_alone(motion, model, by_pose))
    swing = next(one for one in identify_load(motion, model, ("length_m",)) if one.name == "length_m")
    tracked = tracked_length(motion, columns.attachment.below_m)
    below = columns.attachment.below_m
    return {
        "flight": path.name,
        "rows": len(motion.time_s),
        **_figures(scores),
        "tracked_length_m": [tracked.value, tracked.half_width],
        "predicted_length_m": [swing.value + below, swing.half_width],
    }, scores


def _figures(scores: tuple[Score, ...]) -> dict[str, float]:
    two, five, alone = scores
    return {
        "ahead_2s_m": two.median_m,
        "ahead_5s_m": five.median_m,
        "pose_alone_m": alone.median_m,
        "ahead_2s_inside": two.inside,
        "ahead_5s_inside": five.inside,
        "pose_alone_inside": alone.inside,
    }


def combined(scores: list[tuple[Score, ...]]) -> dict[str, float]:
    """The figures of all windows of all flights."""
    return _figures(
        tuple(Score(*map(np.concatenate, zip(*each, strict=True))) for each in zip(*scores, strict=True))
    )


def line(row: dict[str, Any]) -> list[str]:
    """A row of the table."""
    lengths = [
        f"{v:.3f} +- {h:.3f} m"
        for v, h in (row[k] for k in ("tracked_length_m", "predicted_length_m") if k in row)
    ]
    return [
        row["flight"],
        str(row["rows"]),
        *(f"{1e3 * row[key]:.1f} mm" for key in ("ahead_2s_m", "ahead_5s_m", "pose_alone_m")),
        f"{100 * row['pose_alone_inside']:.1f} %",
        *(lengths or ["", ""]),
    ]


def main() -> None:
    """Score every recording of the folder."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", default=os.environ.get("PLUMBLINE_REAL_FLIGHTS"), type=Path)
    parser.add_argument("--columns", default="motion-capture", help="column map: a shipped name or a file")
    parser.add_argument("--out", type=Path, help="write the figures as JSON too")
    options = parser.parse_args()
    if options.folder is None:
        parser.error("name a folder with recordings, or set PLUMBLINE_REAL_FLIGHTS")
    paths = sorted([*options.folder.glob("*.csv.gz"), *options.folder.glob("*.csv")])
    if not paths:
        sys.exit(f"{options.folder}: holds no recordings (*.csv, *.csv.gz)")
    table, scores = [], []
    print("| " + " | ".join(COLUMNS) + " |\n|" + "---|" * len(COLUMNS))
    try:
        columns = load_map(options.columns)
        for path in paths:
            row, found = score_flight(path, columns)
            table.append(row)
            scores.append(found)
            print("| " + " | ".join(line(row)) + " |", flush=True)
    except (MapError, RecordingError) as error:
        sys.exit(str(error))
    whole = {"flight": "all", "rows": sum(row["rows"] for row in table), **combined(scores)}
    print("| " + " | ".join(line(whole)) + " |")
    if options.out:
        options.out.write_text(
            json.dumps({"flights": table, "all": whole}, indent=1) + "\n", encoding="utf-8"
        )


if __name__ == "__main__":
    main()
