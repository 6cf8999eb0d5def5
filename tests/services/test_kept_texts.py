"""The last texts of the vehicle, sent again to a client that requests them."""

from __future__ import annotations

import re

from autopilot.services.kept_texts import MAX_TEXTS, TEXT_INTERVAL_US, KeptText, KeptTexts
from autopilot.services.records import Verdict
from autopilot.services.streams import NEVER_US
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.statustext import TextWriter
from tests.services.conftest import TICK_US, Rig

WARNING, CRITICAL = mavlink.MAV_SEVERITY_WARNING, mavlink.MAV_SEVERITY_CRITICAL
ASK = mavlink.MAVLink_command_long_message(
    1, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, mavlink.MAVLINK_MSG_ID_STATUSTEXT, 0, 0, 0, 0, 0, 0
)
HEAD = re.compile(r"\[(\d+)/(\d+), (\d+\.\d) s ago\] (.*)")


def texts(received):
    """(severity, text) of each text, chunks joined."""
    whole, number = [], 0
    for message in (one.message for one in received if one.message.get_type() == "STATUSTEXT"):
        if message.id and message.id == number:
            whole[-1] = (message.severity, whole[-1][1] + message.text)
        else:
            whole.append((message.severity, message.text))
        number = message.id
    return whole


def asked(rig: Rig, link: str = "gcs", seconds: float = 0.5):
    rig.send(ASK, link=link)
    return texts(rig.run(round(seconds * 1e6), link))


def test_what_was_said_before_is_told_with_its_age_to_the_asker_alone(rig: Rig) -> None:
    rig.endpoint.add_link("other")
    rig.endpoint.send_text(
        CRITICAL, "tilt 122 deg exceeds FS_TILT_DEG 60: rotors off, and more than fits into one"
    )
    rig.run(2_000_000)
    rig.endpoint.send_text(WARNING, "Machine busy")
    rig.run(1_000_000)
    rig.send(ASK)
    told, others = [], []
    for _ in range(100):
        out = rig.poll()
        told += out.get("gcs", [])
        others += out.get("other", [])
    found = [(severity, *HEAD.fullmatch(text).groups()) for severity, text in texts(told)]
    reason = "tilt 122 deg exceeds FS_TILT_DEG 60: rotors off, and more than fits into one"
    assert found == [(CRITICAL, "1", "2", "3.0", reason), (WARNING, "2", "2", "1.0", "Machine busy")]
    assert texts(others) == []


def test_a_text_that_comes_back_crowds_out_no_other(rig: Rig) -> None:
    rig.endpoint.send_text(CRITICAL, "the reason")
    for _ in range(10 * MAX_TEXTS):
        rig.endpoint.send_text(WARNING, "Machine busy")
        rig.poll()
    assert [HEAD.fullmatch(text)[4] for _, text in asked(rig)] == ["the reason", "Machine busy"]


def test_no_more_than_the_last_are_kept(rig: Rig) -> None:
    for number in range(3 * MAX_TEXTS):
        rig.endpoint.send_text(WARNING, f"text {number}")
        rig.poll()
    said = [HEAD.fullmatch(text)[4] for _, text in asked(rig)]
    assert said == [f"text {number}" for number in range(2 * MAX_TEXTS, 3 * MAX_TEXTS)]


def test_who_asks_without_end_is_sent_no_more_for_it(rig: Rig) -> None:
    for number in range(MAX_TEXTS):
        rig.endpoint.send_text(WARNING, f"text {number}")
    rig.poll()
    sent = 0
    for _ in range(50):
        for _ in range(40):
            rig.send(ASK)
        sent += len(texts(rig.poll().get("gcs", [])))
    assert sent <= 50 * max(1, TICK_US // TEXT_INTERVAL_US)


def test_another_component_keeps_none(rig: Rig) -> None:
    rig.endpoint.send_text(WARNING, "a text")
    rig.poll()
    ask = mavlink.MAVLink_command_long_message(
        1, 25, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, mavlink.MAVLINK_MSG_ID_STATUSTEXT, 0, 0, 0, 0, 0, 0
    )
    acks = [m for m in rig.replies(ask) if m.get_type() == "COMMAND_ACK"]
    assert [ack.result for ack in acks] == [mavlink.MAV_RESULT_UNSUPPORTED]


def test_a_run_inherits_what_the_one_before_has_said() -> None:
    kept = KeptTexts(TextWriter())
    kept.keep(WARNING, "again", 0)
    before = [KeptText(1_000_000, CRITICAL, "the reason"), KeptText(9_000_000, WARNING, "again")]
    kept.inherit(before, 10_000_000)
    assert kept.texts == (KeptText(-9_000_000, CRITICAL, "the reason"), KeptText(0, WARNING, "again"))
    kept.inherit([KeptText(number, WARNING, str(number)) for number in range(MAX_TEXTS)], MAX_TEXTS)
    assert len(kept.texts) == MAX_TEXTS
    assert kept.texts[-1].text == "again"


def test_a_link_that_is_gone_is_told_nothing() -> None:
    kept = KeptTexts(TextWriter())
    kept.keep(WARNING, "a text", 0)
    kept.request("gone", 0)
    kept.forget("gone")
    assert kept.poll(10 * TEXT_INTERVAL_US) == []
    assert kept.next_timer() == NEVER_US


def test_a_refusal_is_a_warning_until_what_was_refused_is_accepted(rig: Rig) -> None:
    start = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_MISSION_START, 0, 0, 0, 0, 0, 0, 0, 0)
    land = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_NAV_LAND, 0, 0, 0, 0, 0, 0, 0, 0)
    rig.verdict = lambda request: Verdict(mavlink.MAV_RESULT_DENIED, f"{type(request).__name__} denied")
    rig.send(start)
    rig.send(land)
    rig.endpoint.send_text(WARNING, "Machine busy")

    def severities():
        rig.run(100_000)
        return {HEAD.fullmatch(text)[4]: severity for severity, text in asked(rig)}

    assert severities() == {"StartMission denied": WARNING, "Land denied": WARNING, "Machine busy": WARNING}
    rig.verdict = lambda request: Verdict(mavlink.MAV_RESULT_ACCEPTED)
    rig.send(start)
    notice = mavlink.MAV_SEVERITY_NOTICE
    assert severities() == {"StartMission denied": notice, "Land denied": WARNING, "Machine busy": WARNING}
    rig.verdict = lambda request: Verdict(mavlink.MAV_RESULT_DENIED, f"{type(request).__name__} denied")
    rig.run(4_000_000)
    rig.send(start)
    assert severities()["StartMission denied"] == WARNING, "it is refused once more"


def test_a_text_is_kept_once_and_in_its_place_whatever_becomes_of_what_was_refused() -> None:
    kept = KeptTexts(TextWriter())
    kept.keep(WARNING, "Mission denied", 1, subject="mission")
    kept.clear_refusals("mission")
    kept.keep(WARNING, "another", 2)
    kept.keep(WARNING, "Mission denied", 3, subject="mission")
    assert [(text.now_us, text.text) for text in kept.texts] == [(2, "another"), (3, "Mission denied")]
    kept.keep(WARNING, "last", 4)
    kept.clear_refusals("mission")
    notice = mavlink.MAV_SEVERITY_NOTICE
    assert kept.texts[1:] == (KeptText(3, notice, "Mission denied"), KeptText(4, WARNING, "last"))


def test_texts_that_merge_keep_the_place_of_the_later_one() -> None:
    kept, notice = KeptTexts(TextWriter()), mavlink.MAV_SEVERITY_NOTICE
    kept.keep(WARNING, "another", 2)
    kept.keep(WARNING, "Mission denied", 3, subject="mission")
    kept.inherit([KeptText(8, notice, "Mission denied"), KeptText(9, WARNING, "before")], 10)
    kept.clear_refusals("mission")
    assert kept.texts == (
        KeptText(-1, WARNING, "before"),
        KeptText(2, WARNING, "another"),
        KeptText(3, notice, "Mission denied"),
    )
