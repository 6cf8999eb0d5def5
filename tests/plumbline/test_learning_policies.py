"""Policies outside of the environment that they were trained in, and laws inside of one."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import pytest

import plumbline.learning
from plumbline import Land, Takeoff, Waypoint
from plumbline.learning import HOVER, LOAD_TRACKING
from plumbline.learning.baseline import LawPolicy
from plumbline.learning.policy import Normalisation, Policy, PolicyPilot, load_policy, policy_of_sb3

TICK_HZ = 250.0


def made(size: int, actions: int, options: dict[str, Any]) -> Policy:
    """A policy with small actions."""
    rng = np.random.default_rng(1)
    shapes = [(8, size), (actions, 8)]
    return Policy([(0.05 * rng.normal(size=shape), np.zeros(shape[0])) for shape in shapes], options)


@pytest.mark.parametrize("action", ["rotors", "ctbr", "acceleration"])
def test_in_flight_it_sees_and_does_the_same_as_in_its_environment(action: str) -> None:
    # an environment whose steps are single ticks, so that each of them can be seen
    options: dict[str, Any] = {"action": action, "rate_hz": TICK_HZ, "history": 2, "preview": 2}
    env = gymnasium.make(LOAD_TRACKING, observation="estimate", **options)
    policy = made(env.observation_space.shape[0], env.action_space.shape[0], options)  # type: ignore[index]
    pilot, episodes = PolicyPilot(policy), env.unwrapped.episodes  # type: ignore[attr-defined]
    seen, _ = env.reset(seed=1)
    for _ in range(30):
        pilot.tick(episodes.state(0), episodes.jet(0))
        assert np.array_equal(pilot.observation, seen)
        seen, *_ = env.step(policy(seen))


def test_an_action_is_held_for_a_step_and_rotors_get_what_was_asked_for() -> None:
    env = gymnasium.make(HOVER, action="rotors", start_m=0.3)
    policy = made(28, 4, {"action": "rotors"})
    pilot, episodes = PolicyPilot(policy), env.unwrapped.episodes  # type: ignore[attr-defined]
    env.reset(seed=1)
    hover = pilot.tick(episodes.state(0), episodes.jet(0))[0]
    first = pilot.observation.copy()
    env.step(np.ones(4, np.float32))
    for _ in range(4):
        assert pilot.tick(episodes.state(0), episodes.jet(0))[0] == hover
        assert np.array_equal(pilot.observation, first)
    pilot.tick(episodes.state(0), episodes.jet(0))
    assert not np.array_equal(pilot.observation, first)
    numbers = policy(first)
    weight, most = 0.5 * 9.81, 4 * 1.96  # N, of the Bebop with its load
    low, high = numbers < 0, numbers > 0
    expected = weight + 0.25 * (numbers[low].sum() * weight + numbers[high].sum() * (most - weight))
    assert hover == pytest.approx(expected, rel=1e-6)


def test_begun_anew_it_has_forgotten_what_it_did() -> None:
    options = {"history": 3}
    policy = made(28 * 4, 4, options)
    pilot = PolicyPilot(policy)
    env = gymnasium.make(HOVER, **options)  # type: ignore[arg-type]
    env.reset(seed=1)
    episodes = env.unwrapped.episodes  # type: ignore[attr-defined]
    for _ in range(11):
        pilot.tick(episodes.state(0), episodes.jet(0))
    assert np.abs(pilot.observation[28:56]).max() > 0.0
    pilot.start()
    pilot.tick(episodes.state(0), episodes.jet(0))
    assert not pilot.observation[24:28].any() and not pilot.observation[28:].any()


def test_a_file_holds_all_of_it(tmp_path: Path) -> None:
    policy = made(28, 4, {"action": "rotors", "randomise": {"SIM_WIND_E": (0.0, 1.0)}})
    policy.save(tmp_path / "out" / "policy.npz")
    again = load_policy(tmp_path / "out" / "policy.npz")
    seen = np.linspace(-1.0, 1.0, 28, dtype=np.float32)
    assert np.array_equal(again(seen), policy(seen)) and again(np.stack([seen, seen])).shape == (2, 4)
    assert again.options == {"action": "rotors"}


def test_what_is_no_policy_is_told(tmp_path: Path) -> None:
    with pytest.raises(plumbline.Error, match="No such file"):
        load_policy(tmp_path / "none.npz")
    np.savez(tmp_path / "other.npz", numbers=np.zeros(3))
    with pytest.raises(plumbline.Error, match="it holds no policy"):
        load_policy(tmp_path / "other.npz")
    with pytest.raises(plumbline.Error, match="does not fit its options: they show 28 numbers"):
        PolicyPilot(made(12, 4, {}))
    with pytest.raises(plumbline.Error, match=r"is written as .npz; name it best.npz"):
        made(28, 4, {}).save(tmp_path / "best.policy")
    (tmp_path / "file").touch()
    with pytest.raises(plumbline.Error, match="name another file"):
        made(28, 4, {}).save(tmp_path / "file" / "policy.npz")


def broken(folder: Path, kind: str) -> Path:
    """A file of which something is wrong."""
    path = folder / "policy.npz"
    policy = made(28, 4, {"rate_hz": np.int64(50)})
    policy.save(path)
    with np.load(path) as file:
        parts = dict(file)
    if kind == "empty":
        path.write_bytes(b"")
    elif kind == "cut":
        path.write_bytes(path.read_bytes()[:500])
    elif kind == "array":
        with path.open("wb") as out:
            np.save(out, np.zeros(3))
    else:
        changed: dict[str, dict[str, Any]] = {
            "no biases": {"biases_0": None},
            "no weights": {"weights_0": None, "weights_1": None},
            "options": {"options": np.array("[1]")},
            "option": {"options": np.array('{"preveiw": 1}')},
            "shapes": {"weights_1": np.zeros((4, 7))},
            "flat": {"weights_1": np.zeros(4)},
            "half a normalisation": {"mean": np.zeros(28)},
            "limits": {"mean": np.zeros(28), "deviation": np.ones(28), "limit": np.zeros(2)},
            "not finite": {"biases_1": np.full(4, np.nan)},
        }
        kept = {name: part for name, part in (parts | changed[kind]).items() if part is not None}
        np.savez(path, **kept)
    return path


@pytest.mark.parametrize(
    ("kind", "told"),
    [
        ("empty", "it holds no policy"),
        ("cut", "it holds no policy"),
        ("array", "it holds no policy"),
        ("no biases", "it holds no policy"),
        ("no weights", "it holds no policy: there are no weights"),
        ("options", "it holds no policy"),
        ("option", "it holds no policy: preveiw: there is no such option"),
        ("shapes", "it holds no policy: layer 1 takes 7 numbers, and gets 8"),
        ("flat", r"it holds no policy: layer 1: weights \(4,\), biases \(4,\); must be"),
        ("half a normalisation", "it holds no policy"),
        ("limits", "it holds no policy"),
        ("not finite", "it holds no policy: layer 1: all weights and biases must be finite"),
    ],
)
def test_a_broken_file_is_named(tmp_path: Path, kind: str, told: str) -> None:
    with pytest.raises(plumbline.Error, match=rf"policy\.npz: {told}"):
        load_policy(broken(tmp_path, kind))


def test_a_policy_acts_at_its_rate_whatever_the_rate_of_the_autopilot() -> None:
    up = plumbline.Mission("up", [Takeoff(0.6), Waypoint(0.0, 0.0, 0.6, hold_s=2.0), Land()])
    law = "plumbline.examples.hover_policy:HoverPolicy"
    fast = {"SIM_RATE_HZ": 500, "CTL_RATE_HZ": 500}
    flight = plumbline.fly(up, law=law, settings=fast)
    assert (flight.outcome, flight.reason) == ("completed", "")
    assert 0.002 < flight.summary["load_error_max_m"] < 0.05
    with pytest.raises(
        plumbline.Error, match="the policy acts at 50 Hz, which does not divide CTL_RATE_HZ = 125"
    ):
        plumbline.fly(up, law=law, settings={"CTL_RATE_HZ": 125})


class Tensor:
    def __init__(self, values: Any) -> None:
        self._values = np.asarray(values, np.float32)

    def detach(self) -> Tensor:
        return self

    def cpu(self) -> Tensor:
        return self

    def numpy(self) -> Any:
        return self._values


class Linear:
    def __init__(self, weight: Any, bias: Any) -> None:
        self.weight, self.bias = Tensor(weight), Tensor(bias)


class Tanh:
    pass


class ReLU:
    pass


class FlattenExtractor:
    pass


class NatureCNN:
    pass


class ActorCriticPolicy:
    def __init__(self, between: Any, squash_output: bool) -> None:
        self.mlp_extractor, self.features_extractor = self, FlattenExtractor()
        self.policy_net = [Linear([[2.0]], [0.0]), between, Linear([[1.0]], [0.5]), between]
        self.action_net = Linear([[1.0], [3.0]], [0.0, 0.0])
        self.squash_output = squash_output


class VecNormalize:
    """As the wrapper of Stable-Baselines3 of that name."""

    def __init__(self, norm_obs: bool = True) -> None:
        self.norm_obs, self.epsilon, self.clip_obs = norm_obs, 1e-8, 2.0
        self.obs_rms = SimpleNamespace(mean=np.array([0.3]), var=np.array([0.04]))


class PPO:
    def __init__(
        self, between: Any = None, squash_output: bool = False, scaling: VecNormalize | None = None
    ) -> None:
        self.policy: Any = ActorCriticPolicy(between or Tanh(), squash_output)
        self._last_original_obs = None if scaling is None else np.zeros((1, 1), np.float32)
        self.scaling = scaling

    def get_vec_normalize_env(self) -> VecNormalize | None:
        return self.scaling


class SACPolicy:
    """Has an actor in place of what an ActorCriticPolicy has."""


class SAC:
    policy = SACPolicy()


def inner(observation: float) -> float:
    """What the last layer of an `ActorCriticPolicy` above takes."""
    return float(np.tanh(np.tanh(2.0 * observation) + 0.5))


def observed(value: float) -> Any:
    return np.array([value], np.float32)


def test_a_network_of_stable_baselines_becomes_one() -> None:
    policy = policy_of_sb3(PPO(), {})
    assert policy(observed(0.1)) == pytest.approx([inner(0.1), 1.0])  # the second is clipped
    with pytest.raises(plumbline.Error, match="ReLU between its layers"):
        policy_of_sb3(PPO(ReLU()), {})


def test_actions_that_stable_baselines_squashes_are_squashed() -> None:
    policy = policy_of_sb3(PPO(squash_output=True), {})
    assert policy(observed(0.1)) == pytest.approx(np.tanh([inner(0.1), 3.0 * inner(0.1)]))


def test_observations_that_stable_baselines_normalises_are_normalised(tmp_path: Path) -> None:
    policy_of_sb3(PPO(scaling=VecNormalize()), {}).save(tmp_path / "policy.npz")
    policy = load_policy(tmp_path / "policy.npz")
    for value, scaled in ((0.25, -0.25), (0.3, 0.0), (9.0, 2.0), (-9.0, -2.0)):  # the last two are clipped
        assert policy(observed(value))[0] == pytest.approx(inner(scaled), abs=1e-6)
    many = policy(np.array([[0.25], [9.0]], np.float32))
    assert many.dtype == np.float32 and many[:, 0] == pytest.approx([inner(-0.25), inner(2.0)], abs=1e-6)
    only_rewards = policy_of_sb3(PPO(scaling=VecNormalize(norm_obs=False)), {})
    assert only_rewards(observed(0.25))[0] == pytest.approx(inner(0.25))


def test_a_model_that_a_policy_cannot_express_is_refused() -> None:
    with pytest.raises(plumbline.Error, match="model: a SAC with a SACPolicy; must be a PPO or A2C"):
        policy_of_sb3(SAC(), {})
    with pytest.raises(plumbline.Error, match="model: a dict; must be a PPO or A2C"):
        policy_of_sb3({}, {})
    recurrent, pictures, lost = PPO(), PPO(), PPO(scaling=VecNormalize())
    recurrent.policy.lstm_actor = Linear([[1.0]], [0.0])
    with pytest.raises(plumbline.Error, match="with an MlpPolicy"):
        policy_of_sb3(recurrent, {})
    pictures.policy.features_extractor = NatureCNN()
    with pytest.raises(plumbline.Error, match="extracts features by NatureCNN; must be FlattenExtractor"):
        policy_of_sb3(pictures, {})
    lost.scaling = None  # the file of a model does not hold it
    with pytest.raises(plumbline.Error, match=r"PPO\.load\(file, env=VecNormalize\.load\("):
        policy_of_sb3(lost, {})


@pytest.mark.parametrize(
    ("normalisation", "told"),
    [
        (Normalisation(np.zeros(3), np.ones(28), 10.0), r"mean \(3,\), deviation \(28,\); must be \(28,\)"),
        (Normalisation(np.full(28, np.nan), np.ones(28), 10.0), "must be finite"),
        (Normalisation(np.zeros(28), np.zeros(28), 10.0), "each deviation above 0"),
        (Normalisation(np.zeros(28), np.ones(28), 0.0), "limit = 0; must be above 0"),
    ],
)
def test_a_normalisation_that_scales_nothing_is_refused(normalisation: Normalisation, told: str) -> None:
    with pytest.raises(plumbline.Error, match=told):
        Policy(made(28, 4, {}).layers, {}, normalisation)


@pytest.mark.parametrize(("action", "rate_hz", "limit_m"), [("rotors", TICK_HZ, 0.004), ("ctbr", 50.0, 0.01)])
def test_a_law_is_a_baseline(action: str, rate_hz: float, limit_m: float) -> None:
    env = gymnasium.make_vec(LOAD_TRACKING, 2, action=action, rate_hz=rate_hz, observation="truth")
    law = LawPolicy(env)
    seen, _ = env.reset(seed=3)
    for step in range(round(7 * rate_hz)):
        actions, _ = law.predict(seen)
        seen, _, crashed, _, _ = env.step(actions)
        assert not crashed.any()
        if step > 6 * rate_hz:
            assert np.linalg.norm(seen[:, :3], axis=1).max() < limit_m


def test_a_law_cannot_ask_for_what_is_below_it() -> None:
    with pytest.raises(plumbline.Error, match="must be rotors or ctbr"):
        LawPolicy(gymnasium.make(HOVER, action="acceleration"))
    with pytest.raises(plumbline.Error, match="law 'best': there is none of that name"):
        LawPolicy(gymnasium.make(HOVER), "best")


def test_a_trained_policy_flies_a_mission_as_a_law() -> None:
    up = plumbline.Mission("up", [Takeoff(0.6), Waypoint(0.0, 0.0, 0.6, hold_s=2.0), Land()])
    flight = plumbline.fly(up, law="plumbline.examples.hover_policy:HoverPolicy", quiet=True)
    assert (flight.outcome, flight.reason) == ("completed", "")
    assert 0.002 < flight.summary["load_error_max_m"] < 0.05  # more than shipped laws leave, but bounded


def test_a_policy_has_the_options_of_environments_only() -> None:
    with pytest.raises(plumbline.Error, match="preveiw: there is no such option; did you mean preview"):
        Policy([(np.zeros((4, 3)), np.zeros(4))], {"preveiw": 1})


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ('file = "lost.npz"', "lost.npz: No such file"),
        ("pass", "Lost: file, the path of the policy .*, is not set"),
    ],
    ids=["lost", "not set"],
)
def test_a_law_without_its_policy_is_told(tmp_path: Path, line: str, told: str) -> None:
    text = f"from plumbline.learning.law import PolicyLaw\n\n\nclass Lost(PolicyLaw):\n    {line}\n"
    (tmp_path / "lost.py").write_text(text, encoding="utf-8")
    with pytest.raises(plumbline.Error, match=told):
        plumbline.fly("hover", law=f"{tmp_path / 'lost.py'}:Lost", quiet=True)
