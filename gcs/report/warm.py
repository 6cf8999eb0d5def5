"""Loads once what reports are made with: python -m gcs.report.warm.

The first time, matplotlib searches the machine's fonts, and Python compiles the imported modules.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from importlib import import_module

_LIBRARIES = (
    "gcs.analysis.parquet",
    "gcs.report.build",
    "gcs.report.draw",
    "gcs.report.html",
    "jinja2",
    "pyarrow.parquet",
    "rich.console",
    "rich.table",
)
_DRAWING_LIBRARIES = ("matplotlib.backends.backend_agg", "mpl_toolkits.mplot3d")


def load_libraries(is_enough: Callable[[], bool] = lambda: False) -> None:
    """Import what a report is made with, until `is_enough` is true: the rest is imported when needed."""
    for name in _LIBRARIES:
        if is_enough():
            return
        import_module(name)


def load_drawing() -> None:
    """Import what pictures are drawn with."""
    for name in _DRAWING_LIBRARIES:
        import_module(name)


def main() -> None:
    """Import everything and draw an empty picture."""
    print("matplotlib", flush=True)
    load_libraries()
    load_drawing()
    from matplotlib.figure import Figure

    from gcs.report.style import style

    with style():
        figure = Figure()
        figure.subplots().set_title("load")
        figure.savefig(io.BytesIO(), format="png")


if __name__ == "__main__":
    main()
