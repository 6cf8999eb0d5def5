"""A custom law in the real autopilot, over UDP."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import plumbline
from gcs.errors import EXIT_DONE, EXIT_NOT_MET

pytestmark = pytest.mark.processes
FAILS = """
import time
from plumbline.examples.load_pid import LoadPid

class Fails(LoadPid):
    def load_position(self, memory, now):
        if now.time_s > 3.0:
            FAULT
        return super().load_position(memory, now)
"""
FAULTS = {
    "raise SystemExit(0)": "Law Fails failed: SystemExit: 0 (mine.py:8); landing by law plumbline",
    "time.sleep(600.0)": (
        "Law Fails failed: TooSlow: no answer within 5 s: an endless loop, or too much work for one call "
        "(mine.py:8); landing by law plumbline"
    ),
}


def flown(folder: Path, law: str) -> subprocess.CompletedProcess[str]:
    words = ["fly", "hover", "--law", law, "--json", "--out", "out"]
    command = [sys.executable, "-m", "gcs", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=folder, check=False)


def test_a_flight_leaves_the_bytes_of_one_in_this_process(tmp_path: Path) -> None:
    law = "plumbline.examples.load_pid:LoadPid"
    result = flown(tmp_path, law)
    assert result.returncode == EXIT_DONE, result.stderr
    record = json.loads(result.stdout)
    assert (record["law"], record["outcome"]) == ("LoadPid", "completed")
    assert (tmp_path / "out" / "flight.tlog").read_bytes() == plumbline.fly("hover", law=law, quiet=True).tlog


@pytest.mark.parametrize("fault", FAULTS)
def test_one_that_fails_is_told_and_the_report_is_made(tmp_path: Path, fault: str) -> None:
    (tmp_path / "mine.py").write_text(FAILS.replace("FAULT", fault))
    result = flown(tmp_path, "mine.py:Fails")
    assert result.returncode == EXIT_NOT_MET, result.stderr
    record = json.loads(result.stdout)
    assert (record["law"], record["outcome"]) == ("Fails", "diverged")
    assert FAULTS[fault] in result.stderr
    assert (tmp_path / "out" / "report.html").is_file()


def test_the_autopilot_tells_what_is_no_law(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "autopilot", "--law", "nofile.py:Mine", "--storage", str(tmp_path)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert result.returncode == 2
    assert result.stderr.strip() == "autopilot: --law nofile.py: no such file"
