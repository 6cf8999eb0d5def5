"""The sweeps of docs/robustness.md: flies them and renews the maps in docs/images/robustness.

    python benchmarks/robustness.py [--out DIR] [--docs DIR] [--only NAME ...] [--whole]

Each is a `gcs sweep` into a directory of its own below DIR: what was flown already by the same code is kept,
and after Ctrl-C the same command goes on. `--whole` adds the sweep of 10 000 flights over everything at once.
"""

from __future__ import annotations

import argparse
import shlex
import shutil
import sys
from pathlib import Path

from gcs.cli import gcs

ROOT = Path(__file__).resolve().parents[1]
BOTH = "--law plumbline --law thesis"
NOISE = "--vary SIM_NOISE_SCALE=0.5,1,2,4,8"
DELAY = "--vary SIM_ACT_DELAY_MS=0:96:9"
# name: what is flown
SWEEPS = {
    "delay-noise": f"case-b {BOTH} --seeds 3 {DELAY} {NOISE}",
    "latency-noise": f"case-b {BOTH} --seeds 3 --vary SIM_SENS_LAT_MS=0:80:9 {NOISE}",
    "delay-lag": f"case-b {BOTH} --seeds 3 {DELAY} --vary SIM_ROTOR_TAU_MS=0,10,20,30,40,60",
    "delay-unknown": "case-b --seeds 10 --set VEH_ACT_DELAY=40 --vary SIM_ACT_DELAY_MS=0:96:25",
    "mass-length": "case-c --seeds 3 --vary SIM_LOAD_MASS=0.025:0.25:10 --vary SIM_CABLE_LEN=0.6:0.8:9",
    "wind-gusts": "case-b --seeds 3 --vary SIM_WIND_E=0:10:11 --vary SIM_GUST_STD=0,0.5,1,2,3",
    "dropouts": f"case-b {BOTH} --seeds 10 --vary SIM_DROP_PCT=0:95:20",
}
WHOLE = {
    "everything": (
        "case-b --sample 2000 --seeds 5 --vary SIM_ACT_DELAY_MS=0:40 --vary SIM_ROTOR_TAU_MS=0:40"
        " --vary SIM_SENS_LAT_MS=0:30 --vary SIM_NOISE_SCALE=0:4 --vary SIM_DROP_PCT=0:30"
        " --vary SIM_LOAD_MASS=0.05:0.15 --vary SIM_WIND_E=0:4 --vary SIM_GUST_STD=0:1"
    )
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("sweeps/robustness"))
    parser.add_argument("--docs", type=Path, default=ROOT / "docs/images/robustness")
    parser.add_argument("--only", nargs="*", choices=[*SWEEPS, *WHOLE])
    parser.add_argument("--whole", action="store_true")
    options = parser.parse_args()
    wanted = options.only or [*SWEEPS, *(WHOLE if options.whole else ())]
    for name in wanted:
        words = shlex.split({**SWEEPS, **WHOLE}[name])
        directory = options.out / name
        sys.argv = ["gcs", "sweep", *words, "--out", str(directory)]
        print(f"== {name}: {shlex.join(sys.argv)}", flush=True)
        try:
            gcs(sys.argv[1:], prog_name="gcs")
        except SystemExit as end:
            if end.code:
                return int(end.code)
        options.docs.mkdir(parents=True, exist_ok=True)
        maps = sorted(directory.glob("map-*.png")) if name in SWEEPS else []
        for picture in maps or sorted(directory.glob("curve-*.png")):
            shutil.copy(picture, options.docs / f"{name}-{picture.name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
