"""Load signals (thesis A-1): exact position and its first six derivatives.

A term is amplitude * envelope * sines. In each stretch of its envelope (rise, hold, fall) the envelope is
1, or (1 -+ cos)/2, and a product of sines and cosines is a sum of cosines:

    sin(a) cos(b) = (cos(a + b - pi/2) + cos(a - b - pi/2)) / 2   and so on.

So the whole trajectory is a sum of cosines in each stretch, and its n-th derivative is the same sum with
each amplitude times omega^n and each phase plus n pi/2: the control loop needs no product rule, and no
derivative is approximated. `signal_table` does the expansion once, `evaluate` adds up.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import cos, inf, pi, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, axpy
from missions.model import Term

Jet = tuple[Vec3, Vec3, Vec3, Vec3, Vec3, Vec3, Vec3]
"""Position (m) and its 1st ... 6th time derivatives (m/s ... m/s^6), world ENU."""

SignalTable = NDArray[np.float64]
"""A cosine in each row: begin, end (s); amplitude east, north, up (m), omega (rad/s), phase there (rad)."""

REST: Jet = (ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO)
_COLUMNS = 7


class _Cosine(NamedTuple):
    """amplitude * cos(omega t + phase)."""

    amplitude: float
    omega: float
    phase: float


def _product(terms: Iterable[_Cosine], factors: Sequence[_Cosine]) -> tuple[_Cosine, ...]:
    """(sum of terms) * (sum of factors) as a sum of cosines: cos a cos b = (cos(a+b) + cos(a-b)) / 2."""
    return tuple(
        _Cosine(0.5 * a.amplitude * b.amplitude, a.omega + sign * b.omega, a.phase + sign * b.phase)
        for a in terms
        for b in factors
        for sign in (1.0, -1.0)
    )


def risen_share(elapsed_s: float, duration_s: float) -> float:
    """The share of a rise or fall of a term that is made after so long."""
    return 0.5 - 0.5 * cos(pi * min(elapsed_s / duration_s, 1.0))


def _half_cosine(begin_s: float, duration_s: float, sign: float) -> tuple[_Cosine, ...]:
    """(1 - sign cos(pi (t - begin) / duration)) / 2: rises for sign = 1, falls for sign = -1."""
    omega = pi / duration_s
    return (_Cosine(0.5, 0.0, 0.0), _Cosine(-0.5 * sign, omega, -omega * begin_s))


def _stretches(term: Term) -> Iterable[tuple[float, float, tuple[_Cosine, ...]]]:
    """(begin, end, envelope) of rise, hold and fall; stretches of zero duration are left out."""
    top = term.start_s + term.rise_s
    if term.rise_s > 0.0:
        yield term.start_s, top, _half_cosine(term.start_s, term.rise_s, 1.0)
    edge = inf if term.hold_s is None else top + term.hold_s
    if edge > top:
        yield top, edge, ()
    if term.hold_s is not None and term.fall_s > 0.0:
        yield edge, edge + term.fall_s, _half_cosine(edge, term.fall_s, -1.0)


def _rows(term: Term) -> Iterable[tuple[float, ...]]:
    axis = "xyz".index(term.axis)
    carrier: tuple[_Cosine, ...] = (_Cosine(term.amplitude_m, 0.0, 0.0),)
    for sine in term.factors:
        omega = 2.0 * pi / sine.period_s
        phase = sine.phase_rad - omega * sine.start_s - 0.5 * pi
        carrier = _product(carrier, (_Cosine(1.0, omega, phase),))
    for begin, end, envelope in _stretches(term):
        cosines = _product(carrier, envelope) if envelope else carrier
        for cosine in cosines:
            amplitude = [0.0, 0.0, 0.0]
            amplitude[axis] = cosine.amplitude
            yield (begin, end, *amplitude, cosine.omega, cosine.phase + cosine.omega * begin)


def signal_table(terms: Sequence[Term]) -> SignalTable:
    """The sum of the terms as a table for `evaluate`. Cosines of equal frequency are merged into one row."""
    merged: dict[tuple[float, ...], complex] = {}
    for term in terms:
        for begin, end, *amplitude, omega, phase in _rows(term):
            axis = next((i for i in range(3) if amplitude[i] != 0.0), 0)
            # cos is even: fold to omega >= 0, so that equal frequencies have equal keys
            key = (begin, end, float(axis), abs(omega))
            folded_phase = -phase if omega < 0.0 else phase
            merged[key] = merged.get(key, 0j) + amplitude[axis] * complex(
                cos(folded_phase), sin(folded_phase)
            )
    table = np.zeros((len(merged), _COLUMNS))
    for row, ((begin, end, axis_number, omega), phasor) in zip(table, merged.items(), strict=True):
        row[0:2] = begin, end
        row[2 + int(axis_number)] = abs(phasor)
        row[5:7] = omega, np.angle(phasor)
    return table


@kernel
def evaluate(table: SignalTable, t: float) -> Jet:
    """Trajectory at t seconds after its beginning, relative to the anchor, ENU.

    At the joint of two stretches, the derivatives are those of the stretch that begins there.
    """
    d0, d1, d2, d3, d4, d5, d6 = REST
    for i in range(table.shape[0]):
        if table[i, 0] <= t < table[i, 1]:
            amplitude = (table[i, 2], table[i, 3], table[i, 4])
            omega = table[i, 5]
            # counted from the beginning of the stretch, so that the phase stays accurate in long flights
            angle = table[i, 6] + omega * (t - table[i, 0])
            c = cos(angle)
            s = sin(angle)
            w2 = omega * omega
            d0 = axpy(c, amplitude, d0)
            d1 = axpy(-omega * s, amplitude, d1)
            d2 = axpy(-w2 * c, amplitude, d2)
            d3 = axpy(w2 * omega * s, amplitude, d3)
            d4 = axpy(w2 * w2 * c, amplitude, d4)
            d5 = axpy(-w2 * w2 * omega * s, amplitude, d5)
            d6 = axpy(-w2 * w2 * w2 * c, amplitude, d6)
    return d0, d1, d2, d3, d4, d5, d6


def joints(terms: Sequence[Term]) -> tuple[float, ...]:
    """Times (s), sorted, at which an envelope begins, changes or ends: there derivatives may jump."""
    times: set[float] = set()
    for term in terms:
        times.add(term.start_s)
        for begin, end, _ in _stretches(term):
            times.update((begin, end))
    return tuple(sorted(time for time in times if time < inf))
