"""Calls a custom estimator; its place in the tick is `autopilot.core.estimator_seat`.

It is called with the address of its desk, a row of numbers: `Sensed`, then the `Estimate`, then the
estimator's own numbers.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from math import nan
from typing import Any

import numpy as np

from autopilot.estimation.desk import (
    FORGOTTEN,
    GIVEN,
    NO_ESTIMATE,
    NOTHING_SENSED,
    OWN,
    REST,
    SOUND,
    Estimate,
    Sensed,
    flaw,
    told_of,
)
from autopilot.geometry.packed import Row, pack, unpack
from autopilot.own.compiled import Desk, address_in, compiled, is_compiled, memory_of
from autopilot.own.estimator import METHOD, OwnEstimator
from autopilot.own.guard import Calling, Guard, Wrong, pair_of, shown
from autopilot.own.source import blamed

_FUNCTION = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
_DESK = Desk(Sensed, GIVEN, OWN)
UNGIVEN = Estimate(True, REST._replace(x_quad=(nan, nan, nan)), nan, nan, nan)


class EstimatorHost:
    """The estimator of one flight. `failed` is called, perhaps amid a tick, when it has failed."""

    def __init__(self, estimator: OwnEstimator, failed: Callable[[], None] = lambda: None) -> None:
        self.estimator = estimator
        self.guard = Guard(estimator, failed)
        self.desk: Row = np.zeros(OWN)
        self._calling = Calling(self.guard, _checked)
        self._function: Any = _FUNCTION(self._call)
        self.begin()

    @property
    def known(self) -> bool:
        """Whether it has given an estimate."""
        return bool(self.desk[GIVEN])

    @property
    def address(self) -> int:
        """Address of the C function that is called with the address of the desk."""
        return address_in(self._function)

    def begin(self) -> None:
        """Clear the desk: the next tick is the estimator's first."""
        pack(NOTHING_SENSED, self.desk, 0)
        pack(NO_ESTIMATE, self.desk, GIVEN)

    def make(self, values: Mapping[str, float]) -> None:
        """Make the estimator with these parameters; its memory is kept. The desk may be replaced."""
        if self.guard.fault:
            return
        kind: Any = self.estimator.kind
        try:
            made = self._calling.made = self.estimator.made(values)
            if not is_compiled(self.estimator, (METHOD,)):
                return
            if len(self.desk) == OWN:
                memory = memory_of(made, NOTHING_SENSED)
                self.desk = np.zeros(_DESK.room(kind, memory))
                self.begin()
                self._function = compiled(kind, (METHOD,), memory, _DESK)[METHOD]
            pack(made, self.desk, OWN)
        except BaseException as error:
            self.guard.fail(blamed(error, self.estimator.path, self.estimator.making))

    def estimate_once(self, now: Sensed) -> None:
        """Call it as the tick calls it, and raise the alarm if something is wrong."""
        was_known = self.known
        pack(now, self.desk, 0)
        pack(UNGIVEN, self.desk, GIVEN)
        _FUNCTION(self.address)(self.desk.ctypes.data)
        estimate = unpack(Estimate, self.desk, GIVEN)
        found = flaw(estimate) if estimate.known else FORGOTTEN if was_known else SOUND
        if found != SOUND:
            self.raise_alarm()

    def raise_alarm(self) -> None:
        """Fail, because the estimate on the desk is unusable or missing."""
        estimate = unpack(Estimate, self.desk, GIVEN)
        found = flaw(estimate) if estimate.known else FORGOTTEN
        self.guard.fail(self.guard.why or f"{told_of(estimate, found)} ({self.estimator.line(METHOD)})")

    def _call(self, _: int) -> None:
        """One tick of an estimator in plain Python."""
        now = unpack(Sensed, self.desk, 0)
        estimate = self._calling.call(METHOD, now, now.period_s or 1.0)
        if estimate is not None:
            pack(estimate, self.desk, GIVEN)


def _checked(answer: Any, method: str) -> tuple[Any, Estimate]:
    """Memory and estimate that an estimator has returned; raises Wrong if it returned anything else."""
    memory, estimate = pair_of(answer, method, "estimated(...)")
    if not isinstance(estimate, Estimate):
        raise Wrong(f"{method} gives {shown(estimate)}, which must be made by estimated or no_estimate")
    return memory, estimate
