"""Vehicles drawn at random: does the autopilot fly each as it is delivered? The table of docs/robustness.md.

    python benchmarks/random_vehicles.py [--vehicles 1000] [--jobs 2] [--docs docs/robustness.md]

Each vehicle flies one mission in three worlds: in that which the autopilot assumes; in wind, with a load that
is up to 30 % lighter or heavier than assumed and up to 24 ms of delay (known); and with a gust of 10 m/s for
2 s that comes 3 s after the mission begins. Prints how many flights were refused before take-off, completed
and lost, and names each that was lost.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from math import cos, exp, log, pi, sin
from pathlib import Path
from random import Random
from statistics import median, quantiles
from typing import NamedTuple

import plumbline
from gcs.experiments.marked_text import write_between

MISSIONS = ("hover", "square", "delivery", "case-a", "case-b", "case-c")
AS_ASSUMED, DISTURBED, GUST = WORLDS = ("as assumed", "disturbed", "gust")
REFUSED, COMPLETED = "refused", "completed"
GUST_M_S, GUST_S, GUST_AFTER_S = 10.0, 2.0, 3.0
BEGIN, END = "<!-- measured: benchmarks/random_vehicles.py -->\n", "<!-- end of measured -->"


class Flight(NamedTuple):
    """One flight, of the vehicle drawn with `seed`."""

    seed: int
    mission: str
    world: str
    outcome: str
    error_m: float | None


def random_vehicle(seed: int) -> plumbline.Vehicle:
    """A quadrotor of 0.1 to 20 kg, proportioned about as those that are built, with a load of 5 to 70 % of
    its mass on 0.4 to 6 m of cable, at least 1.5 arms. Its rotors give 1.6 to 3.5 times the weight of
    both."""
    draw = Random(seed)

    def log_uniform(low: float, high: float) -> float:
        return exp(draw.uniform(log(low), log(high)))

    mass = log_uniform(0.1, 20.0)
    size = (mass / 0.5) ** (1.0 / 3.0)  # relative to the Bebop
    load = mass * log_uniform(0.05, 0.7)
    arm = 0.17 * size * draw.uniform(0.7, 1.4)
    roll = mass * arm**2 * draw.uniform(0.15, 0.5)
    pitch = roll * draw.uniform(0.8, 1.25)
    gravity = 9.81
    return plumbline.Vehicle(
        name=f"random-{seed}",
        frame=draw.choice(("plus", "x")),
        quad_mass_kg=mass,
        arm_m=arm,
        inertia_kg_m2=(roll, pitch, (roll + pitch) * draw.uniform(0.8, 0.99)),
        load_mass_kg=load,
        # on a shorter one the load lies under the vehicle
        cable_length_m=max(1.5 * arm, log_uniform(0.4, 6.0)),
        gravity_m_s2=gravity,
        rotor_min_n=0.0,
        rotor_max_n=draw.uniform(1.6, 3.5) * (mass + load) * gravity / 4.0,
        rotor_tau_s=draw.uniform(0.01, 0.05) * size**0.75,
        torque_ratio_m=draw.uniform(0.01, 0.03) * size,
        quad_drag_n_s_m=0.025 * mass,
        quad_drag_quadratic_n_s2_m2=0.02 * mass,
        load_drag_quadratic_n_s2_m2=3.7e-3 * load ** (2.0 / 3.0),
        load_radius_m=0.065 * load ** (1.0 / 3.0),
    )


def disturbance(seed: int, vehicle: plumbline.Vehicle) -> dict[str, float]:
    """The settings of the world that is not as the autopilot assumes."""
    draw = Random(f"world of {seed}")
    return {
        "SIM_ACT_DELAY_MS": draw.choice((0, 4, 12, 24)),
        "SIM_LOAD_MASS": vehicle.load_mass_kg * draw.uniform(0.7, 1.3),
        "SIM_WIND_E": draw.uniform(-3.0, 3.0),
        "SIM_WIND_N": draw.uniform(-3.0, 3.0),
    }


def gust(seed: int, calm: plumbline.Flight) -> dict[str, float]:
    """The settings of a gust from any side, in a flight that is otherwise as `calm`."""
    columns = calm.telemetry("arrow")
    begin_s = columns["time_s"].filter(columns["in_mission"])[0].as_py()
    angle = Random(f"gust of {seed}").uniform(0.0, 2.0 * pi)
    return {
        "SIM_GUST_E": GUST_M_S * cos(angle),
        "SIM_GUST_N": GUST_M_S * sin(angle),
        "SIM_GUST_AT_S": begin_s + GUST_AFTER_S,
        "SIM_GUST_FOR_S": GUST_S,
    }


def flights_of(seed: int) -> list[Flight]:
    """The flights of the vehicle drawn with this seed."""
    vehicle, mission = random_vehicle(seed), MISSIONS[seed % len(MISSIONS)]
    found = []

    def fly(world: str, settings: dict[str, float]) -> plumbline.Flight:
        flight = plumbline.fly(mission, vehicle=vehicle, seed=seed, settings=settings)
        found.append(Flight(seed, mission, world, flight.outcome, flight.summary["load_error_max_m"]))
        return flight

    refused = [Flight(seed, mission, world, REFUSED, None) for world in WORLDS]
    try:
        calm = fly(AS_ASSUMED, {})
    except plumbline.Error:
        return refused
    if calm.outcome == REFUSED:  # by the autopilot
        return refused
    fly(DISTURBED, disturbance(seed, vehicle))
    if calm.outcome == COMPLETED:
        fly(GUST, gust(seed, calm))
    else:  # nor is it in a gust
        found.append(found[0]._replace(world=GUST))
    return found


def table(flights: list[Flight]) -> Iterator[str]:
    """The lines of the table: a row for each mission and world."""
    groups = defaultdict(list)
    for flight in flights:
        groups[flight.mission, flight.world].append(flight)
    yield "| mission | world | refused | completed | lost | median error | 95th percentile | worst |"
    yield "|---|---|---|---|---|---|---|---|"
    for mission in MISSIONS:
        for world in WORLDS:
            group = groups[mission, world]
            errors = [1e3 * one.error_m for one in group if one.outcome == COMPLETED and one.error_m]
            refused = sum(one.outcome == REFUSED for one in group)
            figures = ["", "", ""]
            if len(errors) > 1:
                worst_twentieth = quantiles(errors, n=20, method="inclusive")[-1]
                figures = [f"{value:.0f} mm" for value in (median(errors), worst_twentieth, max(errors))]
            lost = len(group) - refused - len(errors)
            cells = (mission, world, str(refused), str(len(errors)), str(lost), *figures)
            yield f"| {' | '.join(cells)} |"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--vehicles", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--docs", type=Path, help="the page that shows the table")
    options = parser.parse_args()
    flights: list[Flight] = []
    with ProcessPoolExecutor(options.jobs) as pool:
        for found in pool.map(flights_of, range(1, options.vehicles + 1)):
            flights += found
            for one in found:
                if one.outcome not in (REFUSED, COMPLETED):
                    print(one, flush=True)
    lines = list(table(flights))
    print("\n".join(lines))
    if options.docs:
        write_between(options.docs, BEGIN, END, "\n".join(("", *lines, "", "")))
    return 0


if __name__ == "__main__":
    sys.exit(main())
