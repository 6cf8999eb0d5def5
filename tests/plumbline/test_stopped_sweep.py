"""A sweep that runs as a program of its own ends with the call that started it."""

from __future__ import annotations

import subprocess
import sys

import pytest

from plumbline.sweeps import _stopped_with_us

# says that it listens, and ends only by the signal for an orderly end, of which it tells
LISTENS = """
import os, signal, sys
signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP, signal.SIGINT})
os.write(2, b"ready\\n")
got = signal.sigwait({signal.SIGHUP, signal.SIGINT})
sys.exit(7 if got == signal.SIGHUP else 8)
"""


def test_a_signal_that_only_this_process_receives_ends_the_sweep_in_order() -> None:
    command = [sys.executable, "-c", LISTENS]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as program:
        try:
            assert program.stderr is not None
            assert program.stderr.readline() == "ready\n"
            with pytest.raises(KeyboardInterrupt), _stopped_with_us(program):
                raise KeyboardInterrupt
            assert program.poll() == 7
        finally:
            program.kill()
