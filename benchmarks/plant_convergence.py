"""Error of the plant as a function of its step, in each mode: the table from which steps were chosen.

Each case flies the same commands (constant over ticks of 4 ms) with steps h and compares the positions of
both bodies and the attitude, along the whole flight, with a run at a step 32 times shorter than the shortest.
The order is the slope of log(error) over log(h).

    python benchmarks/plant_convergence.py [--json]
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.linear import axpy
from autopilot.geometry.so3 import quat_exp
from sitl.plant.by_value import Forces, StateWithRotors, advance_many, initial_state
from sitl.plant.records import Truth
from sitl.vehicles.truth import load_truth

TICK = 4e-3
STEPS = (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4)
# near the ground `advance` divides steps longer than its CONTACT_STEP, so longer ones cannot be compared
STEPS_CONTACT = (5e-4, 2.5e-4, 1.25e-4, 6.25e-5, 3.125e-5)
WIND = (2.0, -1.0, 0.5)

Case = tuple[Truth, StateWithRotors, Callable[[int], Forces], float]


def _hovering(truth: Truth) -> StateWithRotors:
    """Hanging at rest, 5 m up, rotors at hover."""
    hover = 0.25 * (truth.quad_mass + truth.load_mass) * truth.gravity
    return initial_state(truth)._replace(
        x_load=(0.0, 0.0, 5.0),
        x_quad=(0.0, 0.0, 5.0 + truth.cable_length),
        q_cable=(0.0, 0.0, -1.0),
        taut=1.0,
        rotor_force=(hover,) * 4,
        vehicle_on_ground=0.0,
        load_on_ground=0.0,
    )


def _taut() -> Case:
    truth = load_truth("bebop")
    tilt = (0.3, 0.0, -0.95)
    length = math.hypot(*tilt)
    q = (tilt[0] / length, 0.0, tilt[2] / length)
    start = _hovering(truth)._replace(q_cable=q, q_cable_dot=(0.0, 1.5, 0.0))
    start = start._replace(
        x_quad=axpy(-truth.cable_length, q, start.x_load),
        v_quad=(0.0, -1.5 * truth.cable_length, 0.0),
    )
    rng = np.random.default_rng(1)
    trims = 1.35 + 0.15 * rng.standard_normal((500, 4))

    def command(tick: int) -> Forces:
        a, b, c, d = (float(x) for x in trims[tick])
        return (a, b, c, d)

    return truth, start, command, 1.0


def _slack() -> Case:
    truth = load_truth("bebop")
    start = _hovering(truth)
    start = start._replace(
        x_load=(0.0, 0.0, start.x_quad[2] - 0.2),
        taut=0.0,
        v_load=(0.3, 0.1, 0.5),
        omega_body=(4.0, -3.0, 2.0),
    )
    return truth, start, lambda tick: (0.0, 0.1, 0.0, 0.1), 0.4


def _contact() -> Case:
    truth = load_truth("bebop")
    start = initial_state(truth)
    start = start._replace(
        x_quad=(start.x_quad[0], 0.0, 0.4),
        v_quad=(0.3, 0.2, 0.0),
        quat_wxyz=quat_exp((0.1, -0.06, 0.3)),
        x_load=(0.0, 0.0, 0.25),
        v_load=(0.2, 0.3, 0.0),
    )
    return truth, start, lambda tick: (0.0, 0.0, 0.0, 0.0), 0.6


def _switching() -> Case:
    truth = load_truth("bebop")
    start = _hovering(truth)._replace(v_load=(0.2, 0.1, 5.0), v_quad=(0.2, 0.1, 5.0))

    # Thrown upwards with the rotors at rest, the vehicle is braked by its drag while the load flies on; then
    # full thrust until the cable snaps taut; and so on. The rotors' lag puts the release inside a step.
    def command(tick: int) -> Forces:
        return (0.0, 0.0, 0.0, 0.0) if tick % 100 < 30 else (1.9, 1.93, 1.91, 1.92)

    return truth, start, command, 1.2


CASES: dict[str, Callable[[], Case]] = {
    "taut": _taut,
    "slack": _slack,
    "switching": _switching,
    "contact": _contact,
}


def fly(case: Case, h: float) -> tuple[NDArray[np.float64], StateWithRotors]:
    """Positions (m) and attitude after every tick, shape (ticks, 10), and the last state."""
    truth, state, command, duration = case
    per_tick = round(TICK / h)
    rows = []
    for tick in range(round(duration / TICK)):
        state = advance_many(state, truth, command(tick), WIND, h, per_tick)
        rows.append([*state.x_load, *state.x_quad, *state.quat_wxyz])
    if state.diverged:
        raise ArithmeticError("the flight left the domain of the model")
    return np.array(rows), state


def study(name: str, steps: tuple[float, ...] = ()) -> tuple[dict[float, float], float]:
    """Largest error (m or quaternion unit) for each step, and the order."""
    steps = steps or (STEPS_CONTACT if name == "contact" else STEPS)
    case = CASES[name]()
    reference, _ = fly(case, min(steps) / 32)
    errors = {h: float(np.abs(fly(case, h)[0] - reference).max()) for h in steps}
    # errors near the rounding of the reference, 250,000 steps a second, say nothing about the order
    usable = np.log([(h, e) for h, e in errors.items() if e > 2e-11])
    order = float(np.polyfit(usable[:, 0], usable[:, 1], 1)[0]) if len(usable) > 1 else math.nan
    return errors, order


def call_time_us(h: float) -> dict[str, float]:
    """Wall time of one call from Python, in the air and on the ground."""
    truth = load_truth("bebop")
    times = {}
    for name, state in (("air", _hovering(truth)), ("ground", initial_state(truth))):
        advance_many(state, truth, state.rotor_force, WIND, h, 1)
        begin = time.perf_counter()
        for _ in range(5000):
            advance_many(state, truth, state.rotor_force, WIND, h, 1)
        times[name] = (time.perf_counter() - begin) / 5000 * 1e6
    return times


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print the record instead of the table")
    as_json = parser.parse_args().json
    found = {name: study(name) for name in CASES}
    calls = call_time_us(TICK)
    if as_json:
        record = {
            name: {"order": order, "errors": {f"{h * 1e3:g} ms": e for h, e in errors.items()}}
            for name, (errors, order) in found.items()
        }
        print(json.dumps({"cases": record, "call_us": calls}, indent=2))
        return 0
    print("step      " + "".join(f"{name:>12}" for name in found))
    for h in sorted({*STEPS, *STEPS_CONTACT}, reverse=True):
        cells = [f"{errors[h]:12.1e}" if h in errors else " " * 12 for errors, _ in found.values()]
        print(f"{f'{h * 1e3:g} ms':<10}" + "".join(cells))
    print("order     " + "".join(f"{order:12.2f}" for _, order in found.values()))
    print(f"one call of 4 ms: {calls['air']:.1f} us in the air, {calls['ground']:.1f} us on the ground")
    return 0


if __name__ == "__main__":
    sys.exit(main())
