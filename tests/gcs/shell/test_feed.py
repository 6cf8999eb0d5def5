"""The pipe from a flight to its page: messages arrive in order, and the flight never waits for the page."""

from __future__ import annotations

from contextlib import closing

from gcs.shell.feed import EVENT, TRUTH, VEHICLE, feed_pipe, inherited_feed


def test_messages_come_whole_and_in_order() -> None:
    ours, theirs = feed_pipe()
    with closing(ours), closing(inherited_feed(theirs.detach())) as page:
        ours.send_datagrams(VEHICLE, 5, [b"one", b"two"])
        ours.send_datagrams(TRUTH, 6, [b"three"])
        ours.send_event({"stage": "flying"})
        first, second, third = page.read()
        assert (first.kind, first.time_us, first.body) == (VEHICLE, 5, b"onetwo")
        assert (second.kind, second.body) == (TRUTH, b"three")
        assert third.kind == EVENT
        assert third.event == {"stage": "flying"}
        assert page.read() == []
        assert not page.closed


def test_a_page_that_does_not_read_is_not_waited_for() -> None:
    ours, theirs = feed_pipe()
    with closing(ours), closing(inherited_feed(theirs.detach())) as page:
        for number in range(10_000):
            ours.send_datagrams(VEHICLE, number, [bytes(40_000)])
        heard = page.read(max_count=20_000)
        assert 0 < len(heard) < 10_000
        assert [piece.time_us for piece in heard] == list(range(len(heard)))


def test_a_page_that_is_gone_is_noticed() -> None:
    ours, theirs = feed_pipe()
    with closing(ours):
        theirs.close()
        ours.send_datagrams(VEHICLE, 0, [b"word"])
        assert ours.closed
        assert ours.read() == []
