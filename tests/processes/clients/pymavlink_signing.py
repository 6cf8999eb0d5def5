"""A signed vehicle through pymavlink: `python pymavlink_signing.py PORT KEY_IN_HEX`; JSON on stdout."""

from __future__ import annotations

import json
import sys
from typing import Any

from pymavlink import mavutil

LONG_S = 60.0
SHORT_S = 1.5
HOME_POSITION = 242


def main(port: str, key: str) -> None:
    told: dict[str, Any] = {}
    link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", source_system=255, source_component=230)

    def acknowledged(seconds: float) -> int | None:
        link.mav.command_long_send(1, 1, 512, 0, HOME_POSITION, 0, 0, 0, 0, 0, 0)
        ack = link.recv_match(type="COMMAND_ACK", blocking=True, timeout=seconds)
        return None if ack is None else int(ack.result)

    link.wait_heartbeat(timeout=LONG_S)
    told["unsigned"] = acknowledged(SHORT_S)
    link.setup_signing(b"\x55" * 32, sign_outgoing=True, allow_unsigned_callback=lambda *_: True)
    told["wrong"] = acknowledged(SHORT_S)
    link.setup_signing(bytes.fromhex(key), sign_outgoing=True)
    told["right"] = acknowledged(LONG_S)
    told["signed"] = link.recv_match(type="HEARTBEAT", blocking=True, timeout=LONG_S).get_signed()
    link.mav.setup_signing_send(1, 1, bytes(32), 0)
    link.disable_signing()  # otherwise the vehicle's text about it is not received
    off = None
    while off is None or "off" not in off.text:
        off = link.recv_match(type="STATUSTEXT", blocking=True, timeout=LONG_S)
    told["off"] = acknowledged(LONG_S)
    print(json.dumps(told))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
