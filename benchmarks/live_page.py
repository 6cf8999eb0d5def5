"""Cost of the live page: script time per frame in the browser, processor time of `gcs fly` and its page.

    python benchmarks/live_page.py [--seconds 15]

Headless Chromium, which draws without a graphics card, shows a flight in real time. All times are processor
times of threads and processes, so that a busy machine has no effect.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.processor_time import processor_s
from tests.doubles.browser import Browser, chromium, missing

IN_MISSION = "document.getElementById('phase').textContent.startsWith('mission')"
WAIT_S = 60.0


def children(pid: int) -> dict[str, int]:
    """The processes that a process has started, by the name of the program in their command line."""
    found = {}
    listed = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    for child in listed:
        words = Path(f"/proc/{child}/cmdline").read_text().split("\0")
        name = next((name for name in ("sitl", "autopilot", "gcs") if name in words), "")
        found["page" if name == "gcs" else name] = int(child)
    return found


@contextmanager
def flight(folder: Path, *arguments: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A flight in real time with its page, and the page's address."""
    command = [sys.executable, "-m", "gcs", "fly", "square", "--speed", "1", "--view", "--quiet"]
    command += ["--out", str(folder / "out"), *arguments]
    environment = {
        key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")
    }
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment) as process:
        try:
            assert process.stderr is not None
            address = ""
            for line in process.stderr:
                found = re.search(r"http://\S+", line)
                if found:
                    address = found[0]
                    break
            yield process, address
        finally:
            process.send_signal(signal.SIGINT)


def script_s(browser: Browser) -> float:
    """Seconds that the page's thread has spent in scripts."""
    metrics = browser.driver.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
    return float({metric["name"]: metric["value"] for metric in metrics}["ScriptDuration"])


def measure(browser: Browser, folder: Path, seconds: float) -> list[tuple[str, str]]:
    """Names and figures."""
    rows = []
    with flight(folder) as (process, address):
        browser.driver.execute_cdp_cmd("Performance.enable", {"timeDomain": "threadTicks"})
        browser.open(address)
        browser.wait(IN_MISSION, WAIT_S)
        pids = {"gcs fly": process.pid, **children(process.pid)}
        frames = "return Plumbline.live.page.frames"
        before = (
            script_s(browser),
            browser.run(frames),
            {name: processor_s(pid) for name, pid in pids.items()},
        )
        began = time.monotonic()
        time.sleep(seconds)
        taken = time.monotonic() - began
        drawn = browser.run(frames) - before[1]
        script = script_s(browser) - before[0]
        rows.append(("frames a second, drawn without a graphics card", f"{drawn / taken:.0f}"))
        rows.append(("script time a frame", f"{1000 * script / max(drawn, 1):.2f} ms"))
        rows += [
            (f"share of a core: {name}", f"{100 * (processor_s(pid) - before[2][name]) / taken:.1f} %")
            for name, pid in pids.items()
        ]
    return rows


def main() -> None:
    """Measure, and print the figures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=15.0)
    options = parser.parse_args()
    if missing():
        sys.exit(missing())
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        with chromium(folder / "profile") as browser:
            rows = measure(browser, folder, options.seconds)
    for name, figure in rows:
        print(f"{name:<50} {figure}")


if __name__ == "__main__":
    main()
