"""The last texts for the operators, kept so that a ground station that connects later can request them.

A repeated text replaces its previous occurrence, so that a complaint that recurs every few seconds does not
displace the reason of a failsafe. Kept texts are sent at a steady pace, only to the link that requested them,
each with its number, the count and its age: `[2/7, 12.3 s ago] Landed, disarmed`. A refusal of something that
has been accepted since is sent as a notice instead of a warning.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from typing import NamedTuple

from autopilot.services.records import Link, Output, Send
from autopilot.services.statustext import TextWriter
from autopilot.services.streams import NEVER_US
from autopilot.wire.dialect import plumbline as mavlink

MOST = 50  # kept texts
PACE_US = 4000  # between two texts on a link
_OVERTAKEN = mavlink.MAV_SEVERITY_NOTICE
_MICRO = 1e-6


class KeptText(NamedTuple):
    """A text, and when it was last sent, by the vehicle's clock; negative: before its boot."""

    now_us: int
    severity: int
    text: str


class KeptTexts:
    """The texts, the oldest first, and the links to which they are being sent."""

    def __init__(self, writer: TextWriter) -> None:
        self._writer = writer
        self._texts: dict[tuple[int, str], int] = {}  # when each was last sent, in that order
        self._refusals: dict[tuple[int, str], Hashable] = {}  # the texts that refuse something, and what
        self._asked: dict[Link, tuple[tuple[KeptText, ...], int, int]] = {}  # texts, next index, its time

    @property
    def texts(self) -> tuple[KeptText, ...]:
        """The kept texts, the oldest first."""
        return tuple(KeptText(now_us, *said) for said, now_us in self._texts.items())

    def keep(self, severity: int, text: str, now_us: int, about: Hashable = None) -> None:
        """Keep a text that is sent now, perhaps a refusal of `about`; the oldest text may be dropped."""
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
        """A command or upload that was refused is now accepted."""
        overtaken = [said for said, what in self._refusals.items() if what == about]
        if not overtaken:
            return
        for said in overtaken:
            del self._refusals[said]
        settled: dict[tuple[int, str], int] = {}
        for said, now_us in self._texts.items():
            notice = (_OVERTAKEN, said[1]) if said in overtaken else said
            settled.pop(notice, None)  # of equal texts the later one counts
            settled[notice] = now_us
        self._texts = settled

    def inherit(self, texts: Iterable[KeptText], ended_us: int) -> None:
        """Take over the texts of the previous run, which ended at `ended_us` of its own clock."""
        older = {(text.severity, text.text): text.now_us - ended_us for text in texts}
        both = [(said, at_us) for said, at_us in older.items() if said not in self._texts]
        both += self._texts.items()
        self._texts = dict(both[-MOST:])

    def ask(self, link: Link, now_us: int) -> None:
        """Send the texts that are kept now to this link, unless a transfer to it is already under way."""
        if self._texts and link not in self._asked:
            self._asked[link] = (self.texts, 0, now_us)

    def next_timer(self) -> int:
        """Time at which `poll` has something to send, in us."""
        return min((at_us for _, _, at_us in self._asked.values()), default=NEVER_US)

    def poll(self, now_us: int) -> list[Output]:
        """The texts that are due, one on each link."""
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
        """Stop sending to a link that no longer exists."""
        self._asked.pop(link, None)
