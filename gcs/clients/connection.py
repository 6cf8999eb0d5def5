"""The ground's end of one link: its frames and heartbeat, and which vehicle is at the other end."""

from __future__ import annotations

from typing import Any

from autopilot.wire.codec import FrameWriter, Received
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.signing import Sign, Signing
from gcs.clients.datagrams import messages
from gcs.clients.operation import GROUND, Target
from gcs.clients.signatures import Signatures

HEARTBEAT_US = 1_000_000
LINK_TIMEOUT_US = 5_000_000
_NOT_A_VEHICLE = {mavlink.MAV_TYPE_GCS, mavlink.MAV_TYPE_ONBOARD_CONTROLLER}


class Connection:
    """Takes the first heartbeat of a vehicle as the vehicle of this link and ignores all other systems."""

    def __init__(self, link_timeout_us: int = LINK_TIMEOUT_US) -> None:
        self._sign: Sign | None = None
        self.signatures = Signatures()
        self.target: Target | None = None
        self.junk_bytes = 0
        self._link_timeout_us = link_timeout_us
        self._system: int | None = None  # system id of the vehicle; None: not known yet
        self._writer = FrameWriter(*GROUND)
        self._next_heartbeat_us: int | None = None
        self._last_received_us: int | None = None

    def sign_with(self, signing: Signing) -> None:
        """From now on sign our frames, and accept only signed frames of the vehicle."""
        self.signatures = Signatures(signing)
        self._sign = signing.signer(0)

    def accept_only(self, system: int | None) -> None:
        """Wait for the vehicle with this system id; None: for the first one that is heard."""
        self._system = system

    def receive(self, datagram: bytes, now_us: int) -> list[Received]:
        """The vehicle's messages in `datagram`; all other contents are dropped."""
        received, junk = messages(datagram)
        self.junk_bytes += junk
        accepted = []
        for one in received:
            if self._system is not None and one.system != self._system:
                continue
            if not self.signatures.accepts(one):
                continue
            if one.id == mavlink.MAVLINK_MSG_ID_HEARTBEAT and is_vehicle(one.message):
                if self.target is None:
                    self.target = Target(one.system, one.component)
                    self._system = one.system
                if self.target == (one.system, one.component):
                    self._last_received_us = now_us
            if self.target is not None:
                accepted.append(one)
        return accepted

    @property
    def next_heartbeat_us(self) -> int:
        """When `poll` has something to send again."""
        return self._next_heartbeat_us or 0

    def send_heartbeat_at_once(self) -> None:
        """Have the next `poll` return our heartbeat, however recent the last one is."""
        self._next_heartbeat_us = None

    def poll(self, now_us: int) -> list[bytes]:
        """Our heartbeat, once a second."""
        if self._next_heartbeat_us is not None and now_us < self._next_heartbeat_us:
            return []
        self._next_heartbeat_us = now_us + HEARTBEAT_US
        heartbeat = mavlink.MAVLink_heartbeat_message(
            type=mavlink.MAV_TYPE_GCS,
            autopilot=mavlink.MAV_AUTOPILOT_INVALID,
            base_mode=0,
            custom_mode=0,
            system_status=mavlink.MAV_STATE_ACTIVE,
            mavlink_version=3,
        )
        return [self.frame(heartbeat)]

    def frame(self, message: Any) -> bytes:
        """`message` as one datagram from the ground station."""
        return self._writer.frame(message, self._sign)

    def lost(self, now_us: int) -> bool:
        """True if a vehicle was heard and has been silent for longer than the link timeout."""
        return self._last_received_us is not None and now_us - self._last_received_us > self._link_timeout_us


def is_vehicle(heartbeat: Any) -> bool:
    """Whether a heartbeat is from a vehicle, not from a ground station or a companion computer."""
    return heartbeat.autopilot != mavlink.MAV_AUTOPILOT_INVALID and heartbeat.type not in _NOT_A_VEHICLE
