"""How often the same text is sent, so that a request that recurs many times a second fills no screen."""

from __future__ import annotations

from collections.abc import Hashable

WARNING_INTERVAL_US = 5_000_000  # between two equal texts
_MAX_KEYS = 500


class TextLimiter:
    """When each text was last sent, and to whom, as far as the limiter has to know it."""

    def __init__(self) -> None:
        self._sent_us: dict[Hashable, int] = {}  # the oldest first

    def allows(self, key: Hashable, now_us: int, interval_us: int = WARNING_INTERVAL_US) -> bool:
        """Whether a text is sent now: that of the same `key` was not sent less than an interval ago."""
        sent_us = self._sent_us.get(key)
        if sent_us is not None and now_us - sent_us < interval_us:
            return False
        self._sent_us.pop(key, None)
        self._sent_us[key] = now_us
        if len(self._sent_us) > _MAX_KEYS:
            del self._sent_us[next(iter(self._sent_us))]
        return True
