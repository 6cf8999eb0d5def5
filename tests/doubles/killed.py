"""A process that is killed at any of its system calls that change a file, or halfway through a write."""

from __future__ import annotations

import builtins
import io
import os
import signal
from collections.abc import Callable
from typing import Any

CALLS = ("open", "write", "fsync", "close", "rename", "replace", "unlink", "mkdir", "rmdir", "truncate")
WRITING = frozenset("wax+")


def killed_at(number: int, what: Callable[[], Any]) -> bool:
    """Do `what` in a process that dies by SIGKILL before its system call `number`; return whether it did.

    Each call to write takes only half of the data, as a system may do; the rest takes a separate call.
    """
    child = os.fork()
    if child == 0:
        _count_calls(number)
        try:
            what()
        finally:
            os.kill(os.getpid(), signal.SIGTERM)  # at the end, without the clean-up of the test program
    _, status = os.waitpid(child, 0)
    assert os.WIFSIGNALED(status)
    return os.WTERMSIG(status) == signal.SIGKILL


def _count_calls(number: int) -> None:
    left = number

    def count() -> None:
        nonlocal left
        left -= 1
        if left < 0:
            os.kill(os.getpid(), signal.SIGKILL)

    def counted(call: Callable[..., Any]) -> Callable[..., Any]:
        def made(*args: Any, **kwargs: Any) -> Any:
            count()
            return call(*args, **kwargs)

        return made

    class File(io.FileIO):
        """A file that is written when requested, and not when a buffer is full."""

        def write(self, data: Any) -> int:
            for part in (data[: len(data) // 2], data[len(data) // 2 :]):
                count()
                super().write(part)
            return len(data)

        def close(self) -> None:
            if not self.closed:
                count()
            super().close()

    write, opened = os.write, io.open

    def write_half(handle: int, data: Any) -> int:
        return write(handle, data[: max(len(data) // 2, 1)])

    def open_file(file: Any, mode: str = "r", *args: Any, **kwargs: Any) -> Any:
        if not WRITING & set(mode):
            return opened(file, mode, *args, **kwargs)
        assert "b" in mode, "bytes alone are written"
        count()
        return File(file, mode)

    os.write = write_half
    for name in CALLS:
        setattr(os, name, counted(getattr(os, name)))
    io.open = builtins.open = open_file  # type: ignore[assignment]
