"""`gcs`, also as `python -m gcs`."""

from __future__ import annotations

import atexit
import gc
import os
import signal
import sys


def main() -> None:
    """Run the command line."""
    # matrices are small, and work in parallel runs in processes: BLAS threads would only wait for each other
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when numpy is imported, here and in children
    # children must not import a file in the user's folder that has the name of a module, such as numpy.py
    os.environ.setdefault("PYTHONSAFEPATH", "1")
    gc.set_threshold(100_000, 20, 20)  # most objects are modules and tables, which stay until the end
    atexit.register(gc.freeze)  # otherwise Python would search all of them at exit, which takes 0.3 s
    try:
        from gcs.cli import gcs

        gcs(prog_name="gcs")
    except ImportError:
        from gcs.shadowing import shadowing_problem

        problem = shadowing_problem()
        if not problem:
            raise
        sys.exit(f"gcs: {problem}")
    except KeyboardInterrupt:  # while it was loaded; the command itself answers the others
        from gcs.errors import EXIT_INTERRUPTED

        sys.stderr.write("gcs: stopped\n")
        sys.exit(EXIT_INTERRUPTED)
    finally:
        # Python only ends now, and must not be interrupted in that
        signal.signal(signal.SIGINT, signal.SIG_IGN)


if __name__ == "__main__":
    main()
