"""Pictures of the Gymnasium environments: their shape, what is drawn where, and that nothing else changes."""

from __future__ import annotations

import pickle
import re
import subprocess
import sys
import warnings
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import SyncVectorEnv
from gymnasium.wrappers import RecordVideo
from matplotlib.colors import to_rgb

import plumbline.learning
from plumbline.learning import HOVER, LOAD_TRACKING
from plumbline.learning.camera import camera_at
from plumbline.learning.picture import COLOURS, Painter
from plumbline.learning.scene import Scene, cable_shape, scene_of, vehicle_shape

ROOT = Path(__file__).resolve().parents[2]
DRAWN = {"render_mode": "rgb_array"}
SIZE = (480, 480)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A scene in flight: the vehicle is tilted, and the load is off its desired position."""
    env = gymnasium.make(HOVER)
    env.reset(seed=1)
    for _ in range(20):
        env.step(np.array([0.1, 0.2, 0.1, 0.0], np.float32))
    return scene_of(env.unwrapped.episodes, 0)


def moved(scene: Scene, *displacement: float) -> Scene:
    """The scene with vehicle and load elsewhere."""
    plant = scene.plant
    x_load, x_quad = (tuple(np.add(x, displacement)) for x in (plant.x_load, plant.x_quad))
    return scene._replace(plant=plant._replace(x_load=x_load, x_quad=x_quad))


def is_colour(pixels: Any, colour: str) -> Any:
    """Which pixels (..., 3) have about this colour."""
    return (np.abs(pixels - 255 * np.array(to_rgb(colour))) < 12).all(axis=-1)


# ---- frames


@pytest.mark.parametrize("name", [HOVER, LOAD_TRACKING])
def test_a_frame_is_an_array_of_colours(name: str) -> None:
    env = gymnasium.make(name, render_size=(320, 240), rate_hz=25.0, **DRAWN)
    assert env.metadata == {"render_modes": ["rgb_array"], "render_fps": 25}
    env.reset(seed=1)
    frame = env.render()
    assert isinstance(frame, np.ndarray) and frame.shape == (240, 320, 3) and frame.dtype == np.uint8
    assert np.array_equal(frame, env.render()) and frame is not env.render()
    for _ in range(3):
        env.step(np.ones(4, np.float32))
    assert not np.array_equal(frame, env.render())


def test_gymnasium_finds_nothing_wrong_with_rendering() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(HOVER, **DRAWN).unwrapped)
    assert gymnasium.make(HOVER, rate_hz=62.5).metadata["render_fps"] == 62.5


def test_rendering_does_not_change_the_simulation() -> None:
    seen = []
    for mode in ("rgb_array", None):
        env = gymnasium.make(HOVER, render_mode=mode, render_size=(64, 64), settings={"SIM_GUST_STD": 0.5})
        observations = [env.reset(seed=5)[0]]
        for _ in range(10):
            if mode:
                env.render()
            observations.append(env.step(np.full(4, 0.1, np.float32))[0])
        seen.append(np.stack(observations).tobytes())
    assert seen[0] == seen[1]


def test_a_copy_draws_the_same() -> None:
    env = gymnasium.make(HOVER, render_size=(96, 96), **DRAWN)
    env.reset(seed=1)
    before = env.render()
    copy = pickle.loads(pickle.dumps(env))
    assert np.array_equal(copy.render(), before)
    copy.step(np.ones(4, np.float32))
    assert not np.array_equal(copy.render(), before) and np.array_equal(env.render(), before)


def test_training_without_pictures_loads_no_drawing_library() -> None:
    program = "import sys, plumbline.learning.env, plumbline.learning.vector; print(*sys.modules)"
    told = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    loaded = set(told.stdout.split())
    assert "plumbline.learning.rendering" in loaded
    assert not loaded & {"matplotlib", "PIL", "plumbline.learning.picture"}


# ---- many, and wrappers


def test_many_are_drawn_as_one_is() -> None:
    options: dict[str, Any] = {"render_size": (96, 72), "rate_hz": 50.0, **DRAWN}
    together = gymnasium.make_vec(HOVER, 3, vectorization_mode="vector_entry_point", **options)
    alone = SyncVectorEnv([lambda: gymnasium.make(HOVER, **options)] * 3)
    assert together.metadata["render_fps"] == alone.metadata["render_fps"] == 50
    assert together.render_mode == "rgb_array"
    for envs in (together, alone):
        envs.reset(seed=4)
        envs.step(np.full((3, 4), 0.3, np.float32))
    frames, expected = together.render(), alone.render()
    assert isinstance(frames, tuple) and len(frames) == 3
    assert all(np.array_equal(a, b) for a, b in zip(frames, expected, strict=True))
    assert not np.array_equal(frames[0], frames[1])


def test_gymnasium_collects_frames() -> None:
    env = gymnasium.make(HOVER, render_mode="rgb_array_list", render_size=(64, 64))
    env.reset(seed=1)
    for _ in range(2):
        env.step(np.zeros(4, np.float32))
    assert [frame.shape for frame in env.render()] == [(64, 64, 3)] * 3


class VecEnv:
    """The constructor of the base class of Stable-Baselines3, as far as it matters here."""

    def __init__(self, num_envs: int, *_: Any) -> None:
        self.num_envs = num_envs
        (self.render_mode,) = set(self.get_attr("render_mode"))
        self.metadata = {"render_modes": ["human", "rgb_array"]}

    def get_attr(self, name: str, indices: Any = None) -> list[Any]:
        raise NotImplementedError

    def _get_indices(self, indices: Any) -> range:
        return range(self.num_envs)


def test_stable_baselines_receives_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("stable_baselines3.common.vec_env")
    monkeypatch.setattr(module, "VecEnv", VecEnv, raising=False)
    for name in ("stable_baselines3", "stable_baselines3.common"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.delitem(sys.modules, "plumbline.learning.stable_baselines", raising=False)
    adapter = import_module("plumbline.learning.stable_baselines").SB3VecEnv
    monkeypatch.delitem(sys.modules, "plumbline.learning.stable_baselines")
    envs = adapter(gymnasium.make_vec(HOVER, 2, autoreset_mode="SameStep", render_size=(64, 64), **DRAWN))
    envs.envs.reset(seed=1)
    assert envs.render_mode == "rgb_array" and envs.metadata["render_fps"] == 50
    assert [frame.shape for frame in envs.get_images()] == [(64, 64, 3)] * 2


def test_gymnasium_records_a_video(tmp_path: Path) -> None:
    pytest.importorskip("moviepy")
    env = RecordVideo(gymnasium.make(HOVER, render_size=(64, 64), **DRAWN), str(tmp_path))
    env.reset(seed=1)
    env.step(np.zeros(4, np.float32))
    env.close()
    assert [path.suffix for path in tmp_path.iterdir()] == [".mp4"]


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "mode": ({"render_mode": "ansi"}, "render_mode = 'ansi'; must be rgb_array, or None"),
    "size": ({"render_size": 480}, r"render_size = 480; must be \(width, height\) in pixels"),
    "side": ({"render_size": (480, 0)}, "render_size = 0; must be a whole number from 32 to 4096"),
    "three": ({"render_size": (480, 480, 3)}, r"must be \(width, height\)"),
}


@pytest.mark.parametrize(("options", "told"), WRONG.values(), ids=WRONG)
@pytest.mark.parametrize("make", [gymnasium.make, gymnasium.make_vec])
@pytest.mark.filterwarnings("ignore::UserWarning")  # of Gymnasium, about the mode
def test_a_wrong_mode_or_size_is_told(make: Any, options: dict[str, Any], told: str) -> None:
    with pytest.raises(plumbline.Error, match=told):
        make(HOVER, **options)


def test_nothing_is_drawn_without_a_mode_or_before_the_first_reset() -> None:
    envs = gymnasium.make_vec(HOVER, 2, **DRAWN)
    with pytest.raises(plumbline.Error, match="reset comes before render"):
        envs.render()
    env = gymnasium.make(HOVER).unwrapped
    env.reset(seed=1)
    with pytest.warns(UserWarning, match="render_mode='rgb_array'"):
        assert env.render() is None


# ---- what is drawn


def test_the_load_is_drawn_where_it_is(scene: Scene) -> None:
    painter = Painter(SIZE)
    for displacement in ((0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.0, -0.7, 0.4), (-2.5, 1.0, -0.5)):
        here = moved(scene, *displacement)
        right, up = painter.camera(here).pixels(np.array(here.plant.x_load))
        rows, columns = np.nonzero(is_colour(painter.draw(here), COLOURS["load"]))
        assert len(rows) > 20
        assert np.hypot(columns + 0.5 - right, SIZE[1] - rows - 0.5 - up).max() < 8.0
        assert (columns.mean(), SIZE[1] - rows.mean()) == pytest.approx((right, up), abs=2.0)


def test_east_is_to_the_right_and_height_is_up(scene: Scene) -> None:
    camera = camera_at(scene.desired, scene.desired, 1.0, SIZE)
    origin, east, north, up = camera.pixels(np.array([(0, 0, 2), (1, 0, 2), (0, 1, 2), (0, 0, 3)], float))
    assert east[0] > origin[0] + 50 and north[1] > origin[1] and up[1] > origin[1] + 50
    assert up[0] == pytest.approx(origin[0])
    assert camera.scale(np.array(scene.desired)) > camera.scale(np.array([0.0, 5.0, 3.0]))
    assert np.isnan(camera.pixels(2.0 * camera.eye - camera.centre)).all()


@pytest.mark.parametrize("error", [(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, -4.0, 1.0), (-9.0, 3.0, -2.0)])
@pytest.mark.parametrize("height", [1.0, 3.0, 40.0])
@pytest.mark.parametrize("size", [SIZE, (640, 240), (240, 640)])
def test_load_and_desired_position_are_in_the_picture(
    size: tuple[int, int], height: float, error: tuple[float, float, float]
) -> None:
    desired = (3.0, -2.0, height)
    load = (desired[0] + error[0], desired[1] + error[1], max(0.0, desired[2] + error[2]))
    camera = camera_at(desired, load, 0.9, size)
    for x in (desired, load, (*load[:2], load[2] + 0.8)):
        pixels = camera.pixels(np.array(x))
        assert ((pixels > 0.0) & (pixels < size)).all()


def test_the_vehicle_is_drawn_in_its_attitude(scene: Scene) -> None:
    shape, plant = vehicle_shape(scene), scene.plant
    arms = shape.hubs - shape.middle
    assert np.linalg.norm(arms, axis=1) == pytest.approx(scene.truth.arm)
    assert np.abs(arms @ shape.upward).max() < 1e-12
    assert 0.05 < 1.0 - shape.upward[2] < 0.5  # tilted
    forward = (shape.nose[1] - shape.nose[0]) / np.linalg.norm(shape.nose[1] - shape.nose[0])
    assert arms[2] / scene.truth.arm == pytest.approx(forward)  # the third rotor is the front one
    upright = scene._replace(plant=plant._replace(quat_wxyz=(1.0, 0.0, 0.0, 0.0)))
    assert not np.array_equal(Painter((96, 96)).draw(scene), Painter((96, 96)).draw(upright))


def test_a_slack_cable_bends_and_is_told(scene: Scene) -> None:
    taut = cable_shape(scene)
    assert np.linalg.norm(taut[-1] - taut[0]) == pytest.approx(scene.truth.cable_length, abs=1e-6)
    plant, length = scene.plant, scene.truth.cable_length
    for x_load in (
        np.add(plant.x_quad, (0.3, 0.0, 0.0)),
        np.add(plant.x_quad, (0.0, 0.0, -0.3)),
        plant.x_quad,
    ):
        slack = scene._replace(plant=plant._replace(x_load=tuple(x_load), taut=0.0))
        points = cable_shape(slack)
        assert points[0] == pytest.approx(taut[0]) and points[-1] == pytest.approx(np.array(x_load))
        assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(length, rel=0.15)
    painter = Painter(SIZE)
    corner = (slice(0, 40), slice(400, 480))
    assert is_colour(painter.draw(slack)[corner], COLOURS["slack"]).any()
    assert not is_colour(painter.draw(scene)[corner], COLOURS["slack"]).any()


def test_colours_are_those_of_the_replay() -> None:
    text = (ROOT / "gcs" / "web" / "scene_theme.js").read_text(encoding="utf-8")
    light = text[text.index("light: {") :]
    theme = dict(re.findall(r"(\w+): 0x([0-9a-f]{6})", light))
    assert {name: f"#{theme[name]}" for name in COLOURS} == COLOURS
