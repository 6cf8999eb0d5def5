"""Flies a custom control law: calls its methods, and finds what is wrong with them.

A law that raises, or commands something that is no number or far too large, is not called again: its
functions are unlinked, so that the built-in law flies from the same tick on, and `fault` says why. The
supervisor sees that at the next tick.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any

import numpy as np

from autopilot.control.law_exchange import (
    COMMAND_OFFSET,
    LAW_OFFSET,
    RATES,
    UNLINKED,
    UNSET_COMMAND,
    WRENCH,
    Asked,
    Link,
    Now,
    is_valid,
)
from autopilot.control.laws import link_own
from autopilot.geometry.magnitude import BOUNDED_TEXT, is_bounded, is_bounded_vector
from autopilot.geometry.packed import Row, pack, unpack
from autopilot.own.compiled import ExchangeLayout, compiled, function_address, is_compiled, memory_type
from autopilot.own.guard import CallError, Guard, MethodCaller, memory_and_answer, short_repr
from autopilot.own.law import MODES, OwnLaw
from autopilot.own.source import error_text

_C_FUNCTION = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
_LAYOUT = ExchangeLayout(Now, COMMAND_OFFSET, LAW_OFFSET)


class Host:
    """The law of one flight. `on_failure` is called, perhaps amid a tick, when it has failed."""

    def __init__(self, law: OwnLaw, on_failure: Callable[[], None] = lambda: None) -> None:
        self.law = law
        self.guard = Guard(law, self._handle_failure)
        self.exchange: Row = np.zeros(LAW_OFFSET)
        self._on_failure = on_failure
        self._method_caller = MethodCaller(self.guard, _checked_answer)
        self._rows: Any = None
        self._mode = law.modes[0]
        self._reject_function = _C_FUNCTION(self._reject_command)
        self._functions: Mapping[str, Any] = {}

    @property
    def fault(self) -> str:
        """Why the law is no longer called; empty while it flies."""
        return self.guard.fault

    def bind(self, rows: Any, values: Mapping[str, float]) -> None:
        """Let the law fly the tick of these rows, with these values of the parameters."""
        self._rows = rows
        self.configure(values)
        self._link()

    def configure(self, values: Mapping[str, float]) -> None:
        """Make the law with these parameters; its memory is kept."""
        if self.fault:
            return
        try:
            self._method_caller.instance = self.law.new_instance(values)
            if not self._functions:
                self._functions = (
                    self._compiled_functions() if self._is_compiled else self._python_functions()
                )
            if self._is_compiled:
                pack(self._method_caller.instance, self.exchange, LAW_OFFSET)
        except BaseException as error:
            self.guard.fail(error_text(error, self.law.path, self.law.constructor_location))

    @property
    def _is_compiled(self) -> bool:
        return is_compiled(self.law, self.law.modes)

    def address(self, mode: str) -> int:
        """Address of the C function that flies a mode; 0 if the law does not fly it."""
        function = self._functions.get(mode)
        return 0 if function is None else function_address(function)

    def command_once(self, mode: str, now: Now) -> Asked:
        """The command of a mode, called as the tick calls it."""
        pack(now, self.exchange, 0)
        pack(UNSET_COMMAND, self.exchange, COMMAND_OFFSET)
        _C_FUNCTION(self.address(mode))(self.exchange.ctypes.data)
        command = unpack(Asked, self.exchange, COMMAND_OFFSET)
        if not is_valid(command):
            self._reject_command(0)
        return command

    def _python_functions(self) -> Mapping[str, Any]:
        """Functions that call the methods in Python."""
        return {mode: _C_FUNCTION(self._python_function(mode)) for mode in self.law.modes}

    def _compiled_functions(self) -> Mapping[str, Any]:
        """Functions that are the machine code of the methods; law and memory are in the exchange row."""
        memory = memory_type(self._method_caller.instance, unpack(Now, self.exchange, 0))
        self.exchange = np.zeros(_LAYOUT.size(self.law.kind, memory))
        return compiled(self.law.kind, self.law.modes, memory, _LAYOUT)

    def _python_function(self, mode: str) -> Callable[[int], None]:
        def call(_: int) -> None:
            command = self.call(mode, unpack(Now, self.exchange, 0))
            if command is not None:
                pack(command, self.exchange, COMMAND_OFFSET)

        return call

    def call(self, mode: str, now: Now) -> Asked | None:
        """The command of the law; None if there is no answer; `guard` then has the reason."""
        self._mode = mode
        command: Asked | None = self._method_caller.call(mode, now, now.period_s)
        return command

    def _location(self) -> str:
        """File and line of the method that was called last."""
        path = self.law.path
        if self._is_compiled and len(self.law.modes) > 1:  # it is unknown which of them it was
            return path.name if path else self.law.reference
        return self.law.location(self._mode)

    def _link(self) -> None:
        if self._rows is None:
            return
        if self.fault:
            link_own(self._rows, UNLINKED)
            return
        link_own(
            self._rows,
            Link(
                self.exchange.ctypes.data, function_address(self._reject_function), *map(self.address, MODES)
            ),
        )

    def _reject_command(self, _: int) -> None:
        """Fail, because the tick has found no valid command in the exchange row."""
        command = unpack(Asked, self.exchange, COMMAND_OFFSET)
        self.guard.fail(self.guard.reason or f"{_invalid_command_text(command)} ({self._location()})")

    def _handle_failure(self) -> None:
        self._link()
        self._on_failure()


def _checked_answer(answer: Any, mode: str) -> tuple[Any, Asked]:
    """Memory and command that a law has returned; raises CallError if it returned anything else."""
    memory, command = memory_and_answer(answer, mode, "force(...)")
    if not isinstance(command, Asked):
        raise CallError(
            f"{mode} asks for {short_repr(command)}, which must be made by wrench, force, attitude or rates"
        )
    return memory, command


def _invalid_command_text(command: Asked) -> str:
    """What is invalid in a command, in words."""
    if not WRENCH <= command.kind <= RATES:
        return f"asks for a kind {command.kind} that there is not"
    if not is_bounded(command.thrust):
        return f"asks for a thrust of {command.thrust} N; {BOUNDED_TEXT}"
    if not is_bounded_vector(command.vector):
        return f"asks for {command.vector}; {BOUNDED_TEXT}"
    if not all(isfinite(number) for row in command.attitude for number in row):
        return "commands an attitude that is not a number"
    return (
        "commands an attitude that is no rotation: its rows must be unit vectors, orthogonal and right-handed"
    )
