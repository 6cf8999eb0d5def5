"""Checks whether a change of the code has changed a flight: flies shipped missions and hashes the results.

    python benchmarks/yardstick.py                # fly all, compare with the record
    python benchmarks/yardstick.py --record       # fly all, and record
    python benchmarks/yardstick.py case-b         # only the flights whose name contains this
    python benchmarks/yardstick.py --lanes case-b # three seeds of these, together and each alone

Each flight goes over the byte queues of `gcs.closed_loop`; its telemetry is hashed, texts separately, so that
a reworded STATUSTEXT does not hide a changed flight; parameters are not hashed. The same flights are also
flown as in a sweep, and all true states and figures are hashed. The hashes are valid for one kind of machine:
linear algebra libraries choose their instructions by the processor. Record before a change, on the machine on
which you compare after it.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import asdict, replace
from hashlib import sha256
from pathlib import Path

import numpy as np

from autopilot.wire.codec import decode
from autopilot.wire.dialect import plumbline as mavlink
from gcs.closed_loop import Conditions
from gcs.closed_loop import fly as fly_with_wire
from gcs.sweep.cell import cell_of
from gcs.sweep.flight import TRACE_COLUMNS, SweepFlight, fly, start_times
from gcs.sweep.group import MIN_FLIGHTS, LaneGroup, fits_in_lanes
from missions.fileformat import load_mission

RECORD = Path(__file__).with_name("yardstick.json")
MAX_TICKS = 60_000
TEXTS = {mavlink.MAVLINK_MSG_ID_STATUSTEXT}
# messages about the parameters, which are no part of a flight
IGNORED = {mavlink.MAVLINK_MSG_ID_PARAM_VALUE, mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST}
THESIS, LQR = {"CTL_LAW": 0.0}, {"CTL_LAW": 1.0}

FLIGHTS: dict[str, tuple[str, Conditions]] = {
    "case-a lab": ("case-a", Conditions()),
    "case-a thesis lost": ("case-a", Conditions(sensors="ideal", settings=THESIS)),
    "case-a thesis unlimited": ("case-a", Conditions("thesis", "ideal", 1, THESIS)),
    "case-b lab": ("case-b", Conditions()),
    "case-b thesis": ("case-b", Conditions(settings=THESIS)),
    "case-b lqr ideal": ("case-b", Conditions(sensors="ideal", settings=LQR)),
    "case-b rtk": ("case-b", Conditions(sensors="rtk", seed=2)),
    "case-b delay": ("case-b", Conditions(seed=3, settings={"SIM_ACT_DELAY_MS": 72.0})),
    "case-c delay": ("case-c", Conditions(settings={"SIM_ACT_DELAY_MS": 12.0, "SIM_ROTOR_TAU_MS": 30.0})),
    "case-b-extended": ("case-b-extended", Conditions()),
    "square lab": ("square", Conditions()),
    "hover gps gusts": (
        "hover",
        Conditions(sensors="gps", settings={"SIM_GUST_STD": 0.5, "SIM_WIND_E": 1.0, "SIM_DROP_PCT": 5.0}),
    ),
    "delivery lab": ("delivery", Conditions()),
    "delivery rtk": ("delivery", Conditions(sensors="rtk", settings={"SIM_ACT_DELAY_MS": 5.0})),
    "load-attitude": ("load-attitude", Conditions(sensors="ideal", settings=THESIS)),
    "quad-attitude": ("quad-attitude", Conditions(sensors="ideal")),
    "winch": (str(Path(__file__).with_name("yardstick-winch.toml")), Conditions()),
    "winch thesis rtk": (
        str(Path(__file__).with_name("yardstick-winch.toml")),
        Conditions(sensors="rtk", settings=THESIS),
    ),
}


class Hasher:
    """A log that keeps two hashes of its frames: of the flight, and of the texts."""

    def __init__(self) -> None:
        self.telemetry, self.texts = sha256(), sha256()

    def write(self, unix_us: int, *frames: bytes) -> None:
        """Add frames to the hashes."""
        for one in decode(b"".join(frames))[0]:
            message = one.message
            kind = message.get_msgId()
            if kind in IGNORED:
                continue
            into = self.texts if kind in TEXTS else self.telemetry
            into.update(f"{unix_us} {one.system} {kind} {message.to_dict()!r}\n".encode())


def measure(name: str) -> dict[str, str]:
    """The hashes of one flight."""
    mission_name, conditions = FLIGHTS[name]
    mission = load_mission(mission_name)
    log = Hasher()
    outcome = fly_with_wire(mission, conditions, log)
    found = {
        "outcome": outcome.name,
        "flown": log.telemetry.hexdigest()[:16],
        "said": log.texts.hexdigest()[:16],
    }
    trace = np.full((MAX_TICKS, TRACE_COLUMNS), np.nan)
    try:
        swept = fly(mission, conditions, start_times(mission, conditions), trace)
    except ValueError as error:
        return {**found, "sweep": str(error)}
    figures = {key: value for key, value in asdict(swept).items() if key not in ("texts", "reason")}
    return {
        **found,
        "sweep": swept.outcome,
        "sweep figures": _hash(repr(figures).encode()),
        "sweep states": _hash(trace),
    }


def measure_lanes(name: str) -> dict[str, str]:
    """Whether three seeds of a flight give the same results together as each alone."""
    mission_name, conditions = FLIGHTS[name]
    mission = load_mission(mission_name)
    try:
        start = start_times(mission, conditions)
    except ValueError as error:
        return {"outcome": str(error)}
    seeds = range(conditions.seed, conditions.seed + MIN_FLIGHTS)
    flights = [SweepFlight(cell_of(mission, conditions), seed, start) for seed in seeds]
    if not fits_in_lanes(flights[0]):
        return {"outcome": "alone"}
    group = LaneGroup(flights)
    group.run()
    alone = [fly(mission, replace(conditions, seed=seed), start) for seed in seeds]
    differing = sum(repr(one) != repr(flight.result) for one, flight in zip(alone, flights, strict=True))
    share = group.lane_ticks / sum(flight.tick for flight in flights)
    found = {"outcome": alone[0].outcome, "in lanes": f"{share:.0%}"}
    return {**found, "differ": str(differing)} if differing else found


def _hash(data: bytes | np.ndarray) -> str:
    return sha256(data if isinstance(data, bytes) else data.tobytes()).hexdigest()[:16]


def compare_lanes(part_of_name: str) -> int:
    """Fly in lanes; returns 1 if a flight differs there."""
    differ = 0
    for name in FLIGHTS:
        if part_of_name in name:
            found = measure_lanes(name)
            differ += "differ" in found
            print(f"{name:26} {', '.join(f'{key}: {value}' for key, value in found.items())}", flush=True)
    return 1 if differ else 0


def main() -> int:
    """Fly, and compare or record."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n", maxsplit=1)[0])
    parser.add_argument("only", nargs="?", default="", help="part of the names of the flights")
    parser.add_argument("--record", action="store_true", help="record what is flown now")
    parser.add_argument("--lanes", action="store_true", help="fly three seeds together, and each alone")
    options = parser.parse_args()
    if options.lanes:
        return compare_lanes(options.only)
    recorded = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.exists() else {}
    changed = 0
    for name in FLIGHTS:
        if options.only not in name:
            continue
        begun = time.perf_counter()
        found = measure(name)
        before = recorded.get(name, {})
        differing = [key for key in {**before, **found} if before.get(key) != found.get(key)]
        changed += bool(differing)
        verdict = ", ".join(f"{key}: {before.get(key)} -> {found.get(key)}" for key in differing) or "same"
        print(f"{name:26} {time.perf_counter() - begun:5.1f} s  {found['outcome']:10} {verdict}", flush=True)
        if options.record:
            recorded[name] = found
    if options.record:
        RECORD.write_text(json.dumps(recorded, indent=1) + "\n", encoding="utf-8")
        return 0
    return 1 if changed else 0


if __name__ == "__main__":
    sys.exit(main())
