"""Missions drawn at random: is each flown to its end, and does it look well? The table of docs/robustness.md.

    python benchmarks/random_missions.py [--missions 1000] [--jobs 2] [--docs docs/robustness.md]

Each mission has one to six steps between take-off and landing: waypoints up to 12 m away, speeds, delays,
returns, a longer or shorter cable, the release of the load. It is flown by one of the shipped vehicles with
one of the sensor profiles, seven in ten of them in wind of up to 8 m/s with gusts. Prints each flight that
was not completed, and the flights that were completed and look worst by one of the measures: greatest tilt
and rate of turn, rotors at their limits, heading turned away, time on the ground before the rotors stop.
`--show N` describes the flight of the mission drawn with seed N.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from math import degrees, hypot
from pathlib import Path
from random import Random
from statistics import mean, median, quantiles

import numpy as np

import plumbline
from gcs.experiments.marked_text import write_between
from plumbline import Delay, Land, Mission, Release, ReturnHome, Speed, Takeoff, Waypoint, Winch

VEHICLES = ("bebop", "bebop-real", "heavy", "heavy-real", "hexarotor", "octorotor", "iris")
SENSORS = ("lab", "lab-real", "rtk", "field", "lab-blind", "rtk-blind")
WINDY_SHARE = 0.7
COMPLETED, REFUSED = "completed", "refused"
MEASURES = ("tilt_deg", "turn_rad_s", "saturated", "yaw_deg", "touchdown_s")
STANDING_M = 0.02  # the height above that at the end of the flight below which the vehicle is on the ground
BEGIN, END = "<!-- measured: benchmarks/random_missions.py -->\n", "<!-- end of random missions -->"


@dataclass(frozen=True)
class Drawn:
    """A mission, and the conditions under which it is flown."""

    seed: int
    mission: Mission
    vehicle: str
    sensors: str
    settings: dict[str, float]

    @property
    def wind_m_s(self) -> float:
        return hypot(self.settings.get("SIM_WIND_E", 0.0), self.settings.get("SIM_WIND_N", 0.0))


@dataclass(frozen=True)
class Flight:
    """How it was flown; the figures are those of the whole flight, None if it was not completed."""

    seed: int
    vehicle: str
    sensors: str
    wind_m_s: float
    outcome: str
    reason: str
    error_m: float | None = None  # of the load in the mission; None also if it was released first
    tilt_deg: float | None = None
    turn_rad_s: float | None = None  # body rate
    saturated: float | None = None  # share of the time with a rotor at its limit
    yaw_deg: float | None = None  # greatest angle by which the heading is away from where it points
    touchdown_s: float | None = None  # from the vehicle's last touch of the ground to the stop of its rotors


def drawn(seed: int) -> Drawn:
    """The mission with this seed, and its conditions."""
    draw = Random(seed)
    mission = Mission(f"drawn-{seed}", [Takeoff(draw.uniform(0.8, 6.0)), *_steps(draw), Land()])
    settings = {}
    vehicle, sensors = draw.choice(VEHICLES), draw.choice(SENSORS)
    if draw.random() < WINDY_SHARE:
        settings = {
            "SIM_WIND_E": draw.uniform(-7.0, 7.0),
            "SIM_WIND_N": draw.uniform(-4.0, 4.0),
            "SIM_GUST_STD": draw.uniform(0.0, 1.5),
        }
    return Drawn(seed, mission, vehicle, sensors, settings)


def _steps(draw: Random) -> Iterator[plumbline.Step]:
    released = False
    for _ in range(draw.randint(1, 6)):
        kind = draw.random()
        if kind < 0.55:
            east_m, north_m = draw.uniform(-12.0, 12.0), draw.uniform(-12.0, 12.0)
            yield Waypoint(east_m, north_m, draw.uniform(0.6, 6.0), draw.choice((0.0, 0.0, 1.0)))
        elif kind < 0.65:
            yield Speed(draw.uniform(0.5, 5.0))
        elif kind < 0.75:
            yield Delay(draw.uniform(0.5, 5.0))
        elif kind < 0.85:
            yield ReturnHome()
        elif not released and kind < 0.92:
            released = True
            yield Release()
        elif not released:
            yield Winch(draw.uniform(-0.2, 0.6))


def flown(seed: int) -> Flight:
    """Fly the mission with this seed."""
    one = drawn(seed)
    told = (seed, one.vehicle, one.sensors, one.wind_m_s)
    try:
        flight = fly(one)
    except plumbline.Error as error:
        return Flight(*told, REFUSED, str(error))
    if flight.outcome != COMPLETED:
        return Flight(*told, flight.outcome, flight.reason)
    t = flight.telemetry()
    up = np.cos(t["vehicle_angle_roll_rad"]) * np.cos(t["vehicle_angle_pitch_rad"])
    turn = np.sqrt(sum(t[f"vehicle_rate_{axis}_rad_s"] ** 2 for axis in "xyz"))
    heights = t["vehicle_true_z_m"].to_numpy()
    above = np.flatnonzero(heights > heights[-1] + STANDING_M)
    standing_s = t["time_s"].iloc[-1] - t["time_s"].iloc[above[-1]]
    return Flight(
        *told,
        flight.outcome,
        "",
        flight.summary["load_error_max_m"],
        degrees(float(np.arccos(up.min()))),
        float(turn.max()),
        float((t["rotor_saturated"] > 0).mean()),
        degrees(float(t["vehicle_angle_yaw_rad"].abs().max())),
        float(standing_s),
    )


def fly(one: Drawn) -> plumbline.Flight:
    """The flight; plumbline.Error if it is refused."""
    return plumbline.fly(
        one.mission, vehicle=one.vehicle, sensors=one.sensors, seed=one.seed, settings=one.settings
    )


def table(flights: Sequence[Flight]) -> Iterator[str]:
    """The lines of the table: a row for the flights with each sensor profile, in calm air and in wind."""
    groups = defaultdict(list)
    for one in flights:
        groups[one.sensors, one.wind_m_s > 0.0].append(one)
    yield (
        "| sensors | air | flights | completed | load error: median | 95th percentile | worst | "
        "tilt: 95th percentile | worst | rotors at their limits |"
    )
    yield "|---|---|---|---|---|---|---|---|---|---|"
    for sensors in SENSORS:
        for windy in (False, True):
            group = [one for one in groups[sensors, windy] if one.outcome != REFUSED]
            done = [one for one in group if one.outcome == COMPLETED]
            errors = [1e3 * one.error_m for one in done if one.error_m is not None]
            tilts = [one.tilt_deg for one in done if one.tilt_deg is not None]
            if len(errors) < 2:
                continue
            cells = (
                *(f"`{sensors}`", "wind" if windy else "calm", str(len(group)), str(len(done))),
                *(f"{value:.0f} mm" for value in (median(errors), _percentile95(errors), max(errors))),
                *(f"{value:.0f} deg" for value in (_percentile95(tilts), max(tilts))),
                f"{100.0 * mean(one.saturated or 0.0 for one in done):.1f} %",
            )
            yield f"| {' | '.join(cells)} |"


def _percentile95(values: Sequence[float]) -> float:
    return quantiles(values, n=20, method="inclusive")[-1]


def worst_lines(flights: Sequence[Flight]) -> Iterator[str]:
    """The five completed flights with the greatest value of each measure."""
    done = [asdict(one) for one in flights if one.outcome == COMPLETED]
    for measure in MEASURES:
        for one in sorted(done, key=lambda one: one[measure], reverse=True)[:5]:
            told = f"{one['vehicle']}, {one['sensors']}, wind {one['wind_m_s']:.1f} m/s"
            yield f"{measure} = {one[measure]:.2f}: mission {one['seed']}, {told}"


def show(seed: int) -> None:
    """Print the mission, its conditions, and how it was flown."""
    one = drawn(seed)
    print(one.vehicle, one.sensors, one.settings, *one.mission.steps, flown(seed), sep="\n")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--missions", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--show", type=int, metavar="N", help="describe this flight alone")
    parser.add_argument("--docs", type=Path, help="the page that shows the table")
    options = parser.parse_args()
    if options.show is not None:
        show(options.show)
        return 0
    flights: list[Flight] = []
    with ProcessPoolExecutor(options.jobs) as pool:
        for one in pool.map(flown, range(1, options.missions + 1), chunksize=4):
            flights.append(one)
            if one.outcome != COMPLETED:
                print(one, flush=True)
    print(*worst_lines(flights), sep="\n")
    lines = list(table(flights))
    print(*lines, sep="\n")
    if options.docs:
        write_between(options.docs, BEGIN, END, "\n".join(("", *lines, "", "")))
    return 0


if __name__ == "__main__":
    sys.exit(main())
