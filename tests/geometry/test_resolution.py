"""The memory of how calls in compiled code are resolved."""

from __future__ import annotations

import operator
from math import inf
from typing import Any

import numba
import pytest
from numba import types
from numba.core.errors import TypingError
from numba.core.registry import cpu_target
from numba.core.typing.templates import AbstractTemplate
from numba.extending import overload

from autopilot.geometry import resolution  # noqa: F401 - changes numba as it is imported


def test_candidates_are_asked_once_for_the_same_types(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second addition of two floats finds what the first one found."""
    context = cpu_target.typing_context
    context.refresh()
    plus = context.resolve_value_type(operator.add)
    plus.get_call_type(context, (types.float64, types.float64), {})
    asked: list[Any] = []
    monkeypatch.setattr(AbstractTemplate, "apply", lambda *given: asked.append(given))
    found = plus.get_call_type(context, (types.float64, types.float64), {})
    assert found.return_type == types.float64
    assert plus.get_impl_key(found) is not None
    assert not asked


def test_types_that_do_not_fit_are_refused_each_time() -> None:
    """A failed resolution is not remembered as a successful one."""
    context = cpu_target.typing_context
    context.refresh()
    plus = context.resolve_value_type(operator.add)
    for _ in range(2):
        with pytest.raises(TypingError):
            plus.get_call_type(context, (types.float64, types.none), {})


def test_functions_that_are_compiled_otherwise_do_not_mix() -> None:
    """Functions that they call are compiled with the options of each: division by zero is an exception, or
    infinite."""

    def ratio(x: float, y: float) -> float:
        return x / y

    @overload(ratio)
    def _ratio(x: Any, y: Any) -> Any:
        def divided(x: Any, y: Any) -> Any:
            return x / y

        return divided

    def first(x: float) -> float:
        return ratio(1.0, x)

    def second(x: float) -> float:
        return ratio(1.0, x)

    for options in ({}, {"error_model": "numpy"}, {}):
        for function in (first, second):
            compiled = numba.njit(**options)(function)
            if options:
                assert compiled(0.0) == inf
            else:
                with pytest.raises(ZeroDivisionError):
                    compiled(0.0)
