"""The parts in which the flight software is compiled before the first flight, and the text meanwhile.

Each part is a separate program, so that several compile at the same time; kernels that they share are
compiled by the first program that needs them (`autopilot.geometry.kernel`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from autopilot.geometry.machine_code import KEEPING_HINT, ROOT, is_ready, mark_ready, storage_problem
from autopilot.vehicle.parameters import LAWS

COMPILING_TEXT = (
    "compiling the flight software, once; it takes a minute or two (gcs warmup shows how far it is)"
)

# of what is compiled although all parts are ready: these have not every kernel for every vehicle and setting
COMPILING_MORE_TEXT = "compiling, once, what the flight software needs besides for these options"


@dataclass(frozen=True)
class Part:
    """What `python -m MODULE ARGUMENTS` compiles."""

    title: str
    module: str
    arguments: tuple[str, ...]
    source: Path  # which imports all kernels of the part
    mark: str
    cost_s: float  # of one core, roughly

    @property
    def ready(self) -> bool:
        """Whether nothing is left to be compiled."""
        return is_ready(self.source, (self.mark,))

    def mark_done(self) -> None:
        """Mark the part: nothing is left to be compiled from now on."""
        mark_ready(self.source, (self.mark,))


_ONBOARD = ROOT / "autopilot" / "shell" / "tick_loop.py"
_AUTOPILOT = ROOT / "autopilot" / "core" / "warmup.py"
SIMULATOR = Part("the simulator", "sitl.warmup", (), ROOT / "sitl" / "shell" / "tick_loop.py", "world", 18.0)

CABLE = Part("the cable of links", "sitl.warmup", ("cable",), SIMULATOR.source, "cable", 14.0)


ANY_OWN_LAW = "own"  # stands for any custom law: the autopilot is compiled once for all of them


def compiled_for(laws: Iterable[str]) -> tuple[str, ...]:
    """The names for which code is compiled to fly with these laws, each once."""
    return tuple(dict.fromkeys(law if law in LAWS else ANY_OWN_LAW for law in laws))


def autopilot_parts(*laws: str) -> tuple[Part, ...]:
    """The parts that the autopilot needs to fly with these laws, the longest one first; shared parts once."""
    module, placeholder_law = "autopilot.shell.warmup", compiled_for(laws)[0]
    return (
        Part("the autopilot", module, ("tick", placeholder_law), _AUTOPILOT, "tick", 25.0),
        *(
            Part(f"the law {law}", module, ("law", law), _AUTOPILOT, f"law-{law}", 12.0)
            for law in compiled_for(laws)
        ),
        Part("the messages", module, ("messages", placeholder_law), _ONBOARD, "messages", 13.0),
        Part("the paths", module, ("paths", placeholder_law), _AUTOPILOT, "paths", 5.0),
    )


def ready(parts: Iterable[Part]) -> bool:
    """Whether nothing is left to be compiled in any of these parts."""
    return all(part.ready for part in parts)


def print_compiled_kernels() -> None:
    """From now on print the name of each kernel as its compilation begins."""

    def print_name(function: Any) -> None:
        module = function.__module__  # functions that numba generates have none
        if module and module.partition(".")[0] != "numba":
            print(f"{module}.{function.__name__}", flush=True)

    _call_at_compilation(print_name)


class Compilation:
    """The compilation with which a program begins. It is announced: at once if a part is missing, otherwise
    as soon as any kernel has to be compiled."""

    def __init__(self, parts: Iterable[Part], notify: Callable[[str], None]) -> None:
        """`notify` prints a line."""
        self._parts = tuple(parts)
        self.was_needed = not ready(self._parts)
        self._stop: Callable[[], None] = lambda: None
        if self.was_needed:
            notify(COMPILING_TEXT)
            not_kept_reason = storage_problem()
            if not_kept_reason:
                notify(f"{not_kept_reason}; the machine code cannot be kept there; {KEEPING_HINT}")
            return

        def announce(_: Any) -> None:
            self._stop()
            notify(COMPILING_MORE_TEXT)

        self._stop = _call_at_compilation(announce)

    def done(self) -> None:
        """Everything is compiled: mark the parts, and announce nothing from now on."""
        self._stop()
        if self.was_needed:
            for part in self._parts:
                part.mark_done()


def _call_at_compilation(handle: Callable[[Any], None]) -> Callable[[], None]:
    """Call `handle` with the Python function of each kernel whose compilation begins, until the function that
    is returned is called."""
    from numba.core import event

    class Beginnings(event.Listener):
        listens = True

        def on_start(self, event: Any) -> None:
            if self.listens:
                handle(event.data["dispatcher"].py_func)

        def on_end(self, event: Any) -> None:
            pass

    beginnings = Beginnings()
    event.register("numba:compile", beginnings)

    def stop() -> None:
        beginnings.listens = False  # numba may be walking through its listeners at this moment

    return stop
