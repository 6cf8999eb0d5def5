"""Compiles one part of the autopilot: python -m autopilot.shell.warmup tick|paths|telemetry LAW."""

from __future__ import annotations

import sys

from autopilot.shell.compiling import name_what_is_compiled


def main(part: str, law: str) -> None:
    """Compile it, or find it compiled; prints the names of the kernels that it compiles."""
    name_what_is_compiled()
    # only now: the import itself compiles the first ones
    from autopilot.core.warmup import PARTS
    from autopilot.onboard.onboard import build_setup
    from autopilot.onboard.warmup import rehearse_telemetry
    from autopilot.vehicle.file import load_vehicle
    from autopilot.vehicle.parameters import LAWS, autopilot_parameters

    table = autopilot_parameters(load_vehicle("bebop"))
    table.set("CTL_LAW", LAWS.index(law))
    table.freeze()
    setup = build_setup(table, 1)
    if part == "telemetry":
        rehearse_telemetry(setup, table)
    else:
        PARTS[part](setup)


if __name__ == "__main__":
    main(*sys.argv[1:])
