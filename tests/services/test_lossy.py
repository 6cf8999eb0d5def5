"""A hundred items over a bad line: each way it loses, doubles and delays a fifth of the datagrams each."""

from __future__ import annotations

import heapq
import random
from typing import Any

import pytest

from autopilot.wire.codec import FrameWriter, decode

LOST, DOUBLED, LATE = 0.2, 0.2, 0.2
MOST_LATE_US = 120_000
ITEMS = 100
PATIENCE_US = 600_000_000  # simulated


class Line:
    """One direction of a bad line."""

    def __init__(self, rng: random.Random) -> None:
        self.rng = rng
        self.flying: list[tuple[int, int, bytes]] = []
        self.count = 0
        self.dropped = 0

    def put(self, datagram: bytes, now_us: int) -> None:
        if self.rng.random() < LOST:
            self.dropped += 1
            return
        for _ in range(2 if self.rng.random() < DOUBLED else 1):
            late_us = self.rng.randrange(MOST_LATE_US) if self.rng.random() < LATE else 0
            heapq.heappush(self.flying, (now_us + late_us, self.count, datagram))
            self.count += 1

    def take(self, now_us: int) -> list[bytes]:
        taken = []
        while self.flying and self.flying[0][0] <= now_us:
            taken.append(heapq.heappop(self.flying)[2])
        return taken


def fly(rig: Any, client: Any, begin: list[Any], up: Line, down: Line) -> None:
    """Run vehicle and ground on one clock until the client is done."""
    writer = FrameWriter(255, 190)
    outgoing = begin
    deadline_us = rig.now_us + PATIENCE_US
    while not client.done or outgoing:
        assert rig.now_us < deadline_us, "the transfer never ended"
        for message in [*outgoing, *client.poll(rig.now_us)]:
            up.put(writer.frame(message), rig.now_us)
        for datagram in up.take(rig.now_us):
            rig.send_bytes(datagram)
        now_us = rig.now_us
        for received in rig.poll().get("gcs", []):
            down.put(received.frame, now_us)
        outgoing = []
        for datagram in down.take(now_us):
            outgoing += heard(client, datagram, now_us)


def heard(client: Any, datagram: bytes, now_us: int) -> list[Any]:
    out: list[Any] = []
    for received in decode(datagram)[0]:
        out += client.receive(received.message, now_us)
    return out


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_hundred_items_go_up_and_come_down_intact(rig, items, mission_client, seed):
    rng = random.Random(seed)
    up, down = Line(rng), Line(rng)
    sent = items(ITEMS)
    fly(rig, mission_client, mission_client.upload(sent, rig.now_us), up, down)
    assert mission_client.result == 0
    assert rig.endpoint.mission.items == sent
    fly(rig, mission_client, mission_client.download(rig.now_us), up, down)
    assert mission_client.items == sent
    assert up.dropped > 0
    assert down.dropped > 0
