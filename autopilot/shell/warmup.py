"""Compiles one part of the autopilot: python -m autopilot.shell.warmup tick|law|messages|paths LAW."""

from __future__ import annotations

import sys

from autopilot.shell.compiling import ANY_OWN_LAW, print_compiled_kernels


def main(part: str, law: str) -> None:
    """Compile a part, unless it is compiled already; prints the names of the kernels that it compiles."""
    print_compiled_kernels()
    # only now, since the import itself compiles the first kernels
    from autopilot.core.warmup import PARTS
    from autopilot.onboard.onboard import Onboard, build_setup
    from autopilot.onboard.snapshot import Options
    from autopilot.own.law import law_number, own_law_reference
    from autopilot.own.own_code import OwnCode, parameters_for
    from autopilot.own.warmup_law import WARMUP_LAW
    from autopilot.services.identity import identity_of
    from autopilot.shell.tick_loop import warm_up
    from autopilot.vehicle.file import load_vehicle
    from autopilot.wire.convert.geodesy import Home

    law_reference = WARMUP_LAW if law == ANY_OWN_LAW else law
    own = OwnCode(own_law_reference(law_reference))
    table = parameters_for(load_vehicle("bebop"), own)
    table.set("CTL_LAW", law_number(law_reference))
    table.freeze()
    if part == "messages":
        onboard = Onboard(table, identity_of(table), Options(Home(), 0, own=own), None)
        onboard.warm_up_messages()
        warm_up(onboard)
    else:
        PARTS[part](build_setup(table, 1, own))


if __name__ == "__main__":
    main(*sys.argv[1:])
