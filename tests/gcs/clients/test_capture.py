"""Logs: the order of the records depends on what was sent and on nothing else."""

from __future__ import annotations

import io

from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.tlog import TlogWriter, read_tlog
from gcs.clients.capture import LOCKSTEP_BOOT_UNIX_US, Capture
from gcs.clients.lockstep import LockstepTurns, TruthQueue


def text(writer: FrameWriter, words: str) -> bytes:
    return writer.frame(mavlink.MAVLink_statustext_message(6, words.encode()))


def status(writer: FrameWriter, time_us: int) -> bytes:
    return writer.frame(mavlink.MAVLink_sim_status_message(time_us, 0.0, 0.0, 0, 0, 0, 0, 1, 1))


def question(writer: FrameWriter, time_ns: int) -> bytes:
    return writer.frame(mavlink.MAVLink_timesync_message(0, time_ns))


def test_truth_then_vehicle_then_ground_and_no_timesync():
    file = io.BytesIO()
    capture = Capture(TlogWriter(file))
    world, vehicle, ground = FrameWriter(1, 26), FrameWriter(1, 1), FrameWriter(255, 190)
    capture.on_sent(text(ground, "g0"))
    capture.on_vehicle(text(vehicle, "v0") + text(vehicle, "v1"))
    capture.on_vehicle(question(vehicle, 20_000_000))
    capture.on_truth(text(world, "t0"))
    capture.flush(20_000)
    capture.on_vehicle(b"\x00garbage" + text(vehicle, "v2"))
    capture.flush(40_000)
    records = list(read_tlog(io.BytesIO(file.getvalue())))
    found = [(stamp - LOCKSTEP_BOOT_UNIX_US, one.message.text) for stamp, one in records]
    assert found == [(20_000, "t0"), (20_000, "v0"), (20_000, "v1"), (20_000, "g0"), (40_000, "v2")]
    assert capture.records == 5


def test_a_question_is_answered_once_and_its_repetition_with_the_same_bytes():
    turns = LockstepTurns()
    vehicle = FrameWriter(1, 1)
    assert turns.question(text(vehicle, "no question")) is None
    assert turns.question(b"\xfd\xff garbage") is None
    asked = turns.question(text(vehicle, "first the news, ") + question(vehicle, 40_000_000))
    assert asked == 40_000_000
    assert turns.repeated_answer(asked) is None
    answer = turns.answer(asked)
    assert turns.repeated_answer(asked) == answer
    assert turns.repeated_answer(20_000_000) == b"", "a question that is older still needs no answer"
    assert turns.repeated_answer(60_000_000) is None
    assert turns.question(answer) is None, "an answer is no question"


def test_an_answer_promises_silence_and_at_least_that_it_is_one():
    turns = LockstepTurns()
    for question_ns, silent_until_us, tc1 in (
        (20_000_000, 0, 20_000_001),
        (40_000_000, 1_020_000, 1_020_000_000),
        (1_040_000_000, 1_020_000, 1_040_000_001),
    ):
        (received,), _ = decode(turns.answer(question_ns, silent_until_us))
        assert (received.message.tc1, received.message.ts1) == (tc1, question_ns)


def test_truth_of_a_later_tick_waits_for_its_window():
    queue = TruthQueue()
    world = FrameWriter(1, 26)
    early, now, late = (status(world, time_us) for time_us in (12_000, 20_000, 24_000))
    queue.put([early, now, late])
    assert queue.take_until(20_000) == [early, now]
    assert queue.take_until(20_000) == []
    assert queue.take_until(40_000) == [late]
