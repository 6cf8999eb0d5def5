"""Datagrams as messages, decoded once for all their readers."""

from __future__ import annotations

from functools import lru_cache

from autopilot.wire.codec import Received, decode

# the client, the capture and lockstep read each datagram within one window of some ten datagrams
_CACHE_SIZE = 128


@lru_cache(maxsize=_CACHE_SIZE)
def messages(datagram: bytes) -> tuple[tuple[Received, ...], int]:
    """`decode(datagram)`: the messages, which must not be changed, and the number of bytes outside messages.

    A message that is only recorded, or replaced by a newer one before it is read, never becomes an object.
    """
    received, junk = decode(datagram)
    return tuple(received), junk
