"""`gcs`, also as `python -m gcs`."""

from __future__ import annotations

from gcs.cli import gcs


def main() -> None:
    """Run the command line."""
    gcs(prog_name="gcs")


if __name__ == "__main__":
    main()
