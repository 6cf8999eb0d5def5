"""Two vehicles at one port: one of them is heard and answered, the other is named."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from autopilot.wire.codec import FrameWriter
from autopilot.wire.dialect import plumbline as mavlink
from gcs.errors import GcsError
from gcs.shell import vehicle_socket
from gcs.shell.link import Address, UdpSocket, free_port, parse_address, wait
from gcs.shell.session import Session
from gcs.shell.vehicle_socket import REPLACEMENT_US, VehicleSocket

WAIT_S = 5.0


def heartbeat(
    kind: int = mavlink.MAV_AUTOPILOT_PX4, of: int = mavlink.MAV_TYPE_QUADROTOR, system: int = 1
) -> bytes:
    return FrameWriter(system, 1).frame(mavlink.MAVLink_heartbeat_message(of, kind, 0, 0, 0, 3))


def telemetry() -> bytes:
    return FrameWriter(1, 1).frame(mavlink.MAVLink_attitude_message(0, 0, 0, 0, 0, 0, 0))


class Clock:
    """The clock of the ground station, in us."""

    def __init__(self) -> None:
        self.now_us = 0

    def __call__(self) -> int:
        return self.now_us


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    ours = Clock()
    monkeypatch.setattr(vehicle_socket, "monotonic_us", ours)
    return ours


@pytest.fixture
def address() -> Address:
    return parse_address(str(free_port()))


@pytest.fixture
def ground(address: Address) -> Iterator[VehicleSocket]:
    ours = VehicleSocket(address)
    yield ours
    ours.close()


@pytest.fixture
def two(address: Address) -> Iterator[tuple[UdpSocket, UdpSocket]]:
    both = UdpSocket(peer=(address.host, address.port)), UdpSocket(peer=(address.host, address.port))
    yield both
    for one in both:
        one.close()


def heard(ground: VehicleSocket, sender: UdpSocket, *datagrams: bytes) -> list[bytes]:
    found: list[bytes] = []
    for datagram in datagrams:
        sender.send(datagram)
        wait([ground], WAIT_S)
        assert ground.has_datagram
        found += ground.drain()
    return found


def test_of_two_vehicles_the_first_is_heard_and_answered(
    ground: VehicleSocket, two: tuple[UdpSocket, UdpSocket], clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = two
    assert heard(ground, first, heartbeat(), b"first") == [heartbeat(), b"first"]
    assert heard(ground, second, heartbeat(), b"second") == []
    assert not capsys.readouterr().err, "it may be the first one, started again"
    assert heard(ground, first, b"goes on", b"and on") == [b"goes on", b"and on"]
    assert capsys.readouterr().err.count(f"from {second.address} and is not heard") == 1
    ground.send(b"answer")
    wait([first], WAIT_S)
    assert first.drain() == [b"answer"]
    assert not second.has_datagram


def test_a_twin_is_no_choice_and_is_no_trouble_after_it_has_fallen_silent(
    ground: VehicleSocket, two: tuple[UdpSocket, UdpSocket], clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = two
    heard(ground, second, telemetry())
    heard(ground, first, heartbeat())
    assert "two vehicles with system id 1 speak on UDP 127.0.0.1:" in ground.twin_problem
    assert f"from {first.address} and {second.address}" in ground.twin_problem
    clock.now_us = REPLACEMENT_US
    assert not ground.twin_problem
    heard(ground, first, telemetry())
    assert "give one another id (MAV_SYS_ID), or give each a port" in capsys.readouterr().err
    heard(ground, second, telemetry())
    assert ground.twin_problem


def test_a_vehicle_with_another_id_is_no_twin(
    ground: VehicleSocket, two: tuple[UdpSocket, UdpSocket], clock: Clock
) -> None:
    first, second = two
    heard(ground, first, heartbeat())
    heard(ground, second, heartbeat(system=2))
    heard(ground, first, telemetry())
    assert not ground.twin_problem


def test_a_script_is_told_of_other_vehicles_by_its_own_means(
    address: Address, two: tuple[UdpSocket, UdpSocket], capsys: pytest.CaptureFixture[str]
) -> None:
    told: list[str] = []
    with Session(address, note=told.append, quiet=True) as session:
        for sender, datagram in ((two[0], heartbeat()), (two[1], heartbeat()), (two[0], telemetry())):
            sender.send(datagram)
        assert session.watch(lambda: bool(told), WAIT_S)
    assert f"from {two[1].address} and is not heard" in told[0]
    assert not capsys.readouterr().err


def test_what_moves_one_of_two_twins_is_refused(address: Address, two: tuple[UdpSocket, UdpSocket]) -> None:
    with Session(address) as session:
        for one in two:
            one.send(heartbeat())
        with pytest.raises(GcsError, match="two vehicles with system id 1 speak on UDP"):
            session.find_to_command()


def test_another_autopilot_is_named_by_any_message_of_it(
    ground: VehicleSocket, two: tuple[UdpSocket, UdpSocket], clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its heartbeat may come only after the first vehicle has done what was requested."""
    first, second = two
    heard(ground, second, telemetry())
    heard(ground, first, heartbeat())
    heard(ground, first, telemetry())
    told = capsys.readouterr().err
    assert f"from {second.address} and is not heard, nor does it hear what is said to {first.address}" in told
    assert heard(ground, second, telemetry()) == []


def test_an_autopilot_that_begins_to_speak_is_named_by_its_first_message(
    ground: VehicleSocket, two: tuple[UdpSocket, UdpSocket], clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = two
    heard(ground, first, heartbeat())
    assert heard(ground, second, telemetry()) == []
    heard(ground, first, telemetry())
    assert f"from {second.address} and is not heard" in capsys.readouterr().err


def test_a_vehicle_that_starts_again_is_heard_at_its_new_port(
    ground: VehicleSocket, two: tuple[UdpSocket, UdpSocket], clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    before, after = two
    heard(ground, before, heartbeat())
    clock.now_us = REPLACEMENT_US - 1
    assert heard(ground, after, heartbeat()) == []
    clock.now_us = REPLACEMENT_US
    assert heard(ground, after, heartbeat(), b"here") == [heartbeat(), b"here"]
    ground.send(b"answer")
    wait([after], WAIT_S)
    assert after.drain() == [b"answer"]
    assert not capsys.readouterr().err


def test_who_is_no_vehicle_is_heard_beside_it(
    ground: VehicleSocket, two: tuple[UdpSocket, UdpSocket], clock: Clock
) -> None:
    vehicle, companion = two
    word = heartbeat(mavlink.MAV_AUTOPILOT_INVALID, mavlink.MAV_TYPE_ONBOARD_CONTROLLER)
    heard(ground, vehicle, heartbeat())
    assert heard(ground, companion, word) == [word]
    ground.send(b"answer")
    wait([vehicle], WAIT_S)
    assert vehicle.drain() == [b"answer"]


def test_the_vehicle_that_is_chosen_is_heard_and_answered_though_another_speaks_first(
    address: Address, two: tuple[UdpSocket, UdpSocket], clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    ground = VehicleSocket(replace(address, system=2))
    first, second = two
    assert heard(ground, first, heartbeat(), telemetry()) == []
    chosen = heartbeat(system=2)
    assert heard(ground, second, chosen, b"more") == [chosen, b"more"]
    clock.now_us = 2 * REPLACEMENT_US
    assert heard(ground, first, heartbeat()) == [], "a silent vehicle is not replaced by another one"
    assert heard(ground, second, chosen) == [chosen]
    ground.send(b"answer")
    wait([second], WAIT_S)
    assert second.drain() == [b"answer"]
    assert ground.other_systems == [1]
    assert not capsys.readouterr().err, "the user knows of the others"
    ground.close()
