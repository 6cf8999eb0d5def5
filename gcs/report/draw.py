"""The pictures of a report, drawn by two processes where there are two cores."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path
from typing import Any

from gcs.report.plots import Picture, View
from gcs.report.style import style


class Drawing:
    """The pictures in the making: a second process begins at once, `finish` joins in."""

    def __init__(self, view: View, directory: Path, pictures: Sequence[Picture]) -> None:
        self._view = view
        self._directory = directory
        self._pictures = pictures
        self._missing = {picture.file: picture for picture in pictures}
        self._helper: Any = None
        if (os.cpu_count() or 1) < 2 or "fork" not in multiprocessing.get_all_start_methods():
            self._taken: Synchronized[int] | None = None
            return
        context = multiprocessing.get_context("fork")  # it draws from the same memory
        self._taken = context.Value("i", 0)
        self._done, theirs = context.Pipe(duplex=False)
        self._helper = context.Process(target=self._help, args=(theirs,), daemon=True)
        self._helper.start()
        theirs.close()

    def finish(self, done: Callable[[Picture], None]) -> None:
        """Draw what nobody draws yet and wait for the rest; `done` is told of each picture."""
        with style():
            for picture in self._next():
                self._draw(picture)
                self._tell(picture.file, done)
                while self._helper is not None and self._done.poll():
                    self._receive(done)
            while self._helper is not None:
                self._receive(done)
            for picture in list(self._missing.values()):  # the helper was killed
                self._draw(picture)
                self._tell(picture.file, done)

    def _next(self) -> Iterator[Picture]:
        """Those that the other process has not taken."""
        if self._taken is None:
            yield from self._pictures
            return
        while True:
            with self._taken.get_lock():
                index = self._taken.value
                self._taken.value = index + 1
            if index >= len(self._pictures):
                return
            yield self._pictures[index]

    def _draw(self, picture: Picture) -> None:
        picture.draw(self._view, self._directory / picture.file)

    def _tell(self, file: str, done: Callable[[Picture], None]) -> None:
        done(self._missing.pop(file))

    def _receive(self, done: Callable[[Picture], None]) -> None:
        """Take one word of the helper, or note that it has ended."""
        try:
            self._tell(self._done.recv(), done)
        except EOFError:
            self._helper.join()
            self._helper = None

    def _help(self, answer: Connection) -> None:
        with suppress(KeyboardInterrupt, OSError), style():  # our parent has its own, and draws what is left
            for picture in self._next():
                self._draw(picture)
                answer.send(picture.file)

    def __enter__(self) -> Drawing:
        return self

    def __exit__(self, *_: object) -> None:
        if self._helper is not None:
            self._helper.kill()
            self._helper.join()
