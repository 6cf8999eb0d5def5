"""Shaping: load signals are flown exactly as requested where the vehicle can, and nearby where it cannot.

At the joints of half-cosine envelopes the acceleration jumps, and following a jump would require an unbounded
moment; elsewhere a path may demand more than rotors, cable or tilt allow. Around each such place a window of
the path is replaced by a spline. It leaves the requested path and returns to it without a jump up to the
sixth derivative, and stays as near to it as the limits allow (`autopilot.trajectory.convex`). As the whole
path is known, the vehicle prepares before a jump: a window around the beginning of the signals opens before
it (the lead), in which the load stays within `LEAD_TOLERANCE_M` of its position; a window around the end
closes after it (the tail).

Times are seconds from the beginning of the requested signals; paths are relative to the position there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import inf, nextafter
from typing import NamedTuple

import numpy as np

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO
from autopilot.trajectory.convex import (
    NO_CONSTRAINTS,
    SAMPLES,
    TOLERANCE,
    LinearConstraints,
    Objective,
    Problem,
    excess,
)
from autopilot.trajectory.load_path import (
    NO_PATH,
    NO_PIECES,
    PathTables,
    evaluate_load_path,
    path_joints,
    path_tables,
)
from autopilot.trajectory.peaks import Body
from autopilot.trajectory.rotor_demand import Bounds, demand
from autopilot.trajectory.signals import REST, Jet, risen_share
from autopilot.trajectory.splines import ORDERS, Array, Basis, PieceTable, evaluate_piece, find_piece
from missions.model import LoadPath, Signals

LEAD_TOLERANCE_M = 0.005  # how far the load may leave its position before the signals begin
INTERVAL_S = 0.04  # of the splines
_LEAD_SAMPLE_S = 0.005  # between samples of that bound: at 10 m/s^2 it is exceeded by 0.03 mm between them
WINDOW_S = 0.45  # before and after a place that cannot be flown
MAX_WINDOW_S = 15.0  # of one window; a longer one is no local change of the path
_WIDENING = 1.6  # a window whose path exceeds the bounds is widened by this factor, ...
_WIDENING_TRIES = 3  # ... up to this number of tries, ...
# ... unless it is longer than this and off by a rotor's whole range: not because of its ends
_LONG_WINDOW_S = 4.0
_COARSE_S = 0.01
_FINE_S = 0.002
_EXCESS_S = 0.001  # between samples of its excess: a path may begin with a peak of a millisecond
_SAMPLE_MARGIN = 0.022  # ranges of a rotor by which the samples of a path must stay inside its bounds
_RIPPLE = 0.1  # ranges: an excess above `TOLERANCE`, but below this, is that of waves between the samples
# in the cost, this distance counts as much as a sixth derivative that takes a quarter of a rotor's range: the
# share `_SMOOTHNESS_SHARE` of `reference_sixth_derivative`
_DISTANCE_M = 1e-3
_SMOOTHNESS_SHARE = 0.5
_SMOOTHNESS_S = 0.02  # the time in which the sixth derivative may change by as much
# a jump of the n-th derivative counts if smoothing it over `_JUMP_S` takes more than the share `_JUMP_SHARE`
# of `reference_sixth_derivative`
_JUMP_S = 0.15
_JUMP_SHARE = 0.01
_REST_M_S = 1e-2
_HUGE_EXCESS = 10.0  # times the range of a rotor


@dataclass(frozen=True, slots=True)
class ShapedSignals:
    """Signals to be flown: `pieces` where the path is a spline, the requested path elsewhere.

    The path begins `lead_s` before the requested signals and ends `tail_s` after them.
    """

    tables: PathTables
    pieces: PieceTable
    duration_s: float  # of the requested signals
    lead_s: float
    tail_s: float
    distance_m: float  # greatest distance between the flown and the requested path
    excess_n: float  # by which a bound is still exceeded
    duration_factor: float  # how many times as long as in the mission the signals last
    reason: str  # why the path cannot be flown, or ""

    def jet(self, t: float) -> Jet:
        """The path to fly at t (s from the beginning of the requested signals) with derivatives 1 ... 6."""
        return evaluate_shaped(self.tables, self.pieces, self.duration_s, t)

    def requested(self, t: float) -> Jet:
        """The requested path at t."""
        return evaluate_requested(self.tables, self.duration_s, t)


@kernel
def evaluate_requested(tables: PathTables, duration: float, t: float) -> Jet:
    """The requested path: at rest before the signals begin, and after they end if they end at rest."""
    if t < 0.0:
        return REST
    if t < duration:
        return evaluate_load_path(tables, t)
    last = evaluate_load_path(tables, duration)
    v = last[1]
    if v[0] * v[0] + v[1] * v[1] + v[2] * v[2] > 1e-4:
        return evaluate_load_path(tables, t)
    return last[0], ZERO, ZERO, ZERO, ZERO, ZERO, ZERO


@kernel
def evaluate_shaped(tables: PathTables, pieces: PieceTable, duration: float, t: float) -> Jet:
    """The path to fly: the piece that contains t, or else the requested signals."""
    row = find_piece(pieces, t)
    if row >= 0:
        return evaluate_piece(pieces, row, t)
    return evaluate_requested(tables, duration, t)


@kernel
def _fill(tables: PathTables, pieces: PieceTable, duration: float, times: Array, out: Array) -> None:
    for i in range(times.shape[0]):
        jet = evaluate_shaped(tables, pieces, duration, times[i])
        for order in range(7):
            for axis in range(3):
                out[order, i, axis] = jet[order][axis]


def unshaped_signals(step: LoadPath) -> ShapedSignals:
    """The signals exactly as requested."""
    return ShapedSignals(path_tables(step), NO_PIECES, step.duration_s, 0.0, 0.0, 0.0, 0.0, 1.0, "")


def path_jets(shaped: ShapedSignals, times: Array) -> Array:
    """(7, n, 3) jets of the path to fly."""
    out = np.empty((7, times.size, 3))
    _fill(shaped.tables, shaped.pieces, shaped.duration_s, times, out)
    return out


def requested_jets(tables: PathTables, duration: float, times: Array) -> Array:
    """(7, n, 3) jets of the requested path."""
    out = np.empty((7, times.size, 3))
    _fill(tables, NO_PIECES, duration, times, out)
    return out


def reference_sixth_derivative(body: Body, rotor_range: float) -> float:
    """The sixth derivative of a sideways path (m/s^6) that takes half the range of a rotor (N), at hover.

    Linearised about hover: pitch = m_Q L x'''' / (m g^2), and its second derivative times J is 2 l F for a
    plus quadrotor.
    """
    mass_length = body.quad_mass * body.cable_length
    weight = (body.quad_mass + body.load_mass) * body.gravity
    max_effort = max(max(abs(roll), abs(pitch)) for _, roll, pitch, _ in body.efforts)
    return (
        0.5
        / max_effort
        * body.arm
        * rotor_range
        * weight
        * body.gravity
        / (max(body.inertia[:2]) * mass_length)
    )


def shape(step: LoadPath, body: Body, bounds: Bounds) -> ShapedSignals:
    """The signals shaped so that the vehicle can fly them within the bounds; `reason` is set if it cannot."""
    requested = unshaped_signals(step)
    tables, duration = requested.tables, step.duration_s
    end_speed = float(
        np.linalg.norm(requested_jets(tables, duration, np.array([nextafter(duration, -inf)]))[1])
    )
    if end_speed > _REST_M_S:
        return _refused(requested, f"the signals end at {end_speed:.2f} m/s; they must end at rest")
    places = sorted([*_jumps(step, tables, body, bounds), *_violations(tables, duration, body, bounds)])
    spans = _windows(places, WINDOW_S)
    windows: list[_Window] = []
    while len(windows) < len(spans):
        begin, end = spans[len(windows)]
        window = _solve_widening(step, tables, begin, end, body, bounds)
        if window is None:
            text = f"from {max(begin, 0.0):.1f} s to {min(end, duration):.1f} s it exceeds what can be flown"
            return _refused(requested, text)
        if windows and window.begin < windows[-1].end:
            # it overlaps its neighbour after widening: one window for both
            last = len(windows) - 1
            spans[last : last + 2] = [(spans[last][0], end)]
            windows.pop()
        else:
            windows.append(window)
    if not windows:
        return requested
    rows = np.vstack([window.pieces for window in windows])
    lead, tail = max(-windows[0].begin, 0.0), max(windows[-1].end - duration, 0.0)
    worst = max(window.excess_n for window in windows)
    shaped = ShapedSignals(tables, rows, duration, lead, tail, 0.0, worst, 1.0, "")
    times = _sample_times(-lead, duration + tail, _FINE_S)
    deviation = path_jets(shaped, times)[0] - requested_jets(tables, duration, times)[0]
    distance = float(np.sqrt(np.max(np.sum(deviation * deviation, axis=1))))
    reason = "" if worst <= TOLERANCE * bounds.rotor_range else _excess_reason(worst, bounds)
    return ShapedSignals(tables, rows, duration, lead, tail, distance, worst, 1.0, reason)


class _Window(NamedTuple):
    """A spline from begin to end that replaces the requested path."""

    begin: float
    end: float
    pieces: PieceTable
    excess_n: float


def _solve_widening(
    step: LoadPath, tables: PathTables, begin: float, end: float, body: Body, bounds: Bounds
) -> _Window | None:
    """The first of increasingly wide windows that keeps the bounds, or else the one that exceeds them least;
    None if there is none."""
    best: _Window | None = None
    widening = 0.0
    for _ in range(_WIDENING_TRIES):
        b, e = begin - widening, end + widening
        if e - b > MAX_WINDOW_S:
            break
        for candidate in _candidates(step, tables, b, e, body, bounds):
            if best is None or candidate.excess_n < best.excess_n:
                best = candidate
        tolerance_n = TOLERANCE * bounds.rotor_range
        max_excess_n = bounds.rotor_range if e - b > _LONG_WINDOW_S else inf
        if best is not None and (best.excess_n <= tolerance_n or best.excess_n > max_excess_n):
            break
        widening = (widening + WINDOW_S) * _WIDENING - WINDOW_S
    return best


def _candidates(
    step: LoadPath, tables: PathTables, begin: float, end: float, body: Body, bounds: Bounds
) -> Iterator[_Window]:
    """The spline from begin to end; and if it exceeds the bounds between its samples, a second one whose
    samples stay inside by as much more."""
    margin_n = _SAMPLE_MARGIN * bounds.rotor_range
    window = _solve(step, tables, begin, end, body, bounds, margin_n)
    if window is None:
        return
    yield window
    if TOLERANCE * bounds.rotor_range < window.excess_n < _RIPPLE * bounds.rotor_range:
        stricter = _solve(step, tables, begin, end, body, bounds, margin_n + window.excess_n)
        if stricter is not None:
            yield stricter


def _excess_reason(excess_n: float, bounds: Bounds) -> str:
    """The excess of a path that could not be brought within the bounds, in words; in N unless it is huge."""
    is_huge = excess_n > _HUGE_EXCESS * bounds.rotor_range
    by = "far" if is_huge else f"as much as {excess_n:.2f} N of a rotor"
    return f"it exceeds the bounds of rotors, cable or rate of turn by {by}"


def _refused(requested: ShapedSignals, reason: str) -> ShapedSignals:
    return ShapedSignals(
        requested.tables, requested.pieces, requested.duration_s, 0.0, 0.0, 0.0, inf, 1.0, reason
    )


def _sample_times(begin: float, end: float, spacing: float) -> Array:
    return np.linspace(begin, end, max(int((end - begin) / spacing), 2) + 1)


def _jumps(step: LoadPath, tables: PathTables, body: Body, bounds: Bounds) -> Iterable[tuple[float, float]]:
    """Times at which derivatives jump by more than the rotors can follow."""
    reference = reference_sixth_derivative(body, bounds.rotor_range)
    times = {t for t in (*path_joints(step), 0.0, step.duration_s) if 0.0 <= t <= step.duration_s}
    for time in sorted(times):
        sides = requested_jets(tables, step.duration_s, np.array([nextafter(time, -inf), time]))
        jump = np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1)
        sixth_derivative = sum(jump[n] * _JUMP_S ** (n - 6) for n in range(1, 7))
        if sixth_derivative > _JUMP_SHARE * reference:
            yield time, time


def _violations(
    tables: PathTables, duration: float, body: Body, bounds: Bounds
) -> Iterable[tuple[float, float]]:
    """Stretches of the requested path that exceed the bounds."""
    times = _sample_times(0.0, duration, _COARSE_S)
    # samples on both sides of a joint have no common slope: the lag is considered only in the optimisation
    over = (
        excess(demand(requested_jets(tables, duration, times), body), 1.0, bounds._replace(rotor_tau=0.0))
        > 0.0
    )
    edges = np.flatnonzero(np.diff(np.concatenate([[False], over, [False]]).astype(np.int8)))
    for first, after in zip(edges[::2], edges[1::2], strict=True):
        yield float(times[first]), float(times[after - 1])


def _windows(places: Iterable[tuple[float, float]], margin: float) -> list[tuple[float, float]]:
    """Stretches `margin` wider on each side than the places; stretches near each other are merged."""
    windows: list[tuple[float, float]] = []
    for begin, end in places:
        b, e = begin - margin, end + margin
        if windows and b < windows[-1][1] + margin:
            windows[-1] = (windows[-1][0], max(windows[-1][1], e))
        else:
            windows.append((b, e))
    return windows


def _solve(
    step: LoadPath, tables: PathTables, begin: float, end: float, body: Body, bounds: Bounds, margin_n: float
) -> _Window | None:
    """The spline from begin to end, whose samples keep the bounds of the rotors by `margin_n`; None if there
    is none within the constraints."""
    intervals = max(round((end - begin) / INTERVAL_S), 2 * ORDERS)
    basis = Basis(begin, end, intervals)
    ends = requested_jets(tables, step.duration_s, np.array([begin, end]))
    origin = ends[0, 0].copy()
    ends[0] -= origin
    fixed = basis.end_coefficients(ends[:, 0], ends[:, 1])
    times = np.linspace(begin, end, SAMPLES * intervals + 1)
    target = requested_jets(tables, step.duration_s, times)[0] - origin
    reference = reference_sixth_derivative(body, bounds.rotor_range)
    smooth = 1.0 / (_SMOOTHNESS_SHARE * reference) ** 2
    objective = Objective(target, _DISTANCE_M**-2, ((6, smooth), (7, smooth * _SMOOTHNESS_S**2)))
    inner = bounds._replace(rotor_low=bounds.rotor_low + margin_n, rotor_high=bounds.rotor_high - margin_n)
    problem = Problem(
        basis, fixed, body, inner, objective, _path_constraints(step, tables, begin, end, origin)
    )
    coefficients = problem.solve()
    if coefficients is None:
        return None
    pieces = basis.pieces(coefficients, origin)
    return _Window(begin, end, pieces, _fine_excess(pieces, begin, end, body, bounds))


def _path_constraints(
    step: LoadPath, tables: PathTables, begin: float, end: float, origin: Array
) -> LinearConstraints:
    """Constraints: the load stays within LEAD_TOLERANCE_M of its position until the signals begin, and each
    rise with `rise_90_by_s` is nine tenths done by then."""
    times: list[float] = []
    axes: list[int] = []
    low: list[float] = []
    high: list[float] = []
    if begin < 0.0:
        lead_times = _sample_times(begin, 0.0, _LEAD_SAMPLE_S)[1:]
        for axis in range(3):
            times += lead_times.tolist()
            axes += [axis] * lead_times.size
            low += [-LEAD_TOLERANCE_M] * lead_times.size
            high += [LEAD_TOLERANCE_M] * lead_times.size
    for term in step.terms if isinstance(step, Signals) else ():
        if term.rise_90_by_s is None or not begin < term.start_s + term.rise_90_by_s < end:
            continue
        axis = "xyz".index(term.axis)
        time = term.start_s + term.rise_90_by_s
        share_done = risen_share(term.rise_90_by_s, term.rise_s)
        requested_position = float(requested_jets(tables, step.duration_s, np.array([time]))[0, 0, axis])
        bound = requested_position + (0.9 - share_done) * term.amplitude_m - origin[axis]
        times.append(time)
        axes.append(axis)
        low.append(bound if term.amplitude_m > 0.0 else -inf)
        high.append(bound if term.amplitude_m < 0.0 else inf)
    if not times:
        return NO_CONSTRAINTS
    order = np.zeros(len(times), np.int64)
    return LinearConstraints(np.array(times), order, np.eye(3)[axes], np.array(low), np.array(high))


def _fine_excess(pieces: PieceTable, begin: float, end: float, body: Body, bounds: Bounds) -> float:
    times = _sample_times(begin, nextafter(end, -inf), _EXCESS_S)
    jets = np.empty((7, times.size, 3))
    _fill(NO_PATH, pieces, 0.0, times, jets)
    return float(excess(demand(jets, body), float(times[1] - times[0]), bounds).max())
