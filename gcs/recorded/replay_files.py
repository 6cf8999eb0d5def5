"""The files that `gcs replay` writes: a table of the load, row by row, and a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gcs.recorded.motion import Motion
from gcs.recorded.smoothing import Floats

_HEAD = "time_s,load_x_m,load_y_m,load_z_m,sd_x_m,sd_y_m,measured_x_m,measured_y_m,measured_z_m"


def write_table(path: Path, motion: Motion, load: Floats, sd: Floats) -> None:
    """Write the load (n, 3) from the vehicle's pose alone, its deviations (n, 2), and the measured load."""
    table = np.column_stack([motion.time_s, load, sd, motion.load])
    np.savetxt(path, table, fmt="%.6f", delimiter=",", header=_HEAD, comments="")


def write_picture(path: Path, motion: Motion, load: Floats, sd: Floats) -> None:
    """Plot estimated and measured load relative to the vehicle, and the error with its 95 % bounds."""
    from gcs.report.style import draw, key, rows, save, style

    time, vehicle = motion.time_s, motion.attachment.position
    with style():
        figure, axes = rows(9.0, 7.0, 4)
        for i, name in enumerate("xy"):
            place, error = axes[2 * i][0], axes[2 * i + 1][0]
            draw(place, time, motion.load[:, i] - vehicle[:, i], color="0.6", label="measured")
            draw(place, time, load[:, i] - vehicle[:, i], color="C0", label="from the vehicle's pose alone")
            place.set_ylabel(f"load - vehicle, {name} (m)")
            draw(error, time, 1e3 * (load[:, i] - motion.load[:, i]), color="C0", label="error")
            for sign in (-1.96, 1.96):
                draw(
                    error,
                    time,
                    sign * 1e3 * sd[:, i],
                    color="0.4",
                    linestyle="--",
                    label="95 %" if sign > 0 else "",
                )
            error.set_ylabel(f"error, {name} (mm)")
            key(place)
            key(error)
        axes[-1][0].set_xlabel("time (s)")
        save(figure, path)
