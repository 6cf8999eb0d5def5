"""Speed of other simulators in closed loop, compared with Plumbline, in one run on this machine.

    pip install '.[peers]'
    python benchmarks/peers.py [--repeat 5] [--docs docs/performance.md]

Each flies its own model, as its authors set it up: udaan a quadrotor whose load follows a circle by the law
of Sreenath et al. (2013), in its own physics and in MuJoCo's; RotorPy a quadrotor without a load on a circle,
by its law on SE(3); MuJoCo alone has no law, only the physics of our vehicle with its load, which hovers.
They are flown in turn, and the median of their processor time counts.
"""

from __future__ import annotations

import argparse
import importlib.util
import logging
import math
import statistics
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.learning_speed import TIMESTEP_S, mujoco_model
from gcs.closed_loop import Conditions
from gcs.experiments.marked_text import write_between
from gcs.sweep.flight import fly, start_times
from missions.fileformat import load_mission
from sitl.vehicles.truth import load_truth

FLIGHT_S = 20.0  # of a peer's flight; ours is longer, which costs less per second
RADIUS_M, PERIOD_S = 1.0, 8.0
BEGIN, END = "<!-- peers -->\n", "<!-- end of peers -->"


class Peer(NamedTuple):
    """What flies, what its flight includes, and a call that flies and returns the seconds flown."""

    name: str
    includes: str
    fly: Callable[[], float]


def circle(t: float) -> tuple[Any, Any, Any]:
    """Position, velocity and acceleration (m, s) of a load on a circle, each an array of three."""
    w = 2.0 * math.pi / PERIOD_S
    c, s = RADIUS_M * math.cos(w * t), RADIUS_M * math.sin(w * t)
    return np.array([c, s, 1.0]), np.array([-w * s, w * c, 0.0]), np.array([-w * w * c, -w * w * s, 0.0])


def plumbline_peer() -> Peer:
    """Case B with the sensors `lab`, without messages."""
    mission, conditions = load_mission("case-b"), Conditions()
    board = start_times(mission, conditions)
    return Peer(
        "**Plumbline**, Case B",
        "load, slack cable, ground, rotors, sensors with noise and delay, estimator, law: 250 Hz",
        lambda: fly(mission, conditions, board).flight_s,
    )


def udaan(mujoco_cable: str | None) -> Peer:
    """The load on a circle, by udaan's own law."""
    from udaan.models.quadrotor_cspayload import QuadrotorCsPayloadBase, QuadrotorCsPayloadMujoco

    def fly_once() -> float:
        if mujoco_cable is None:
            model: Any = QuadrotorCsPayloadBase()
        else:
            model = QuadrotorCsPayloadMujoco(render=False, cable_model=mujoco_cable)
        model.payload_controller.setpoint = circle
        model.simulate(tf=FLIGHT_S, payload_position=circle(0.0)[0])
        # a flight that is fast only because the vehicle fell does not count
        assert np.linalg.norm(model.state.payload_position - circle(model.t)[0]) < 1.0, "udaan has crashed"
        return float(model.t)

    if mujoco_cable is None:
        return Peer("udaan, its own physics", "load on a taut cable, law: 200 Hz, Euler at 800 Hz", fly_once)
    return Peer(f"udaan, MuJoCo's {mujoco_cable}", "load, law; truth instead of sensors", fly_once)


def rotorpy(rate_hz: int) -> Peer:
    """A quadrotor without a load on a circle, by RotorPy's own law, as its examples set it up."""
    from rotorpy.controllers.quadrotor_control import SE3Control
    from rotorpy.environments import Environment
    from rotorpy.trajectories.circular_traj import ThreeDCircularTraj
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    def fly_once() -> float:
        turns = np.array([1.0 / PERIOD_S] * 3)
        path = ThreeDCircularTraj(radius=np.array([RADIUS_M, RADIUS_M, 0.0]), freq=turns)
        world = Environment(Multirotor(quad_params), SE3Control(quad_params), path, sim_rate=rate_hz)
        return float(world.run(t_final=FLIGHT_S, plot=False, verbose=False)["time"][-1])

    return Peer(f"RotorPy at {rate_hz} Hz", "no load; rotors, drag, inertial unit, law", fly_once)


def mujoco() -> Peer:
    """The physics of our vehicle alone, which hovers."""
    import mujoco as mj

    truth = load_truth("bebop")
    model = mujoco_model(truth, "RK4")
    data = mj.MjData(model)

    def fly_once() -> float:
        mj.mj_resetData(model, data)
        data.act[:] = data.ctrl[:] = 0.25 * (truth.quad_mass + truth.load_mass) * truth.gravity
        mj.mj_step(model, data, nstep=round(FLIGHT_S / TIMESTEP_S))
        return FLIGHT_S

    return Peer("MuJoCo, physics alone", "load on a tendon, rotors: Runge-Kutta at 250 Hz; no law", fly_once)


def processor_s_of_a_second(peer: Peer) -> float:
    """Processor seconds that one second of flight takes."""
    began = time.process_time()
    flown_s = peer.fly()
    return (time.process_time() - began) / flown_s


def main() -> None:
    """Fly all in turn, print the table, and with `--docs` write it into the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--docs", type=Path)
    options = parser.parse_args()
    missing = [name for name in ("mujoco", "rotorpy", "udaan") if importlib.util.find_spec(name) is None]
    if missing:
        parser.error(f"not installed: {', '.join(missing)} (pip install '.[peers]')")
    logging.disable(logging.INFO)
    warnings.simplefilter("ignore")
    peers = [
        plumbline_peer(),
        mujoco(),
        udaan(None),
        udaan("tendon"),
        udaan("links"),
        rotorpy(100),
        rotorpy(500),
    ]
    for peer in peers:
        peer.fly()  # what is loaded or compiled at the first flight does not count
    costs: dict[str, list[float]] = {peer.name: [] for peer in peers}
    for _ in range(options.repeat):
        for peer in peers:
            costs[peer.name].append(processor_s_of_a_second(peer))
    base = statistics.median(costs[peers[0].name])
    lines = ["| what flies | what a flight holds | times real time | Plumbline is so many times as fast |"]
    lines.append("| --- | --- | --- | --- |")
    for peer in peers:
        cost = statistics.median(costs[peer.name])
        lines.append(f"| {peer.name} | {peer.includes} | {1.0 / cost:.3g} | {cost / base:.3g} |")
    text = "\n".join(lines) + "\n"
    print(text)
    if options.docs:
        write_between(options.docs, BEGIN, END, text)


if __name__ == "__main__":
    main()
