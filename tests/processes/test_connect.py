"""A script commands a vehicle that was started by hand."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import pytest

import plumbline
from autopilot.wire.codec import FrameWriter
from autopilot.wire.dialect import plumbline as mavlink
from gcs.shell.link import UdpSocket, free_port
from plumbline import Land, Mission, Takeoff, Waypoint
from tests.doubles.pages import ROOT, split
from tests.doubles.ports import ground_port

pytestmark = pytest.mark.processes

OUT_AND_DOWN = Mission("out", [Takeoff(0.8), Waypoint(0.5, 0.0, 0.8), Land()])
PATIENCE_S = 60.0  # the machine may be busy: its speed is not what is tested


def test_the_script_of_docs_python_md_flies(start: Callable[..., Any]) -> None:
    (script,) = (block.text for block in split(ROOT / "docs" / "python.md")[0] if block.mark == "run by")
    usual = "udpin:127.0.0.1:14550"
    assert usual in script
    port, _ = running(start)
    exec(compile(script.replace(usual, f"udpin:{port}"), "docs/python.md", "exec"), {})


def running(start: Callable[..., Any]) -> tuple[str, Any]:
    """Start a simulator and an autopilot on free ports, and wait until it flies; return its address and the
    autopilot."""
    ports = free_port(), free_port(), ground_port()
    simulator, truth, port = (f"127.0.0.1:{port}" for port in ports)
    start("sitl", "--listen", simulator, "--truth", truth, "--speed", "20", "--sensors", "ideal")
    words = ("--sim", simulator, "--gcs", port, "--api", "none", "--storage", "storage")
    autopilot = start("autopilot", *words)
    autopilot.says(b"flying with the simulator")
    return port, autopilot


def test_the_truth_of_another_simulator_is_refused(start: Callable[..., Any], tmp_path: Path) -> None:
    port, _ = running(start)
    at = free_port()
    boot = mavlink.MAVLink_sim_boot_message(0, 1, [0.0] * 4, 0.0, 0, 0)
    status = mavlink.MAVLink_sim_status_message(0, 1.0, 111.0, 0, 0, 0, 0, 1, 1)
    OUT_AND_DOWN.save(tmp_path / "out.toml")
    words = ("out.toml", "--connect", port, "--truth", str(at), "--out", "out", "--quiet")
    flight = start("gcs", "fly", *words)
    with closing(UdpSocket()) as other:
        while flight.process.poll() is None:
            other.send_to(b"".join(map(FrameWriter(1, 27).frame, (boot, status))), ("127.0.0.1", at))
            with suppress(subprocess.TimeoutExpired):
                flight.process.wait(0.05)
    assert flight.process.returncode == 0, flight.log.read_text()
    refused = f"the truth at UDP 127.0.0.1:{at} is refused: it comes from another simulator; --truth PORT"
    assert f"the report will not contain the simulator's truth: {refused}" in flight.log.read_text()
    record = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (record["outcome"], record["rate_hz"], record["load_error_max_m"]) == ("completed", None, None)
    assert refused in (tmp_path / "out" / "report.html").read_text()


def test_a_script_leads_a_vehicle_from_the_ground_to_the_ground(start: Callable[..., Any]) -> None:
    port, _ = running(start)
    with plumbline.connect(f"udpin:{port}", timeout_s=PATIENCE_S) as vehicle:
        with pytest.raises(plumbline.Error, match=r"takeoff: the vehicle is not armed; arm\(\) first"):
            vehicle.takeoff(1.0)
        vehicle.arm()
        assert vehicle.state.armed and repr(vehicle).endswith("armed>")

        vehicle.takeoff(1.0)
        assert vehicle.state.load_m == pytest.approx((0.0, 0.0, 1.0), abs=0.1)
        vehicle.goto(1.0, -0.5, 2.0)
        assert vehicle.state.load_m == pytest.approx((1.0, -0.5, 2.0), abs=0.15)
        before_m = vehicle.state.cable_length_m
        with pytest.raises(plumbline.Error, match=r"Winch denied: .*; must be 0.01 \.\.\."):
            vehicle.winch(0.2, speed_m_s=9.0)
        vehicle.winch(0.2)
        assert before_m is not None and vehicle.state.cable_length_m == pytest.approx(
            before_m + 0.2, abs=0.02
        )
        assert vehicle.state.load_m == pytest.approx((1.0, -0.5, 1.8), abs=0.15)
        began_s = vehicle.state.time_s
        after_s = vehicle.wait(1.5).time_s
        assert began_s is not None and after_s is not None and after_s - began_s > 1.4

        with pytest.raises(plumbline.Error, match=r"^Disarming denied: in the air"):
            vehicle.disarm()
        with pytest.raises(plumbline.Error, match=r"not within 0\.5 s of the vehicle's clock"):
            vehicle.wait("landed", timeout_s=0.5)
        with pytest.raises(plumbline.Error, match="waiting for 'mission complete': the vehicle was disarmed"):
            vehicle.mode("land")
            vehicle.wait("mission complete")
        assert "Landed, disarmed" in vehicle.texts

        vehicle.release()
        vehicle.grab()
        vehicle.wait(lambda _: vehicle.texts[-2:] == ["Load released", "Load taken"])

        vehicle.set_parameter("mis_speed", 1.25)
        assert vehicle.parameter("MIS_SPEED") == 1.25
        vehicle.upload(OUT_AND_DOWN)
        vehicle.arm()
        vehicle.start()
        assert vehicle.wait(lambda state: state.mission_item == 1).mission_items == 3
        vehicle.pause()
        assert (vehicle.state.mode, vehicle.state.phase) == ("hold", "hold")
        rests = vehicle.wait("holding")
        assert rests.phase == "hold" and rests.load_speed_m_s == pytest.approx(0.0, abs=0.01)
        vehicle.resume()
        ended = vehicle.wait()
        assert (ended.mission, ended.phase, ended.landed) == ("complete", "disarmed", "on the ground")
        assert vehicle.state.load_m == pytest.approx((0.5, 0.0, 0.02), abs=0.1)


def test_a_vehicle_that_falls_silent_is_told(start: Callable[..., Any]) -> None:
    port, autopilot = running(start)
    with plumbline.connect(f"udpin:{port}", timeout_s=PATIENCE_S) as vehicle:
        vehicle.wait("ready")
    with plumbline.connect(f"udpin:{port}", timeout_s=4.0) as vehicle:
        autopilot.stop()
        with pytest.raises(plumbline.Error, match="the vehicle fell silent for 4 s"):
            vehicle.wait(lambda state: False, timeout_s=1e9)
        with pytest.raises(plumbline.Error, match="the vehicle fell silent"):
            vehicle.arm(force=True)
