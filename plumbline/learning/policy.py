"""A trained policy: its file, and flying a vehicle with it tick by tick.

A file holds the weights of a network, and the options of the environment that determine its observations and
actions. It is read by numpy alone: the libraries that trained the policy are not needed to fly it.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from autopilot.control.actuators.mixer import new_rotors
from autopilot.control.records import State
from autopilot.control.thesis_cascade import ThesisMemory, start
from autopilot.geometry.linear import IDENTITY, ZERO, Vec3
from autopilot.shell.atomic_file import write_atomically
from autopilot.trajectory.signals import Jet
from autopilot.vehicle.layout import MAX_ROTORS
from autopilot.vehicle.rates import RateError, divider
from autopilot.vehicle.rotors import mixer_table
from gcs.errors import GcsError, write_error
from plumbline.arguments import file_path
from plumbline.learning.actions import Mixing, apply_action, clipped
from plumbline.learning.initial_world import hover_forces
from plumbline.learning.observations import observation_size, write_observation
from plumbline.learning.options import options_of
from plumbline.learning.records import FEATURES
from plumbline.learning.scenario import Scenario

Floats = NDArray[np.float32]
Layers = Sequence[tuple[Floats, Floats]]  # (weights (outputs, inputs), biases) of each layer

KEPT_OPTIONS = (  # options that determine the observations and actions of a policy
    "action",
    "rate_hz",
    "history",
    "preview",
    "preview_s",
    "vehicle",
    "settings",
    "max_rate_rad_s",
    "max_accel_m_s2",
)
_AT_REST = State(ZERO, ZERO, (0.0, 0.0, -1.0), ZERO, ZERO, ZERO, IDENTITY, ZERO)


class Normalisation(NamedTuple):
    """How a network scales what it observes: (observation - mean) / deviation, within -limit ... limit."""

    mean: NDArray[np.float64]  # (size,)
    deviation: NDArray[np.float64]  # (size,)
    limit: float

    def __call__(self, observation: Floats) -> Floats:
        """The scaled numbers of one observation, or of many (n, size)."""
        scaled = (observation - self.mean) / self.deviation
        return np.clip(scaled, -self.limit, self.limit).astype(np.float32)


class Policy:
    """A network with tanh between its layers, whose first layer takes the observation, or what the
    `normalisation` makes of it. Of the `options` of its environment, those in `KEPT_OPTIONS` are kept;
    `Error` (plumbline.Error) if there is no such option, or if the layers do not fit each other."""

    def __init__(
        self, layers: Layers, options: Mapping[str, Any], normalisation: Normalisation | None = None
    ) -> None:
        self.layers = [(np.asarray(w, np.float32), np.asarray(b, np.float32)) for w, b in layers]
        _require_network(self.layers)
        size = self.layers[0][0].shape[1]
        self.normalisation = None if normalisation is None else _checked(normalisation, size)
        checked = options_of(options)
        self.options = {name: options[name] for name in KEPT_OPTIONS if name in options}
        if "vehicle" in self.options:
            self.options["vehicle"] = checked.vehicle_file

    def __call__(self, observation: Floats) -> Floats:
        """Actions for one observation, or for many (n, size)."""
        *hidden, (last, shift) = self.layers
        x = observation if self.normalisation is None else self.normalisation(observation)
        for weights, biases in hidden:
            x = np.tanh(x @ weights.T + biases)
        actions: Floats = np.clip(x @ last.T + shift, -1.0, 1.0)
        return actions

    def save(self, path: str | Path) -> None:
        """Write it to a file that ends in .npz; an existing file is replaced once the new one is complete.
        `Error` (plumbline.Error) if it cannot be written."""
        file = file_path("path", path)
        if file.suffix != ".npz":
            raise GcsError(f"{file}: a policy is written as .npz; name it {file.stem}.npz")
        arrays: dict[str, NDArray[Any]] = {f"weights_{k}": w for k, (w, _) in enumerate(self.layers)}
        arrays |= {f"biases_{k}": b for k, (_, b) in enumerate(self.layers)}
        if self.normalisation is not None:
            arrays |= {name: np.asarray(part) for name, part in self.normalisation._asdict().items()}
        # options may be NumPy's numbers and arrays
        options = json.dumps(self.options, default=lambda number: number.tolist())
        content = io.BytesIO()
        np.savez(content, options=np.array(options), **arrays)  # type: ignore[arg-type]
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(file, content.getvalue())
        except OSError as error:
            raise write_error(error, file, "file", option="") from None


def load_policy(path: str | Path) -> Policy:
    """The policy in a file. `Error` (plumbline.Error) if it holds none."""
    try:
        with np.load(path) as file:
            options = json.loads(str(file["options"]))
            count = sum(name.startswith("weights_") for name in file.files)
            layers = [(file[f"weights_{k}"], file[f"biases_{k}"]) for k in range(count)]
            scaled = any(name in file.files for name in Normalisation._fields)
            parts = [file[name] for name in Normalisation._fields] if scaled else []
            return Policy(layers, options, Normalisation(*parts) if scaled else None)
    except OSError as error:
        raise GcsError(f"{path}: {error.strerror or error}") from None
    except (KeyError, ValueError, TypeError, AttributeError, EOFError, BadZipFile, GcsError) as error:
        raise GcsError(f"{path}: it holds no policy: {error}") from None


def _require_network(layers: Layers) -> None:
    """GcsError unless each layer takes the numbers that the one before gives, and all weights are finite."""
    if not layers:
        raise GcsError("there are no weights")
    for k, (weights, biases) in enumerate(layers):
        if weights.ndim != 2 or biases.shape != weights.shape[:1]:
            shapes = f"weights {weights.shape}, biases {biases.shape}"
            raise GcsError(f"layer {k}: {shapes}; must be (outputs, inputs) and (outputs,)")
        if k and weights.shape[1] != len(layers[k - 1][1]):
            raise GcsError(f"layer {k} takes {weights.shape[1]} numbers, and gets {len(layers[k - 1][1])}")
        if not (np.isfinite(weights).all() and np.isfinite(biases).all()):
            raise GcsError(f"layer {k}: all weights and biases must be finite")


def _checked(normalisation: Normalisation, size: int) -> Normalisation:
    """The normalisation with its numbers as arrays; GcsError unless it can scale observations of `size`."""
    mean, deviation = (np.asarray(part, np.float64) for part in normalisation[:2])
    limit = float(normalisation.limit)
    if mean.shape != (size,) or deviation.shape != (size,):
        shapes = f"mean {mean.shape}, deviation {deviation.shape}"
        raise GcsError(f"normalisation: {shapes}; must be ({size},), as the first layer takes {size} numbers")
    if not (np.isfinite(mean).all() and np.isfinite(deviation).all() and (deviation > 0.0).all()):
        raise GcsError("normalisation: mean and deviation must be finite, and each deviation above 0")
    if not limit > 0.0:
        raise GcsError(f"normalisation: limit = {limit:g}; must be above 0")
    return Normalisation(mean, deviation, limit)


def policy_of_sb3(model: Any, options: Mapping[str, Any]) -> Policy:
    """The deterministic policy of a PPO or A2C of Stable-Baselines3 with an `MlpPolicy`.

    `options` are those with which its environment was made. The statistics of a `VecNormalize` around the
    environment become the policy's normalisation. `Error` (plumbline.Error) if the model has a network that a
    `Policy` cannot express.
    """
    net: Any = getattr(model, "policy", None)
    policy_net = getattr(getattr(net, "mlp_extractor", None), "policy_net", None)
    if policy_net is None or not hasattr(net, "action_net") or hasattr(net, "lstm_actor"):
        given = f"a {type(model).__name__}" + ("" if net is None else f" with a {type(net).__name__}")
        raise GcsError(f"model: {given}; must be a PPO or A2C of Stable-Baselines3 with an MlpPolicy")
    extractor = type(getattr(net, "features_extractor", None)).__name__
    if extractor != "FlattenExtractor":
        raise GcsError(
            f"the policy extracts features by {extractor}; must be FlattenExtractor, the default of MlpPolicy"
        )
    others = {type(part).__name__ for part in policy_net} - {"Linear", "Tanh"}
    if others:
        raise GcsError(f"the policy has {', '.join(sorted(others))} between its layers; must be Tanh")
    linear = [part for part in policy_net if hasattr(part, "weight")]
    layers = [(_array(part.weight), _array(part.bias)) for part in (*linear, net.action_net)]
    if getattr(net, "squash_output", False):  # another tanh, after the last layer
        actions = len(layers[-1][1])
        layers.append((np.eye(actions, dtype=np.float32), np.zeros(actions, np.float32)))
    return Policy(layers, options, _normalisation_of_sb3(model))


def _array(tensor: Any) -> Floats:
    """The numbers of a tensor of PyTorch, on whatever device it is."""
    numbers: Floats = tensor.detach().cpu().numpy()
    return numbers


def _normalisation_of_sb3(model: Any) -> Normalisation | None:
    """What the `VecNormalize` of the model's environment does to observations; None if it has none, or one
    that leaves them alone. GcsError if the model has lost it: files of models do not hold it."""
    scaling = model.get_vec_normalize_env()
    if scaling is None:
        if getattr(model, "_last_original_obs", None) is not None:  # set while learning with a VecNormalize
            raise GcsError(
                "model: trained with a VecNormalize, which is missing; load the model with it: "
                f"{type(model).__name__}.load(file, env=VecNormalize.load(statistics, envs))"
            )
        return None
    if not scaling.norm_obs:
        return None
    deviation = np.sqrt(scaling.obs_rms.var + scaling.epsilon)
    return Normalisation(scaling.obs_rms.mean, deviation, scaling.clip_obs)


def _options_at(options: Mapping[str, Any], control_hz: float | None) -> Mapping[str, Any]:
    """The options of an environment with so many ticks in a second."""
    if control_hz is None:
        return options
    step_hz = options_of(options).rate_hz
    try:
        divider(control_hz, step_hz, "rate_hz")
    except RateError:
        raise GcsError(
            f"the policy acts at {step_hz:g} Hz, which does not divide CTL_RATE_HZ = {control_hz:g} Hz"
        ) from None
    rates = {"CTL_RATE_HZ": control_hz, "SIM_RATE_HZ": control_hz}
    return {**options, "settings": {**options.get("settings", {}), **rates}}


class PolicyPilot:
    """A policy that flies one vehicle: it is called at each tick of the autopilot, which has `control_hz` of
    them in a second; None: as many as in the environment."""

    def __init__(self, policy: Policy, control_hz: float | None = None) -> None:
        scenario = Scenario(options_of(_options_at(policy.options, control_hz)))
        task = scenario.task
        self._policy, self._model, self._observation_model, self._ticks = (
            policy,
            task.action,
            task.observation_model,
            task.ticks,
        )
        size = observation_size(task.observation_model)
        if policy.layers[0][0].shape[1] != size or policy.layers[-1][1].shape != (
            task.observation_model.actions,
        ):
            raise GcsError(f"the policy does not fit its options: they show {size} numbers")
        self._past = np.zeros((task.observation_model.past, FEATURES + MAX_ROTORS))
        self.observation: Floats = np.zeros(size, np.float32)
        self._action, self._tick = np.zeros(MAX_ROTORS), 0
        self._memory: ThesisMemory | None = None
        hover = hover_forces(scenario, task.action.weight)
        self._mixing = Mixing(mixer_table(scenario.cell.setup.layout), new_rotors(), hover)
        # compile now, not in flight
        self.tick(_AT_REST, (ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO))
        self.start()

    def start(self) -> None:
        """Reset, as at the beginning of an episode."""
        self._past[:] = 0.0
        self._action[:] = 0.0
        self._tick, self._memory = 0, None

    def tick(self, state: State, reference: Jet) -> tuple[float, Vec3]:
        """Thrust (N) and moment (N m, body) at this tick, for the known state and the reference of the
        load."""
        if self._tick % self._ticks == 0:
            write_observation(
                state, reference, self._action, self._past, self._observation_model, self.observation
            )
            for k, number in enumerate(self._policy(self.observation).tolist()):
                self._action[k] = clipped(number)
        self._tick += 1
        if self._memory is None:
            self._memory = start(state, state.x_load, state.v_load)
        self._memory, mixed = apply_action(self._action, state, self._memory, self._model, self._mixing)
        return mixed.achieved_thrust, mixed.achieved_moment
