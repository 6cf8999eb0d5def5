"""The real programs as a user starts them; each is ended after its test."""

from __future__ import annotations

import os
import re
import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from gcs.cli import gcs as command_line

END_S = 10.0


class Program:
    """One running program with its output in a file."""

    def __init__(self, arguments: list[str], log: Path) -> None:
        self.log = log
        with log.open("wb") as output:
            self.process = subprocess.Popen(
                [sys.executable, "-m", *arguments], stdout=output, stderr=subprocess.STDOUT, cwd=log.parent
            )

    def says(self, pattern: bytes) -> None:
        """Wait until its output matches `pattern`; it must not end before."""
        while not re.search(pattern, self.log.read_bytes()):
            try:
                code = self.process.wait(0.2)
            except subprocess.TimeoutExpired:
                continue
            raise AssertionError(f"{self.log.stem} ended with {code}: {self.log.read_text()}")

    def kill(self) -> None:
        """As kill -9 does."""
        self.process.kill()
        self.process.wait(END_S)

    def interrupt(self) -> int:
        """As Ctrl-C does; the exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(60.0)

    def stop(self) -> None:
        """As a session's end does."""
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(END_S)
            except subprocess.TimeoutExpired:
                self.kill()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Program]]:
    """Start a program: start("sitl", "--lockstep")."""
    programs: list[Program] = []

    def begin(*arguments: str) -> Program:
        program = Program(list(arguments), tmp_path / f"{arguments[0]}-{len(programs)}.log")
        programs.append(program)
        return program

    yield begin
    for program in reversed(programs):
        program.stop()


@pytest.fixture
def command() -> Callable[..., Result]:
    """Give a command to a running vehicle, in this process: command("arm", "--connect", "14550").

    `gcs` then loads its modules only once for all commands.
    """

    def run(*arguments: str) -> Result:
        return CliRunner().invoke(command_line, arguments, prog_name="gcs", env={"COLUMNS": "200"})

    return run


@pytest.fixture
def gcs(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run a gcs command to its end, in a separate process: gcs("fly", "hover")."""

    def run(*arguments: str, file_bytes: int = resource.RLIM_INFINITY) -> subprocess.CompletedProcess[str]:
        """`file_bytes`: no file may grow larger, as on a disk that is full."""
        return subprocess.run(
            [sys.executable, "-m", "gcs", *arguments],
            capture_output=True,
            text=True,
            timeout=240.0,
            cwd=tmp_path,
            env={**os.environ, "COLUMNS": "200"},
            check=False,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (file_bytes, file_bytes)),
        )

    return run
