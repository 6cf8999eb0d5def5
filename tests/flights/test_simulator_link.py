"""The simulator link in lockstep over a bad network: datagrams lost, doubled, late, and garbage between.

Joined by byte queues under a seeded network; on silence the simulator sends again, as its shell does.
"""

from __future__ import annotations

import numpy as np

from autopilot.wire.convert.geodesy import Home
from gcs.closed_loop import Conditions, build_onboard, build_simulator

TICKS = 400
CONDITIONS = Conditions(sensors="lab", seed=3)


def flown(seed: int | None) -> tuple[list[bytes], int]:
    """The sensor datagrams of the first ticks, and how often one had to be sent again."""
    rng = np.random.default_rng(seed)
    bad = seed is not None
    onboard, simulator = build_onboard(CONDITIONS, Home()), build_simulator(CONDITIONS, Home())
    late: list[bytes] = []
    sensors: list[bytes] = []
    resent = 0
    while len(sensors) < TICKS:
        sensors.append(simulator.sensor_datagram())
        sends = 0
        while not simulator.answered:
            sends += 1
            arriving = [] if bad and rng.random() < 0.2 else [sensors[-1]]
            if bad and rng.random() < 0.2:
                arriving.append(sensors[-1])
            if bad and rng.random() < 0.2:
                arriving.append(sensors[int(rng.integers(len(sensors)))])
            if bad and rng.random() < 0.2:
                arriving.append(rng.bytes(60))
            answers = [a for a in map(onboard.receive_sensors, arriving) if a is not None]
            if bad and rng.random() < 0.2:
                late += answers
                answers = []
            if bad and late and rng.random() < 0.5:
                answers.append(late.pop(int(rng.integers(len(late)))))
            for answer in answers:
                simulator.receive(answer)
        resent += sends - 1
        simulator.advance()
    return sensors, resent


def test_a_bad_network_neither_stops_nor_changes_a_run_in_lockstep() -> None:
    good, never = flown(None)
    bad, resent = flown(11)
    assert never == 0
    assert resent > TICKS // 10, "the network was not bad"
    assert bad == good
