"""How often the same text is sent, so that a request that recurs many times a second fills no screen."""

from __future__ import annotations

import re
from collections.abc import Hashable
from typing import Any

WARNING_INTERVAL_US = 5_000_000  # between two equal texts
MAX_VARIANTS = 5  # texts in this time that begin alike, up to a number
_MAX_KEYS = 500
_DIGIT = re.compile(r"\d")


class TextLimiter:
    """When each text was last sent, and on which link, and how many like it."""

    def __init__(self) -> None:
        self._sent_us: dict[Hashable, int] = {}  # the oldest first
        self._alike: dict[
            Hashable, tuple[int, int]
        ] = {}  # begin of an interval, and how many were sent in it

    def allows(
        self, text: str, now_us: int, interval_us: int = WARNING_INTERVAL_US, link: Hashable = None
    ) -> bool:
        """Whether a text is sent now on a link: it was not sent less than an interval ago, nor were
        `MAX_VARIANTS` like it, which differ from it in a number."""
        sent_us = self._sent_us.get((link, text))
        if sent_us is not None and now_us - sent_us < interval_us:
            return False
        kind = link, _DIGIT.split(text, maxsplit=1)[0]
        begin_us, count = self._alike.get(kind, (now_us, 0))
        if now_us - begin_us >= WARNING_INTERVAL_US:
            begin_us, count = now_us, 0
        if count == MAX_VARIANTS:
            return False
        _note(self._alike, kind, (begin_us, count + 1))
        _note(self._sent_us, (link, text), now_us)
        return True


def _note(entries: dict[Hashable, Any], key: Hashable, value: object) -> None:
    """Make the entry the newest one; the oldest of too many is dropped."""
    entries.pop(key, None)
    entries[key] = value
    if len(entries) > _MAX_KEYS:
        del entries[next(iter(entries))]
