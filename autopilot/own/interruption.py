"""Distinguishes an exception that comes from outside, such as Ctrl-C, from one of the interrupted code."""

from __future__ import annotations

from itertools import pairwise
from opcode import opmap
from types import FrameType

_RAISE = opmap["RAISE_VARARGS"]  # the statement `raise`


def is_interruption(error: BaseException) -> bool:
    """Whether none of the interrupted code in the traceback of an error caused it.

    This holds for Python's own reaction to Ctrl-C, which no statement raises, and for what a signal handler
    raises. A `SystemExit`, or a `KeyboardInterrupt` that the interrupted code raises itself, is its fault.
    """
    if isinstance(error, Exception):
        return False
    frames: list[FrameType] = []
    trace, last_opcode = error.__traceback__, -1
    while trace is not None:
        frames.append(trace.tb_frame)
        last_opcode = trace.tb_frame.f_code.co_code[trace.tb_lasti]
        trace = trace.tb_next
    if any(_handles_signals(inner, outer) for outer, inner in pairwise(frames)):
        return True
    return isinstance(error, KeyboardInterrupt) and last_opcode != _RAISE


def _handles_signals(inner: FrameType, outer: FrameType) -> bool:
    """Whether the inner frame is a signal handler: its variables include the frame that was interrupted."""
    values = list(inner.f_locals.values())
    for group in [one for one in values if isinstance(one, tuple)]:
        values += group
    return any(one is outer for one in values)
