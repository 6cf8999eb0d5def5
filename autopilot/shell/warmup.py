"""Compiles one part of the autopilot: python -m autopilot.shell.warmup tick|messages|paths LAW."""

from __future__ import annotations

import sys

from autopilot.shell.compiling import name_what_is_compiled


def main(part: str, law: str) -> None:
    """Compile it, or find it compiled; prints the names of the kernels that it compiles."""
    name_what_is_compiled()
    # only now: the import itself compiles the first ones
    from autopilot.core.warmup import PARTS
    from autopilot.onboard.onboard import Onboard, build_setup
    from autopilot.onboard.snapshot import Options
    from autopilot.services.identity import identity_of
    from autopilot.vehicle.file import load_vehicle
    from autopilot.vehicle.parameters import LAWS, autopilot_parameters
    from autopilot.wire.convert import Home

    table = autopilot_parameters(load_vehicle("bebop"))
    table.set("CTL_LAW", LAWS.index(law))
    table.freeze()
    if part == "messages":
        Onboard(table, identity_of(table), Options(Home(), 0), None).rehearse_messages()
    else:
        PARTS[part](build_setup(table, 1))


if __name__ == "__main__":
    main(*sys.argv[1:])
