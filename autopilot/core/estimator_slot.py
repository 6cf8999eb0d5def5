"""The place of a custom estimator in the tick.

After the built-in estimate, the tick calls `run_estimator`, which is compiled once for all estimators. It
writes the readings to the estimator's exchange row, calls the estimator with the address of the row, and
writes the result to `EstimateSummary.state`, where the laws, the supervisor and telemetry read it. Everything
else in `EstimateSummary` stays that of the built-in filter: whether the cable is taut, tilt, pull, and the
problems of the estimate. An estimator that fails is not called again: from that same tick on, the built-in
estimate is used instead.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from math import isnan
from typing import Any, NamedTuple

import numpy as np

from autopilot.control.actuators.mixer import FORCE
from autopilot.control.records import State
from autopilot.core.tick import ControlMemory, CoreConstants, CoreRows, EstimateSummary, Winch
from autopilot.estimation.estimator_exchange import (
    ESTIMATE_OFFSET,
    ESTIMATOR_OFFSET,
    LOST,
    VALID,
    Driven,
    Estimate,
    Sensed,
    estimate_fault,
    with_readings,
)
from autopilot.estimation.inbox import COLUMNS
from autopilot.estimation.records import Array, EstimatorState
from autopilot.geometry.addresses import call_at, numbers_at
from autopilot.geometry.entry import c_function_address_of
from autopilot.geometry.kernel import kernel
from autopilot.geometry.packed import Row, pack, unpack, width, with_field
from autopilot.geometry.so3 import quat_from_rotation
from autopilot.own.estimator import OwnEstimator
from autopilot.own.estimator_host import UNSET_ESTIMATE, EstimatorHost
from autopilot.vehicle.layout import MAX_ROTORS

_FUNCTION = ctypes.CFUNCTYPE(None, ctypes.c_void_p)


class EstimatorCall(NamedTuple):
    """The arguments of one call: those of the tick, and addresses."""

    readings: int  # in the inbox
    now_us: int
    dt: float  # s, since the last tick
    inbox: int
    summary: int
    control: int
    winch: int
    constants: int
    forces: int  # of the rotors
    estimator: int
    reported: int  # `EstimatorState` as telemetry shows it
    exchange: int
    estimate: int  # the estimator, a C function of the exchange row's address
    alarm: int  # a C function that is called if the estimate cannot be used


_CALL_WIDTH = width(EstimatorCall)
_SUMMARY_WIDTH, _CONTROL_WIDTH, _WINCH_WIDTH = width(EstimateSummary), width(ControlMemory), width(Winch)
_CONSTANTS_WIDTH, _ESTIMATOR_WIDTH = width(CoreConstants), width(EstimatorState)


@kernel
def write_sensed(call: EstimatorCall, inbox: Array, f: Row, summary: EstimateSummary, exchange: Row) -> None:
    """Write what is sensed at this tick to the exchange row; `f` are the forces of the rotors."""
    constants = unpack(CoreConstants, numbers_at(call.constants, _CONSTANTS_WIDTH), 0)
    control = unpack(ControlMemory, numbers_at(call.control, _CONTROL_WIDTH), 0)
    winch = unpack(Winch, numbers_at(call.winch, _WINCH_WIDTH), 0)
    forces = (f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8], f[9], f[10], f[11], f[12], f[13])
    driven = Driven(
        control.mixed.achieved_thrust, control.mixed.achieved_moment, forces, control.thrust, control.moment
    )
    sensed = with_readings(unpack(Sensed, exchange, 0), inbox, call.readings, call.now_us, constants.tuning)
    sensed = with_field(sensed, "period_s", call.dt)
    sensed = with_field(sensed, "driven", driven)
    sensed = with_field(sensed, "cable", winch.cable)
    sensed = with_field(sensed, "taut", summary.taut)
    pack(with_field(sensed, "built_in", summary.state), exchange, 0)


@kernel
def write_estimate(estimate: Estimate, summary_row: Row, reported: Row) -> None:
    """Write a sound estimate to `summary_row` and `reported`, from which it is read."""
    summary, state = unpack(EstimateSummary, summary_row, 0), estimate.state
    if isnan(state.a_quad[0]):
        state = with_field(state, "a_quad", summary.state.a_quad)
    pack(with_field(summary, "state", state), summary_row, 0)
    estimator_state = unpack(EstimatorState, reported, 0)
    vehicle, load, uncertainty = estimator_state.vehicle, estimator_state.load, estimator_state.uncertainty
    vehicle = with_field(vehicle, "quat_wxyz", quat_from_rotation(state.R))
    vehicle = with_field(vehicle, "accel_quad", state.a_quad)
    if not isnan(estimate.tension):
        load = with_field(load, "tension", estimate.tension)
    if not isnan(estimate.horizontal_std):
        uncertainty = with_field(uncertainty, "horizontal", estimate.horizontal_std)
    if not isnan(estimate.vertical_std):
        uncertainty = with_field(uncertainty, "vertical", estimate.vertical_std)
    estimator_state = with_field(
        with_field(with_field(estimator_state, "vehicle", vehicle), "load", load), "uncertainty", uncertainty
    )
    pack(estimator_state, reported, 0)


@kernel
def run_estimator(address: int) -> None:
    """Run the estimator in a tick, given the address of its `EstimatorCall`."""
    call = unpack(EstimatorCall, numbers_at(address, _CALL_WIDTH), 0)
    inbox = numbers_at(call.inbox, call.readings * COLUMNS).reshape((call.readings, COLUMNS))
    summary, exchange = numbers_at(call.summary, _SUMMARY_WIDTH), numbers_at(call.exchange, ESTIMATOR_OFFSET)
    estimator, reported = (
        numbers_at(call.estimator, _ESTIMATOR_WIDTH),
        numbers_at(call.reported, _ESTIMATOR_WIDTH),
    )
    write_sensed(
        call, inbox, numbers_at(call.forces, MAX_ROTORS), unpack(EstimateSummary, summary, 0), exchange
    )
    was_known = unpack(Estimate, exchange, ESTIMATE_OFFSET).known and exchange[0] == 0.0
    pack(UNSET_ESTIMATE, exchange, ESTIMATE_OFFSET)
    call_at(call.estimate, call.exchange)
    exchange[0] = 0.0  # `Sensed.begins`: the first tick has passed
    estimate = unpack(Estimate, exchange, ESTIMATE_OFFSET)
    for i in range(_ESTIMATOR_WIDTH):
        reported[i] = estimator[i]
    problem = LOST if was_known else VALID
    if estimate.known:
        problem = estimate_fault(estimate)
        if problem == VALID:
            write_estimate(estimate, summary, reported)
    if problem != VALID:
        call_at(call.alarm, call.exchange)


class EstimatorSlot:
    """The place of one flight's estimator. `on_failure` is called, during a tick, when it has failed."""

    def __init__(self, estimator: OwnEstimator, rows: CoreRows, on_failure: Callable[[], None]) -> None:
        self.host = EstimatorHost(estimator, on_failure)
        self.reported: Row = np.array(rows.estimator)  # the estimate, as telemetry shows it
        self._rows = rows
        self._call: Row = np.zeros(_CALL_WIDTH)
        self._alarm = _FUNCTION(lambda _: self.host.reject_estimate())
        self._entry_point = _entry_point()

    @property
    def fault(self) -> str:
        """Why the estimator is no longer used; empty while it is."""
        return self.host.guard.fault

    @property
    def built_in(self) -> State:
        """The built-in filter's estimate of this tick."""
        return unpack(Sensed, self.host.exchange, 0).built_in

    @property
    def link(self) -> tuple[int, int]:
        """Addresses of the function that the tick calls and of its argument; zeros if nothing is to be
        called."""
        return (0, 0) if self.fault else (_address(self._entry_point), self._call.ctypes.data)

    def bind(self, rows: CoreRows) -> None:
        """Connect the slot to these rows, whose arrays must live as long as the slot."""
        self._rows = rows
        call = EstimatorCall(
            readings=0,
            now_us=0,
            dt=0.0,
            inbox=rows.inbox.ctypes.data,
            summary=rows.summary.ctypes.data,
            control=rows.control.ctypes.data,
            winch=rows.winch.ctypes.data,
            constants=rows.constants.ctypes.data,
            forces=rows.rotors[FORCE].ctypes.data,
            estimator=rows.estimator.ctypes.data,
            reported=self.reported.ctypes.data,
            exchange=self.host.exchange.ctypes.data,
            estimate=self.host.address,
            alarm=_address(self._alarm),
        )
        pack(call, self._call, 0)

    def configure(self, values: Mapping[str, float]) -> None:
        """Make the estimator with these parameters; what it remembers is kept."""
        self.host.configure(values)
        self.bind(self._rows)


def _entry_point() -> Any:
    """The C function that the tick calls."""
    return (
        c_function_address_of(run_estimator, 0)
        if hasattr(run_estimator, "overloads")
        else _FUNCTION(run_estimator)
    )


def _address(function: Any) -> int:
    """The address of a C function, given as a function of Python or as the address itself."""
    return function if isinstance(function, int) else int(ctypes.cast(function, ctypes.c_void_p).value or 0)
