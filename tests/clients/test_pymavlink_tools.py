"""The programs that come with pymavlink, as docs/tools.md starts them, with the log of one of our flights."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.tlog import read_tlog

pytestmark = [pytest.mark.processes, pytest.mark.xdist_group("tools")]  # they share a flight
FAST = Path(__file__).with_name("fast.toml")
MOST_LOST_PERCENT = 0.5
COUNTED_M_S = 3.0  # mavflighttime's own threshold
FLOAT32_REL = 1e-6
SHOWN = 5e-7  # six decimals
OURS = {kind.msgname for number, kind in m.mavlink_map.items() if 60100 <= number < 60200}


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory of a finished flight."""
    out = tmp_path_factory.mktemp("flown") / "out"
    command = [sys.executable, "-m", "gcs", "fly", str(FAST), "--out", str(out), "--quiet"]
    flown = subprocess.run(command, capture_output=True, text=True, timeout=300.0, check=False)
    assert flown.returncode == 0, flown.stderr
    return out


def tool(name: str, *arguments: str, cwd: Path) -> str:
    """The output of a tool, which must end without an error."""
    command = [sys.executable, str(Path(sys.executable).with_name(f"{name}.py")), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120.0, cwd=cwd, check=False)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stdout[-500:] + done.stderr
    return done.stdout


def test_mavloss_finds_nothing_lost(flight: Path) -> None:
    said = tool("mavloss", "flight.tlog", cwd=flight)
    rows = re.findall(r"^ +(\d+) +(\d+) +(\d+) +(\d+) +([\d.]+)%$", said, re.MULTILINE)
    sources = {(int(system), int(component)) for system, component, *_ in rows}
    assert sources == {(1, 1), (1, 26), (1, 169), (255, 190)}
    assert max(float(percent) for *_, percent in rows) < MOST_LOST_PERCENT


def test_mavparms_prints_every_parameter(flight: Path) -> None:
    said = dict(line.split() for line in tool("mavparms", "flight.tlog", cwd=flight).splitlines())
    table = autopilot_parameters(load_vehicle("bebop"))
    for name, value in table.values().items():
        assert float(said[name]) == pytest.approx(value, rel=FLOAT32_REL, abs=SHOWN), name
    assert {"SIM_WIND_E", "SIM_LOSS_PCT"} <= said.keys()


def test_mavflighttime_counts_the_fast_part_of_the_flight(flight: Path) -> None:
    said = tool("mavflighttime", "flight.tlog", cwd=flight)
    (minutes, seconds) = re.findall(r"^Total time in air: (\d+):(\d+)$", said, re.MULTILINE)[0]
    (metres,) = re.findall(r"^Total distance travelled: ([\d.]+) meters$", said, re.MULTILINE)
    truth = [
        one.message
        for _, one in read_tlog(flight / "flight.tlog")
        if one.id == m.MAVLINK_MSG_ID_HIL_STATE_QUATERNION
    ]
    times_s = np.array([state.time_usec * 1e-6 for state in truth])
    speeds = np.array([np.hypot(state.vx, state.vy) * 0.01 for state in truth])
    fast_s = float(np.diff(times_s)[speeds[1:] > COUNTED_M_S].sum())
    assert fast_s > 4.0
    # it counts in whole seconds, on the way out and back
    assert 60 * int(minutes) + int(seconds) == pytest.approx(fast_s, abs=2.0)
    assert float(metres) == pytest.approx(48.0, abs=2.0)


def test_mavtomfile_writes_all_of_the_log_for_common_tools(flight: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "gcs", "report", str(flight), "--out", str(tmp_path), "--common-tlog"]
    subprocess.run(command, capture_output=True, timeout=120.0, check=True)
    tool("mavtomfile", "flight.common.tlog", cwd=tmp_path)
    written = (tmp_path / "flight_common.m").read_text()
    counts: dict[str, int] = {}
    for _, one in read_tlog(tmp_path / "flight.common.tlog"):
        name = one.message.get_type()
        counts[name] = counts.get(name, 0) + 1
    assert counts.keys() == {one.message.get_type() for _, one in read_tlog(flight / "flight.tlog")} - OURS
    for name, count in counts.items():
        assert f"{name}.columns = {{'timestamp'" in written
        assert f"\n{name}.data({count},:) = [" in written
        assert f"\n{name}.data({count + 1},:) = [" not in written


def test_mavlogdump_prints_every_message(flight: Path) -> None:
    lines = tool("mavlogdump", "flight.tlog", cwd=flight).splitlines()
    assert len(lines) == sum(1 for _ in read_tlog(flight / "flight.tlog"))
    table = tool("mavlogdump", "--types", "GPS_RAW_INT", "--format", "csv", "flight.tlog", cwd=flight)
    assert table.splitlines()[0].startswith("timestamp,GPS_RAW_INT.time_usec,")


@pytest.mark.parametrize(
    ("name", "arguments", "says"),
    [
        ("mavsummarize", (), "Total time"),
        ("mavflightmodes", (), "MISSION"),
        ("mavgpslock", (), "Total time locked"),
        ("mavsensor_status_change", (), "+PREARM"),
        ("mavsigloss", (), "Processing log"),
        ("mavmission", (), "Saved 5 waypoints"),
        ("mavtogpx", (), "points"),
        ("mavsearch", ("--condition=STATUSTEXT",), "Cable taut, lifting the load"),
    ],
)
def test_the_others_say_what_they_say_of_other_logs(
    flight: Path, tmp_path: Path, name: str, arguments: tuple[str, ...], says: str
) -> None:
    shutil.copy(flight / "flight.tlog", tmp_path)
    assert says in tool(name, *arguments, "flight.tlog", cwd=tmp_path)


def test_messages_of_the_dialect_are_read_as_unknown_ones(flight: Path) -> None:
    said = tool("mavlogdump", "--types", "UNKNOWN_60101", "flight.tlog", cwd=flight)
    assert set(re.findall(r"UNKNOWN_\d+", said)) == {"UNKNOWN_60101"}
