"""Compiles the check of missions before flights: python -m gcs.workflows.warm_check."""

from __future__ import annotations

from autopilot.shell.compiling import print_compiled_kernels


def main() -> None:
    """Check every shipped mission; prints the names of the kernels that this compiles."""
    print_compiled_kernels()
    # imported only now, because the import itself compiles the first kernels
    from gcs.workflows.check_mission import check_mission
    from missions.fileformat import shipped

    for name in shipped():
        check_mission(name, "bebop", False)


if __name__ == "__main__":
    main()
