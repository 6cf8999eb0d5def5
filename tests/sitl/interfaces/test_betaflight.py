"""Betaflight's interface, against the answers of the SITL target of Betaflight 4.6 to states that we sent."""

from __future__ import annotations

import re
import struct
import sys
from itertools import pairwise
from math import cos, isnan, pi, radians, sin
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.geometry.so3 import Quat, quat_multiply
from autopilot.vehicle.file import load_vehicle
from autopilot.wire.convert.geodesy import Home
from sitl.hil import HilSimulator
from sitl.interfaces.betaflight import RATE_HZ, Exchange, read_motors, state_packet
from sitl.interfaces.frame import frame_of
from tests.doubles import betaflight

EXAMPLE = Path(__file__).resolve().parents[3] / "docs" / "examples" / "betaflight_hover.py"
DISARMED = bytes(16)
# Its answers when armed with the throttle in the middle, 0.15 s after the beginning of a state that is at
# rest except for (rates FLU in rad/s, axis and degrees of a lean about an axis FLU): in ANGLE mode, in ACRO
LEVEL = bytes.fromhex("8941003f8941003f8941003f8941003f")
ANSWERS = {
    "level": ((0.0, 0.0, 0.0), (0, 0.0), LEVEL, LEVEL),
    "rolled right": ((0.0, 0.0, 0.0), (0, 10.0), bytes.fromhex("ee7c1f3f5c8fc23e5c8fc23eee7c1f3f"), LEVEL),
    "nose down": ((0.0, 0.0, 0.0), (1, 10.0), bytes.fromhex("b072283fd7a3b03eb072283fd7a3b03e"), LEVEL),
    "turning left": (
        (0.0, 0.0, 0.5),
        (0, 0.0),
        bytes.fromhex("21b0323f21b0323ff6289c3ef6289c3e"),
        bytes.fromhex("b4c8363fb4c8363fcff7933ecff7933e"),
    ),
    "rolling right": (
        (0.2, 0.0, 0.0),
        (0, 0.0),
        bytes.fromhex("fa7e0a3f448bec3e448bec3efa7e0a3f"),
        bytes.fromhex("0c020b3f1f85eb3e1f85eb3e0c020b3f"),
    ),
    "nose dropping": (
        (0.0, 0.2, 0.0),
        (0, 0.0),
        bytes.fromhex("cdcc0c3f9eefe73ecdcc0c3f9eefe73e"),
        bytes.fromhex("cdcc0c3f9eefe73ecdcc0c3f9eefe73e"),
    ),
}
# the state that it was sent when it was rolled right, with the nose to the north
ROLLED = bytes.fromhex(
    "00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000005a3923a"
    "019d23c0a21518b4d3e0ef3f0281c2b8d64fb63f000000000000603c000000000000a03c00000000000000000000000000000000"
    "0000000000000000a3c9c51858172140711fb935e9b24740000000000000000000000000d0bcf840"
)
NUMBERS = (
    "time",
    "p",
    "q",
    "r",
    "ax",
    "ay",
    "az",
    "w",
    "x",
    "y",
    "z",
    "ve",
    "vn",
    "vu",
    "lon",
    "lat",
    "alt",
    "pa",
)


def leaning(axis: int, deg: float) -> Quat:
    """The attitude with the nose to the north, then turned about an axis FLU."""
    half = radians(0.5 * deg)
    lean = [cos(half), 0.0, 0.0, 0.0]
    lean[1 + axis] = sin(half)
    return quat_multiply((cos(0.25 * pi), 0.0, 0.0, sin(0.25 * pi)), (lean[0], lean[1], lean[2], lean[3]))


def numbers(packet: bytes) -> dict[str, float]:
    return dict(zip(NUMBERS, struct.unpack("<18d", packet), strict=True))


@pytest.fixture
def simulator() -> HilSimulator:
    return HilSimulator.build("iris", "ideal", 1, {"SIM_RATE_HZ": RATE_HZ}, lockstep=False)


@pytest.fixture(scope="module")
def example() -> ModuleType:
    module = ModuleType("betaflight_hover")
    sys.modules[module.__name__] = module
    exec(compile(EXAMPLE.read_text(encoding="utf-8"), EXAMPLE, "exec"), module.__dict__)
    return module


@pytest.mark.parametrize("case", [name for name in ANSWERS if name != "level"])
@pytest.mark.parametrize("mode", [2, 3])
def test_its_motors_turn_the_vehicle_back(case: str, mode: int) -> None:
    """In ANGLE mode against lean and rate, in ACRO against the rate alone."""
    rates, (axis, deg), *_ = ANSWERS[case]
    motors = read_motors(ANSWERS[case][mode])
    vehicle = load_vehicle("iris")
    assert motors
    forces = frame_of(vehicle.layout, vehicle.rotor_min_n, vehicle.rotor_max_n).forces(motors)
    turning = [
        sum(force * arm for force, arm in zip(forces, arms, strict=True))
        for arms in (
            [rotor.y for rotor in vehicle.layout],
            [-rotor.x for rotor in vehicle.layout],
            [rotor.yaw for rotor in vehicle.layout],
        )
    ]
    away = list(rates)
    if mode == 2:
        away[axis] += deg
    for moment, off in zip(turning, away, strict=True):
        if off == 0.0:
            assert abs(moment) < 1e-3
        else:
            assert moment < -0.05


def test_what_it_answered_to_is_what_is_sent() -> None:
    still = (0.0, 0.0, 0.0)
    sent = state_packet(still, (0.0, 0.0, 9.80665), leaning(0, 10.0), still, still, Home())
    assert struct.unpack("<18d", sent) == pytest.approx(struct.unpack("<18d", ROLLED), abs=1e-12)


def test_a_state_is_in_the_firmwares_axes() -> None:
    said = numbers(
        state_packet(
            (0.1, 0.2, 0.3), (1.0, 2.0, 9.8), leaning(1, 20.0), (4.0, 5.0, 6.0), (0.0, 111.0, 30.0), Home()
        )
    )
    assert [said[axis] for axis in ("p", "q", "r")] == [0.1, -0.2, -0.3]
    # the firmware uses the negative for its accelerometer, which is FLU
    assert [said[axis] for axis in ("ax", "ay", "az")] == [-1.0, -2.0, -9.8]
    # nose down by 20 degrees, heading north: a negative turn about the axis to the right
    assert [said[i] for i in "wxyz"] == pytest.approx(
        [cos(radians(10)), 0.0, -sin(radians(10)), 0.0], abs=1e-12
    )
    assert [said[axis] for axis in ("ve", "vn", "vu")] == [4.0, 5.0, 6.0]
    home = Home()
    assert said["lon"] == pytest.approx(home.longitude_deg, abs=1e-7)
    assert said["lat"] == pytest.approx(home.latitude_deg + 0.001, abs=1e-5)
    assert said["alt"] == pytest.approx(home.altitude_m + 30.0, abs=1e-3)
    # 12 Pa per metre at the ground
    assert said["pa"] == pytest.approx(101_325.0 - 12.0 * (home.altitude_m + 30.0), rel=0.01)
    # with a time that advances, its clock would follow the unevenness of the packets
    assert said["time"] == 0.0


def test_no_part_of_a_packet_is_one_and_nothing_longer() -> None:
    assert read_motors(DISARMED) == (0.0,) * 4
    for length in range(len(DISARMED)):
        assert read_motors(DISARMED[:length]) is None
    # the raw pulses, which it sends to another port
    assert read_motors(struct.pack("<H2x16f", 4, *(1000.0,) * 16)) is None


@given(st.binary(max_size=100))
def test_rubbish_is_no_packet(datagram: bytes) -> None:
    motors = read_motors(datagram)
    assert (motors is None) == (len(datagram) != 16)


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), -float("inf"), -1.0, 1e38])
def test_any_number_is_a_throttle_or_is_counted(simulator: HilSimulator, wrong: float) -> None:
    exchange = Exchange(simulator)
    exchange.receive((wrong, 0.0, 0.0, 0.0))
    simulator.advance()
    assert simulator.rejected == isnan(wrong)
    assert all(0.0 <= force <= 8.5 for force in simulator.core.rotor_force)


def test_a_firmware_that_falls_silent_lets_the_rotors_stop(simulator: HilSimulator) -> None:
    exchange = Exchange(simulator)
    exchange.receive((0.3,) * 4)
    for _ in range(400):
        simulator.advance()
    assert min(simulator.core.rotor_force) > 0.5
    for _ in range(400):
        simulator.advance()
    assert max(simulator.core.rotor_force) < 0.01 and simulator.missed == 799


def test_the_example_hovers_with_the_load_rolls_and_lands(example: ModuleType) -> None:
    simulator = HilSimulator.build("iris", "ideal", 1, {"SIM_RATE_HZ": 250}, lockstep=False)
    exchange, home = Exchange(simulator), Home()
    pilot = example.Pilot(hover_s=3.0)
    flight = pilot.fly()
    channels, seen = next(flight).packet(0.0), None
    ended = False
    while not ended:
        motors = read_motors(betaflight.flies(exchange.state(), channels))
        assert motors
        exchange.receive(motors)
        seen = example.seen_in(simulator.truth_datagram() or b"", home, seen) or seen
        if seen:
            try:
                channels = flight.send(seen).packet(seen.time_s)
            except StopIteration:
                ended = True
        simulator.advance()
        assert simulator.now_us < 90_000_000, pilot.told
    armed, hovered, rolled, *rest = pilot.told
    assert armed.startswith("armed after") and rest == ["set the load down", "landed and disarmed"]
    seconds, within_mm, swing_deg, *pull_n = (float(number) for number in re.findall(r"[0-9.]+", hovered))
    # the truth gives positions to 11 mm
    assert seconds == 3.0 and within_mm < 80.0 and swing_deg < 1.0
    assert pull_n == pytest.approx([0.3 * 9.81] * 2, abs=0.1)
    asked, rate, least, greatest = (float(number) for number in re.findall(r"[0-9]+", rolled))
    assert asked == 100.0 and rate == pytest.approx(asked, abs=3.0)
    assert least == pytest.approx(asked, abs=10.0) and greatest == pytest.approx(asked, abs=10.0)


def test_the_example_gives_up_when_the_firmware_does_not_arm(
    example: ModuleType, simulator: HilSimulator
) -> None:
    flight = example.Pilot().fly()
    next(flight)
    home, tries = Home(), []
    with pytest.raises(RuntimeError, match="--setup"):
        while True:
            seen = example.seen_in(simulator.truth_datagram() or b"", home, None)
            if seen:
                tries.append(flight.send(seen).armed)
            for _ in range(50):
                simulator.advance()
    # the switch was thrown again and again
    assert sum(before < after for before, after in pairwise(tries)) == 10
