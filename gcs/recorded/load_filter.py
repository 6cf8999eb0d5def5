"""Kalman filter of the load: from its measured position, from the vehicle's attitude, from both, or neither.

Eight states: cable direction (2), its rate (2), turbulence (2), bias of the thrust's direction (2).
The rows of `drive` hold the vehicle's motion (`load_model.Drive`), those of `slow` the same smoothed as
strongly as the attitude, and those of `measurements`: load relative to attachment (2, m), direction of the
thrust (2), weight of the row, whether the time since the row before is unknown.
"""

from __future__ import annotations

from autopilot.geometry.kernel import kernel
from gcs.recorded.load_model import Drive, LoadModel, LoadState, step_load, thrust_tilt
from gcs.recorded.smoothing import Floats

SIZE = 8
WORK = 3 * SIZE + 4  # rows of SIZE numbers, working memory of the kernels
_DIFFERENCE_STEP = 1e-5  # step of finite differences
_GATE_LOAD = 60.0  # greatest normalised square of an innovation
_GATE_TILT = 30.0
_MAX_REJECTED_ROWS = 8  # after more refusals in succession the filter starts anew
_MEASURED_SD = 0.01  # of a measured direction at the start; `_RATE_SD`: of its rate
_RATE_SD = 1.0
_UNMEASURED_SD = 0.15  # of a direction at the start that is not measured; its rate as in a swing
_BIAS_SD = 5e-3  # of the thrust's direction


@kernel
def _drive(rows: Floats, k: int) -> Drive:
    return (
        rows[k, 0],
        rows[k, 1],
        rows[k, 2],
        rows[k, 3],
        rows[k, 4],
        rows[k, 5],
        rows[k, 6],
        rows[k, 7],
    )


@kernel
def _state(x: Floats) -> LoadState:
    return (x[0], x[1], x[2], x[3], x[4], x[5])


@kernel
def _perturbed(s: LoadState, j: int) -> LoadState:
    e = _DIFFERENCE_STEP
    return (
        s[0] + (e if j == 0 else 0.0),
        s[1] + (e if j == 1 else 0.0),
        s[2] + (e if j == 2 else 0.0),
        s[3] + (e if j == 3 else 0.0),
        s[4] + (e if j == 4 else 0.0),
        s[5] + (e if j == 5 else 0.0),
    )


@kernel
def forecast(
    x: Floats, p: Floats, f: Floats, h: float, before: Drive, after: Drive, m: LoadModel, work: Floats
) -> None:
    """Advance state x (8,) and covariance p (8, 8) by h (s); f (8, 8) becomes the transition matrix."""
    s = _state(x)
    new = step_load(s, h, before, after, m)
    for i in range(SIZE):
        for j in range(SIZE):
            f[i, j] = 1.0 if i == j else 0.0
    for j in range(6):
        other = step_load(_perturbed(s, j), h, before, after, m)
        f[0, j] = (other[0] - new[0]) / _DIFFERENCE_STEP
        f[1, j] = (other[1] - new[1]) / _DIFFERENCE_STEP
        f[2, j] = (other[2] - new[2]) / _DIFFERENCE_STEP
        f[3, j] = (other[3] - new[3]) / _DIFFERENCE_STEP
        f[4, j] = (other[4] - new[4]) / _DIFFERENCE_STEP
        f[5, j] = (other[5] - new[5]) / _DIFFERENCE_STEP
    for i in range(6):
        x[i] = new[i]
    for i in range(SIZE):
        for j in range(SIZE):
            total = 0.0
            for k in range(SIZE):
                total += f[i, k] * p[k, j]
            work[i, j] = total
    for i in range(SIZE):
        for j in range(i + 1):
            total = 0.0
            for k in range(SIZE):
                total += work[i, k] * f[j, k]
            p[i, j] = total
            p[j, i] = total
    rate_noise = (m.force_density / m.length_m) ** 2 * h
    turbulence_noise = 2.0 * m.turbulence_m_s2**2 / m.turbulence_s * h
    bias_noise = m.tilt_walk**2 * h
    for i in range(2):
        p[2 + i, 2 + i] += rate_noise
        p[4 + i, 4 + i] += turbulence_noise
        p[6 + i, 6 + i] += bias_noise


@kernel
def _correct(
    x: Floats,
    p: Floats,
    h: Floats,
    y0: float,
    y1: float,
    r00: float,
    r01: float,
    r11: float,
    gate: float,
    work: Floats,
) -> float:
    """Correct by two innovations with Jacobian h (2, 8); the normalised square, negative if refused."""
    s00, s01, s11 = r00, r01, r11
    for i in range(SIZE):
        a = 0.0
        b = 0.0
        for j in range(SIZE):
            a += p[i, j] * h[0, j]
            b += p[i, j] * h[1, j]
        work[0, i] = a
        work[1, i] = b
    for i in range(SIZE):
        s00 += h[0, i] * work[0, i]
        s01 += h[0, i] * work[1, i]
        s11 += h[1, i] * work[1, i]
    det = s00 * s11 - s01 * s01
    square = (s11 * y0 * y0 - 2.0 * s01 * y0 * y1 + s00 * y1 * y1) / det
    if not square < gate:
        return -square
    for i in range(SIZE):
        work[2, i] = (s11 * work[0, i] - s01 * work[1, i]) / det
        work[3, i] = (s00 * work[1, i] - s01 * work[0, i]) / det
        x[i] += work[2, i] * y0 + work[3, i] * y1
    for i in range(SIZE):
        for j in range(i + 1):
            p[i, j] -= work[2, i] * work[0, j] + work[3, i] * work[1, j]
            p[j, i] = p[i, j]
    return square


@kernel
def correct_by_load(x: Floats, p: Floats, measurements: Floats, k: int, m: LoadModel, work: Floats) -> float:
    """Correct by the load's position of row k; return the normalised square, negative if refused."""
    h = work[:2]
    for i in range(2):
        for j in range(SIZE):
            h[i, j] = 1.0 if i == j else 0.0
    inverse = 1.0 / m.length_m
    place = m.seen_m**2 * inverse * inverse / measurements[k, 4]
    late = m.seen_s**2
    return _correct(
        x,
        p,
        h,
        measurements[k, 0] * inverse - x[0],
        measurements[k, 1] * inverse - x[1],
        place + late * x[2] * x[2],
        late * x[2] * x[3],
        place + late * x[3] * x[3],
        _GATE_LOAD,
        work[2:],
    )


@kernel
def correct_by_tilt(
    x: Floats, p: Floats, measurements: Floats, slow: Floats, k: int, m: LoadModel, work: Floats
) -> float:
    """Correct by the thrust's direction of row k; return the normalised square, negative if refused."""
    h = work[:2]
    s, u = _state(x), _drive(slow, k)
    tx, ty = thrust_tilt(s, u, m)
    for j in range(SIZE):
        h[0, j] = 1.0 if j == 6 else 0.0
        h[1, j] = 1.0 if j == 7 else 0.0
    for j in range(4):
        ox, oy = thrust_tilt(_perturbed(s, j), u, m)
        h[0, j] = (ox - tx) / _DIFFERENCE_STEP
        h[1, j] = (oy - ty) / _DIFFERENCE_STEP
    r = m.tilt_noise**2 * (1.0 + m.tilt_per_accel * (u[0] * u[0] + u[1] * u[1])) / measurements[k, 4]
    return _correct(
        x,
        p,
        h,
        measurements[k, 2] - tx - x[6],
        measurements[k, 3] - ty - x[7],
        r,
        0.0,
        r,
        _GATE_TILT,
        work[2:],
    )


@kernel
def start(x: Floats, p: Floats, measurements: Floats, k: int, m: LoadModel, with_load: bool) -> None:
    """Start the filter from the cable's direction in row k alone, or without any measurement."""
    for i in range(SIZE):
        x[i] = 0.0
        for j in range(SIZE):
            p[i, j] = 0.0
    if with_load:
        x[0], x[1] = measurements[k, 0] / m.length_m, measurements[k, 1] / m.length_m
    for i in range(2):
        p[i, i] = _MEASURED_SD**2 if with_load else _UNMEASURED_SD**2
        p[2 + i, 2 + i] = _RATE_SD**2 if with_load else _UNMEASURED_SD**2 * m.gravity_m_s2 / m.length_m
        p[4 + i, 4 + i] = m.turbulence_m_s2**2
        p[6 + i, 6 + i] = _BIAS_SD**2


@kernel
def run_filter(
    time: Floats,
    drive: Floats,
    slow: Floats,
    measurements: Floats,
    m: LoadModel,
    with_load: bool,
    with_tilt: bool,
    states: Floats,
    covariances: Floats,
    forecasts: Floats,
    forecast_covariances: Floats,
    transitions: Floats,
    squares: Floats,
    work: Floats,
) -> None:
    """Estimates (n, 8), (n, 8, 8) of all rows, with the forecasts before each correction and the normalised
    squares of the innovations of load position (squares[:, 0]) and thrust direction (squares[:, 1]).
    """
    n = len(time)
    x, p, rest = work[0], work[1 : 1 + SIZE], work[1 + SIZE :]
    rejected = 0
    for k in range(n):
        if k == 0 or measurements[k, 5] > 0.0:
            start(x, p, measurements, k, m, with_load)
            for i in range(SIZE):
                for j in range(SIZE):
                    transitions[k, i, j] = 0.0  # no information is passed on, forwards or backwards
        else:
            forecast(
                x, p, transitions[k], time[k] - time[k - 1], _drive(drive, k - 1), _drive(drive, k), m, rest
            )
        for i in range(SIZE):
            forecasts[k, i] = x[i]
            for j in range(SIZE):
                forecast_covariances[k, i, j] = p[i, j]
        if with_tilt:
            squares[k, 1] = correct_by_tilt(x, p, measurements, slow, k, m, rest)
        if with_load:
            squares[k, 0] = correct_by_load(x, p, measurements, k, m, rest)
            rejected = rejected + 1 if squares[k, 0] < 0.0 else 0
            if rejected > _MAX_REJECTED_ROWS:
                start(x, p, measurements, k, m, True)
                rejected = 0
        for i in range(SIZE):
            states[k, i] = x[i]
            for j in range(SIZE):
                covariances[k, i, j] = p[i, j]


@kernel
def swing_ahead(
    time: Floats, drive: Floats, m: LoadModel, begin: int, ends: Floats, states: Floats, directions: Floats
) -> None:
    """Predict from the estimate of row `begin` by the vehicle's motion alone: `directions` (len(ends), 2) of
    the cable at rows `ends`. Nothing is corrected, so no covariance is needed, which would take nine tenths
    of the time."""
    s = _state(states[begin])
    k = begin
    for e in range(len(ends)):
        while k < int(ends[e]):
            k += 1
            s = step_load(s, time[k] - time[k - 1], _drive(drive, k - 1), _drive(drive, k), m)
        directions[e, 0], directions[e, 1] = s[0], s[1]


@kernel
def predict_ahead(
    time: Floats,
    drive: Floats,
    slow: Floats,
    measurements: Floats,
    m: LoadModel,
    begin: int,
    ends: Floats,
    states: Floats,
    covariances: Floats,
    found: Floats,
    work: Floats,
) -> None:
    """Predict from the estimate of row `begin`, corrected by the attitude but not by the load: directions and
    covariances at rows `ends`.

    found (len(ends), 5) becomes q_x, q_y, and the covariance xx, xy, yy.
    """
    x, p, f, rest = work[0], work[1 : 1 + SIZE], work[1 + SIZE : 1 + 2 * SIZE], work[1 + 2 * SIZE :]
    for i in range(SIZE):
        x[i] = states[begin, i]
        for j in range(SIZE):
            p[i, j] = covariances[begin, i, j]
    k = begin
    for e in range(len(ends)):
        while k < int(ends[e]):
            k += 1
            forecast(x, p, f, time[k] - time[k - 1], _drive(drive, k - 1), _drive(drive, k), m, rest)
            correct_by_tilt(x, p, measurements, slow, k, m, rest)
        found[e, 0], found[e, 1] = x[0], x[1]
        found[e, 2], found[e, 3], found[e, 4] = p[0, 0], p[0, 1], p[1, 1]
