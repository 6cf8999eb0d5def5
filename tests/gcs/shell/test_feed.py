"""The pipe from a flight to its page: messages arrive in order, and the flight never waits for the page."""

from __future__ import annotations

from contextlib import closing

from gcs.shell.feed import EVENT, TRUTH, VEHICLE, inherited, pipe


def test_messages_come_whole_and_in_order() -> None:
    ours, theirs = pipe()
    with closing(ours), closing(inherited(theirs.detach())) as page:
        ours.tell(VEHICLE, 5, [b"one", b"two"])
        ours.tell(TRUTH, 6, [b"three"])
        ours.tell_event({"stage": "flying"})
        first, second, third = page.read()
        assert (first.kind, first.time_us, first.body) == (VEHICLE, 5, b"onetwo")
        assert (second.kind, second.body) == (TRUTH, b"three")
        assert third.kind == EVENT
        assert third.event == {"stage": "flying"}
        assert page.read() == []
        assert not page.closed


def test_a_page_that_does_not_read_is_not_waited_for() -> None:
    ours, theirs = pipe()
    with closing(ours), closing(inherited(theirs.detach())) as page:
        for number in range(10_000):
            ours.tell(VEHICLE, number, [bytes(40_000)])
        heard = page.read(most=20_000)
        assert 0 < len(heard) < 10_000
        assert [piece.time_us for piece in heard] == list(range(len(heard)))


def test_a_page_that_is_gone_is_noticed() -> None:
    ours, theirs = pipe()
    with closing(ours):
        theirs.close()
        ours.tell(VEHICLE, 0, [b"word"])
        assert ours.closed
        assert ours.read() == []
