"""The Gymnasium environments: what gymnasium requires of them, and that they fly as the simulator does."""

from __future__ import annotations

import pickle
import subprocess
import sys
import warnings
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import plumbline.learning
from missions.model import Land, Mission, Takeoff
from plumbline.learning import HOVER, LOAD_TRACKING

CHANGING = {"SIM_LOAD_MASS": (0.08, 0.12), "SIM_ACT_DELAY_MS": (0.0, 15.0), "SIM_WIND_E": (-2.0, 2.0)}
OPTIONS: dict[str, dict[str, Any]] = {
    "plain": {},
    "rotors": {"action": "rotors", "history": 2, "preview": 3},
    "acceleration": {"action": "acceleration", "randomise": CHANGING, "settings": {"SIM_GUST_STD": 0.5}},
    "estimate": {"observation": "estimate", "randomise": {"SIM_NOISE_SCALE": (0.5, 2.0)}},
}
COUNT, STEPS = 5, 40
UP_AND_DOWN = Mission("up", "Up", "", (), (Takeoff(1.0), Land()))


def actions_of(space: gymnasium.Space[Any], seed: int) -> Callable[[], Any]:
    space.seed(seed)
    return space.sample


@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
@pytest.mark.parametrize("name", [HOVER, LOAD_TRACKING])
def test_gymnasium_finds_nothing_wrong(name: str, options: dict[str, Any]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(name, **options).unwrapped)


@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_many_are_the_same_to_the_bit_as_one_after_another(
    mode: AutoresetMode, options: dict[str, Any]
) -> None:
    # short episodes, far from the path's beginning: some crash, some end, all begin again
    given = {"start": "random", "start_m": 0.2, "reach_m": 0.23, "mission": "case-b", **options}
    alone = SyncVectorEnv(
        [lambda: gymnasium.make(LOAD_TRACKING, max_episode_steps=15, **given)] * COUNT, autoreset_mode=mode
    )
    together = gymnasium.make_vec(
        LOAD_TRACKING,
        COUNT,
        vectorization_mode="vector_entry_point",
        max_episode_steps=15,
        autoreset_mode=mode,
        threads=2,
        **given,
    )
    assert together.single_observation_space == alone.single_observation_space
    assert together.observation_space == alone.observation_space
    assert together.action_space == alone.action_space
    assert together.metadata["autoreset_mode"] == mode
    first, second = alone.reset(seed=7), together.reset(seed=7)
    assert np.array_equal(first[0], second[0]) and second[0] in together.observation_space
    crashes = ends = 0
    sample = actions_of(together.action_space, 1)
    for _ in range(STEPS):
        actions = sample()
        one, many = alone.step(actions), together.step(actions)
        for expected, found in zip(one[:4], many[:4], strict=True):
            assert np.array_equal(expected, found) and expected.dtype == found.dtype
        assert one[4].keys() == many[4].keys()
        if "final_obs" in one[4]:
            assert np.array_equal(one[4]["_final_obs"], many[4]["_final_obs"])
            for i in np.flatnonzero(one[4]["_final_obs"]):
                assert np.array_equal(one[4]["final_obs"][i], many[4]["final_obs"][i])
        crashes, ends = crashes + int(many[2].sum()), ends + int(many[3].sum())
    assert ends > 0 and crashes > 0


def test_episodes_that_are_not_begun_by_themselves() -> None:
    envs = gymnasium.make_vec(HOVER, 3, autoreset_mode="Disabled", max_episode_steps=4)
    first, _ = envs.reset(seed=1)
    actions = np.zeros(envs.action_space.shape, np.float32)
    for _ in range(4):
        *_, truncated, _ = envs.step(actions)
    assert truncated.all()
    with pytest.raises(plumbline.Error, match="reset_mask"):
        envs.step(actions)
    kept, _ = envs.reset(seed=[1, None, None], options={"reset_mask": np.array([True, False, True])})
    assert np.array_equal(kept[0], first[0]) and not np.array_equal(kept[2], first[2])
    with pytest.raises(plumbline.Error, match="3 booleans"):
        envs.reset(options={"reset_mask": np.array([True])})


@pytest.mark.parametrize("options", [{}, {"randomise": CHANGING}, {"observation": "estimate"}])
def test_a_mask_that_marks_no_environment_changes_nothing(options: dict[str, Any]) -> None:
    envs, untouched = (gymnasium.make_vec(HOVER, 3, autoreset_mode="Disabled", **options) for _ in range(2))
    actions = np.full(envs.action_space.shape, 0.1, np.float32)
    for one in (envs, untouched):
        one.reset(seed=1)
        present, *_ = one.step(actions)
    kept, infos = envs.reset(seed=9, options={"reset_mask": np.zeros(3, np.bool_)})
    assert np.array_equal(kept, present) and infos == {}
    assert np.array_equal(envs.step(actions)[0], untouched.step(actions)[0])
    assert np.array_equal(envs.reset()[0], untouched.reset()[0]), "the same random numbers follow"


def test_a_step_comes_after_a_reset() -> None:
    env = gymnasium.make(HOVER).unwrapped
    with pytest.raises(ResetNeeded, match=r"call reset\(\) first"):
        env.step(np.zeros(4, np.float32))
    envs = gymnasium.make_vec(HOVER, 2, autoreset_mode="Disabled")
    with pytest.raises(ResetNeeded, match=r"call reset\(\) first"):
        envs.step(np.zeros((2, 4), np.float32))
    for mask in ([False, False], [True, False]):
        with pytest.raises(ResetNeeded, match="first reset all of them"):
            envs.reset(options={"reset_mask": np.array(mask)})
    envs.reset(options={"reset_mask": np.array([True, True])})
    envs.step(np.zeros((2, 4), np.float32))


WRONG_SEEDS = {
    "text": ("a", "seed = 'a'; must be a whole number, 0 or more, or a list of 2 of them"),
    "fraction": (1.5, "seed = 1.5; must be a whole number, 0 or more, or a list of 2 of them"),
    "negative": (-1, "seed = -1; must be a whole number, 0 or more"),
    "few": ([1], "seed: 1 seeds; must be 2"),
    "text of one": ([1, "b"], r"seed\[1\] = 'b'; must be a whole number, 0 or more"),
    "negative one": ([None, -3], r"seed\[1\] = -3; must be a whole number, 0 or more"),
}


@pytest.mark.parametrize(("seed", "told"), WRONG_SEEDS.values(), ids=WRONG_SEEDS)
def test_a_seed_that_is_none_is_told(seed: Any, told: str) -> None:
    envs = gymnasium.make_vec(HOVER, 2)
    with pytest.raises(plumbline.Error, match=told):
        envs.reset(seed=seed)
    if not isinstance(seed, list):
        with pytest.raises(plumbline.Error, match=r"seed = .*; must be a whole number, 0 or more"):
            gymnasium.make(HOVER).reset(seed=seed)


def test_the_same_seed_is_the_same_episode() -> None:
    def episode(seed: int) -> list[bytes]:
        env = gymnasium.make(HOVER, observation="estimate", randomise=CHANGING)
        sample = actions_of(env.action_space, 3)
        seen = [env.reset(seed=seed)[0].tobytes()]
        return seen + [env.step(sample())[0].tobytes() for _ in range(20)]

    assert episode(4) == episode(4)
    assert episode(4)[0] != episode(5)[0]


@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
def test_a_pickled_copy_goes_on_where_its_original_is(options: dict[str, Any]) -> None:
    env = gymnasium.make(LOAD_TRACKING, **options)
    envs = gymnasium.make_vec(LOAD_TRACKING, 2, vectorization_mode="vector_entry_point", **options)
    for one in (env, envs):
        action = one.action_space.sample()
        one.reset(seed=3)
        one.step(action)
        copy = pickle.loads(pickle.dumps(one))
        for _ in range(5):
            assert np.array_equal(one.step(action)[0], copy.step(action)[0])
        again = [each.reset()[0] for each in (one, copy)]
        assert np.array_equal(*again), "the same random numbers follow"
        copy.close()
        one.close()


def test_another_process_goes_on_with_pickled_environments(tmp_path: Path) -> None:
    envs = [gymnasium.make(HOVER, observation=observation) for observation in ("truth", "estimate")]
    for env in envs:
        env.reset(seed=3)
    path = tmp_path / "envs"
    path.write_bytes(pickle.dumps(envs))
    program = f"""
import pickle
for env in pickle.load(open({str(path)!r}, "rb")):
    print(env.step({[0.1] * 4})[0])
"""
    told = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert told.stdout == "".join(f"{env.step(np.full(4, 0.1))[0]}\n" for env in envs)


def test_statistics_of_gymnasium_count_episodes() -> None:
    envs = RecordEpisodeStatistics(gymnasium.make_vec(HOVER, 4, max_episode_steps=10))
    envs.reset(seed=2)
    for _ in range(10):
        *_, infos = envs.step(np.zeros(envs.action_space.shape, np.float32))
    assert infos["episode"]["l"].tolist() == [10, 10, 10, 10]


def test_no_action_hovers_and_a_rotor_that_is_off_does_not() -> None:
    env = gymnasium.make(HOVER, action="rotors", start_m=0.0)
    start, _ = env.reset(seed=1)
    for _ in range(100):
        seen, _, crashed, _, _ = env.step(np.zeros(4, np.float32))
    assert not crashed and np.abs(seen[:3] - start[:3]).max() < 1e-3
    steps = 0
    while not crashed:
        *_, crashed, _, _ = env.step(np.array([-1.0, 0.0, 0.0, 0.0], np.float32))
        steps += 1
    assert 5 < steps < 100


def test_a_vehicle_has_an_action_for_each_of_its_rotors() -> None:
    env = gymnasium.make(HOVER, action="rotors", vehicle="hexarotor", start_m=0.0)
    assert env.action_space.shape == (6,)
    start, _ = env.reset(seed=1)
    for _ in range(50):
        seen, *_ = env.step(np.zeros(6, np.float32))
    assert np.abs(seen[:3] - start[:3]).max() < 1e-3
    for _ in range(10):
        seen, *_ = env.step(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.5], np.float32))
    assert np.linalg.norm(seen[21:24]) > 0.2  # rad/s: a single rotor turns it


def test_a_rotor_that_fails_can_be_drawn_by_episode() -> None:
    env = gymnasium.make(HOVER, settings={"SIM_ENGINE_FAIL": 1}, randomise={"SIM_ENGINE_MUL": (0.0, 0.2)})
    env.reset(seed=1)
    crashed = False
    for _ in range(100):
        _, _, crashed, _, _ = env.step(np.zeros(4, np.float32))
        if crashed:
            break
    assert crashed


def test_which_rotors_fail_can_be_drawn_by_episode() -> None:
    ranges = {"SIM_ENGINE_FAIL": (0, 3), "SIM_WIND_E": (0.0, 1.0)}
    envs = gymnasium.make_vec(HOVER, 2, randomise=ranges)
    for seed in range(3):
        envs.reset(seed=seed)
    scenario, rng = envs.unwrapped.scenario, np.random.default_rng(1)  # type: ignore[attr-defined]
    failing, winds = zip(*(scenario.draw(rng).values for _ in range(400)), strict=True)
    counts = {number: failing.count(number) for number in set(failing)}
    assert set(counts) == {0.0, 1.0, 2.0, 3.0} and min(counts.values()) > 70
    assert len(set(winds)) == 400
    with pytest.raises(plumbline.Error, match=r"randomise SIM_ENGINE_FAIL = 0\.5; must be a whole number"):
        gymnasium.make(HOVER, randomise={"SIM_ENGINE_FAIL": (0.5, 3)})


def test_a_rate_and_an_acceleration_are_what_is_asked_for() -> None:
    env = gymnasium.make(HOVER, start_m=0.0)
    env.reset(seed=1)
    for _ in range(25):
        seen, *_ = env.step(np.array([0.0, 0.0, 0.0, 0.25], np.float32))
    assert seen[21:24] == pytest.approx([0.0, 0.0, 0.5], abs=0.02)  # rad/s, a quarter of 2 about the nose
    env = gymnasium.make(HOVER, action="acceleration", start_m=0.0, reach_m=20.0)
    env.reset(seed=1)
    speeds = []
    for _ in range(100):
        seen, *_ = env.step(np.array([0.25, 0.0, 0.0], np.float32))
        speeds.append(float(seen[3]))
    # a quarter of 4 m/s^2, less the air's drag, after the cable has turned to it
    assert (speeds[99] - speeds[89]) / 0.2 == pytest.approx(1.0, abs=0.1)


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "action": ({"action": "thrust"}, "must be one of rotors, ctbr, acceleration"),
    "option": ({"histroy": 1}, "histroy: there is no such option"),
    "rate": ({"rate_hz": 60.0}, "rate_hz = 60 Hz does not divide"),
    "history": ({"history": -1}, "history = -1"),
    "reward": ({"reward": {"speed": 1.0}}, "reward: there is no 'speed'"),
    "range": ({"randomise": {"SIM_WIND_E": (2.0, -2.0)}}, "must be \\(least, greatest\\)"),
    "belief": ({"randomise": {"VEH_LOAD_MASS": (0.1, 0.2)}}, "must be a parameter of the simulator"),
    "typo": ({"randomise": {"SIM_LOAD_MAS": (0.1, 0.2)}}, r"SIM_LOAD_MAS: .* did you mean SIM_LOAD_MASS\?"),
    "group": ({"randomise": {"SMI_WIND_E": (0.1, 0.2)}}, r"SMI_WIND_E: did you mean SIM_WIND_E\?"),
    "value": ({"randomise": {"SIM_ACT_DELAY_MS": (0.0, 900.0)}}, "SIM_ACT_DELAY_MS = 900.0 ms; must be"),
    "setting": ({"settings": {"SIM_WIND": 1.0}}, "SIM_WIND: no such parameter"),
    "vehicle": ({"vehicle": "zeppelin"}, "zeppelin"),
    "sensors": ({"sensors": "eyes"}, "eyes"),
    "mission": ({"mission": UP_AND_DOWN}, r"mission up: there is no path .*; items\[1\] \(land\) ends it"),
    "start": ({"start_m": 3.0}, "start_m = 3.0"),
    "law": ({"settings": {"CTL_LAW": 1}}, "CTL_LAW has no effect: actions fly an environment"),
    "start without a path": ({"start": "random"}, "name one by mission="),
}


WRONG_ACTIONS = {
    "three": (np.zeros(3), r"action of shape \(3,\); must be \(4,\)"),
    "number": (0.0, r"action of shape \(\); must be \(4,\)"),
    "text": ("up", r"action = 'up'; must be \(4,\) numbers"),
    "nan": (np.array([0.0, np.nan, 0.0, 0.0]), r"action = .*nan.*; must be finite numbers from -1 to 1"),
    "inf": ([0.0, 0.0, np.inf, 0.0], "must be finite numbers from -1 to 1"),
}


def test_an_action_that_is_none_is_refused() -> None:
    env = gymnasium.make(HOVER, disable_env_checker=True)
    env.reset(seed=1)
    for action, told in WRONG_ACTIONS.values():
        with pytest.raises(plumbline.Error, match=told):
            env.step(action)
    assert env.step(np.array([9.0, 0.0, 0.0, 0.0]))[4] == {}  # clipped to 1
    envs = gymnasium.make_vec(HOVER, 2)
    envs.reset(seed=1)
    with pytest.raises(plumbline.Error, match=r"actions of shape \(4,\); must be \(2, 4\)"):
        envs.step(np.zeros(4))
    with pytest.raises(plumbline.Error, match=r"actions\[1\] = .*nan"):
        envs.step(np.array([[0.0] * 4, [0.0, 0.0, 0.0, np.nan]]))


@pytest.mark.parametrize(("options", "told"), BAD.values(), ids=BAD)
def test_what_is_wrong_is_told_in_one_line(options: dict[str, Any], told: str) -> None:
    with pytest.raises(plumbline.Error, match=told) as caught:
        gymnasium.make(HOVER, **options)
    assert "\n" not in str(caught.value)


def test_what_is_missing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, "plumbline.learning")
    with pytest.raises(plumbline.Error, match=r"pip install -e '.\[gym\]' in the clone"):
        import_module("plumbline.learning")
