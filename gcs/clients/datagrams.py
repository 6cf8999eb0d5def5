"""Datagrams as messages, decoded once for all who look at them."""

from __future__ import annotations

from functools import lru_cache

from autopilot.wire.codec import Received, decode

# the client, the capture and lockstep look at each datagram within one window of some ten datagrams
_REMEMBERED = 128


@lru_cache(maxsize=_REMEMBERED)
def messages(datagram: bytes) -> tuple[tuple[Received, ...], int]:
    """`decode(datagram)`: the messages, not to be changed, and how many bytes were none.

    What is only recorded, or only the newest of which counts, is never made an object of.
    """
    received, junk = decode(datagram)
    return tuple(received), junk
