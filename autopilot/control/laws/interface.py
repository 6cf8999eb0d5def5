"""What a control law is: a record of constants, a record of memory, and five kernels over them.

A law is one file of this folder that contains `LAW = Law(name="...", number=..., ...)`, by which it is found.
Its own parameters, if it has any, are a text `PARAMETERS` in the format of `parameters.toml`. The kernels are
the flight modes of 3-2 and the position law of the vehicle alone:

| kernel | follows | arguments after (constants, memory, state) |
|---|---|---|
| start | | (constants, state, x_d, v_d): the memory of a law that begins now, without a jump of its command |
| load_position | load position | reference, actuation, observed, cable |
| quad_position | vehicle position, without a load | reference, actuation, observed, cable |
| load_attitude | cable direction q_d under a pull (N) | q_d, b1_d, pull, actuation, observed, cable |
| quad_attitude | attitude R_d under a thrust (N) | R_d, thrust, actuation, observed, cable |

All but `start` return (memory, Command). World ENU, body FLU, SI. `reference` is the reference `preview_s`
later than now; `actuation` and `observed` are the estimates of rotors and disturbances at this tick; `cable`
is the cable's present length, rate and acceleration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload

from autopilot.control.records import Vehicle
from autopilot.geometry.compiler import INNER_OPTIONS
from autopilot.geometry.packed import packed, unpack, width
from autopilot.wire.parameter_table import ParameterTable


class Kernels(NamedTuple):
    """The compiled functions of a law."""

    start: Any
    load_position: Any
    quad_position: Any
    load_attitude: Any
    quad_attitude: Any


@dataclass(frozen=True)
class Law:
    """A law as the rest of the autopilot sees it."""

    name: str  # as users write it
    number: int  # of CTL_LAW
    constants: type  # NamedTuple of numbers
    memory: type  # NamedTuple of numbers
    rows: type  # NamedTuple (constants, memory) of two rows; its type shows the compiler which law it is
    build: Callable[[ParameterTable, Vehicle], Any]  # the constants, from the parameters
    kernels: Kernels
    preview_s: Callable[[Any], float] = lambda constants: 0.0  # how much later than now its reference applies
    # time by which the load lags behind a reference that rises or sinks steadily
    ramp_lag_s: Callable[[Any], float] = lambda constants: 0.0
    supports_reeling: bool = True  # it can fly with a cable length other than the one it was built for
    follows_shaped: bool = False  # it follows a path accurately enough for shaping to be worthwhile


_BY_RECORD: dict[Any, Law] = {}  # by the types of constants and of rows


def register(law: Law) -> Law:
    """Make the law known to the compiler."""
    _BY_RECORD[law.constants] = law
    _BY_RECORD[law.rows] = law
    return law


def law_of(record: Any) -> Law:
    """The law to which constants, or rows, belong."""
    return _BY_RECORD[type(record)]


def new_rows(constants: Any) -> Any:
    """Rows of a law with these constants and a memory of zeros."""
    law = law_of(constants)
    return law.rows(packed(constants), np.zeros(width(law.memory)))


# ---- in kernels: the compiler sees from the type of the record which law it is


def kernels_of(record: Any) -> Kernels:
    """The kernels of the law to which constants, or rows, belong."""
    return law_of(record).kernels


def constants_of(rows: Any) -> Any:
    """The constants in a law's rows."""
    return unpack(law_of(rows).constants, rows.constants, 0)


def memory_of(rows: Any) -> Any:
    """The memory in a law's rows."""
    return unpack(law_of(rows).memory, rows.memory, 0)


def _law_of_type(kind: Any) -> Law | None:
    return _BY_RECORD.get(getattr(kind, "instance_class", None))


@overload(kernels_of, jit_options=INNER_OPTIONS)
def _kernels_of(record: Any) -> Any:
    law = _law_of_type(record)
    if law is None:
        return None
    kernels = law.kernels

    def constant_kernels(record: Any) -> Any:
        return kernels

    return constant_kernels


@overload(constants_of, jit_options=INNER_OPTIONS)
def _constants_of(rows: Any) -> Any:
    law = _law_of_type(rows)
    if law is None:
        return None
    kind = law.constants

    def unpacked(rows: Any) -> Any:
        return unpack(kind, rows.constants, 0)

    return unpacked


@overload(memory_of, jit_options=INNER_OPTIONS)
def _memory_of(rows: Any) -> Any:
    law = _law_of_type(rows)
    if law is None:
        return None
    kind = law.memory

    def unpacked(rows: Any) -> Any:
        return unpack(kind, rows.memory, 0)

    return unpacked
