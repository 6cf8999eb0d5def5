"""Flies a custom control law: calls its methods, and finds what is wrong with them.

A law that raises, or commands something that is no number, is not called again: its functions are unlinked,
so that the built-in law flies from the same tick on, and `fault` says why. The supervisor sees that at the
next tick.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any

import numpy as np

from autopilot.control.law_exchange import (
    ASKED,
    OWN,
    RATES,
    UNASKED,
    UNLINKED,
    WRENCH,
    Asked,
    Link,
    Now,
    is_sound,
)
from autopilot.control.laws import link_own
from autopilot.geometry.packed import Row, pack, unpack
from autopilot.own.compiled import Desk, address_in, compiled, is_compiled, memory_of
from autopilot.own.guard import Calling, Guard, Wrong, pair_of, shown
from autopilot.own.law import MODES, OwnLaw
from autopilot.own.source import blamed

_FUNCTION = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
_DESK = Desk(Now, ASKED, OWN)


class Host:
    """The law of one flight. `alarmed` is called, perhaps amid a tick, when it has failed."""

    def __init__(self, law: OwnLaw, alarmed: Callable[[], None] = lambda: None) -> None:
        self.law = law
        self.guard = Guard(law, self._replaced)
        self.desk: Row = np.zeros(OWN)
        self._alarmed = alarmed
        self._calling = Calling(self.guard, _checked)
        self._rows: Any = None
        self._mode = law.modes[0]
        self._alarm = _FUNCTION(self._raise_alarm)
        self._functions: Mapping[str, Any] = {}

    @property
    def fault(self) -> str:
        """Why the law is no longer called; empty while it flies."""
        return self.guard.fault

    def bind(self, rows: Any, values: Mapping[str, float]) -> None:
        """Let the law fly the tick of these rows, with these values of the parameters."""
        self._rows = rows
        self.make(values)
        self._link()

    def make(self, values: Mapping[str, float]) -> None:
        """Make the law with these parameters; its memory is kept."""
        if self.fault:
            return
        try:
            self._calling.made = self.law.made(values)
            if not self._functions:
                self._functions = self._compiled() if self._is_compiled else self._called()
            if self._is_compiled:
                pack(self._calling.made, self.desk, OWN)
        except BaseException as error:
            self.guard.fail(blamed(error, self.law.path, self.law.making))

    @property
    def _is_compiled(self) -> bool:
        return is_compiled(self.law, self.law.modes)

    def address(self, mode: str) -> int:
        """Address of the C function that flies a mode; 0 if the law does not fly it."""
        function = self._functions.get(mode)
        return 0 if function is None else address_in(function)

    def fly_once(self, mode: str, now: Now) -> Asked:
        """The command of a mode, called as the tick calls it."""
        pack(now, self.desk, 0)
        pack(UNASKED, self.desk, ASKED)
        _FUNCTION(self.address(mode))(self.desk.ctypes.data)
        asked = unpack(Asked, self.desk, ASKED)
        if not is_sound(asked):
            self._raise_alarm(0)
        return asked

    def _called(self) -> Mapping[str, Any]:
        """Functions that call the methods in Python."""
        return {mode: _FUNCTION(self._caller(mode)) for mode in self.law.modes}

    def _compiled(self) -> Mapping[str, Any]:
        """Functions that are the machine code of the methods; law and memory are on the desk."""
        memory = memory_of(self._calling.made, unpack(Now, self.desk, 0))
        self.desk = np.zeros(_DESK.room(self.law.kind, memory))
        return compiled(self.law.kind, self.law.modes, memory, _DESK)

    def _caller(self, mode: str) -> Callable[[int], None]:
        def call(_: int) -> None:
            asked = self.call(mode, unpack(Now, self.desk, 0))
            if asked is not None:
                pack(asked, self.desk, ASKED)

        return call

    def call(self, mode: str, now: Now) -> Asked | None:
        """The command of the law; None if there is no answer; the alarm then reports the reason."""
        self._mode = mode
        asked: Asked | None = self._calling.call(mode, now, now.period_s)
        return asked

    def _line(self) -> str:
        """File and line of the method that was called last."""
        path = self.law.path
        if self._is_compiled and len(self.law.modes) > 1:  # it is unknown which of them it was
            return path.name if path else self.law.reference
        return self.law.line(self._mode)

    def _link(self) -> None:
        if self._rows is None:
            return
        if self.fault:
            link_own(self._rows, UNLINKED)
            return
        link_own(self._rows, Link(self.desk.ctypes.data, address_in(self._alarm), *map(self.address, MODES)))

    def _raise_alarm(self, _: int) -> None:
        """Fail, because the tick has found no valid command on the desk."""
        asked = unpack(Asked, self.desk, ASKED)
        self.guard.fail(self.guard.why or f"{_told(asked)} ({self._line()})")

    def _replaced(self) -> None:
        self._link()
        self._alarmed()


def _checked(answer: Any, mode: str) -> tuple[Any, Asked]:
    """Memory and command that a law has returned; raises Wrong if it returned anything else."""
    memory, asked = pair_of(answer, mode, "force(...)")
    if not isinstance(asked, Asked):
        raise Wrong(f"{mode} asks for {shown(asked)}, which must be made by wrench, force, attitude or rates")
    return memory, asked


def _told(asked: Asked) -> str:
    """What is invalid in a command, in words."""
    if not WRENCH <= asked.kind <= RATES:
        return f"asks for a kind {asked.kind} that there is not"
    if not isfinite(asked.thrust):
        return f"asks for a thrust of {asked.thrust} N"
    if not all(map(isfinite, asked.vector)):
        return f"asks for {asked.vector}"
    return "commands an attitude that is not a number"
