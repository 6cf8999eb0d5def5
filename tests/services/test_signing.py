"""A vehicle with a signing key: whose messages it accepts, how it signs its own, and what is stored."""

from __future__ import annotations

from typing import Any

import pytest

from autopilot.services.endpoint import VehicleEndpoint
from autopilot.services.identity import Identity
from autopilot.services.records import SigningChanged, Verdict
from autopilot.services.requests import ChangeSigningKey
from autopilot.services.signing import STORED_LEAD
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.signing import Signing, timestamp_of

KEY, OTHER = bytes(range(32)), bytes(range(1, 33))
BOOT_US = 1_767_225_600_000_000
BOOT = timestamp_of(BOOT_US)
ARM = m.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
HEARTBEAT = m.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


@pytest.fixture
def signed(rig: Any) -> Any:
    """The rig with a key from the start, in a new `rig.endpoint`."""
    rig.endpoint = VehicleEndpoint(
        Identity(), Home(), rig.table, signing=Signing(KEY, BOOT), boot_unix_us=BOOT_US
    )
    rig.endpoint.add_link("gcs")
    return rig


def send(rig: Any, message: Any, signing: Signing | None, link: str = "gcs") -> None:
    sign = signing.signer(0) if signing else None
    rig.send_bytes(FrameWriter(255, 190).frame(message, sign), link)


def test_only_signed_commands_are_obeyed(signed: Any) -> None:
    for signing in (None, Signing(OTHER, BOOT), Signing(KEY, BOOT - 10_000_000)):
        send(signed, ARM, signing)
    assert signed.asked == []
    send(signed, ARM, Signing(KEY, BOOT))
    assert len(signed.asked) == 1


def test_a_recorded_command_is_not_obeyed_again(signed: Any) -> None:
    frame = FrameWriter(255, 190).frame(ARM, Signing(KEY, BOOT).signer(0))
    signed.send_bytes(frame)
    signed.send_bytes(frame)
    signed.send_bytes(frame, link="another")
    assert len(signed.asked) == 1


def test_who_is_refused_is_told_once(signed: Any) -> None:
    texts = []
    for _ in range(500):
        send(signed, ARM, None)
        texts += [r.message for r in signed.poll().get("gcs", []) if r.message.get_type() == "STATUSTEXT"]
    assert [t.text for t in texts] == ["Unsigned or wrongly signed messages are refused"]


def test_a_stranger_becomes_no_link_but_a_heartbeat_does(signed: Any) -> None:
    send(signed, ARM, None, "stranger")
    assert signed.endpoint.links == ("gcs",)
    send(signed, HEARTBEAT, None, "stranger")
    assert signed.endpoint.links == ("gcs", "stranger")


def test_every_frame_of_every_source_leaves_signed(signed: Any) -> None:
    send(signed, HEARTBEAT, None, "second")
    reader, numbers = Signing(KEY, BOOT), {}
    for _ in range(300):
        for link, received in signed.poll().items():
            for one in received:
                assert reader.accepts(one.frame, one.message.get_msgId(), one.system, one.component)
                assert one.frame[2] & 1
                numbers.setdefault(link, set()).add(one.frame[-13])
    assert numbers == {"gcs": {0}, "second": {1}}


def test_without_a_key_nothing_is_signed(rig: Any) -> None:
    assert all(not one.frame[2] & 1 for one in rig.run(1_000_000))


def setup(key: bytes, timestamp: int = 0) -> Any:
    return m.MAVLink_setup_signing_message(1, 1, list(key), timestamp)


def changes(rig: Any) -> list[SigningChanged]:
    return [event for event in rig.events if isinstance(event, SigningChanged)]


@pytest.fixture
def open_to_all(rig: Any) -> Any:
    """The rig with a vehicle that accepts a first key from any sender."""
    rig.endpoint = VehicleEndpoint(Identity(), Home(), rig.table, boot_unix_us=BOOT_US, setup_signing=True)
    rig.endpoint.add_link("gcs")
    return rig


def test_a_stranger_cannot_lock_the_operator_out(rig: Any) -> None:
    (first, *more) = [r.text for r in rig.replies(setup(KEY)) if r.get_type() == "STATUSTEXT"]
    assert "--allow-setup-signing" in "".join([first, *more])
    assert changes(rig) == rig.asked == []
    send(rig, ARM, None)
    assert len(rig.asked) == 1, "still heard without a signature"


def test_a_key_that_was_taken_away_is_not_replaced_by_a_stranger(signed: Any) -> None:
    send(signed, setup(bytes(32)), Signing(KEY, BOOT))
    assert changes(signed)[-1].key is None
    send(signed, setup(OTHER), None)
    assert changes(signed)[-1].key is None


def test_a_key_is_set_changed_and_taken_away(open_to_all: Any) -> None:
    rig = open_to_all
    send(rig, setup(KEY, BOOT), None)
    assert rig.asked == [ChangeSigningKey()]
    assert changes(rig)[-1].key == KEY
    send(rig, setup(OTHER, BOOT), None)
    assert changes(rig)[-1].key == KEY, "unsigned"
    send(rig, setup(OTHER, BOOT), Signing(KEY, BOOT))
    assert changes(rig)[-1].key == OTHER
    send(rig, setup(bytes(32)), Signing(OTHER, BOOT))
    assert changes(rig)[-1].key is None
    send(rig, ARM, None)
    assert len(rig.asked) == 4
    assert KEY.hex() not in repr(rig.events)


def test_a_key_that_is_taken_is_acknowledged_by_text(open_to_all: Any) -> None:
    rig = open_to_all
    (text,) = [one.text for one in rig.replies(setup(KEY, BOOT)) if one.get_type() == "STATUSTEXT"]
    assert text == "Signing is on: only signed messages are heard"


def test_a_refused_change_changes_nothing(open_to_all: Any) -> None:
    rig = open_to_all
    rig.verdict = lambda request: Verdict(m.MAV_RESULT_DENIED, "disarm first")
    (text,) = [r for r in rig.replies(setup(KEY)) if r.get_type() == "STATUSTEXT"]
    assert "disarm first" in text.text
    assert changes(rig) == []


def test_the_stored_time_is_ahead_of_every_time_in_use(signed: Any) -> None:
    stored = 0
    for _ in range(8000):  # 32 s
        made = signed.poll()
        for change in signed.endpoint.take_events():
            assert change.key == KEY
            stored = change.timestamp
        for received in made.values():
            for one in received:
                assert int.from_bytes(one.frame[-12:-6], "little") <= stored
    assert stored <= BOOT + timestamp_of(BOOT_US + 32_000_000) - BOOT + 2 * STORED_LEAD


def test_after_a_restart_nothing_old_is_heard_and_our_times_go_on(signed: Any) -> None:
    client = Signing(KEY, BOOT)
    command = FrameWriter(255, 190).frame(ARM, client.signer(0))
    signed.send_bytes(command)
    last = max(int.from_bytes(one.frame[-12:-6], "little") for one in signed.run(2_000_000))
    stored = max(change.timestamp for change in signed.endpoint.take_events())
    kept = Signing(KEY, stored, floor=stored)
    again = VehicleEndpoint(Identity(), Home(), signed.table, signing=kept, boot_unix_us=BOOT_US)
    again.add_link("gcs")
    (first, *_), _ = decode(again.datagram("gcs", HEARTBEAT))
    assert int.from_bytes(first.frame[-12:-6], "little") > last
    signed.endpoint, signed.asked = again, []
    signed.send_bytes(command)
    assert signed.asked == []
    client.accepts(first.frame, 0, first.system, first.component)
    send(signed, ARM, client)
    assert len(signed.asked) == 1, "who hears us catches up"


def test_the_wall_clock_counts_where_it_is_told(signed: Any) -> None:
    ahead = BOOT_US + 3_600_000_000
    signed.endpoint.set_wall_clock(ahead)
    stamps = [int.from_bytes(one.frame[-12:-6], "little") for one in signed.run(100_000)]
    assert stamps[0] >= timestamp_of(ahead)
    assert stamps == sorted(set(stamps))
