"""The place of a custom estimator in the tick.

After the built-in estimate, the tick calls `take_turn`, which is compiled once for all estimators. It writes
the readings to the estimator's desk, calls the estimator with the address of the desk, and writes the result
to `Seen.state`, where the laws, the supervisor and telemetry read it. Everything else in `Seen` stays that of
the built-in filter: whether the cable is taut, tilt, pull, and the complaints about the estimate. An
estimator that fails is not called again: from that same tick on, the built-in estimate is used instead.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from math import isnan
from typing import Any, NamedTuple

import numpy as np

from autopilot.control.actuators.mixer import FORCE
from autopilot.control.records import State
from autopilot.core.tick import CoreConstants, CoreRows, Pilot, Seen, Winch
from autopilot.estimation.desk import (
    FORGOTTEN,
    GIVEN,
    OWN,
    SOUND,
    Driven,
    Estimate,
    Sensed,
    flaw,
    with_readings,
)
from autopilot.estimation.inbox import COLUMNS
from autopilot.estimation.records import Array, EstimatorState
from autopilot.geometry.addresses import call_at, numbers_at
from autopilot.geometry.entry import address_of
from autopilot.geometry.kernel import kernel
from autopilot.geometry.packed import Row, pack, unpack, width, with_field
from autopilot.geometry.so3 import quat_from_rotation
from autopilot.own.estimator import OwnEstimator
from autopilot.own.estimator_host import UNGIVEN, EstimatorHost
from autopilot.vehicle.layout import MOST

_FUNCTION = ctypes.CFUNCTYPE(None, ctypes.c_void_p)


class Turn(NamedTuple):
    """The seat: arguments of the tick, and addresses."""

    readings: int  # in the inbox
    now_us: int
    dt: float  # s, since the last tick
    inbox: int
    seen: int
    pilot: int
    winch: int
    constants: int
    forces: int  # of the rotors
    estimator: int
    shown: int  # `EstimatorState` as telemetry shows it
    desk: int
    estimate: int  # the estimator, a C function of the desk's address
    alarm: int  # a C function that is called if the estimate cannot be used


_SEAT = width(Turn)
_SEEN, _PILOT, _WINCH = width(Seen), width(Pilot), width(Winch)
_CONSTANTS, _ESTIMATOR = width(CoreConstants), width(EstimatorState)


@kernel
def gather(turn: Turn, inbox: Array, f: Row, seen: Seen, desk: Row) -> None:
    """Write what is sensed at this tick to the desk; `f` are the forces of the rotors."""
    constants = unpack(CoreConstants, numbers_at(turn.constants, _CONSTANTS), 0)
    pilot = unpack(Pilot, numbers_at(turn.pilot, _PILOT), 0)
    winch = unpack(Winch, numbers_at(turn.winch, _WINCH), 0)
    forces = (f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8], f[9], f[10], f[11], f[12], f[13])
    driven = Driven(pilot.mixed.thrust_done, pilot.mixed.moment_done, forces, pilot.thrust, pilot.moment)
    sensed = with_readings(unpack(Sensed, desk, 0), inbox, turn.readings, turn.now_us, constants.tuning)
    sensed = with_field(sensed, "period_s", turn.dt)
    sensed = with_field(sensed, "driven", driven)
    sensed = with_field(sensed, "cable", winch.cable)
    sensed = with_field(sensed, "taut", seen.taut)
    pack(with_field(sensed, "built_in", seen.state), desk, 0)


@kernel
def show(estimate: Estimate, seen: Row, shown: Row) -> None:
    """Write a sound estimate to `seen` and `shown`, from which it is read."""
    told, state = unpack(Seen, seen, 0), estimate.state
    if isnan(state.a_quad[0]):
        state = with_field(state, "a_quad", told.state.a_quad)
    pack(with_field(told, "state", state), seen, 0)
    whole = unpack(EstimatorState, shown, 0)
    vehicle, load, doubt = whole.vehicle, whole.load, whole.doubt
    vehicle = with_field(vehicle, "quat_wxyz", quat_from_rotation(state.R))
    vehicle = with_field(vehicle, "accel_quad", state.a_quad)
    if not isnan(estimate.tension):
        load = with_field(load, "tension", estimate.tension)
    if not isnan(estimate.horizontal_std):
        doubt = with_field(doubt, "horizontal", estimate.horizontal_std)
    if not isnan(estimate.vertical_std):
        doubt = with_field(doubt, "vertical", estimate.vertical_std)
    whole = with_field(with_field(with_field(whole, "vehicle", vehicle), "load", load), "doubt", doubt)
    pack(whole, shown, 0)


@kernel
def take_turn(address: int) -> None:
    """The estimator's turn in a tick, given the address of its seat."""
    turn = unpack(Turn, numbers_at(address, _SEAT), 0)
    inbox = numbers_at(turn.inbox, turn.readings * COLUMNS).reshape((turn.readings, COLUMNS))
    seen, desk = numbers_at(turn.seen, _SEEN), numbers_at(turn.desk, OWN)
    estimator, shown = numbers_at(turn.estimator, _ESTIMATOR), numbers_at(turn.shown, _ESTIMATOR)
    gather(turn, inbox, numbers_at(turn.forces, MOST), unpack(Seen, seen, 0), desk)
    was_known = unpack(Estimate, desk, GIVEN).known and desk[0] == 0.0
    pack(UNGIVEN, desk, GIVEN)
    call_at(turn.estimate, turn.desk)
    desk[0] = 0.0  # `Sensed.begins`: the first tick has passed
    estimate = unpack(Estimate, desk, GIVEN)
    for i in range(_ESTIMATOR):
        shown[i] = estimator[i]
    found = FORGOTTEN if was_known else SOUND
    if estimate.known:
        found = flaw(estimate)
        if found == SOUND:
            show(estimate, seen, shown)
    if found != SOUND:
        call_at(turn.alarm, turn.desk)


class Seat:
    """The place of one flight's estimator. `alarmed` is called, during a tick, when it has failed."""

    def __init__(self, estimator: OwnEstimator, rows: CoreRows, alarmed: Callable[[], None]) -> None:
        self.host = EstimatorHost(estimator, alarmed)
        self.shown: Row = np.array(rows.estimator)  # the estimate, as telemetry shows it
        self._rows = rows
        self._seat: Row = np.zeros(_SEAT)
        self._alarm = _FUNCTION(lambda _: self.host.raise_alarm())
        self._turn = _turn()

    @property
    def fault(self) -> str:
        """Why the estimator is no longer used; empty while it is."""
        return self.host.guard.fault

    @property
    def built_in(self) -> State:
        """The built-in filter's estimate of this tick."""
        return unpack(Sensed, self.host.desk, 0).built_in

    @property
    def link(self) -> tuple[int, int]:
        """Addresses of the function that the tick calls and of its argument; zeros if nothing is to be
        called."""
        return (0, 0) if self.fault else (_address(self._turn), self._seat.ctypes.data)

    def bind(self, rows: CoreRows) -> None:
        """Connect the seat to these rows, whose arrays must live as long as the seat."""
        self._rows = rows
        turn = Turn(
            readings=0,
            now_us=0,
            dt=0.0,
            inbox=rows.inbox.ctypes.data,
            seen=rows.seen.ctypes.data,
            pilot=rows.pilot.ctypes.data,
            winch=rows.winch.ctypes.data,
            constants=rows.constants.ctypes.data,
            forces=rows.rotors[FORCE].ctypes.data,
            estimator=rows.estimator.ctypes.data,
            shown=self.shown.ctypes.data,
            desk=self.host.desk.ctypes.data,
            estimate=self.host.address,
            alarm=_address(self._alarm),
        )
        pack(turn, self._seat, 0)

    def make(self, values: Mapping[str, float]) -> None:
        """Make the estimator with these parameters; what it remembers is kept."""
        self.host.make(values)
        self.bind(self._rows)


def _turn() -> Any:
    """The C function that the tick calls."""
    return address_of(take_turn, 0) if hasattr(take_turn, "overloads") else _FUNCTION(take_turn)


def _address(function: Any) -> int:
    """The address of a C function, given as a function of Python or as the address itself."""
    return function if isinstance(function, int) else int(ctypes.cast(function, ctypes.c_void_p).value or 0)
