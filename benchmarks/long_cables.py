"""Long cables, in calm air and in wind. The tables of docs/robustness.md.

    python benchmarks/long_cables.py [--jobs 2] [--docs docs/robustness.md]

Take-off, two waypoints 5 m apart, and landing, with cables of 10 to 100 m. `heavy` is flown as assumed;
`heavy-real` has effects that the autopilot does not assume, and a cable whose drag counts in wind.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from statistics import median_low
from typing import Any

import plumbline
from gcs.experiments.marked_text import write_between

BEGIN, END = "<!-- long cables: benchmarks/long_cables.py -->", "<!-- end of long cables -->"
CABLE = ("SIM_CABLE_LEN", "VEH_CABLE_LEN")
LENGTHS_M = (10.0, 20.0, 30.0, 45.0, 60.0, 100.0)
WINDY_LENGTHS_M = (10.0, 15.0, 20.0, 25.0, 30.0, 40.0)
WINDS_M_S = (2.0, 4.0, 6.0)
CALM = [
    *(("heavy", sensors, 4) for sensors in ("lab", "rtk", "field")),
    *(("heavy-real", sensors, 2) for sensors in ("lab", "rtk", "field")),
]
SEEDS_IN_WIND = 2
MISSION = plumbline.Mission(
    "two-waypoints",
    [
        plumbline.Takeoff(3.0),
        plumbline.Waypoint(5.0, 0.0, 3.0, hold_s=5.0),
        plumbline.Waypoint(0.0, 0.0, 3.0, hold_s=5.0),
        plumbline.Land(),
    ],
)


def flown(
    vehicle: str, sensors: str, lengths: tuple[float, ...], seeds: int, jobs: int, **set_: float
) -> Any:
    """The flights with each of these lengths (m) of the cable."""
    return plumbline.sweep(
        MISSION,
        vary={CABLE: list(lengths)},
        seeds=seeds,
        sensors=sensors,
        vehicle=vehicle,
        settings=set_,
        jobs=jobs,
    )


def errors_text(errors_m: list[float]) -> str:
    """Median and greatest of these errors."""
    middle, worst = median_low(errors_m), max(errors_m)
    if worst < 0.1:
        return f"{1e3 * middle:.0f}; {1e3 * worst:.0f} mm"
    return f"{middle:.2f}; {worst:.2f} m"


def cell_text(flights: Any) -> str:
    """The errors of flights of one length, and how many of them were lost."""
    completed = flights[flights.outcome == "completed"]
    lost = len(flights) - len(completed)
    if len(completed) == 0:
        return "lost"
    return errors_text(completed.load_error_max_m.tolist()) + (f" ({lost} lost)" if lost else "")


def row(name: str, flights: Any, lengths: tuple[float, ...]) -> str:
    """The row of a table."""
    by_length = dict(list(flights.groupby("SIM_CABLE_LEN")))
    cells = [cell_text(by_length[length]) for length in lengths]
    return f"| {name} | {' | '.join(cells)} |"


def head(name: str, lengths: tuple[float, ...]) -> list[str]:
    """The head of a table."""
    titles = " | ".join(f"{length:g} m" for length in lengths)
    return [f"| {name} | {titles} |", "|---" * (len(lengths) + 1) + "|"]


def main() -> None:
    """Fly, print the tables, and write them into the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--docs", type=Path, help="the page that shows the tables")
    options = parser.parse_args()
    calm, windy = head("calm air", LENGTHS_M), head("`heavy-real`, `lab`", WINDY_LENGTHS_M)
    for vehicle, sensors, seeds in CALM:
        flights = flown(vehicle, sensors, LENGTHS_M, seeds, options.jobs)
        calm.append(row(f"`{vehicle}`, `{sensors}`", flights, LENGTHS_M))
        print(calm[-1], flush=True)
    for thin in (False, True):
        for wind_m_s in WINDS_M_S:
            world = {"SIM_WIND_E": wind_m_s} | ({"SIM_CABLE_DIAM": 0.0} if thin else {})
            flights = flown("heavy-real", "lab", WINDY_LENGTHS_M, SEEDS_IN_WIND, options.jobs, **world)
            name = f"{wind_m_s:g} m/s" + (", no drag of the cable" if thin else "")
            windy.append(row(name, flights, WINDY_LENGTHS_M))
            print(windy[-1], flush=True)
    if options.docs:
        write_between(options.docs, BEGIN, END, "\n".join(("", *calm, "", *windy, "", "")))


if __name__ == "__main__":
    main()
