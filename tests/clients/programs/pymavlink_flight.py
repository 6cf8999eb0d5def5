"""What a script does with `mavutil`: `python pymavlink_flight.py ADDRESS`; its observations as JSON."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from pymavlink import mavutil

LONG_S = 120.0  # on a busy machine
AGAIN_S = 3.0  # after which a request is repeated: a script without time to read loses answers
RELATIVE_INT = mavutil.mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
POSITION_ONLY = 0b110111111000
MISSION, FENCE, RALLY = 0, 1, 2
WAYPOINT, CORNER, RALLY_POINT = 16, 5001, 5100


class Script:
    """One connection and what is done over it."""

    def __init__(self, address: str) -> None:
        self.link = mavutil.mavlink_connection(address, source_system=255, source_component=190)
        self.link.wait_heartbeat(timeout=LONG_S)
        self.to = (self.link.target_system, self.link.target_component)

    def await_(
        self,
        kind: str | list[str],
        condition: Callable[[Any], Any] = lambda message: True,
        ask: Callable[[], None] = lambda: None,
    ) -> Any:
        """The next message of a kind that meets the condition; `ask` requests it, as often as needed."""
        asked = -math.inf
        until = time.monotonic() + LONG_S
        while time.monotonic() < until:
            if time.monotonic() > asked + AGAIN_S:
                asked = time.monotonic()
                ask()
            message = self.link.recv_match(type=kind, blocking=True, timeout=1.0)
            if message is not None and condition(message):
                return message
        sys.exit(f"in vain waited for {kind}")

    def command(self, number: int, *params: float) -> int:
        """Send a COMMAND_LONG; return its result."""

        def ask() -> None:
            self.link.mav.command_long_send(*self.to, number, 0, *(*params, *[0.0] * 7)[:7])

        return int(self.await_("COMMAND_ACK", lambda ack: ack.command == number, ask).result)

    def mode(self, name: str) -> None:
        """Set a mode by the name that `mavutil` gives it."""
        ask = partial(self.link.set_mode, name)
        assert self.await_("COMMAND_ACK", lambda ack: ack.command == 176, ask).result == 0
        self.await_("HEARTBEAT", lambda beat: beat.get_srcComponent() == 1 and self.link.flightmode == name)

    def parameter(self, name: str, value: float) -> float:
        """Set a parameter, then read it by its name."""
        ask = partial(self.link.param_set_send, name, value)
        self.await_(
            "PARAM_VALUE", lambda answer: answer.param_id == name and answer.param_value == value, ask
        )
        ask = partial(self.link.param_fetch_one, name)
        return float(self.await_("PARAM_VALUE", lambda answer: answer.param_id == name, ask).param_value)

    def send_items(self, kind: int, items: list[Any]) -> int:
        """Upload items; return the result."""
        self.link.mav.mission_count_send(*self.to, len(items), kind)
        while True:
            asked = self.await_(
                ["MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK"],
                lambda one: one.mission_type == kind,
            )
            if asked.get_type() == "MISSION_ACK":
                return int(asked.type)
            self.link.mav.send(items[asked.seq])

    def fetch_items(self, kind: int) -> list[Any]:
        """Download items."""
        ask = partial(self.link.mav.mission_request_list_send, *self.to, kind)
        count = self.await_("MISSION_COUNT", lambda answer: answer.mission_type == kind, ask).count
        items = []
        for seq in range(count):
            ask = partial(self.link.mav.mission_request_int_send, *self.to, seq, kind)
            this = (kind, seq)
            items.append(
                self.await_(
                    "MISSION_ITEM_INT", lambda item, it=this: (item.mission_type, item.seq) == it, ask
                )
            )
        self.link.mav.mission_ack_send(*self.to, 0, kind)
        return items

    def item(self, kind: int, seq: int, command: int, p1: float, x: int, y: int, z: float) -> Any:
        return mavutil.mavlink.MAVLink_mission_item_int_message(
            *self.to, seq, RELATIVE_INT, command, int(seq == 0), 1, p1, 0.0, 0.0, math.nan, x, y, z, kind
        )


def main(address: str) -> None:
    script = Script(address)
    link, told = script.link, {}
    told["modes"] = sorted(link.mode_mapping())
    names: set[str] = set()
    script.await_(
        "PARAM_VALUE",
        lambda answer: names.add(answer.param_id) or len(names) == answer.param_count,
        link.param_fetch_all,
    )
    told["parameters"] = len(names)
    told["real"], told["whole"] = script.parameter("MIS_SPEED", 1.25), script.parameter("MIS_SHAPE", 1.0)
    home = script.await_("HOME_POSITION")
    x, y = home.latitude, home.longitude

    corners = ((-300, -300), (-300, 600), (600, 600), (600, -300))
    fence = [script.item(FENCE, i, CORNER, 4.0, x + a, y + b, 0.0) for i, (a, b) in enumerate(corners)]
    rally = [script.item(RALLY, 0, RALLY_POINT, 0.0, x, y, 2.0)]
    mission = [script.item(MISSION, i, WAYPOINT, 0.0, x + 60 * i, y, 1.5) for i in range(3)]
    told["accepted"], told["equal"] = [], []
    for kind, items in ((FENCE, fence), (RALLY, rally), (MISSION, mission)):
        told["accepted"].append(script.send_items(kind, items))
        back = [(i.command, i.frame, i.x, i.y, i.z) for i in script.fetch_items(kind)]
        told["equal"].append(back == [(i.command, i.frame, i.x, i.y, i.z) for i in items])
    told["takeoff"] = script.command(22, math.nan, 0, 0, math.nan, math.nan, math.nan, 1.5)
    link.arducopter_arm()
    link.motors_armed_wait()
    script.await_("EXTENDED_SYS_STATE", lambda state: state.landed_state == 2)
    script.await_("HEARTBEAT", lambda beat: link.flightmode == "LOITER")

    def stream(north: float) -> None:
        link.mav.set_position_target_local_ned_send(
            0, *script.to, mavutil.mavlink.MAV_FRAME_LOCAL_NED, POSITION_ONLY,
            north, 0.0, -1.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        )  # fmt: skip

    stream(0.0)
    script.mode("OFFBOARD")
    script.await_("LOCAL_POSITION_NED", lambda at: stream(1.0) or abs(at.x - 1.0) < 0.1)
    script.mode("LOITER")
    link.set_mode("MISSION")
    script.await_("MISSION_ITEM_REACHED", lambda item: item.seq == 0)
    script.mode("LOITER")
    link.set_mode("MISSION")
    script.await_("MISSION_ITEM_REACHED", lambda item: item.seq == 2)
    script.mode("RTL")
    link.motors_disarmed_wait()
    entry = script.await_("LOG_ENTRY", ask=partial(link.mav.log_request_list_send, *script.to, 0, 0xFFFF))
    told["logs"] = [entry.num_logs, entry.size]
    print(json.dumps(told))


if __name__ == "__main__":
    main(sys.argv[1])
