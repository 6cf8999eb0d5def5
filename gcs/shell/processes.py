"""The simulator and the autopilot as child processes that cannot outlive us.

Each has its own process group (Ctrl-C reaches only this process, which stops the children in order), is
killed by the kernel if this process dies (Linux), and writes its stderr to a file, from which the reason of
an early end is taken. A program of Plumbline can be loaded before its arguments are known.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType

from autopilot.geometry.machine_code import CACHE_VARIABLE
from autopilot.shell.options import ARGUMENTS_ON_STDIN
from gcs.errors import GcsError
from gcs.shell.display import notify

STOP_S = 3.0  # from SIGTERM to SIGKILL
STOPPED_LIMIT_S = (
    15.0  # that a child may be stopped (SIGSTOP), before its silence is taken for that of another program
)
_BUSY_SHARE = 0.05  # of a processor: a child that waits, and asks again now and then, uses less
CHECK_INTERVAL_S = 1.0  # between two looks at the states of the children
_PR_SET_PDEATHSIG = 1
_LAST_LINE = 4096  # bytes at the end of the log in which the last line is searched


class Child:
    """One running program."""

    def __init__(
        self,
        name: str,
        command: Sequence[str],
        log: Path,
        descriptors: Sequence[int] = (),
        folder: Path | None = None,
        environment: Mapping[str, str] | None = None,
        is_preloaded: bool = False,
    ) -> None:
        """With `is_preloaded` it is a program of Plumbline, which waits for its arguments (`start_with`)."""
        self.name = name
        self.log = log
        self._machine_code_folder = os.environ.get(CACHE_VARIABLE)
        self.exit_code: int | None = None
        with log.open("wb") as stderr:
            self._process = subprocess.Popen(
                command,
                cwd=folder,
                env={**os.environ, **environment} if environment else None,
                stdin=subprocess.PIPE if is_preloaded else subprocess.DEVNULL,
                stdout=stderr,
                stderr=subprocess.STDOUT,
                process_group=0,
                pass_fds=descriptors,
                preexec_fn=end_with_parent(),  # noqa: PLW1509, there are no threads
            )

    def start_with(self, arguments: Sequence[str], log: Path) -> bool:
        """Let it start with these arguments and write to this file; False if it has ended, or is ended now
        because it would not find what was compiled while it waited."""
        pipe = self._process.stdin
        if pipe is None or not self.running:
            return False
        if os.environ.get(CACHE_VARIABLE) != self._machine_code_folder:
            self._process.kill()  # it waits for a line, and has done nothing yet
            self._process.wait()
            return False
        log.write_bytes(b"")
        self.log = log
        try:
            with pipe:
                pipe.write(json.dumps([str(log.resolve()), *arguments]).encode() + b"\n")
        except BrokenPipeError:
            return False
        return True

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def running(self) -> bool:
        self.exit_code = self._process.poll()
        return self.exit_code is None

    @property
    def stopped(self) -> bool:
        """Whether it was stopped by a signal (state T); False if the system does not report it."""
        try:
            state = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()[0]
        except (OSError, IndexError):
            return False
        return state in ("T", "t")

    def cpu_time_s(self) -> float:
        """Processor time that it has used so far; 0 if the system does not report it."""
        try:
            fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
            return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
        except (OSError, IndexError, ValueError):
            return 0.0

    def last_line(self) -> str:
        """The last line that it wrote; empty if none."""
        try:
            text = self.log.read_bytes()[-_LAST_LINE:].decode("utf-8", "replace")
        except OSError:
            return ""
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        return lines[-1] if lines else ""

    def exit_report(self) -> str:
        """One line on why it has ended."""
        line = self.last_line().removeprefix(f"{self.name}: ")
        code = self.exit_code if self.exit_code is not None else 0
        ending = f"ended with exit code {code}"
        if code < 0:
            ending = f"was killed by {signal.Signals(-code).name}"
        silent = ", as after SIGTERM" if code == 0 else ", without a word"
        return f"{self.name} {ending}{': ' + line if line else silent}"

    def terminate(self) -> None:
        """Ask it to end."""
        if self.running:
            self._process.terminate()

    def wait(self, limit_s: float) -> bool:
        """Wait for its end, at most this long; True if it has ended."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(limit_s)
        return not self.running

    def finish(self) -> None:
        """Wait for its end, and force it after `STOP_S`."""
        if not self.wait(STOP_S):
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        self.exit_code = self._process.returncode


class Processes:
    """The children of one flight; leaving the `with` block ends them all."""

    def __init__(self) -> None:
        self._children: list[Child] = []
        self._loaded: dict[str, Child] = {}  # by name, loaded programs that wait to be started
        self._cpus_before: set[int] | None = None
        self._last_check_s = 0.0
        self._last_usage = (
            0.0,
            0.0,
        )  # time of the last look, and processor time that the children had used then
        self._are_busy = False
        self._stopped_since_s: dict[int, float] = {}  # time since which a child is stopped, by its process id

    def load(self, name: str) -> Child:
        """Let a program of Plumbline load what it needs, which takes a second, before it is started."""
        with _start_errors(name):
            command = [sys.executable, "-m", name, ARGUMENTS_ON_STDIN]
            child = self._loaded[name] = Child(name, command, Path(os.devnull), is_preloaded=True)
        return child

    def start(self, name: str, arguments: Sequence[str], log: Path, descriptors: Sequence[int] = ()) -> Child:
        """Start `python -m NAME ARGUMENTS` with its output in `log`: the loaded process if there is one, else
        a new one, which inherits these open descriptors."""
        with _start_errors(name):
            child = self._loaded.pop(name, None)
            if child is None or not child.start_with(arguments, log):
                child = Child(name, [sys.executable, "-m", name, *arguments], log, descriptors)
        self._children.append(child)
        return child

    def start_program(
        self, name: str, command: Sequence[str], log: Path, folder: Path, environment: Mapping[str, str]
    ) -> Child:
        """Start a third-party program, called `name`, in a folder, with its output in `log` and these
        environment variables beside ours."""
        with _start_errors(name):
            child = Child(name, command, log, (), folder, environment)
        self._children.append(child)
        return child

    def end_reason(self) -> str:
        """Why a child has ended, or that it has been stopped for too long; empty while all run."""
        for child in self._children:
            if not child.running:
                return child.exit_report()
        return self._stopped_too_long(time.monotonic())

    def are_busy(self) -> bool:
        """Whether the children have used the processor since the last look, as when preparing paths."""
        now_s, cpu_time_s = time.monotonic(), sum(child.cpu_time_s() for child in self._children)
        before_s, before_cpu_s = self._last_usage
        if now_s - before_s < CHECK_INTERVAL_S:
            return self._are_busy
        self._last_usage = now_s, cpu_time_s
        self._are_busy = cpu_time_s - before_cpu_s > _BUSY_SHARE * (now_s - before_s)
        return self._are_busy

    def stopped_children(self) -> str:
        """The children that are stopped by a signal at this moment; empty if none is."""
        names = [f"{child.name} (process {child.pid})" for child in self._children if child.stopped]
        return f"{' and '.join(names)} stopped by a signal" if names else ""

    def _stopped_too_long(self, now_s: float) -> str:
        if now_s - self._last_check_s < CHECK_INTERVAL_S:
            return ""
        self._last_check_s = now_s
        stopped_since_s = {
            child.pid: self._stopped_since_s.get(child.pid, now_s)
            for child in self._children
            if child.stopped
        }
        for child in self._children:
            if child.pid in stopped_since_s and child.pid not in self._stopped_since_s:
                notify(f"{child.name} (process {child.pid}) is stopped by a signal: waiting for it")
        self._stopped_since_s = stopped_since_s
        for child in self._children:
            stopped_s = now_s - stopped_since_s.get(child.pid, now_s)
            if stopped_s >= STOPPED_LIMIT_S:
                return (
                    f"{child.name} (process {child.pid}) has been stopped by a signal for {stopped_s:.0f} s"
                )
        return ""

    def share_one_core(self) -> None:
        """Keep the children on one core: in lockstep only one of them has work at a time.

        A hand-over on one core is only a switch of processes; between two cores it must wake a sleeping one.
        This process, for which the children seldom wait, keeps to the other cores, if there are any. Without
        the system call, nothing is done.
        """
        if not hasattr(os, "sched_setaffinity"):
            return
        self._cpus_before = os.sched_getaffinity(0)
        core = {_current_core(self._cpus_before)}
        affinities = [(child.pid, core) for child in self._children if child.running]
        for pid, cores in (*affinities, (0, self._cpus_before - core or core)):
            try:
                os.sched_setaffinity(pid, cores)
            except OSError:  # the process has just ended, or may not be moved
                continue

    def stop(self) -> None:
        """End all children, the last started first."""
        if self._cpus_before is not None:
            os.sched_setaffinity(0, self._cpus_before)
            self._cpus_before = None
        children = (*self._loaded.values(), *self._children)
        for child in reversed(children):
            child.terminate()
        for child in reversed(children):
            child.finish()
        self._children.clear()
        self._loaded.clear()

    def __enter__(self) -> Processes:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


@contextmanager
def _start_errors(name: str) -> Iterator[None]:
    """Raise GcsError if a program cannot be started."""
    try:
        yield
    except OSError as error:
        raise GcsError(f"{name} cannot be started: {error}") from None


def _current_core(allowed: set[int]) -> int:
    """The core on which this process runs, as the scheduler chose it: an idle one, if there was any."""
    try:
        core = int(Path("/proc/self/stat").read_text().rpartition(")")[2].split()[36])
    except (OSError, ValueError, IndexError):
        return min(allowed)
    return core if core in allowed else min(allowed)


def end_with_parent(number: signal.Signals = signal.SIGKILL) -> Callable[[], None] | None:
    """A function that a child runs before its program: it asks the kernel for this signal when we die."""
    if not sys.platform.startswith("linux"):
        return None
    libc = ctypes.CDLL(None)
    parent = os.getpid()

    def request() -> None:
        libc.prctl(_PR_SET_PDEATHSIG, number)
        if os.getppid() != parent:  # we died before the call
            os._exit(1)

    return request
