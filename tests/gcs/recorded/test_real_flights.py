"""The recordings that docs/real-flights.md names, in the folder that PLUMBLINE_REAL_FLIGHTS names."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
FOLDER = os.environ.get("PLUMBLINE_REAL_FLIGHTS")


@pytest.mark.skipif(not FOLDER, reason="PLUMBLINE_REAL_FLIGHTS names no folder with recorded flights")
def test_real_flights_are_predicted_and_seen_from_the_vehicle(tmp_path: Path) -> None:
    out = tmp_path / "figures.json"
    program = ROOT / "benchmarks" / "real_flights.py"
    subprocess.run([sys.executable, str(program), str(FOLDER), "--out", str(out)], check=True, cwd=ROOT)
    figures = json.loads(out.read_text(encoding="utf-8"))
    whole = figures["all"]
    assert whole["ahead_2s_m"] < 0.040
    assert whole["ahead_5s_m"] < 0.080
    assert whole["pose_alone_m"] < 0.050
    assert 0.90 < whole["pose_alone_inside"] < 0.98
    for flight in figures["flights"]:
        assert flight["tracked_length_m"][0] == pytest.approx(3.158, rel=0.01)
        assert flight["predicted_length_m"][0] == pytest.approx(3.158, rel=0.01)
