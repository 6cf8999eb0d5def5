"""The wait for a vehicle that does not send yet."""

from __future__ import annotations

import socket

import pytest

from autopilot.wire.codec import FrameWriter
from autopilot.wire.dialect import plumbline as mavlink
from gcs.errors import NoVehicleError
from gcs.shell import session as session_module
from gcs.shell.link import free_port, parse_address
from gcs.shell.session import Session
from gcs.shell.stopping import StopRequest

HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, 29, 0x03040000, 3, 3)


class StopOrVehicle(StopRequest):
    """Once the wait has been told of: the vehicle sends its first heartbeat, or the user stops."""

    def __init__(self, told: list[str], port: int, stops: bool) -> None:
        super().__init__("stopping")
        self._told, self._port, self._stops = told, port, stops

    def __bool__(self) -> bool:
        if self._told and not self._stops:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
                vehicle.sendto(FrameWriter(7, 1).frame(HEARTBEAT), ("127.0.0.1", self._port))
        return bool(self._told) and self._stops


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is printed."""
    lines: list[str] = []
    monkeypatch.setattr(session_module, "FIND_S", 0.05)
    monkeypatch.setattr(session_module, "notify", lines.append)
    return lines


def test_a_flight_waits_until_its_vehicle_sends_and_says_for_what(told: list[str]) -> None:
    port = free_port()
    with Session(parse_address(str(port))) as session:
        assert session.find(StopOrVehicle(told, port, stops=False)).system == 7
    assert len(told) == 1
    assert told[0].startswith(f"no vehicle heard on UDP 127.0.0.1:{port} within 0.05 s; is autopilot running")
    assert told[0].endswith("; waiting for it, Ctrl-C ends this")


def test_the_wait_ends_with_a_stop(told: list[str]) -> None:
    port = free_port()
    with Session(parse_address(str(port))) as session, pytest.raises(KeyboardInterrupt):
        session.find(StopOrVehicle(told, port, stops=True))
    assert len(told) == 1


def test_a_command_does_not_wait(told: list[str]) -> None:
    with Session(parse_address(str(free_port()))) as session, pytest.raises(NoVehicleError):
        session.find()
    assert told == []
