"""A whole flight in one process: simulator, autopilot and ground station joined by byte queues.

The same cores that the three programs run, in the same order of exchange, so that a flight flown here and one
flown over UDP in lockstep leave the same log, byte for byte. This is the one module that joins the rooms.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from autopilot.onboard.onboard import Onboard
from autopilot.onboard.snapshot import Options
from autopilot.own.chosen import NOTHING_OWN, Own, parameters_for
from autopilot.services.identity import identity_of
from autopilot.services.mission_store import StoredMission
from autopilot.trajectory.timeline import expected_duration_s
from autopilot.vehicle.file import load_belief
from autopilot.vehicle.parameters import apply_settings
from autopilot.wire.convert.geodesy import Home
from gcs.clients.capture import LOCKSTEP_BOOT_UNIX_US, Capture, FrameLog
from gcs.clients.flight import FlightClient, Outcome
from gcs.clients.lockstep import LockstepTurns, TruthQueue, ground_turn
from gcs.mission_items import items_of
from missions.model import Mission
from sitl.hil import HilSimulator

_GROUND = "ground"


@dataclass(frozen=True)
class Conditions:
    """What is flown, but for the mission."""

    vehicle: str = "bebop"
    sensors: str = "lab"
    seed: int = 1
    settings: Mapping[str, float] = field(default_factory=dict)  # SIM_ and autopilot parameters by name
    own: Own = NOTHING_OWN  # what somebody has brought, as it is named; with a law CTL_LAW is this one's


def build_onboard(conditions: Conditions, home: Home, mission: StoredMission | None = None) -> Onboard:
    """An autopilot under these conditions."""
    table = parameters_for(load_belief(conditions.vehicle), conditions.own)
    apply_settings(table, conditions.settings.items())
    table.freeze()
    options = Options(home, LOCKSTEP_BOOT_UNIX_US, own=conditions.own)
    return Onboard(table, identity_of(table), options, mission)


def build_simulator(conditions: Conditions, home: Home, lockstep: bool = True) -> HilSimulator:
    """A world under these conditions."""
    return HilSimulator.build(
        conditions.vehicle, conditions.sensors, conditions.seed, conditions.settings, home, lockstep
    )


Watch = Callable[[Onboard, HilSimulator], bool]


def fly(
    mission: Mission,
    conditions: Conditions,
    log: FrameLog,
    watch: Watch | None = None,
    client: FlightClient | None = None,
) -> Outcome:
    """Fly a mission from take-off to landing; the log gets what `gcs fly --lockstep` writes.

    `watch` is shown the cores at every tick, before the world moves on; False from it ends the flight.
    `client` is the ground station's side of it, if it is not to be as usual.
    """
    home = Home()
    onboard = build_onboard(conditions, home)
    onboard.add_link(_GROUND)
    simulator = build_simulator(conditions, home)
    client = client or FlightClient(items_of(mission, home), expected_duration_s(mission))
    capture = Capture(log)
    turns, truth_queue = LockstepTurns(), TruthQueue()
    said: list[bytes] = []
    while client.outcome is None:
        truth = simulator.truth_datagram()
        if truth is not None:
            truth_queue.put([truth])
        answer = onboard.receive_sensors(simulator.sensor_datagram())
        said += [datagram for _, datagram in onboard.ground_datagrams()]
        question = onboard.question(_GROUND)
        if question is not None:
            now_us = onboard.now_us
            said.append(question)
            sent = ground_turn(client, capture, truth_queue.until(now_us), said, now_us)
            said.clear()
            for datagram in (*sent, turns.answer(now_us * 1000)):
                onboard.receive_ground(datagram, _GROUND)
            capture.flush(now_us)
        if watch is not None and not watch(onboard, simulator):
            client.interrupt("stopped by who watched it")
        if answer is not None:
            simulator.receive(answer)
        simulator.advance()
    return client.outcome.of_mission(mission)
