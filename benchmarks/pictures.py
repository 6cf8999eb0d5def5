"""The pictures of README and docs, from flights through real processes: `make pictures`.

    python benchmarks/pictures.py [flight] [report] [live] [learning] [--images docs/images]

`flight.webp` is a replay of Case C in a gust, frame by frame; `report.png` is the page that `make fly` makes;
`live.png` is the live page in the middle of a mission. Headless Chromium draws them without a graphics card.
`learning.png` is what an environment draws.
"""

from __future__ import annotations

import argparse
import io
import subprocess
import sys
import tempfile
from pathlib import Path

import gymnasium
import numpy as np
from live_page import IN_MISSION, WAIT_S, flight
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from plumbline.learning import LOAD_TRACKING
from plumbline.learning.baseline import LawPolicy
from tests.doubles.browser import Browser, chromium, missing

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
THEME = "dark"  # also readable on the light pages of a repository's web site
FLIGHT = ("case-c", "--set", "SIM_GUST_N=6", "--set", "SIM_GUST_AT_S=32")
SIZE = (720, 420)  # of the animated picture, pixels
BEGIN_S, END_S = 28.5, 44.5  # of the flight; the gust is in it
PERIOD_S = 3.0  # of the swing that Case C requests
FRAMES_PER_S, PACE = 12.0, 2.0  # of the picture; seconds of the flight per second of the picture
STEPS = 775  # of the environment: it is then in the middle of a swing
LAST_S = 1.5  # how long the last frame stays before the picture repeats
QUALITY = 70

# The scene fills the window; over it are the legend, load error, tension, swing and speed.
SCENE_ONLY = """
const style = document.createElement("style");
style.textContent = `body { overflow: hidden } .over.cameras { display: none }
  #stage { position: fixed; inset: 0; z-index: 9; border: 0; border-radius: 0 }
  #stage canvas { width: 100vw; height: 100vh }
  .over.readings { left: auto; right: 16px }  /* the trail leads off to the left */
  .readings > :is(:nth-child(1), :nth-child(8), :nth-child(9), :nth-child(n + 12)) { display: none }`;
document.head.append(style);
"""

# The camera looks at the mean of the load over a period of its swing, so that the load swings in the picture.
# The trail ends at the load.
PREPARE = """
const { flight, stage, transport } = window.replay;
const [period, whole] = [arguments[0], flight.tracks()[0]];
const trail = stage.scene.trackOf(1).flown.trail.line.geometry;
const every = Math.round(3 * flight.time.length / whole.flown.length);
const mean = (t) => {
  const sum = [0, 0, 0], parts = 60;
  for (let k = 0; k < parts; k += 1) {
    const { vehicle } = flight.at(t + period * ((k + 0.5) / parts - 0.5));
    vehicle.load.position.forEach((value, axis) => { sum[axis] += value / parts; });
  }
  return sum;
};
stage.camera("orbit");
window.frameAt = (t, distance, turn, height) => {
  transport.set(t);
  trail.instanceCount = Math.floor(flight.at(t).index / every);
  const [north, east, down] = mean(t);
  const { eye, controls } = stage.scene;
  controls.target.set(east, -down + 0.3, -north);
  const angle = turn * Math.PI / 180;
  const away = new THREE.Vector3(Math.cos(angle), height, Math.sin(angle)).setLength(distance);
  eye.position.copy(controls.target).add(away);
  controls.update();
  stage.scene.render();
};
"""
DRAW_FRAME = """
const [done, ...where] = [arguments[arguments.length - 1], ...Array.from(arguments).slice(0, -1)];
window.frameAt(...where);
requestAnimationFrame(() => requestAnimationFrame(done));
"""


def fly_report(folder: Path, *mission: str) -> str:
    """The address of the report of a flight with these arguments of `gcs fly`."""
    out = folder / mission[0]
    command = [sys.executable, "-m", "gcs", "fly", *mission, "--quiet", "--out", str(out)]
    subprocess.run(command, check=True)
    return (out / "report.html").as_uri()


def open_report(browser: Browser, address: str, width: int, height: int) -> None:
    """Open a report, and wait until its scene and plots are drawn."""
    browser.open(address, width, height, THEME)
    browser.wait("document.documentElement.dataset.ready === '1'", WAIT_S)


def animated(browser: Browser, folder: Path, path: Path) -> None:
    """A replay, with a camera that slowly circles the vehicle."""
    open_report(browser, fly_report(folder, *FLIGHT), *SIZE)
    browser.run(SCENE_ONLY)
    browser.run(PREPARE, PERIOD_S)
    frames = []
    for time_s in np.arange(BEGIN_S, END_S, PACE / FRAMES_PER_S):
        share = (time_s - BEGIN_S) / (END_S - BEGIN_S)
        browser.driver.execute_async_script(DRAW_FRAME, time_s, 3.2, 45.0 - 37.0 * share, 0.28 + 0.1 * share)
        frames.append(Image.open(io.BytesIO(browser.driver.get_screenshot_as_png())).convert("RGB"))
    durations = [round(1000 / FRAMES_PER_S)] * (len(frames) - 1) + [round(1000 * LAST_S)]
    frames[0].save(
        path, save_all=True, append_images=frames[1:], duration=durations, loop=0, quality=QUALITY, method=6
    )


def report(browser: Browser, folder: Path, path: Path) -> None:
    """The report of Case B, as it opens."""
    open_report(browser, fly_report(folder, "case-b", "--sensors", "lab"), 1280, 860)
    browser.screenshot(path)


def live(browser: Browser, folder: Path, path: Path) -> None:
    """The live page of a flight in wind, with the vehicle pushed by a gust."""
    with flight(folder, "--set", "SIM_WIND_E=3", "--set", "SIM_GUST_STD=0.5") as (_, address):
        browser.open(address, 1440, 860, THEME)
        browser.wait(IN_MISSION, WAIT_S)
        browser.wait("Plumbline.live.plots.samples.at(-1)[0] > 37", WAIT_S)
        browser.run("Plumbline.live.ask('push', {north: 2, east: 7, seconds: 0.6})")
        browser.run("Plumbline.live.scene.look(Plumbline.live.scene.vehicles.get(1).position, 3.8)")
        browser.wait("Plumbline.live.plots.samples.at(-1)[0] > 39.3", WAIT_S)
        browser.screenshot(path)


def learning(_browser: Browser, _folder: Path, path: Path) -> None:
    """An environment in which a law follows the path of Case C."""
    env = gymnasium.make(LOAD_TRACKING, mission="case-c", render_mode="rgb_array")
    law = LawPolicy(env)
    observation, _ = env.reset(seed=1)
    for _ in range(STEPS):
        observation, *_ = env.step(law.predict(observation)[0])
    Image.fromarray(env.render()).save(path, optimize=True)


PICTURES = {
    "flight": ("flight.webp", animated),
    "report": ("report.png", report),
    "live": ("live.png", live),
    "learning": ("learning.png", learning),
}


def main() -> None:
    """Make the pictures that are named; all by default."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="name", help=f"of {', '.join(PICTURES)}; all by default")
    parser.add_argument("--images", type=Path, default=IMAGES)
    options = parser.parse_args()
    unknown = set(options.names) - set(PICTURES)
    if unknown:
        parser.error(f"unknown: {', '.join(sorted(unknown))}; must be of {', '.join(PICTURES)}")
    if missing():
        sys.exit(missing())
    options.images.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        with chromium(folder / "profile") as browser:
            for name in options.names or PICTURES:
                file, make = PICTURES[name]
                print(f"{file}: flying and drawing, which takes minutes", flush=True)
                make(browser, folder, options.images / file)
                size = (options.images / file).stat().st_size
                print(f"{options.images / file}: {size / 1000:.0f} kB", flush=True)


if __name__ == "__main__":
    main()
