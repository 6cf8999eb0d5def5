"""The effect of a cable of links on Cases A to C: the load's error with realistic cords and loads.

    python benchmarks/cable_cases.py [--links 1 4 10] [--json]

Flights of `bebop` with the sensors `lab`, one seed; the autopilot is not configured for any of it.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from typing import Any

import plumbline

CASES = ("case-a", "case-b", "case-c")
# docs/realism-cable.md has the sources
CORDS: Mapping[str, Mapping[str, float]] = {
    "Dyneema 2 mm": {"SIM_CBL_MASS": 0.0024, "SIM_CABLE_DIAM": 2.0, "SIM_CBL_EA": 2e4, "SIM_CBL_DAMP": 10.0},
    "nylon 3 mm": {"SIM_CBL_MASS": 0.0056, "SIM_CABLE_DIAM": 3.0, "SIM_CBL_EA": 3e3, "SIM_CBL_DAMP": 2.0},
}
# a load of 4 cm, attached at its top
LOAD_INERTIA = {"SIM_LOAD_HOOK": 0.03, "SIM_LOAD_GYR": 0.016, "SIM_LOAD_GYR_UP": 0.016}
FIGURES = ("load_error_max_m", "load_error_rms_m", "tracking_error_max_m", "slack_events")


def worlds(links: tuple[int, ...]) -> dict[str, dict[str, float]]:
    """The SIM_ parameters of each world by its name."""
    found: dict[str, dict[str, float]] = {"massless, fixed length": {}}
    for cord, values in CORDS.items():
        for n in links:
            found[f"{cord}, {n} links"] = {"SIM_CBL_LINKS": float(n), **values}
    longest = f"{next(iter(CORDS))}, {max(links)} links"
    found[f"{longest}, load that turns"] = {**found[longest], **LOAD_INERTIA}
    return found


def fly_case(case: str, settings: Mapping[str, float]) -> dict[str, Any]:
    """The figures of a flight."""
    flight = plumbline.fly(case, settings=settings, quiet=True)
    figures = {key: flight.summary[key] for key in FIGURES if key in flight.summary}
    return {"outcome": flight.outcome, **figures}


def _cell(figures: Mapping[str, Any]) -> str:
    """Greatest error and RMS in mm, or how the flight ended."""
    if figures["outcome"] != "completed":
        return str(figures["outcome"])
    return f"{1e3 * figures['load_error_max_m']:.1f} / {1e3 * figures['load_error_rms_m']:.2f} mm"


def main() -> int:
    """Fly, and print the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--links", type=int, nargs="+", default=[1, 4, 10], help="links of the cables")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    args = parser.parse_args()
    table = {
        name: {case: fly_case(case, settings) for case in CASES}
        for name, settings in worlds(tuple(args.links)).items()
    }
    if args.json:
        json.dump(table, sys.stdout, indent=1)
        return 0
    for name, cases in table.items():
        cells = (_cell(figures) for figures in cases.values())
        print(f"{name:<42}" + "".join(f"{cell:>24}" for cell in cells))
    return 0


if __name__ == "__main__":
    sys.exit(main())
