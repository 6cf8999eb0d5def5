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
from gcs.clients.lockstep import LockstepTurns, ground_turn
from gcs.closed_ticks import NOTHING, ClosedTicks
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
    shown: Callable[[], None] = lambda: None,
) -> Outcome:
    """Fly a mission from take-off to landing; the log gets what `gcs fly --lockstep` writes.

    `watch` is shown the cores at every tick, before the world moves on; False from it ends the flight. Where
    nobody watches, ticks at which nothing is decided are flown in machine code. `client` is the ground
    station's side of it, if it is not to be as usual; `shown` is called when it has had its turn.
    """
    home = Home()
    onboard = build_onboard(conditions, home)
    onboard.add_link(_GROUND)
    simulator = build_simulator(conditions, home)
    client = client or FlightClient(items_of(mission, home), expected_duration_s(mission))
    capture = Capture(log)
    turns = LockstepTurns()
    ticks = ClosedTicks(onboard, simulator) if watch is None else None
    told: list[bytes] = []  # truth of the window that is open
    said: list[bytes] = []  # by the vehicle, in it
    silent_until_us = 0  # as the ground station has promised

    def turn(now_us: int) -> None:
        """The ground station's, at the end of a window; the vehicle hears what it says."""
        nonlocal silent_until_us
        for datagram in ground_turn(client, capture, told, said, now_us):
            onboard.receive_ground(datagram, _GROUND)
        if now_us >= silent_until_us:  # before, nobody waits for an answer
            onboard.receive_ground(turns.answer(now_us * 1000, client.silent_until_us), _GROUND)
            silent_until_us = client.silent_until_us
        told.clear()
        said.clear()
        capture.flush(now_us)
        shown()

    while client.outcome is None:
        truth = simulator.truth_datagram()
        if truth is not None:
            told.append(truth)
        flown = NOTHING if ticks is None else ticks.run(b"".join(said), silent_until_us)
        for window in flown.windows:
            told.append(window.truth)
            said[:] = [window.said]
            if window.ends_us and client.outcome is None:
                turn(window.ends_us)
        if flown.moved or client.outcome is not None:
            continue
        if flown.decide is not None:
            answer: bytes | None = onboard.complete(flown.decide)
        else:
            answer = onboard.receive_sensors(simulator.sensor_datagram())
        said += [datagram for _, datagram in onboard.ground_datagrams()]
        question = onboard.question(_GROUND)
        if question is not None:
            said.append(question)
            turn(onboard.now_us)
        if watch is not None and not watch(onboard, simulator):
            client.interrupt("stopped by who watched it")
        if answer is not None:
            simulator.receive(answer)
        simulator.advance()
    return client.outcome.of_mission(mission)
