"""Sweeps without a program of their own, for tests that ask what comes of them and not who flies them."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner

from gcs.cli import gcs


class Here:
    """What `plumbline.sweep` uses of the program that it starts: it has run in this process."""

    def __init__(self, command: Sequence[str], **_: Any) -> None:
        assert command[:4] == [sys.executable, "-P", "-m", "gcs"]
        result = CliRunner().invoke(gcs, command[4:], prog_name="gcs")
        self.stderr = result.stderr.splitlines(keepends=True)
        self.returncode = result.exit_code

    def __enter__(self) -> Here:
        return self

    def __exit__(self, *_: object) -> None: ...

    def wait(self) -> int:
        return self.returncode


@contextmanager
def one_thread(_: int) -> Iterator[tuple[Executor, int]]:
    """A thread of this process that flies the flights of a sweep."""
    with ThreadPoolExecutor(1) as executor:
        yield executor, 1


@pytest.fixture
def swept_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """`plumbline.sweep` runs `gcs sweep` in this process: a program of its own takes a second of processor
    time to load, and so does each of its workers."""
    names = SimpleNamespace(Popen=Here, DEVNULL=subprocess.DEVNULL, PIPE=subprocess.PIPE)
    monkeypatch.setattr("plumbline.sweeps.subprocess", names)
    monkeypatch.setattr("gcs.workflows.sweep.local_processes", one_thread)
