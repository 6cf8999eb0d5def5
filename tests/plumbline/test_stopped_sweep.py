"""A sweep that runs as a program of its own ends with the call that started it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress

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


# starts a program as a sweep does, tells its number, and is killed
DIES = """
import os, signal, subprocess, sys
from gcs.shell.processes import end_with_parent
child = subprocess.Popen([sys.executable, "-c", sys.argv[1]], preexec_fn=end_with_parent(signal.SIGTERM))
print(child.pid, flush=True)
child.wait()
"""
# holds the pipe of its parent open until SIGTERM comes, of which it tells
OUTLIVES = """
import os, signal
signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
os.write(1, b"ready\\n")
signal.sigwait({signal.SIGTERM})
os.write(1, b"ended\\n")
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux signals the death of a parent")
def test_a_sweep_whose_script_is_killed_is_asked_to_end() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", DIES, OUTLIVES], stdout=subprocess.PIPE, text=True
    ) as script:
        assert script.stdout is not None
        number, ready = sorted(script.stdout.readline() for _ in range(2))
        child = int(number)
        try:
            assert ready == "ready\n"
            script.kill()
            assert script.stdout.read() == "ended\n"
        finally:
            with suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)
