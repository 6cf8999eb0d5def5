"""The files that `gcs replay` writes: a table of the load, row by row, and a picture."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np

from gcs.errors import InputError
from gcs.recorded.motion import Motion
from gcs.recorded.smoothing import Floats

TABLE_FILE, PICTURE_FILE = "load.csv", "load.png"
_HEADER = "time_s,load_x_m,load_y_m,load_z_m,sd_x_m,sd_y_m,measured_x_m,measured_y_m,measured_z_m"


def check_no_other_files(folder: Path) -> None:
    """InputError if a folder contains a file of these names that is not of an earlier replay."""
    with suppress(OSError), (folder / TABLE_FILE).open("rb") as file:
        if file.readline().strip() == _HEADER.encode():
            return
    for name in (TABLE_FILE, PICTURE_FILE):
        if (folder / name).exists():
            raise InputError(
                f"{folder}: holds a {name} that is not of a replay; name another folder by --out"
            )


def write_table(path: Path, motion: Motion, load: Floats, sd: Floats) -> None:
    """Write the load (n, 3) from the vehicle's pose alone, its deviations (n, 2), and the measured load."""
    table = np.column_stack([motion.time_s, load, sd, motion.load])
    np.savetxt(path, table, fmt="%.6f", delimiter=",", header=_HEADER, comments="")


def write_picture(path: Path, motion: Motion, load: Floats, sd: Floats) -> None:
    """Plot estimated and measured load relative to the vehicle, and the error with its 95 % bounds."""
    from gcs.report.style import draw, draw_legend, new_axes_grid, save, style

    time, vehicle = motion.time_s, motion.attachment.position
    with style():
        figure, axes = new_axes_grid(9.0, 7.0, 4)
        for i, name in enumerate("xy"):
            position_ax, error_ax = axes[2 * i][0], axes[2 * i + 1][0]
            draw(position_ax, time, motion.load[:, i] - vehicle[:, i], color="0.6", label="measured")
            draw(
                position_ax,
                time,
                load[:, i] - vehicle[:, i],
                color="C0",
                label="from the vehicle's pose alone",
            )
            position_ax.set_ylabel(f"load - vehicle, {name} (m)")
            draw(error_ax, time, 1e3 * (load[:, i] - motion.load[:, i]), color="C0", label="error")
            for sign in (-1.96, 1.96):
                draw(
                    error_ax,
                    time,
                    sign * 1e3 * sd[:, i],
                    color="0.4",
                    linestyle="--",
                    label="95 %" if sign > 0 else "",
                )
            error_ax.set_ylabel(f"error, {name} (mm)")
            draw_legend(position_ax)
            draw_legend(error_ax)
        axes[-1][0].set_xlabel("time (s)")
        save(figure, path)
