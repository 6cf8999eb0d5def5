"""SETUP_SIGNING, which received frames are accepted, and how sent frames are signed, on all links."""

from __future__ import annotations

from typing import Any

from autopilot.services.records import Decide, Output, Peer, SendText, SigningChanged
from autopilot.services.requests import ChangeSigningKey
from autopilot.services.streams import NEVER_US
from autopilot.wire.codec import Received
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.signing import MAX_TIMESTAMP, UNITS_PER_S, Sign, Signing, timestamp_of

STORED_LEAD = 10 * UNITS_PER_S  # by which the stored time is ahead of the time in use
_WARNING_INTERVAL_US = 10_000_000
_NO_KEY = bytes(32)
_KEY_REFUSED = "Signing key not changed: start the autopilot with --signing-key or --allow-setup-signing"


class SigningService:
    """The key in force, if there is one."""

    def __init__(self, signing: Signing | None, boot_unix_us: int, setup: bool = False) -> None:
        """`setup`: any sender may set the first key."""
        self.signing = signing
        self._allow_setup = setup
        self._boot_unix_us = boot_unix_us
        self._stored_timestamp = 0 if signing is None else signing.timestamp
        self._refused = False
        self._next_warning_us = 0
        self._wall_clock_us: int | None = None

    def set_wall_clock(self, unix_us: int) -> None:
        """Sign with this time of the wall clock; without it, the vehicle's clock since its boot is used."""
        self._wall_clock_us = unix_us

    def _clock(self, now_us: int) -> int:
        return timestamp_of(
            self._boot_unix_us + now_us if self._wall_clock_us is None else self._wall_clock_us
        )

    def next_timer(self) -> int:
        """Time at which `poll` has something to do, in us."""
        return self._next_warning_us if self._refused else NEVER_US

    def signer(self, link_id: int) -> Sign | None:
        """The signer of the frames of a link; None without a key."""
        return None if self.signing is None else self.signing.signer(link_id)

    def accepts(self, received: Received, message_id: int) -> bool:
        """Whether a received frame is accepted."""
        if self.signing is None:
            return True
        accepted = self.signing.accepts(received.frame, message_id, received.system, received.component)
        self._refused = self._refused or not accepted
        return accepted

    def receive_setup(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """SETUP_SIGNING: a new key, or none (all zeros). Once there is a key, only a sender that knows it can
        change it. A first key, which would lock out all others, is accepted only if the vehicle was started
        with `setup`."""
        if self.signing is None and not self._allow_setup:
            return [SendText(mavlink.MAV_SEVERITY_WARNING, _KEY_REFUSED)]
        verdict = decide(ChangeSigningKey())
        if verdict.result != mavlink.MAV_RESULT_ACCEPTED:
            why = verdict.text or "not allowed"
            return [SendText(mavlink.MAV_SEVERITY_WARNING, f"Signing key not changed: {why}")]
        key = bytes(message.secret_key)
        if key == _NO_KEY:
            self.signing = None
            self._stored_timestamp = 0
            return [
                SigningChanged(None, 0),
                SendText(mavlink.MAV_SEVERITY_NOTICE, "Signing is off: all messages are heard"),
            ]
        start = max(min(message.initial_timestamp, MAX_TIMESTAMP), self._clock(now_us))
        self.signing = Signing(key, start)
        self._stored_timestamp = min(start + STORED_LEAD, MAX_TIMESTAMP)
        return [
            SigningChanged(key, self._stored_timestamp),
            SendText(mavlink.MAV_SEVERITY_NOTICE, "Signing is on: only signed messages are heard"),
        ]

    def poll(self, now_us: int) -> list[Output]:
        """The time stamp to be stored before it is reached; a text if messages were refused."""
        signing = self.signing
        if signing is None:
            return []
        signing.advance(self._clock(now_us))
        outputs: list[Output] = []
        if signing.timestamp >= self._stored_timestamp:
            self._stored_timestamp = min(signing.timestamp + STORED_LEAD, MAX_TIMESTAMP)
            outputs.append(SigningChanged(signing.key, self._stored_timestamp))
        if self._refused and now_us >= self._next_warning_us:
            self._refused = False
            self._next_warning_us = now_us + _WARNING_INTERVAL_US
            outputs.append(
                SendText(mavlink.MAV_SEVERITY_WARNING, "Unsigned or wrongly signed messages are refused")
            )
        return outputs
