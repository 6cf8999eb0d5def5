"""The pictures of a report, drawn by a second process if there are two cores.

The libraries for drawing take half a second to load: the second process loads them while this one reads the
log.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path
from typing import Any

from gcs.report.plots import Picture, View
from gcs.report.style import style
from gcs.report.warm import load_drawing


class Drawing:
    """Draws the pictures: the other process loads its libraries immediately, and draws after
    `start_drawing`."""

    def __init__(self, directory: Path, pictures: Sequence[Picture]) -> None:
        self._directory = directory
        self._pictures = pictures
        self._missing = {picture.file: picture for picture in pictures}
        self._view: View
        self._helper: Any = None
        self._taken: Synchronized[int]
        if (os.cpu_count() or 1) < 2 or "fork" not in multiprocessing.get_all_start_methods():
            return
        context = multiprocessing.get_context("fork")  # the child has everything that is loaded here
        self._taken = context.Value("i", 0)
        self._pipe, child_end = context.Pipe()
        self._helper = context.Process(target=self._run_helper, args=(child_end,), daemon=True)
        self._helper.start()
        child_end.close()

    def start_drawing(self, view: View) -> None:
        """Give the process what is to be drawn; waits until it has loaded its libraries."""
        self._view = view
        if self._helper is not None:
            with suppress(OSError):  # it was killed
                self._pipe.send(view)

    def finish(self, done: Callable[[Picture], None]) -> None:
        """Wait until all are drawn, and call `done` for each. Of several, this process draws some too."""
        if self._helper is not None and len(self._pictures) > 1:
            self._draw_here(self._next_pictures(), done)
        while self._helper is not None:
            self._receive(done)
        if self._missing:  # there is no helper, or it was killed
            self._draw_here(list(self._missing.values()), done)

    def _draw_here(self, pictures: Iterable[Picture], done: Callable[[Picture], None]) -> None:
        """Draw these in this process, and meanwhile report what the helper has drawn."""
        with style():
            for picture in pictures:
                self._draw(picture)
                self._report(picture.file, done)
                while self._helper is not None and self._pipe.poll():
                    self._receive(done)

    def _next_pictures(self) -> Iterator[Picture]:
        """The pictures that no process has taken yet; taking one marks it as taken."""
        while True:
            with self._taken.get_lock():
                index = self._taken.value
                self._taken.value = index + 1
            if index >= len(self._pictures):
                return
            yield self._pictures[index]

    def _draw(self, picture: Picture) -> None:
        picture.draw(self._view, self._directory / picture.file)

    def _report(self, file: str, done: Callable[[Picture], None]) -> None:
        done(self._missing.pop(file))

    def _receive(self, done: Callable[[Picture], None]) -> None:
        """Receive the name of one picture that the helper has drawn, or note that the helper has ended."""
        try:
            self._report(self._pipe.recv(), done)
        except (EOFError, OSError):
            self._helper.join()
            self._helper = None

    def _run_helper(self, parent: Connection) -> None:
        self._pipe.close()  # our copy of the parent's end: with it open, we would not notice its closing
        with suppress(KeyboardInterrupt, OSError, EOFError):  # the parent has ended, or draws what is left
            load_drawing()
            self._view = parent.recv()
            with style():
                for picture in self._next_pictures():
                    self._draw(picture)
                    parent.send(picture.file)

    def __enter__(self) -> Drawing:
        return self

    def __exit__(self, *_: object) -> None:
        if self._helper is not None:
            self._helper.kill()
            self._helper.join()
