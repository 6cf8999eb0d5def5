"""ArduPilot's JSON interface, against packets that ArduCopter 4.5 sent and its reader's rules."""

from __future__ import annotations

import re
import struct
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.hil import HilSimulator
from sitl.interfaces.ardupilot import RATE_HZ, Exchange, line, read_servo_packet, throttles

FIRST = bytes.fromhex("1a48b00400000000" + "e803" * 16)  # all its outputs off
LATER = bytes.fromhex("1a48b0049f0f0000" + "e803" * 4 + "0000" * 12)  # four motors, nothing else
WIDE = bytes.fromhex("8173b0049f0f0000" + "e803" * 4 + "0000" * 28)  # the same with SERVO_32_ENABLE
# how many numbers each key has; the firmware's reader looks for the key after the section, skips two
# characters and reads the numbers
REQUIRED = {"timestamp": 1, "gyro": 3, "accel_body": 3, "position": 3, "quaternion": 4, "velocity": 3}


def packet(number: int, pwm: int = 1000) -> bytes:
    return struct.pack("<HHI16H", 18458, 800, number, *(pwm,) * 4, *(0,) * 12)


def as_the_firmware_reads(answer: bytes) -> dict[str, tuple[float, ...]]:
    assert answer.startswith(b"\n") and answer.endswith(b"\n") and answer.count(b"\n") == 2
    text = answer.decode("ascii")
    found = {}
    for key, count in REQUIRED.items():
        rest = text[text.index(key) + len(key) + 2 :]
        assert rest[0] == "[" if count > 1 else rest[0].isdigit()
        numbers = re.match(r"\[?([^\]}\"]*)", rest)
        assert numbers
        found[key] = tuple(float(word) for word in numbers[1].strip(",").split(","))
        assert len(found[key]) == count
    return found


@pytest.fixture
def simulator() -> HilSimulator:
    return HilSimulator.build("iris", "ideal", 1, {"SIM_RATE_HZ": RATE_HZ})


def test_recorded_packets_are_read() -> None:
    first, later, wide = map(read_servo_packet, (FIRST, LATER, WIDE))
    assert first == (1200, 0, (1000,) * 16)
    assert later == (1200, 3999, (1000,) * 4 + (0,) * 12)
    assert wide == (1200, 3999, (1000,) * 4 + (0,) * 28)


def test_no_part_of_a_packet_and_no_other_magic_is_one() -> None:
    for whole in (FIRST, WIDE):
        for length in range(len(whole)):
            assert read_servo_packet(whole[:length]) is None
    assert read_servo_packet(FIRST + b"\0") is None
    assert read_servo_packet(b"\0\0" + FIRST[2:]) is None
    assert read_servo_packet(WIDE[:2] + FIRST[2:]) is None


@given(st.binary(max_size=100))
def test_rubbish_is_no_packet(datagram: bytes) -> None:
    read = read_servo_packet(datagram)
    assert read is None or (len(datagram) in (40, 72) and datagram[:2] in (FIRST[:2], WIDE[:2]))


@pytest.mark.parametrize(("us", "share"), [(0, 0.0), (999, 0.0), (1500, 0.5), (2000, 1.0), (65535, 1.0)])
def test_any_pulse_is_a_throttle(us: int, share: float) -> None:
    assert throttles((us,) * 16) == (share,) * 4


def test_the_answer_is_in_the_firmwares_axes() -> None:
    answer = line(
        1250, (0.1, 0.2, 0.3), (1.0, 2.0, 9.8), (10.0, 20.0, 30.0), (1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0)
    )
    read = as_the_firmware_reads(answer)
    assert read["gyro"] == (0.1, -0.2, -0.3)
    assert read["accel_body"] == (1.0, -2.0, -9.8)
    assert read["position"] == (20.0, 10.0, -30.0)
    assert read["velocity"] == (2.0, 1.0, -3.0)
    # the nose to the east is a heading of a right angle
    assert read["quaternion"] == pytest.approx((0.5**0.5, 0.0, 0.0, 0.5**0.5), abs=1e-8)
    assert b" " not in answer and b'"no_time_sync":1' in answer


def test_the_firmwares_clock_loses_no_microsecond() -> None:
    """The firmware cuts each difference of two times to whole microseconds: (uint64)(dt * 1e6)."""
    zero = (0.0, 0.0, 0.0)
    at = [
        as_the_firmware_reads(line(n * 1250, zero, zero, zero, zero, (1.0, 0.0, 0.0, 0.0)))["timestamp"][0]
        for n in (*range(2000), *range(2_000_000, 2_002_000))
    ]
    steps = {int((after - before) * 1e6) for before, after in pairwise(at)}
    assert {step for step in steps if step < 2000} == {1250}


def test_each_new_frame_is_a_tick(simulator: HilSimulator) -> None:
    exchange = Exchange(simulator)
    for number in range(5):
        reply = exchange.receive(read_servo_packet(packet(number)), 0.0)
        assert reply.advanced and not reply.notice
        assert simulator.now_us == (number + 1) * 1250
        assert as_the_firmware_reads(reply.answer)["timestamp"][0] == pytest.approx(simulator.now_us * 1e-6)


def test_a_repeated_frame_moves_nothing_and_is_answered_when_the_answer_was_lost(
    simulator: HilSimulator,
) -> None:
    exchange = Exchange(simulator)
    first = exchange.receive(read_servo_packet(packet(0)), 10.0)
    now_us = simulator.now_us
    assert exchange.receive(read_servo_packet(packet(0, 1900)), 10.1) == (b"", False, "")
    assert exchange.receive(read_servo_packet(packet(0, 1900)), 11.1) == (first.answer, False, "")
    assert exchange.receive(read_servo_packet(packet(0, 1900)), 11.2) == (b"", False, "")
    assert simulator.now_us == now_us
    assert exchange.receive(read_servo_packet(packet(1)), 11.3).advanced


def test_a_firmware_that_begins_anew_begins_the_world_anew(simulator: HilSimulator) -> None:
    exchange = Exchange(simulator)
    begun = [exchange.receive(read_servo_packet(packet(n)), 0.0).answer for n in range(3)]
    for n in range(3, 200):
        exchange.receive(read_servo_packet(packet(n, 1900)), 0.0)
    again = exchange.receive(read_servo_packet(packet(0)), 1.0)
    assert "restarted at t = 0.250 s" in again.notice
    assert [
        again.answer,
        *(exchange.receive(read_servo_packet(packet(n)), 1.0).answer for n in (1, 2)),
    ] == begun


def test_a_firmware_that_flies_already_is_told_of(simulator: HilSimulator) -> None:
    reply = Exchange(simulator).receive(read_servo_packet(LATER), 0.0)
    assert reply.advanced and "flown for 3999 frames" in reply.notice and simulator.now_us == 1250


def test_the_same_packets_give_the_same_bytes() -> None:
    def flown() -> list[bytes]:
        exchange = Exchange(HilSimulator.build("iris", "rtk", 7, {"SIM_RATE_HZ": RATE_HZ}))
        return [exchange.receive(read_servo_packet(packet(n, 1700)), 0.0).answer for n in range(400)]

    first = flown()
    assert first == flown() and len(set(first)) == 400


def test_throttle_lifts_the_vehicle_and_rest_is_rest(simulator: HilSimulator) -> None:
    exchange = Exchange(simulator)
    rest = as_the_firmware_reads(exchange.receive(read_servo_packet(packet(0)), 0.0).answer)
    assert rest["accel_body"] == pytest.approx((0.0, 0.0, -9.81), abs=0.01)
    for n in range(1, 400):
        answer = exchange.receive(read_servo_packet(packet(n, 1800)), 0.0).answer
    flown = as_the_firmware_reads(answer)
    assert flown["position"][2] < rest["position"][2] - 0.1 and flown["velocity"][2] < -0.5
    assert flown["quaternion"] == pytest.approx(rest["quaternion"], abs=0.02)
