"""Calls a custom estimator; its place in the tick is `autopilot.core.estimator_slot`.

It is called with the address of its exchange row: `Sensed`, then the `Estimate`, then the
estimator's own numbers.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from math import nan
from typing import Any

import numpy as np

from autopilot.estimation.estimator_exchange import (
    ESTIMATE_OFFSET,
    ESTIMATOR_OFFSET,
    LOST,
    NO_ESTIMATE,
    NOTHING_SENSED,
    REST,
    VALID,
    Estimate,
    Sensed,
    estimate_fault,
    fault_text,
)
from autopilot.geometry.packed import Row, pack, unpack
from autopilot.own.compiled import ExchangeLayout, compiled, function_address, is_compiled, memory_type
from autopilot.own.estimator import METHOD, OwnEstimator
from autopilot.own.guard import CallError, Guard, MethodCaller, memory_and_answer, short_repr
from autopilot.own.source import error_text

_C_FUNCTION = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
_LAYOUT = ExchangeLayout(Sensed, ESTIMATE_OFFSET, ESTIMATOR_OFFSET)
UNSET_ESTIMATE = Estimate(True, REST._replace(x_quad=(nan, nan, nan)), nan, nan, nan)


class EstimatorHost:
    """The estimator of one flight. `on_failure` is called, perhaps amid a tick, when it has failed."""

    def __init__(self, estimator: OwnEstimator, on_failure: Callable[[], None] = lambda: None) -> None:
        self.estimator = estimator
        self.guard = Guard(estimator, on_failure)
        self.exchange: Row = np.zeros(ESTIMATOR_OFFSET)
        self._method_caller = MethodCaller(self.guard, _checked_answer)
        self._function: Any = _C_FUNCTION(self._call)
        self.reset()

    @property
    def has_estimate(self) -> bool:
        """Whether it has given an estimate."""
        return bool(self.exchange[ESTIMATE_OFFSET])

    @property
    def address(self) -> int:
        """Address of the C function that is called with the address of the exchange row."""
        return function_address(self._function)

    def reset(self) -> None:
        """Clear the exchange row: the next tick is the estimator's first."""
        pack(NOTHING_SENSED, self.exchange, 0)
        pack(NO_ESTIMATE, self.exchange, ESTIMATE_OFFSET)

    def configure(self, values: Mapping[str, float]) -> None:
        """Make the estimator with these parameters; its memory is kept. The exchange row may be replaced."""
        if self.guard.fault:
            return
        kind: Any = self.estimator.kind
        try:
            instance = self._method_caller.instance = self.estimator.new_instance(values)
            if not is_compiled(self.estimator, (METHOD,)):
                return
            if len(self.exchange) == ESTIMATOR_OFFSET:
                memory = memory_type(instance, NOTHING_SENSED)
                self.exchange = np.zeros(_LAYOUT.size(kind, memory))
                self.reset()
                self._function = compiled(kind, (METHOD,), memory, _LAYOUT)[METHOD]
            pack(instance, self.exchange, ESTIMATOR_OFFSET)
        except BaseException as error:
            self.guard.fail(error_text(error, self.estimator.path, self.estimator.constructor_location))

    def estimate_once(self, now: Sensed) -> None:
        """Call it as the tick calls it, and reject the estimate if it is wrong."""
        had_estimate = self.has_estimate
        pack(now, self.exchange, 0)
        pack(UNSET_ESTIMATE, self.exchange, ESTIMATE_OFFSET)
        _C_FUNCTION(self.address)(self.exchange.ctypes.data)
        estimate = unpack(Estimate, self.exchange, ESTIMATE_OFFSET)
        problem = estimate_fault(estimate) if estimate.known else LOST if had_estimate else VALID
        if problem != VALID:
            self.reject_estimate()

    def reject_estimate(self) -> None:
        """Fail, because the estimate in the exchange row is unusable or missing."""
        estimate = unpack(Estimate, self.exchange, ESTIMATE_OFFSET)
        problem = estimate_fault(estimate) if estimate.known else LOST
        self.guard.fail(
            self.guard.reason or f"{fault_text(estimate, problem)} ({self.estimator.location(METHOD)})"
        )

    def _call(self, _: int) -> None:
        """One tick of an estimator in plain Python."""
        now = unpack(Sensed, self.exchange, 0)
        estimate = self._method_caller.call(METHOD, now, now.period_s or 1.0)
        if estimate is not None:
            pack(estimate, self.exchange, ESTIMATE_OFFSET)


def _checked_answer(answer: Any, method: str) -> tuple[Any, Estimate]:
    """Memory and estimate that an estimator has returned; raises CallError if it returned anything else."""
    memory, estimate = memory_and_answer(answer, method, "estimated(...)")
    if not isinstance(estimate, Estimate):
        raise CallError(
            f"{method} gives {short_repr(estimate)}, which must be made by estimated or no_estimate"
        )
    return memory, estimate
