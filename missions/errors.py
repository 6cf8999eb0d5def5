"""Errors that a caller can put right."""

from __future__ import annotations


class Error(Exception):
    """A known error, which Python scripts catch as `plumbline.Error`. Its text is one line for display;
    `lines` has a line for each problem."""

    def __init__(self, *lines: str) -> None:
        super().__init__("; ".join(lines))
        self.lines = lines


class PathError(Error, ValueError):
    """There is no path through the rows. `text` says why, `index` which row it is about (None: all)."""

    def __init__(self, text: str, index: int | None = None, rows: str = "rows") -> None:
        super().__init__(f"path {text}" if index is None else f"{rows}[{index}] {text}")
        self.text, self.index = text, index
