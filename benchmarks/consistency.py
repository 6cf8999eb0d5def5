"""Consistency of the estimator: its own covariance compared with its true error, phase by phase.

    python benchmarks/consistency.py [--mission NAME] [--vehicle NAME] [--sensors NAME ...] [--wind M_S ...]
                                     [--seeds N] [--set NAME=VALUE ...] [--jobs N] [--docs PAGE]

Flies a mission with each seed, as in a sweep (without messages), in calm air and in wind, and compares the
error of the estimate with the filter's covariance ten times a second. Prints, for each phase of the flight
and each part of the error state, the share of instants inside the bounds that contain 95 % of a consistent
filter's errors, and in brackets the NEES (error^T P^-1 error) per degree of freedom, 1 for a consistent
filter. While the cable is slack, position and speed of the load replace direction and rate.

Position and velocity are those of the point that the autopilot takes for the cable's attachment (VEH_ATT_);
direction and rate are those of the line from this point to the load, which the sensors show and the laws use.
If the cable is attached elsewhere, it has another direction.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from math import sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from autopilot.core.tick import CoreConstants
from autopilot.estimation.records import (
    ACCEL_BIAS,
    ATTITUDE,
    DIRECTION,
    GYRO_BIAS,
    POSITION,
    RATE,
    TRACKER,
    VELOCITY,
    EstimatorState,
)
from autopilot.geometry.packed import unpack
from autopilot.geometry.s2 import tangent
from autopilot.geometry.so3 import quat_conjugate, quat_log, quat_multiply, rotation_from_quat
from autopilot.supervisor.state import Phase
from gcs.closed_loop import Conditions
from gcs.experiments.marked_text import write_between
from gcs.sweep.cell import cell_of
from gcs.sweep.flight import StartTimes, SweepFlight, start_times
from missions.fileformat import load_mission
from missions.model import Mission
from sitl.sensors.imu import ImuState
from sitl.world import IMU, World

INTERVAL_S = 0.1
CONFIDENCE = 0.95
PARTS = {
    "position": (POSITION, 3),
    "velocity": (VELOCITY, 3),
    "attitude": (ATTITUDE, 3),
    "direction": (DIRECTION, 2),
    "rate": (RATE, 2),
    "gyro bias": (GYRO_BIAS, 3),
    "accel bias": (ACCEL_BIAS, 3),
}
BEGIN, END = "<!-- measured: benchmarks/consistency.py -->\n", "<!-- end of measured -->"
Array = NDArray[np.float64]
# phase -> part -> NEES of each instant, and its number of degrees of freedom
Nees = dict[str, dict[str, list[tuple[float, int]]]]


def error_of(flight: SweepFlight, estimate: EstimatorState) -> Array:
    """Truth minus estimate, in the axes of the error state."""
    plant = unpack(World, flight.world.world, 0).plant
    biases = unpack(ImuState, flight.world.errors[IMU], 0)
    vehicle, load = estimate.vehicle, estimate.load
    attachment = unpack(CoreConstants, flight.core.rows.constants, 0).vehicle.attachment
    R = np.array(rotation_from_quat(plant.quat_wxyz))
    x_attachment = plant.x_quad + R @ attachment
    v_attachment = plant.v_quad + R @ np.cross(plant.omega_body, attachment)
    line = plant.x_load - x_attachment
    distance = np.linalg.norm(line)
    q = line / distance
    q_dot = np.array(tangent(tuple(q), tuple(plant.v_load - v_attachment))) / distance
    axes = np.array([load.across, np.cross(load.q_cable, load.across)])
    rotation = quat_log(quat_multiply(plant.quat_wxyz, quat_conjugate(vehicle.quat_wxyz)))
    return np.concatenate(
        [
            x_attachment - vehicle.x_quad,
            v_attachment - vehicle.v_quad,
            rotation,
            np.subtract(biases.gyro_bias, vehicle.gyro_bias),
            np.subtract(biases.accel_bias, vehicle.accel_bias),
            axes @ (q - load.q_cable),
            axes @ (q_dot - load.q_cable_dot),
        ]
    )


def add_nees(flight: SweepFlight, found: dict[str, list[tuple[float, int]]]) -> float:
    """Add the NEES of this instant to `found`; returns the error of the direction to the load, rad."""
    estimate = unpack(EstimatorState, flight.core.rows.estimator, 0)
    error, P = error_of(flight, estimate), flight.core.rows.history.covariance
    slack = estimate.load.taut == 0.0
    for part, (first, count) in PARTS.items():
        at = slice(first, first + count)
        if slack and part in ("direction", "rate"):
            continue
        found[part].append((float(error[at] @ np.linalg.solve(P[at, at], error[at])), count))
    if slack:
        plant, load = unpack(World, flight.world.world, 0).plant, estimate.load
        place, _, speed = load.covariance
        is_tracked = load.source == TRACKER
        difference = np.subtract(plant.x_load, load.x_load)
        if not is_tracked:  # the load lies on the ground: its position is known relative to the vehicle
            difference = (difference - error[POSITION : POSITION + 3])[:2]
        found["load place"].append((float(difference @ difference) / place, len(difference)))
        if is_tracked:
            difference = np.subtract(plant.v_load, load.v_load)
            found["load speed"].append((float(difference @ difference) / speed, 3))
    return float(np.hypot(error[DIRECTION], error[DIRECTION + 1]))


def fly_nees(mission: Mission, conditions: Conditions, start: StartTimes) -> tuple[Nees, dict[str, object]]:
    """The NEES of one flight by phase, and its result."""
    found: Nees = defaultdict(lambda: defaultdict(list))
    flight = SweepFlight(cell_of(mission, conditions), conditions.seed, start)
    interval = round(INTERVAL_S * 1e6 / flight.tick_us)
    next_tick, direction_errors = interval, [0.0]
    while not flight.result.outcome:
        flight.advance(next_tick)
        if flight.tick >= next_tick:
            next_tick += interval
            phase = flight.core.flight.phase
            if flight.airborne_us >= 0 and phase != Phase.DISARMED:
                direction_error = add_nees(flight, found[phase.name.lower()])
                if phase == Phase.MISSION:
                    direction_errors.append(direction_error)
    end = flight.conclude()
    return {phase: dict(parts) for phase, parts in found.items()}, {
        "seed": conditions.seed,
        "outcome": end.outcome,
        "reason": end.reason,
        "error_mm": 1e3 * end.load_error_max_m,
        "rms_mm": 1e3 * end.load_error_rms_m,
        "cable_deg": float(np.degrees(np.sqrt(np.mean(np.square(direction_errors))))),
        "saturated": end.saturated_fraction,
    }


def inside(values: list[tuple[float, int]]) -> float:
    """The share of instants inside the bounds."""
    nees, dof = np.array(values).T
    return float((nees <= chi2.ppf(CONFIDENCE, dof)).mean())


def per_degree(values: list[tuple[float, int]]) -> float:
    """NEES per degree of freedom."""
    nees, dof = np.array(values).T
    return float(nees.sum() / dof.sum())


def table(title: str, found: Nees) -> str:
    """Rows of a Markdown table: one row per phase, one column per part."""
    parts = [*PARTS, "load place", "load speed"]
    rows = [
        f"| {title} | seconds | " + " | ".join(parts) + " |",
        "|---" * (len(parts) + 2) + "|",
    ]
    for phase in (one.name.lower() for one in Phase):
        if phase not in found:
            continue
        cells = [
            f"{inside(found[phase][part]):.2f} ({per_degree(found[phase][part]):.2f})"
            if found[phase].get(part)
            else ""
            for part in parts
        ]
        seconds = INTERVAL_S * len(found[phase]["position"])
        rows.append(f"| {phase.replace('_', ' ')} | {seconds:.0f} | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def _fly_nees(task: tuple[Mission, Conditions, StartTimes]) -> tuple[Nees, dict[str, object]]:
    return fly_nees(*task)


def measure(
    mission: Mission,
    vehicle: str,
    sensors: str,
    settings: dict[str, float],
    seeds: int,
    pool: ProcessPoolExecutor,
) -> tuple[Nees, list[dict[str, object]]]:
    """The NEES of `seeds` flights together, and the result of each."""
    conditions = Conditions(vehicle, sensors, settings=settings)
    start = start_times(mission, conditions)
    tasks = [(mission, replace(conditions, seed=s + 1), start) for s in range(seeds)]
    together: Nees = defaultdict(lambda: defaultdict(list))
    ends = []
    for found, end in pool.map(_fly_nees, tasks):
        ends.append(end)
        for phase, parts in found.items():
            for part, values in parts.items():
                together[phase][part] += values
    return together, ends


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--mission", default="case-b")
    parser.add_argument("--vehicle", default="bebop")
    parser.add_argument("--sensors", nargs="*", default=["lab", "rtk"])
    parser.add_argument("--wind", nargs="*", type=float, default=[0.0, 5.0], metavar="M_S")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--docs", type=Path, help="the page that shows the tables")
    options = parser.parse_args()
    settings_for_all = {
        name: float(value) for name, _, value in (pair.partition("=") for pair in options.set)
    }
    mission = load_mission(options.mission)
    tables = []
    with ProcessPoolExecutor(options.jobs) as pool:
        for sensors in options.sensors:
            for wind in options.wind:
                settings = {**settings_for_all, **({"SIM_WIND_E": wind} if wind else {})}
                found, ends = measure(mission, options.vehicle, sensors, settings, options.seeds, pool)
                title = f"`{sensors}`, " + (f"{wind:g} m/s of wind" if wind else "calm")
                tables.append(table(title, found))
                print(tables[-1])
                worst = max(float(str(end["error_mm"])) for end in ends)
                rms = sqrt(float(np.mean([float(str(end["rms_mm"])) ** 2 for end in ends])))
                slant = max(float(str(end["cable_deg"])) for end in ends)
                saturated = max(float(str(end["saturated"])) for end in ends)
                completed = sum(end["outcome"] == "completed" for end in ends)
                print(
                    f"\n{completed} of {len(ends)} completed, worst load error {worst:.1f} mm,"
                    f" RMS {rms:.2f} mm, cable at worst {slant:.2f} deg RMS,"
                    f" saturated at most {100 * saturated:.1f} %\n",
                    flush=True,
                )
                for end in ends:
                    if end["outcome"] != "completed":
                        print(json.dumps(end))
    if options.docs:
        write_between(options.docs, BEGIN, END, "\n".join(f"{each}\n" for each in tables))
    return 0


if __name__ == "__main__":
    sys.exit(main())
