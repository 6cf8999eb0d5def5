"""Which frames of a vehicle are accepted if messages are signed, and why there is no contact or no answer."""

from __future__ import annotations

from autopilot.wire.codec import Received
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.signing import Signing

_V2 = 0xFD  # the first byte of a frame that may be signed

_NO_KEY = (
    "the vehicle signs its messages, and heeds only those that are signed with its key: name the file that "
    "holds it by gcs --signing-key FILE"
)
_OTHER_KEY = "what comes is signed with another key than that of --signing-key"
_OTHER_TIME = (
    "what comes is signed with the key of --signing-key, but long ago by the clock of this machine: set the "
    "clocks of both machines right"
)
_UNSIGNED = (
    "what comes is not signed, and with --signing-key only signed messages are heard: leave it out, or give "
    "the vehicle the same key (autopilot --signing-key)"
)


class Signatures:
    """Checks the signatures of the frames of one vehicle."""

    def __init__(self, signing: Signing | None = None) -> None:
        self._signing = signing
        self._verified = False  # a signed frame was heard
        self._problem = ""

    def accepts(self, one: Received) -> bool:
        """Whether the message is accepted."""
        signing = self._signing
        is_signed = one.frame[0] == _V2 and bool(one.frame[2] & mavlink.MAVLINK_IFLAG_SIGNED)
        if signing is None:
            if is_signed:
                self._problem = _NO_KEY
            return True
        is_accepted = signing.accepts(one.frame, one.id, one.system, one.component)
        if is_signed and is_accepted:
            self._verified = True
        elif not is_signed:
            if one.id != mavlink.MAVLINK_MSG_ID_RADIO_STATUS:  # radios cannot sign
                self._problem = _UNSIGNED
        else:
            # if a signing state without earlier time stamps accepts it, the key is right
            by_key = Signing(signing.key).accepts(one.frame, one.id, one.system, one.component)
            self._problem = _OTHER_TIME if by_key else _OTHER_KEY
        return is_accepted

    @property
    def are_valid(self) -> bool:
        """Whether a signed frame of the vehicle was accepted, or no signatures are required."""
        return self._signing is None or self._verified

    @property
    def problem(self) -> str:
        """What does not match, and what to do; empty if no problem is known."""
        return "" if self._verified else self._problem
