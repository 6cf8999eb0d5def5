"""The last texts for the operators, kept so that who comes later can ask what was said.

A text that is said again takes the place of the one before: a complaint that comes back every few seconds
does not crowd out the reason of a failsafe. Kept texts go out at a steady pace, to the link that asked alone,
and say which of how many they are and how old: `[2/7, 12.3 s ago] Landed, disarmed`. A refusal that was
overtaken, as what was refused has been accepted since, is told again as a notice and no warning.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from typing import NamedTuple

from autopilot.services.records import Link, Output, Send
from autopilot.services.statustext import TextWriter
from autopilot.services.streams import NEVER_US
from autopilot.wire.dialect import plumbline as mavlink

MOST = 50  # texts that are kept
PACE_US = 4000  # between two of them on a link
_OVERTAKEN = mavlink.MAV_SEVERITY_NOTICE
_MICRO = 1e-6


class KeptText(NamedTuple):
    """A text, and when it was said last by the vehicle's clock; before its boot: less than 0."""

    now_us: int
    severity: int
    text: str


class KeptTexts:
    """The texts, the oldest first, and who is being told them."""

    def __init__(self, writer: TextWriter) -> None:
        self._writer = writer
        self._texts: dict[tuple[int, str], int] = {}  # when each was said last, in that order
        self._refusals: dict[tuple[int, str], Hashable] = {}  # of these, and what was refused
        self._asked: dict[Link, tuple[tuple[KeptText, ...], int, int]] = {}  # which, the next one, and when

    @property
    def texts(self) -> tuple[KeptText, ...]:
        """What is kept, the oldest first."""
        return tuple(KeptText(now_us, *said) for said, now_us in self._texts.items())

    def keep(self, severity: int, text: str, now_us: int, about: Hashable = None) -> None:
        """A text is said now, maybe that something is refused; the oldest one may be forgotten for it."""
        said = severity, text
        for older in (said, (_OVERTAKEN, text)):
            self._texts.pop(older, None)
        self._texts[said] = now_us
        if len(self._texts) > MOST:
            del self._texts[next(iter(self._texts))]
        if about is not None:
            self._refusals[said] = about
        if len(self._refusals) > MOST:
            self._refusals = {one: what for one, what in self._refusals.items() if one in self._texts}

    def settle(self, about: Hashable) -> None:
        """What was refused is accepted now."""
        overtaken = [said for said, what in self._refusals.items() if what == about]
        if not overtaken:
            return
        for said in overtaken:
            del self._refusals[said]
        settled = [
            ((_OVERTAKEN, said[1]) if said in overtaken else said, now_us)
            for said, now_us in self._texts.items()
        ]
        self._texts = dict(sorted(settled, key=lambda one: one[1]))  # of two that are one the later counts

    def inherit(self, texts: Iterable[KeptText], ended_us: int) -> None:
        """Texts of a run that ended at this time of its clock, as this one begins."""
        older = {(text.severity, text.text): text.now_us - ended_us for text in texts}
        both = [(said, at_us) for said, at_us in older.items() if said not in self._texts]
        both += self._texts.items()
        self._texts = dict(both[-MOST:])

    def ask(self, link: Link, now_us: int) -> None:
        """Tell this link what is kept now; one that is being told already is told that to the end."""
        if self._texts and link not in self._asked:
            self._asked[link] = (self.texts, 0, now_us)

    def next_timer(self) -> int:
        """When `poll` has something to send, in us."""
        return min((at_us for _, _, at_us in self._asked.values()), default=NEVER_US)

    def poll(self, now_us: int) -> list[Output]:
        """The texts whose time has come, one on each link."""
        outputs: list[Output] = []
        for link, (texts, index, at_us) in list(self._asked.items()):
            if at_us > now_us:
                continue
            said_us, severity, text = texts[index]
            head = f"[{index + 1}/{len(texts)}, {(now_us - said_us) * _MICRO:.1f} s ago]"
            outputs += [Send(link, message) for message in self._writer.messages(severity, f"{head} {text}")]
            self._asked[link] = (texts, index + 1, now_us + PACE_US)
            if index + 1 == len(texts):
                del self._asked[link]
        return outputs

    def forget(self, link: Link) -> None:
        """The link is gone: nothing for it."""
        self._asked.pop(link, None)
