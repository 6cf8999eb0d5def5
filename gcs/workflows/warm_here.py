"""Compiles what only flights in one process need: python -m gcs.workflows.warm_here."""

from __future__ import annotations

from autopilot.shell.compiling import name_what_is_compiled


def main() -> None:
    """Compile it unless it is compiled already; prints the names of the kernels that this compiles."""
    name_what_is_compiled()
    # imported only now, because the import itself compiles the first kernels
    from autopilot.wire.convert.geodesy import Home
    from gcs.closed_loop import Conditions, build_onboard, build_simulator
    from gcs.closed_ticks import ClosedTicks

    conditions, home = Conditions(), Home()
    ClosedTicks(build_onboard(conditions, home), build_simulator(conditions, home)).rehearse()


if __name__ == "__main__":
    main()
