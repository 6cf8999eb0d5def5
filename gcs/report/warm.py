"""Loads what reports are drawn with, once: python -m gcs.report.warm.

The first time matplotlib looks through the machine's fonts, and Python compiles what is imported.
"""

from __future__ import annotations

import io


def main() -> None:
    """Draw a picture of nothing."""
    print("matplotlib", flush=True)
    from matplotlib.figure import Figure

    import gcs.report.plots  # noqa: F401
    from gcs.report.style import style

    with style():
        figure = Figure()
        figure.subplots().set_title("load")
        figure.savefig(io.BytesIO(), format="png")


if __name__ == "__main__":
    main()
