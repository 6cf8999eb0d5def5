"""Compiles one part of the autopilot: python -m autopilot.shell.warmup tick|law|messages|paths LAW."""

from __future__ import annotations

import sys

from autopilot.shell.compiling import OWN, name_what_is_compiled


def main(part: str, law: str) -> None:
    """Compile a part, unless it is compiled already; prints the names of the kernels that it compiles."""
    name_what_is_compiled()
    # only now, since the import itself compiles the first kernels
    from autopilot.core.warmup import PARTS
    from autopilot.onboard.onboard import Onboard, build_setup
    from autopilot.onboard.snapshot import Options
    from autopilot.own.chosen import Own, parameters_for
    from autopilot.own.law import law_number, own_law
    from autopilot.own.rehearsal import REFERENCE
    from autopilot.services.identity import identity_of
    from autopilot.shell.tick_loop import rehearse
    from autopilot.vehicle.file import load_vehicle
    from autopilot.wire.convert.geodesy import Home

    named = REFERENCE if law == OWN else law
    own = Own(own_law(named))
    table = parameters_for(load_vehicle("bebop"), own)
    table.set("CTL_LAW", law_number(named))
    table.freeze()
    if part == "messages":
        onboard = Onboard(table, identity_of(table), Options(Home(), 0, own=own), None)
        onboard.rehearse_messages()
        rehearse(onboard)
    else:
        PARTS[part](build_setup(table, 1, own))


if __name__ == "__main__":
    main(*sys.argv[1:])
