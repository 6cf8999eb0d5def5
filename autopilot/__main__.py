"""`python -m autopilot`: the `autopilot` program."""

from __future__ import annotations

import gc
import os
import sys


def main() -> None:
    """Run the program."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # for matrices this small, threads only cost time
    gc.disable()  # until everything is loaded (`reduce_latency`): loaded objects stay
    from autopilot.shell.command import main as run
    from autopilot.shell.options import ARGUMENTS_ON_STDIN

    if sys.argv[1:] == [ARGUMENTS_ON_STDIN]:
        import autopilot.shell.program  # noqa: F401 - loaded before the arguments are known

    run()


if __name__ == "__main__":
    main()
