"""Parameters of cable, load and vehicle identified from a recording, with intervals of 95 %.

The length is found twice: from the distance between the tracked points, and with the other parameters of the
load. These are those that predict its positions best, 2 s and 5 s ahead: robust least squares (Huber's
weights) by Gauss-Newton. This length too is nearly that of the distance, from the attachment to the load: a
position lies one length from the attachment, and its height alone shows the length better than the period of
the swing does. A wrong clock therefore does not show in it. Those of the vehicle come from a regression: its
thrust lies along its axis, so the horizontal acceleration of vehicle and load shows in the tilt.

Intervals come from a jackknife: the recording is cut into blocks of ten seconds (neighbouring residuals are
correlated, those of different blocks are not), and the parameters are estimated again without each block, by
one step of Gauss-Newton. Their scatter shows how well the recording determines them; Student's t accounts for
the small number of blocks. A sandwich estimator with sums of gradients is not suitable: at the optimum these
sums cancel, and with three blocks hardly anything is left.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, filtfilt
from scipy.special import stdtrit

from gcs.recorded.estimates import filter_rows, filtered_estimates, load_position, swings
from gcs.recorded.load_model import LoadModel
from gcs.recorded.motion import SLOW_DENSITY, SLOW_NOISE_M, Motion, distances
from gcs.recorded.scoring import HORIZONS_S, SETTLED_ROWS
from gcs.recorded.smoothing import Floats, smooth

_BLOCK_S = 10.0  # residuals further apart are assumed independent
_PREDICTION_INTERVAL_S = 1.0  # between the beginnings of predictions
_MAX_ITERATIONS = 6
_HUBER_M = 0.03  # larger errors count by their size, not their square
_FAR_WEIGHT = 0.35  # of the longer horizon
_DIFFERENCE_SHARE = 0.3  # share of a step, for finite differences
_DAMPING_STEPS = 100.0  # damping, in steps: an undetermined parameter stays where it began
_STEP_FACTORS = (1.0, 0.5, 0.25)
_CUTOFF_RATIO = 4.0  # times the pendulum's frequency: cut-off of the low-pass
# of the regression for the vehicle; each multiplies the error by about r / (1 + r), r the mass ratio
_MAX_VEHICLE_ITERATIONS = 60
_CONVERGED = 1e-6  # change of each parameter in an iteration
_EDGE_S = 5.0  # left out at both ends of the filtered signals

# at speeds below, a load that leans more in the mean is blown; tracking points that are off lean some 0.003
_SLOW_M_S = 0.3
_MAX_LEAN = 0.005

_STEPS = {
    "length_m": 0.01,
    "drag_per_m": 0.005,
    "wash_per_s2": 0.1,
    "swirl_per_s2": 0.05,
    "wash_radius_m": 0.02,
    "wash_delay_s": 0.05,
    "acceleration_share": 0.01,
    "push_x_m_s2": 0.01,
    "push_y_m_s2": 0.01,
}
# for parameters that may be zero: a half width up to this also counts as determined
_NEGLIGIBLE = {
    "drag_per_m": 1e-3,
    "wash_per_s2": 0.05,
    "swirl_per_s2": 0.05,
    "wash_delay_s": 0.02,
    "acceleration_share": 5e-3,
    "push_x_m_s2": 0.01,
    "push_y_m_s2": 0.01,
    "vehicle_drag_per_s": 0.01,
    "attitude_delay_s": 0.01,
    "vehicle_drag_per_m": 5e-3,
}
_MINIMUM = {
    "length_m": 0.01,
    "wash_radius_m": 0.01,
    "wash_delay_s": 0.0,
}  # parameters that cannot be negative

# shortest recording that can be evaluated: the edges, and one block between them
MIN_DURATION_S = 2.0 * _EDGE_S + _BLOCK_S


_MAX_LENGTH_CHANGE = 0.1  # of the length, between 5 % and 95 % of the rows
_TILT_SHARE = (0.5, 2.0)  # of a vehicle that tilts to accelerate, as all multirotors do


class TooLittleMotionError(ValueError):
    """The recording does not determine the parameters of the vehicle separately."""


class NoLoadError(ValueError):
    """No model predicts the positions that are given as those of the load."""


class Identified(NamedTuple):
    """A parameter, and half the width of its 95 % interval; in the unit with which its name ends."""

    name: str
    value: float
    half_width: float

    @property
    def is_determined(self) -> bool:
        """Whether the recording determines it: the half width is at most the value, or what matters."""
        return self.half_width <= max(abs(self.value), _NEGLIGIBLE.get(self.name, 0.0))


def tracked_length(motion: Motion, below_m: float) -> Identified:
    """The median distance from the vehicle's tracked point, `below_m` above the attachment, to the load."""
    tracked_point = motion.attachment.position + below_m * motion.thrust
    distance = np.linalg.norm(motion.load - tracked_point, axis=1)
    known = np.isfinite(distance)
    blocks = _blocks(motion.time_s[known])
    medians = np.array([np.median(distance[known][blocks == k]) for k in np.unique(blocks)])
    spread = float(np.std(medians, ddof=1)) / np.sqrt(len(medians)) if len(medians) > 1 else float("nan")
    return Identified(
        "tracked_length_m", float(np.median(distance[known])), _student_t(len(medians)) * spread
    )


def identify_load(
    motion: Motion,
    model: LoadModel,
    names: Sequence[str],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Identified]:
    """The parameters `names` of the model that predict this load best; the others stay as in `model`.
    NoLoadError if none do.

    `progress` receives the number of predictions of the recording that are done, and their greatest number.
    """
    total = 2 + _MAX_ITERATIONS * (len(names) + len(_STEP_FACTORS))
    done = 0

    def evaluate(candidate: LoadModel) -> tuple[Floats, Floats]:
        nonlocal done
        found = _errors(motion, candidate)
        done += 1
        progress(done, total)
        return found

    steps = np.array([_STEPS[name] for name in names])
    errors, times = evaluate(model)
    blown = _pushed_by_mean_lean(motion, model, names)
    if blown != model:
        blown_errors, _ = evaluate(blown)
        if _cost(blown_errors) < _cost(errors):
            model, errors = blown, blown_errors
    sensitivity = np.zeros((len(names), *errors.shape))
    for _ in range(_MAX_ITERATIONS):
        for j, name in enumerate(names):
            perturbed = model._replace(**{name: getattr(model, name) + _DIFFERENCE_SHARE * steps[j]})
            sensitivity[j] = (evaluate(perturbed)[0] - errors) / _DIFFERENCE_SHARE
        weights = _weights(errors)
        normal = np.einsum("jkhi,kh,lkhi->jl", sensitivity, weights, sensitivity)
        gradient = np.einsum("jkhi,kh,khi->j", sensitivity, weights, errors)
        damped = normal + _prior(errors) * np.eye(len(names))
        if not np.isfinite(damped).all() or not damped.any():
            raise NoLoadError("the load does not move as one on a cable does: does the column map fit?")
        change = -np.linalg.solve(damped, gradient)
        before = _cost(errors)
        for factor in _STEP_FACTORS:
            stepped = {
                n: getattr(model, n) + factor * s * c for n, s, c in zip(names, steps, change, strict=True)
            }
            if any(stepped.get(name, minimum) < minimum for name, minimum in _MINIMUM.items()):
                continue
            found, _ = evaluate(model._replace(**stepped))
            if _cost(found) < before:
                model, errors = model._replace(**stepped), found
                break
        else:
            break
    weights = _weights(errors)
    normal = np.einsum("jkhi,kh,lkhi->kjl", sensitivity, weights, sensitivity)
    gradient = np.einsum("jkhi,kh,khi->kj", sensitivity, weights, errors)
    widths = steps * half_widths(normal, gradient, times)
    return [
        Identified(name, float(getattr(model, name)), float(width))
        for name, width in zip(names, widths, strict=True)
    ]


def identify_vehicle(motion: Motion, model: LoadModel) -> list[Identified]:
    """Mass ratio (load / vehicle), linear drag of the vehicle, share of its acceleration in the tilt, delay
    of the attitude, quadratic drag of the vehicle.

    With r the mass ratio, v and v_L the velocities of vehicle and load, d = d_1 + d_2 |v| the vehicle's drag
    over its mass and c that of the load, the thrust over m_Q is

        share a + g e_3 + d v + r (a_L + g e_3 + c |v_L| v_L),

    so its horizontal part is its vertical part times the tilt. The vertical part depends on r and d, too: the
    regression is repeated with those that it found.

    TooLittleMotionError if the recording does not determine them separately.
    """
    time, slow = motion.time_s, motion.slow
    load = smooth(time, motion.load, SLOW_NOISE_M**2 / motion.times.weight, SLOW_DENSITY)
    cut = _CUTOFF_RATIO * np.sqrt(model.gravity_m_s2 / model.length_m) / (2.0 * np.pi)
    rate = 1.0 / float(np.median(np.diff(time)))
    b, a = butter(3, min(0.9, 2.0 * cut / rate))
    speed = np.linalg.norm(slow.velocity, axis=1)[:, None]
    load_drag = model.drag_per_m * np.linalg.norm(load.velocity, axis=1)[:, None] * load.velocity
    cable_force = load.acceleration + load_drag + np.array([0.0, 0.0, model.gravity_m_s2])
    tilt_rate = np.gradient(motion.tilt, time, axis=0)
    edge = int(_EDGE_S * rate)
    kept = slice(edge, len(time) - edge)

    def filtered(term: Floats) -> Floats:
        return np.asarray(filtfilt(b, a, term, axis=0)[kept])

    pull, velocity, acceleration, quadratic = map(
        filtered,
        (cable_force[:, :2], slow.velocity[:, :2], slow.acceleration[:, :2], speed * slow.velocity[:, :2]),
    )
    found = np.array([model.mass_ratio, model.vehicle_drag_per_s, model.tilt_share, 0.0, 0.0])
    for _ in range(_MAX_VEHICLE_ITERATIONS):
        drag = found[1] + found[4] * speed[:, 0]
        up = (
            slow.acceleration[:, 2]
            + model.gravity_m_s2
            + drag * slow.velocity[:, 2]
            + found[0] * cable_force[:, 2]
        )[:, None]
        delay, level_x, level_y = map(
            filtered, (-up * tilt_rate, up * np.array([1.0, 0.0]), up * np.array([0.0, 1.0]))
        )
        terms = [pull, velocity, acceleration, delay, quadratic, level_x, level_y]
        rows = np.stack(terms, axis=-1)
        target = filtered(up * motion.tilt)
        flat = rows.reshape(-1, len(terms))
        if np.linalg.matrix_rank(flat) < len(terms):
            raise TooLittleMotionError("the vehicle moves too little for its numbers to be identified")
        before, found = found, np.linalg.solve(flat.T @ flat, flat.T @ target.ravel())
        if np.max(np.abs(found[:5] - before[:5])) < _CONVERGED:
            break
    gradients = np.einsum("kij,ki->kj", rows, rows @ found - target)
    spread = half_widths(np.einsum("kij,kil->kjl", rows, rows), gradients, time[kept])
    names = ("mass_ratio", "vehicle_drag_per_s", "tilt_share", "attitude_delay_s", "vehicle_drag_per_m")
    return [Identified(n, float(v), float(s)) for n, v, s in zip(names, found, spread, strict=False)]


def length_warning(motion: Motion) -> str:
    """Why a constant length of the cable does not fit the recording; empty: it fits."""
    low, middle, high = np.nanpercentile(distances(motion), (5.0, 50.0, 95.0))
    if high - low <= _MAX_LENGTH_CHANGE * middle:
        return ""
    return (
        f"the load is {low:.2f} to {high:.2f} m from the vehicle, by a winch or a slack cable, and a "
        "constant length is assumed"
    )


def map_warning(vehicle: Sequence[Identified]) -> str:
    """Why the column map may not fit the recording, by the parameters of the vehicle; empty: it may fit."""
    share = next(one for one in vehicle if one.name == "tilt_share")
    low, high = _TILT_SHARE
    if share.value + share.half_width >= low and share.value - share.half_width <= high:
        return ""
    return (
        f"the tilt shows {share.value:.2f} of the vehicle's acceleration, and of a multirotor some 1: the "
        "column map may not fit (lengths in m, times in s, order of the quaternion, which column is which)"
    )


def wind_warning(motion: Motion, gravity_m_s2: float) -> str:
    """Why the drags may be wrong, by the mean lean of the cable at low speed; empty: the air may be still."""
    speed = np.linalg.norm(motion.attachment.velocity, axis=1)
    slow = speed < _SLOW_M_S
    lean = float(np.hypot(*np.mean(_leans(motion, gravity_m_s2)[slow], axis=0))) if slow.any() else 0.0
    if lean <= _MAX_LEAN:
        return ""
    return (
        f"the load hangs {np.degrees(np.arctan(lean)):.1f} degrees off the vertical while the vehicle is "
        "slow, as in a wind, and still air is assumed: the drags, and what depends on them, may be wrong"
    )


def _leans(motion: Motion, gravity_m_s2: float) -> Floats:
    """(n, 2) how far the cable leans towards x and y, without the lean with which it accelerates the load as
    the vehicle."""
    acceleration = motion.attachment.acceleration
    cable = motion.load - motion.attachment.position
    leans: Floats = -cable[:, :2] / cable[:, 2:] + acceleration[:, :2] / (gravity_m_s2 + acceleration[:, 2:])
    return leans


def _pushed_by_mean_lean(motion: Motion, model: LoadModel, names: Sequence[str]) -> LoadModel:
    """The model with the pushes among `names` as in a wind that makes the cable lean as it does in the mean.

    From there a fit finds those of a strong wind, as it does not from 0. The same model if it hardly leans.
    """
    lean = np.nanmean(_leans(motion, model.gravity_m_s2), axis=0)
    if not np.hypot(*lean) > _MAX_LEAN:
        return model
    pushes = zip(("push_x_m_s2", "push_y_m_s2"), model.gravity_m_s2 * lean, strict=True)
    return model._replace(**{name: float(push) for name, push in pushes if name in names})


def _errors(motion: Motion, model: LoadModel) -> tuple[Floats, Floats]:
    """Errors of predictions (k, horizons, 3) in metres, and when they began (k,)."""
    rows = filter_rows(motion, model)
    estimates = filtered_estimates(rows, model, load=True, tilt=False)
    interval = max(1, round(_PREDICTION_INTERVAL_S / float(np.median(np.diff(rows.time_s)))))
    starts = np.arange(SETTLED_ROWS, len(rows.time_s), interval)
    begins, ends, directions = swings(rows, model, estimates, starts, HORIZONS_S)
    errors = [
        load_position(motion, model, ends[:, i], directions[:, i]) - motion.load[ends[:, i]] for i in range(2)
    ]
    return np.nan_to_num(np.stack(errors, axis=1)), motion.time_s[begins]


def _weights(errors: Floats) -> Floats:
    """Weights of errors (k, horizons): constant up to the bend, then inversely proportional to the size."""
    size = np.linalg.norm(errors, axis=2)
    weights: Floats = np.array([1.0, _FAR_WEIGHT]) * _HUBER_M / np.maximum(size, _HUBER_M)
    return weights


def _cost(errors: Floats) -> float:
    size = np.linalg.norm(errors, axis=2)
    huber = np.where(size < _HUBER_M, size**2 / 2.0, _HUBER_M * (size - _HUBER_M / 2.0))
    return float(np.sum(huber * np.array([1.0, _FAR_WEIGHT])))


def _prior(errors: Floats) -> float:
    """Weight of a squared step, for parameters that the recording does not determine: a change of a hundred
    steps costs as much as a mean error, so any dependence of the errors on a parameter outweighs it."""
    size = np.linalg.norm(errors, axis=2)
    return float(np.mean(_weights(errors) * size**2)) / _DAMPING_STEPS**2


def _blocks(time: Floats) -> NDArray[np.intp]:
    """Which block each row belongs to: two at least, equally long, of ten seconds or a little more."""
    span = time[-1] - time[0]
    count = max(2, int(span / _BLOCK_S))
    blocks: NDArray[np.intp] = np.minimum((time - time[0]) / span * count, count - 1).astype(np.intp)
    return blocks


def _student_t(blocks: int) -> float:
    """Half the width of a 95 % interval in standard deviations that were estimated from so many blocks."""
    return float(stdtrit(blocks - 1, 0.975)) if blocks > 1 else float("nan")


def half_widths(normal: Floats, gradient: Floats, time: Floats) -> Floats:
    """Half widths of 95 % intervals (j,) of least squares parameters, by leaving out one block at a time.

    `normal` (k, j, j) and `gradient` (k, j) are the contributions of each row. Infinite if the remaining rows
    do not determine the parameters.
    """
    blocks = _blocks(time)
    count = int(blocks[-1]) + 1
    normals = np.zeros((count, *normal.shape[1:]))
    gradients = np.zeros((count, gradient.shape[1]))
    np.add.at(normals, blocks, normal)
    np.add.at(gradients, blocks, gradient)
    remaining_normals, remaining_gradients = normals.sum(axis=0) - normals, gradients.sum(axis=0) - gradients
    try:
        estimates = -np.linalg.solve(remaining_normals, remaining_gradients[..., None])[..., 0]
    except np.linalg.LinAlgError:
        return np.full(gradient.shape[1], np.inf)
    scatter = np.sum((estimates - estimates.mean(axis=0)) ** 2, axis=0) * (count - 1) / count
    widths: Floats = _student_t(count) * np.sqrt(scatter)
    return widths
