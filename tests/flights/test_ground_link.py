"""Our ground station's clients and our vehicle's services over a bad ground link: no sockets, no waiting.

Each way 20 % of the datagrams are lost, 20 % doubled, 20 % late (and so overtaken by others); seeded.
"""

from __future__ import annotations

import random
from typing import Any

import pytest

from autopilot.services.endpoint import VehicleEndpoint
from autopilot.services.identity import Identity
from autopilot.services.records import Verdict
from autopilot.services.snapshot import Snapshot
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import encode_steps
from gcs.clients.missions import MissionDownload, MissionUpload
from gcs.clients.operation import GROUND, Operation, Target
from gcs.clients.parameter_transfer import ParameterList
from missions.model import Land, Takeoff, Waypoint

TICK_US = 4_000
LIMIT_US = 120_000_000
HOME = Home()
LINK = "ground"


class BadLine:
    """Datagrams on their way; `take` gives those that have arrived."""

    def __init__(self, rng: random.Random) -> None:
        self._rng = rng
        self._waiting: list[tuple[int, bytes]] = []

    def put(self, datagram: bytes, now_us: int) -> None:
        if self._rng.random() < 0.2:
            return
        copies = 2 if self._rng.random() < 0.2 else 1
        for _ in range(copies):
            delay = self._rng.randrange(100_000) if self._rng.random() < 0.2 else 0
            self._waiting.append((now_us + delay, datagram))

    def take(self, now_us: int) -> list[bytes]:
        arrived = [datagram for due_us, datagram in self._waiting if due_us <= now_us]
        self._waiting = [one for one in self._waiting if one[0] > now_us]
        return arrived


class World:
    """A vehicle on the ground, a ground station, and the bad lines between them."""

    def __init__(self, seed: int) -> None:
        rng = random.Random(seed)
        self.up, self.down = BadLine(rng), BadLine(rng)
        self.parameters = autopilot_parameters(load_vehicle("bebop"))
        self.vehicle = VehicleEndpoint(Identity(), HOME, self.parameters)
        self.vehicle.add_link(LINK)
        self.writer = FrameWriter(*GROUND)
        self.now_us = 0

    def run(self, operation: Operation) -> None:
        """Until the operation has its result."""
        limit_us = self.now_us + LIMIT_US
        while operation.result is None:
            assert self.now_us < limit_us, operation.progress
            for message in operation.poll(self.now_us):
                self.up.put(self.writer.frame(message), self.now_us)
            for datagram in self.up.take(self.now_us):
                self.vehicle.receive(datagram, LINK, self.now_us, accept)
            for _, datagram in self.vehicle.poll(self.snapshot, self.now_us):
                self.down.put(datagram, self.now_us)
            for datagram in self.down.take(self.now_us):
                for received in decode(datagram)[0]:
                    operation.receive(received.message, self.now_us)
            self.now_us += TICK_US

    def snapshot(self) -> Snapshot:
        return Snapshot(
            self.now_us,
            0,
            HOME,
            armed=False,
            phase=mavlink.PLUMBLINE_PHASE_DISARMED,
            main_mode=4,
            sub_mode=3,
            landed_state=mavlink.MAV_LANDED_STATE_ON_GROUND,
            system_status=mavlink.MAV_STATE_STANDBY,
        )


def accept(_request: Any) -> Verdict:
    return Verdict(mavlink.MAV_RESULT_ACCEPTED)


@pytest.mark.parametrize("seed", range(5))
def test_a_hundred_items_go_up_and_come_down_intact(seed: int) -> None:
    steps = (Takeoff(2.0), *(Waypoint(0.1 * i, -0.2 * i, 2.0, hold_s=0.5) for i in range(98)), Land())
    items = encode_steps(steps, HOME)
    assert len(items) == 100
    world = World(seed)
    target = Target(1, 1)

    upload = MissionUpload(target, items)
    world.run(upload)
    assert upload.result is not None
    assert upload.result.done, upload.result.text
    assert world.vehicle.mission.items == items

    download = MissionDownload(target)
    world.run(download)
    assert download.result is not None
    assert download.result.done, download.result.text
    assert tuple(download.items) == items


def test_every_parameter_comes_down() -> None:
    world = World(99)
    listing = ParameterList(Target(1, 1))
    world.run(listing)
    assert listing.result is not None
    assert listing.result.done, listing.result.text
    assert set(listing.values) == set(world.parameters.names)
