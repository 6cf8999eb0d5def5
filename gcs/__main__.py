"""`gcs`, also as `python -m gcs`."""

from __future__ import annotations

import atexit
import gc
import os

from gcs.cli import gcs


def main() -> None:
    """Run the command line."""
    # small matrices, and processes for what is parallel: threads of BLAS would only wait for each other
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read as numpy is imported, here and in our children
    # nor must they import what lies in the user's folder under the name of a module, as numpy.py
    os.environ.setdefault("PYTHONSAFEPATH", "1")
    gc.set_threshold(100_000, 20, 20)  # most of what is made is modules and tables, which stay
    atexit.register(gc.freeze)  # to the end: Python would look through all of it while it ends, for 0.3 s
    gcs(prog_name="gcs")


if __name__ == "__main__":
    main()
