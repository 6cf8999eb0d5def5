"""Requests that are answered without any state: time and round trip."""

from __future__ import annotations

from typing import Any

from autopilot.services.records import Decide, Output, Peer, Send, TimesyncAnswered
from autopilot.wire.dialect import plumbline as mavlink


def answer_timesync(message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
    """Answer a request (tc1 = 0) with our time; an answer becomes an event: answering it would never end."""
    if message.tc1 != 0:
        return [TimesyncAnswered(peer.link, message.tc1, message.ts1)]
    # at time 0 our time stamp would read as a request
    return [Send(peer.link, mavlink.MAVLink_timesync_message(max(now_us * 1000, 1), message.ts1))]


def answer_ping(message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
    """A ping to all (target 0) is returned to its sender; any other ping is an answer and is ignored."""
    if message.target_system or message.target_component:
        return []
    answer = mavlink.MAVLink_ping_message(message.time_usec, message.seq, peer.system, peer.component)
    return [Send(peer.link, answer)]
