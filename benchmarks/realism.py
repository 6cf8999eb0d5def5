"""The influence of each effect of the world on Cases A, B and C: the table of docs/realism.md.

    python benchmarks/realism.py [--seeds 4] [--docs docs/realism.md] [--only WORD]

Each row is three sweeps. A cell has the greatest error of the load (mm), median and worst of the completed
flights; then, if not zero, how many were not completed, and the mean share of ticks at a rotor's limit.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import plumbline
from gcs.experiments.marked_text import split_at_marks, write_between

CASES = ("case-a", "case-b", "case-c")
BEGIN, END = "<!-- measured -->\n", "<!-- end -->"
MIN_SHARE = 0.005  # of the ticks at a rotor's limit, that is shown


class Effect(NamedTuple):
    """A row of the table: the settings that are added to those of vehicle and sensors."""

    name: str
    settings: Mapping[str, float] = {}
    sensors: str = "lab"
    vehicle: str = "bebop"


BATTERY = {"SIM_BATTERY": 1, "SIM_BAT_CHARGE": 90, "SIM_THR_CURVE": 0.57, "SIM_THR_KNOWN": 0.57}
OFF_CENTRE = {"X": 0.008, "Y": -0.004, "Z": -0.02}
ATTACHMENT = {f"SIM_ATT_{axis}": place for axis, place in OFF_CENTRE.items()}
CONFIGURED = {f"VEH_ATT_{axis}": place for axis, place in OFF_CENTRE.items()}


def told(places: Mapping[str, float]) -> dict[str, float]:
    """The same places of sensors, and an autopilot that assumes them."""
    return {**places, **{name.replace("SIM_", "VEH_"): place for name, place in places.items()}}


def axes(name: str, percent_or_degrees: float) -> dict[str, float]:
    """Errors of three axes, of both signs."""
    signs = {"X": 1.0, "Y": -1.0, "Z": 1.0}
    return {f"{name}_{axis}": sign * percent_or_degrees for axis, sign in signs.items()}


UNIT_ABOVE = {"SIM_IMU_POS_X": 0.02, "SIM_IMU_POS_Y": -0.01, "SIM_IMU_POS_Z": 0.03}
UNIT_BELOW = {**UNIT_ABOVE, "SIM_IMU_POS_Z": -0.015}
ANTENNA = {"SIM_GPS_POS_X": -0.05, "SIM_GPS_POS_Z": 0.15}
SCALE = {**axes("SIM_ACC_SCALE", 1.0), **axes("SIM_GYR_SCALE", 1.0)}
ALIGNMENT = {**axes("SIM_ACC_ALIGN", 1.0), **axes("SIM_GYR_ALIGN", 1.0)}
VIBRATION = {"SIM_VIB_ACC": 2, "SIM_VIB_GYR": 0.05}
CORD = {"SIM_CBL_LINKS": 4, "SIM_CBL_MASS": 0.003, "SIM_CABLE_DIAM": 2}
WINDY = {"SIM_WIND_E": 5, "SIM_GUST_STD": 1}
EFFECTS = (
    Effect("nothing"),
    Effect("wind of 3 m/s", {"SIM_WIND_E": 3}),
    Effect("gusts of 1 m/s", {"SIM_GUST_STD": 1}),
    Effect("drag, ten times the believed", {"SIM_DRAG_SCALE": 10}),
    Effect("rotors of 30 ms, believed 20", {"SIM_ROTOR_TAU_MS": 30, "VEH_ROTOR_TAU": 20}),
    Effect("drag of the rotors, 0.25 1/s", {"SIM_ROTOR_DRAG": 0.25}),
    Effect("flapping of stiff blades", {"SIM_ROTOR_FLAP": 0.01, "SIM_BLADE_STIFF": 0.1}),
    Effect("ground effect", {"SIM_GND_EFFECT": 1}),
    Effect("downwash", {"SIM_DOWNWASH": 1}),
    Effect("downwash, cable of 1 mm", {"SIM_DOWNWASH": 1, "SIM_CABLE_DIAM": 1}),
    Effect("cord of 2 mm and 3 g/m, four links", CORD),
    Effect("attachment 8 mm ahead, 4 mm to the right, 20 mm below the centre", ATTACHMENT),
    Effect("the same, told", {**ATTACHMENT, **CONFIGURED}),
    Effect("thrust curve 0.62, taken for 0.57", {"SIM_THR_CURVE": 0.62, "SIM_THR_KNOWN": 0.57}),
    Effect("throttle of 1000 steps", {"SIM_ESC_STEPS": 1000}),
    Effect("battery at 90 %, rotors slow down with it, thrust curve 0.57 (known)", BATTERY),
    Effect("the same, speed controlled", {**BATTERY, "SIM_ESC_RPM_CTL": 1}),
    Effect("vibration of 0.5 m/s²", {"SIM_VIB_ACC": 0.5}),
    Effect("vibration of 2 m/s² and 0.05 rad/s, low-pass 98 Hz", {**VIBRATION, "SIM_IMU_LPF_HZ": 98}),
    Effect("white noise, 0.3 m/s² and 0.02 rad/s", {"SIM_ACC_NOISE": 0.3, "SIM_GYR_NOISE": 0.02}),
    Effect("white noise, 1.0 m/s² and 0.05 rad/s", {"SIM_ACC_NOISE": 1.0, "SIM_GYR_NOISE": 0.05}),
    Effect("inertial unit 3 cm above, 2 cm ahead, 1 cm to the right of the centre of mass", UNIT_ABOVE),
    Effect("inertial unit 1.5 cm below, 2 cm ahead, 1 cm to the right of the centre of mass", UNIT_BELOW),
    Effect(
        "inertial unit 1.5 cm below, 2 cm ahead, 1 cm to the right of the centre of mass, told",
        told(UNIT_BELOW),
    ),
    Effect("scale of the inertial unit's axes, 1 %", SCALE),
    Effect("alignment of the inertial unit's axes, 1°", ALIGNMENT),
    Effect("readings late at random, 5 ms on average", {"SIM_SENS_JIT_MS": 5}),
    Effect("clocks 2 ms apart", {"SIM_SENS_OFS_MS": 2}),
    Effect("trackers' correlated error, 1 mm", {"SIM_TRK_ERR_M": 0.001}),
    Effect("distorted room, 2 mm", {"SIM_TRK_CAL_M": 0.002}),
    Effect("load hidden 4 times a minute for 0.15 s", {"SIM_OCC_LOAD": 4, "SIM_OCC_S": 0.15}),
    Effect("`bebop-real`", vehicle="bebop-real"),
    Effect("`lab-real`", sensors="lab-real"),
    Effect("`lab-real`, `bebop-real`, 12 ms", {"SIM_ACT_DELAY_MS": 12}, "lab-real", "bebop-real"),
    Effect("`rtk`", sensors="rtk"),
    Effect("`rtk`, multipath of 1 cm", {"SIM_GPS_MP_M": 0.01}, "rtk"),
    Effect("`rtk`, floating twice a minute", {"SIM_GPS_FLT": 2}, "rtk"),
    Effect("`rtk`, antenna 15 cm above, 5 cm behind the centre of mass", ANTENNA, "rtk"),
    Effect("`rtk`, antenna 15 cm above, 5 cm behind the centre of mass, told", told(ANTENNA), "rtk"),
    Effect("`rtk`, alignment of the inertial unit's axes, 1°", ALIGNMENT, "rtk"),
    Effect("`rtk`, motor currents, 20 mG", {"SIM_MAG_MOT": 0.02}, "rtk"),
    Effect("`field`", sensors="field"),
    Effect("`heavy`", vehicle="heavy"),
    Effect("`heavy-real`", vehicle="heavy-real"),
    Effect("`field`, `heavy-real`, wind 5 m/s, gusts 1 m/s", WINDY, "field", "heavy-real"),
)


def cell(table: Any) -> str:
    """The cell for the flights of one mission."""
    completed = table[table["outcome"] == "completed"]
    text = "none came home"
    if len(completed):
        errors = 1e3 * completed["load_error_max_m"]
        text = f"{errors.median():.0f}, {errors.max():.0f}"
    if lost := len(table) - len(completed):
        text += f"; {lost} of {len(table)} lost" if len(completed) else ""
    share = completed["saturated_fraction"].mean() if len(completed) else 0.0
    return text + (f" ({share:.0%})" if share >= MIN_SHARE else "")


def row(effect: Effect, seeds: int) -> str:
    """A row of the table."""
    cells = []
    for case in CASES:
        try:
            table = plumbline.sweep(
                case,
                settings=effect.settings,
                sensors=effect.sensors,
                vehicle=effect.vehicle,
                seeds=seeds,
                quiet=True,
            )
        except plumbline.Error:  # the vehicle cannot do what the mission requires
            cells.append("not flyable")
        else:
            cells.append(cell(table))
    return f"| {effect.name} | {' | '.join(cells)} |"


def with_row(table: str, effect: Effect, line: str, seeds: int) -> str:
    """The table with this row; rows of other effects stay, if those effects still exist."""
    rows = {name: row for row, name in re.findall(r"^(\| (.*?) \| .*)$", table, flags=re.MULTILINE)}
    rows[effect.name] = line
    head = f"{seeds} seeds each:\n\n| effect | Case A | Case B | Case C |\n|---|---|---|---|\n"
    return head + "".join(rows[each.name] + "\n" for each in EFFECTS if each.name in rows)


def main() -> None:
    """Fly all, print the table, and with `--docs` write each row into the page as soon as it is flown."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--docs", type=Path)
    parser.add_argument("--only", default="", metavar="WORD", help="effects whose names have this")
    options = parser.parse_args()
    for effect in EFFECTS:
        if options.only not in effect.name:
            continue
        line = row(effect, options.seeds)
        print(line, flush=True)
        if options.docs:
            _, before, _ = split_at_marks(options.docs, BEGIN, END)
            write_between(options.docs, BEGIN, END, with_row(before, effect, line, options.seeds))


if __name__ == "__main__":
    main()
