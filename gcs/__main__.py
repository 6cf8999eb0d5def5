"""`gcs`, also as `python -m gcs`."""

from __future__ import annotations

import os

from gcs.cli import gcs


def main() -> None:
    """Run the command line."""
    # small matrices, and processes for what is parallel: threads of BLAS would only wait for each other
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read as numpy is imported, here and in our children
    gcs(prog_name="gcs")


if __name__ == "__main__":
    main()
