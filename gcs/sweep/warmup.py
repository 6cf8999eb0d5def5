"""Compiles what only sweeps need: python -m gcs.sweep.warmup alone|lanes LAW."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from autopilot.geometry.machine_code import ROOT
from autopilot.shell.compiling import (
    OWN,
    SIMULATOR,
    Part,
    autopilot_parts,
    compiled_for,
    name_what_is_compiled,
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
    name_what_is_compiled()
    # imported only now, because the import itself compiles the first kernels
    from autopilot.own.chosen import Own
    from autopilot.own.law import law_number, own_law
    from autopilot.own.rehearsal import REFERENCE
    from gcs.closed_loop import Conditions
    from gcs.sweep.cell import cell_of
    from gcs.sweep.flight import Boarding, SweptFlight
    from gcs.sweep.group import FEWEST, Group
    from missions.fileformat import load_mission

    named = REFERENCE if law == OWN else law
    conditions = Conditions(settings={"CTL_LAW": float(law_number(named))}, own=Own(own_law(named)))
    cell = cell_of(load_mission("hover"), conditions)
    flights = [SweptFlight(cell, seed, Boarding(0, 0)) for seed in range(FEWEST)]
    if part == "lanes":
        Group(flights).compile()
    else:
        flights[0].compile()


if __name__ == "__main__":
    main(*sys.argv[1:])
