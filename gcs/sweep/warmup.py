"""Compiles what only sweeps need: python -m gcs.sweep.warmup alone|lanes LAW."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from autopilot.geometry.machine_code import ROOT
from autopilot.shell.compiling import (
    ANY_OWN_LAW,
    SIMULATOR,
    Part,
    autopilot_parts,
    compiled_for,
    print_compiled_kernels,
)

_MODULE = "gcs.sweep.warmup"


def sweep_parts(laws: Sequence[str]) -> list[Part]:
    """What a sweep with these laws needs to fly one flight after another."""
    source = ROOT / "gcs" / "sweep" / "flight.py"
    alone = Part("the sweep's flight", _MODULE, ("alone", compiled_for(laws)[0]), source, "alone", 8.0)
    return [alone, *autopilot_parts(*laws), SIMULATOR]


def lanes_part(law: str) -> Part:
    """What a sweep with this law needs to fly eight flights at once."""
    source = ROOT / "gcs" / "sweep" / "lane_kernel.py"
    return Part(f"eight {law} flights at once", _MODULE, ("lanes", law), source, f"lanes-{law}", 70.0)


def main(part: str, law: str) -> None:
    """Compile the part unless it is compiled already; prints the names of the kernels that it compiles."""
    print_compiled_kernels()
    # imported only now, because the import itself compiles the first kernels
    from autopilot.own.law import law_number, own_law_reference
    from autopilot.own.own_code import OwnCode
    from autopilot.own.warmup_law import WARMUP_LAW
    from gcs.closed_loop import Conditions
    from gcs.sweep.cell import cell_of
    from gcs.sweep.flight import StartTimes, SweepFlight
    from gcs.sweep.group import MIN_FLIGHTS, LaneGroup
    from missions.fileformat import load_mission

    law_name = WARMUP_LAW if law == ANY_OWN_LAW else law
    conditions = Conditions(
        settings={"CTL_LAW": float(law_number(law_name))}, own=OwnCode(own_law_reference(law_name))
    )
    cell = cell_of(load_mission("hover"), conditions)
    flights = [SweepFlight(cell, seed, StartTimes(0, 0)) for seed in range(MIN_FLIGHTS)]
    if part == "lanes":
        LaneGroup(flights).compile()
    else:
        flights[0].compile()


if __name__ == "__main__":
    main(*sys.argv[1:])
