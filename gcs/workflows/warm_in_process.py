"""Compiles what only flights in one process need: python -m gcs.workflows.warm_in_process."""

from __future__ import annotations

from autopilot.shell.compiling import print_compiled_kernels


def main() -> None:
    """Compile it unless it is compiled already; prints the names of the kernels that this compiles."""
    print_compiled_kernels()
    # imported only now, because the import itself compiles the first kernels
    from autopilot.wire.convert.geodesy import Home
    from gcs.closed_loop import Conditions, build_onboard, build_simulator
    from gcs.closed_ticks import ClosedTicks

    conditions, home = Conditions(), Home()
    ClosedTicks(build_onboard(conditions, home), build_simulator(conditions, home)).warm_up()


if __name__ == "__main__":
    main()
