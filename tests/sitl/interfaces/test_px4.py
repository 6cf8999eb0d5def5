"""PX4's interface: a stream that is cut anywhere, the contents of a tick, answers in and out of step."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.dialect import plumbline as mavlink
from sitl.hil import HilSimulator
from sitl.interfaces.px4 import RATE_HZ, Exchange, Stream

# its heartbeat before it is armed; `answer` then has all controls 0
HEARTBEAT = FrameWriter(1, 1).frame(mavlink.MAVLink_heartbeat_message(0, 12, 0, 0, 0, 3))
ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED


def answer(time_us: int, controls: Sequence[float] = (0.0,) * 4, mode: int = 1) -> bytes:
    whole = [*controls, *(0.0,) * (16 - len(controls))]
    return FrameWriter(1, 1).frame(mavlink.MAVLink_hil_actuator_controls_message(time_us, whole, mode, 1))


@pytest.fixture
def simulator() -> HilSimulator:
    return HilSimulator.build("iris", "rtk", 1, {"SIM_RATE_HZ": RATE_HZ})


def sent(exchange: Exchange) -> list:
    return [one.message for one in decode(exchange.sensors())[0]]


@given(st.lists(st.integers(0, 200), max_size=20), st.binary(max_size=30))
def test_frames_come_out_of_a_stream_however_it_is_cut(cuts: list[int], rubbish: bytes) -> None:
    # a start byte in the rubbish would begin a frame, and the next bytes would belong to it until it is
    # complete
    whole = rubbish.replace(b"\xfd", b"") + HEARTBEAT + answer(4000) + answer(8000)
    stream, found, before = Stream(), [], 0
    for cut in (*sorted(min(cut, len(whole)) for cut in cuts), len(whole)):
        found += stream.feed(whole[before:cut])
        before = cut
    assert found == [HEARTBEAT, answer(4000), answer(8000)]


def test_a_damaged_frame_is_passed_over() -> None:
    damaged = bytearray(answer(4000))
    damaged[20] ^= 0xFF
    assert Stream().feed(bytes(damaged) + answer(8000)) == [answer(8000)]


def test_each_tick_ends_with_what_sets_its_clock_and_has_nothing_of_our_dialect(
    simulator: HilSimulator,
) -> None:
    exchange = Exchange(simulator)
    kinds = set()
    for _ in range(RATE_HZ):
        messages = sent(exchange)
        assert messages[-1].get_type() == "HIL_SENSOR" and messages[-1].time_usec == simulator.now_us
        assert messages[-1].id == 0
        kinds |= {message.get_type() for message in messages}
        simulator.advance()
    assert kinds == {"HIL_SENSOR", "HIL_GPS", "HIL_STATE_QUATERNION"}


def test_until_its_first_answer_it_is_not_in_step(simulator: HilSimulator) -> None:
    exchange = Exchange(simulator)
    simulator.advance()
    assert not exchange.receive(HEARTBEAT) and not exchange.in_lockstep
    assert exchange.receive(answer(0)) and exchange.in_lockstep  # of the tick before
    simulator.advance()
    assert not exchange.receive(answer(simulator.now_us - 4000))
    assert exchange.receive(answer(simulator.now_us))


def test_controls_turn_the_rotors_of_their_motors(simulator: HilSimulator) -> None:
    exchange = Exchange(simulator)
    for _ in range(100):
        assert exchange.receive(answer(simulator.now_us, (0.8, 0.0, 0.0, 0.0), ARMED | 1))
        simulator.advance()
    u = 0.8
    expected = 8.5 * (0.35 * u + 0.65 * u * u)
    # motor 1 is front right: the third counterclockwise from the rear left
    assert simulator.core.rotor_force == pytest.approx((0.0, 0.0, expected, 0.0), rel=1e-3)


def test_controls_that_are_no_numbers_are_counted_and_not_obeyed(simulator: HilSimulator) -> None:
    exchange = Exchange(simulator)
    assert exchange.receive(answer(0, (float("nan"), 0.5, 0.5, 0.5), ARMED | 1))
    simulator.advance()
    assert simulator.rejected == 1 and simulator.core.rotor_force == (0.0,) * 4


def test_a_profile_without_its_sensors_is_refused() -> None:
    with pytest.raises(ValueError, match="--sensors rtk or gps"):
        Exchange(HilSimulator.build("iris", "lab", 1))
