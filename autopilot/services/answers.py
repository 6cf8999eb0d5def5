"""Questions that are answered without any state: time, round trip, files and logs that there are none of."""

from __future__ import annotations

from typing import Any

from autopilot.services.records import Decide, Output, Peer, Send, TimesyncAnswered
from autopilot.wire.dialect import plumbline as mavlink

_LOG_BLOCK = 90  # LOG_DATA.data

# FILE_TRANSFER_PROTOCOL.payload: where things are, and the codes that are used here
_FTP_SEQ, _FTP_SESSION, _FTP_OPCODE, _FTP_SIZE, _FTP_ASKED, _FTP_DATA = 0, 2, 3, 4, 5, 12
_FTP_LENGTH = 251
_FTP_TERMINATE, _FTP_RESET, _FTP_LIST, _FTP_OPEN = 1, 2, 3, 4
_FTP_ACK, _FTP_NAK = 128, 129
_FTP_UNKNOWN_COMMAND, _FTP_NOT_FOUND = 7, 10


def answer_timesync(message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
    """A question (tc1 = 0) gets our time; an answer is an event. Answering answers would never end."""
    if message.tc1 != 0:
        return [TimesyncAnswered(peer.link, message.tc1, message.ts1)]
    # at time 0 our stamp would read as a question
    return [Send(peer.link, mavlink.MAVLink_timesync_message(max(now_us * 1000, 1), message.ts1))]


def answer_ping(message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
    """A ping for everybody (target 0) comes back to the asker; anything else is somebody's answer."""
    if message.target_system or message.target_component:
        return []
    answer = mavlink.MAVLink_ping_message(message.time_usec, message.seq, peer.system, peer.component)
    return [Send(peer.link, answer)]


def answer_ftp(message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
    """There are no files. Said at once, because clients wait seconds for a silent server."""
    asked = message.payload
    opcode = asked[_FTP_OPCODE]
    answer = [0] * _FTP_LENGTH
    seq = (asked[_FTP_SEQ] | asked[_FTP_SEQ + 1] << 8) + 1
    answer[_FTP_SEQ], answer[_FTP_SEQ + 1] = seq & 0xFF, seq >> 8 & 0xFF
    answer[_FTP_SESSION] = asked[_FTP_SESSION]
    answer[_FTP_ASKED] = opcode
    if opcode in (_FTP_TERMINATE, _FTP_RESET):
        answer[_FTP_OPCODE] = _FTP_ACK
    elif opcode in (_FTP_ACK, _FTP_NAK):
        return []
    else:
        answer[_FTP_OPCODE] = _FTP_NAK
        answer[_FTP_SIZE] = 1
        missing = _FTP_NOT_FOUND if opcode in (_FTP_LIST, _FTP_OPEN) else _FTP_UNKNOWN_COMMAND
        answer[_FTP_DATA] = missing
    return [
        Send(
            peer.link, mavlink.MAVLink_file_transfer_protocol_message(0, peer.system, peer.component, answer)
        )
    ]


def answer_log_list(message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
    """No logs are kept on the vehicle: an entry that says how many (0)."""
    return [Send(peer.link, mavlink.MAVLink_log_entry_message(0, 0, 0, 0, 0))]


def answer_log_data(message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
    """A log that does not exist ends where it begins."""
    empty = mavlink.MAVLink_log_data_message(message.id, message.ofs, 0, (0,) * _LOG_BLOCK)
    return [Send(peer.link, empty)]
