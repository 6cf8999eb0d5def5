"""What Gymnasium asks of an environment that can be drawn: its modes, its metadata and its frames."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gymnasium import logger

from gcs.errors import GcsError
from plumbline.arguments import shown_value
from plumbline.learning.batch import Episodes
from plumbline.learning.scene import Frame, scene_of

if TYPE_CHECKING:
    from plumbline.learning.picture import Painter

RENDER_MODES = ("rgb_array",)


def checked_render_mode(mode: str | None) -> str | None:
    """The mode. `Error` (plumbline.Error) if there is no such mode."""
    if mode is not None and mode not in RENDER_MODES:
        raise GcsError(f"render_mode = {shown_value(mode)}; must be {' or '.join(RENDER_MODES)}, or None")
    return mode


def render_metadata(rate_hz: float) -> dict[str, Any]:
    """The metadata of environments with this rate: a frame for each step."""
    return {"render_modes": list(RENDER_MODES), "render_fps": int(rate_hz) if rate_hz % 1 == 0 else rate_hz}


class Renderer:
    """Draws episodes, in the mode `mode`. Matplotlib is imported with the first frame. Copies, also in
    another process, make drawing artists of their own."""

    def __init__(self, episodes: Episodes, mode: str | None) -> None:
        self._episodes = episodes
        self._mode = mode
        self._painter: Painter | None = None

    def frames(self) -> tuple[Frame, ...] | None:
        """A frame of each episode; None, with a warning of Gymnasium, if there is no mode."""
        if self._mode is None:
            logger.warn("render() needs an environment that is made with render_mode='rgb_array'")
            return None
        return tuple(self._frame(i) for i in range(self._episodes.count))

    def _frame(self, i: int) -> Frame:
        scene = scene_of(self._episodes, i)
        if self._painter is None:
            from plumbline.learning.picture import Painter

            width, height = self._episodes.scenario.options.render_size
            self._painter = Painter((width, height))
        return self._painter.draw(scene)

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_painter": None}
