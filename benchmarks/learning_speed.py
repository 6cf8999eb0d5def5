"""Physics steps per second of the environments, compared with mujoco.rollout of the same vehicle.

    pip install -e '.[peers]'
    python benchmarks/learning_speed.py

A physics step is one Runge-Kutta step of the plant of 4 ms. The environments are stepped as in training, with
random actions; observations and rewards are computed, and ended episodes are reset. MuJoCo's model has the
same masses, inertia and rotors with their lag, and a cable that is a tendon with a maximum length; it has no
drag, no ground and no delays, and computes no observations, which is in its favour.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

import plumbline.learning
from sitl.plant.records import Truth
from sitl.vehicles.truth import load_truth

MIN_DURATION_S = 2.0  # of each measurement
TIMESTEP_S = 0.004

MODEL = """<mujoco>
  <option timestep="{h}" integrator="{integrator}" gravity="0 0 -{g}"/>
  <worldbody>
    <body name="vehicle" pos="0 0 {top}"><freejoint/>
      <inertial pos="0 0 0" mass="{quad_mass}" diaginertia="{J}"/><site name="hook"/>
      <site name="r1" pos="{l} 0 0"/><site name="r2" pos="0 {l} 0"/>
      <site name="r3" pos="-{l} 0 0"/><site name="r4" pos="0 -{l} 0"/>
    </body>
    <body name="load" pos="0 0 3">
      <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="{load_mass}" diaginertia="1e-4 1e-4 1e-4"/><site name="eye"/>
    </body>
  </worldbody>
  <tendon><spatial limited="true" range="0 {L}"><site site="hook"/><site site="eye"/></spatial></tendon>
  <actuator>{rotors}</actuator>
</mujoco>"""
ROTOR = (
    '<general site="r{i}" gear="0 0 1 0 0 {yaw}" dyntype="filterexact" dynprm="{tau}" ctrlrange="0 {most}"/>'
)


def mujoco_model(truth: Truth, integrator: str) -> Any:
    """The vehicle as a MuJoCo model."""
    import mujoco

    c, tau, max_force = truth.torque_ratio, truth.rotor_tau, truth.rotor_max
    rotors = "".join(
        ROTOR.format(i=i, yaw=sign * c, tau=tau, most=max_force)
        for i, sign in enumerate((-1, 1, -1, 1), start=1)
    )
    text = MODEL.format(
        h=TIMESTEP_S,
        integrator=integrator,
        g=truth.gravity,
        top=3.0 + truth.cable_length,
        quad_mass=truth.quad_mass,
        load_mass=truth.load_mass,
        J=" ".join(map(str, truth.inertia)),
        l=truth.arm,
        L=truth.cable_length,
        rotors=rotors,
    )
    return mujoco.MjModel.from_xml_string(text)


def rate(run: Callable[[], int]) -> float:
    """Steps per second of a function that returns how many it took: the best of three measurements."""
    run()
    found = []
    for _ in range(3):
        steps, began_s = 0, time.perf_counter()
        while time.perf_counter() - began_s < MIN_DURATION_S / 3:
            steps += run()
        found.append(steps / (time.perf_counter() - began_s))
    return max(found)


def mujoco_rate(integrator: str, flights: int, threads: int) -> float:
    """Steps per second of mujoco.rollout; the vehicle hovers, with the cable taut."""
    import mujoco
    from mujoco.rollout import Rollout

    truth = load_truth("bebop")
    model, ticks = mujoco_model(truth, integrator), 100
    data = [mujoco.MjData(model) for _ in range(threads)]
    hover = 0.25 * (truth.quad_mass + truth.load_mass) * truth.gravity
    data[0].act[:] = hover
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    state = np.zeros((flights, size))
    mujoco.mj_getState(model, data[0], state[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    state[:] = state[0]
    control = np.full((flights, ticks, 4), hover)
    with Rollout(nthread=threads) as rollout:

        def run() -> int:
            rollout.rollout(model, data, state, control)
            return flights * ticks

        return rate(run)


def environment_rate(count: int, threads: int, **options: Any) -> float:
    """Steps per second of `count` environments."""
    envs = gymnasium.make_vec(
        plumbline.learning.HOVER, count, threads=threads, autoreset_mode="SameStep", **options
    )
    envs.action_space.seed(1)
    actions = [0.3 * envs.action_space.sample() for _ in range(10)]
    envs.reset(seed=1)
    ticks = envs.unwrapped.scenario.ticks

    def run() -> int:
        for action in actions:
            envs.step(action)
        return len(actions) * count * ticks

    found = rate(run)
    envs.close()
    return found


def main() -> None:
    """Measure all, and print the table."""
    cores = len(os.sched_getaffinity(0))
    rows: list[tuple[str, int, float]] = []
    for threads in sorted({1, cores}):
        for integrator in ("RK4", "Euler"):
            rows.append(
                (
                    f"mujoco.rollout, {integrator}, 1024 flights",
                    threads,
                    mujoco_rate(integrator, 1024, threads),
                )
            )
        for count in (64, 1024):
            rows.append((f"truth observed, {count} environments", threads, environment_rate(count, threads)))
        rows.append(
            (
                "estimate observed, 256 environments",
                threads,
                environment_rate(256, threads, observation="estimate"),
            )
        )
    base = {threads: found for name, threads, found in rows if "RK4" in name}
    euler = {threads: found for name, threads, found in rows if "Euler" in name}
    print("| what steps | threads | physics steps/s | to MuJoCo, RK4 | to MuJoCo, Euler |")
    print("|---|---|---|---|---|")
    for name, threads, found in rows:
        ratios = f"{found / base[threads]:.1f} | {found / euler[threads]:.1f}"
        print(f"| {name} | {threads} | {found:,.0f} | {ratios} |")


if __name__ == "__main__":
    main()
