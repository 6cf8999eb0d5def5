"""`python -m sitl`: the `sitl` program."""

from __future__ import annotations

import gc
import os


def main() -> None:
    """Run the program."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # for matrices this small, threads only cost time
    gc.disable()  # until everything is loaded (`reduce_latency`): loaded objects stay
    from sitl.shell.command import main as run

    run()


if __name__ == "__main__":
    main()
