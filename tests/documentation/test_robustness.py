# ruff: noqa: E501 paragraphs of the page stand here as they stand there
"""docs/robustness.md states the figures of docs/robustness.json, which `make robustness` flies anew.

To put it into the page: python tests/documentation/test_robustness.py
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from gcs.experiments.marked_text import write_between

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "robustness.md"
RECORD: dict[str, list[dict[str, Any]]] = json.loads(
    (ROOT / "docs" / "robustness.json").read_text(encoding="utf-8")
)
Cells = list[dict[str, Any]]
DELAY, LAG, NOISE = "SIM_ACT_DELAY_MS", "SIM_ROTOR_TAU_MS", "SIM_NOISE_SCALE"
LATENCY, DROP = "SIM_SENS_LAT_MS", "SIM_DROP_PCT"
WIND, GUSTS, MASS, LENGTH = "SIM_WIND_E", "SIM_GUST_STD", "SIM_LOAD_MASS", "SIM_CABLE_LEN"
PHASES = {
    "tauten": "before the load is lifted",
    "lift": "while the load is lifted",
    "mission": "in the mission",
    "lower": "while the load is set down",
    "set_down": "as the vehicle touches the ground beside its load",
}


def of(sweep: str, law: str = "plumbline", **where: float) -> Cells:
    """The cells of a law in which these parameters have these values."""
    found = [cell for cell in RECORD[sweep] if cell["law"] == law]
    return [cell for cell in found if all(abs(cell[name] - value) < 1e-9 for name, value in where.items())]


def whole(cell: dict[str, Any]) -> bool:
    return bool(cell["completed"] == cell["flown"])


def levels(found: Cells, name: str, when: Callable[[dict[str, Any]], bool]) -> list[float]:
    """The values of a parameter at which `when` holds for every cell."""
    values = sorted({cell[name] for cell in found})
    return [value for value in values if all(when(cell) for cell in found if cell[name] == value)]


def error(found: Sequence[dict[str, Any]]) -> float:
    """The median error of the only cell in `found`, in mm."""
    (cell,) = found
    return float(cell["median_mm"])


def mm(value: float) -> str:
    return f"{value:.0f} mm" if value < 100.0 else f"{1e-3 * value:.2f} m"


def lost_most(found: Cells) -> str:
    """The phase in which most flights were lost."""
    phases: Counter[str] = Counter()
    for cell in found:
        phases.update(cell["lost"])
    return PHASES[phases.most_common(1)[0][0]]


def home(found: Cells) -> str:
    """How many flights of a map were completed, in words."""
    flown, completed = (sum(cell[key] for cell in found) for key in ("flown", "completed"))
    return "through the whole map" if completed == flown else f"home {completed} of {flown} times"


def ends(found: Cells, name: str, unit: str) -> str:
    """Between the last value at which all complete and the first at which none does."""
    least = max(levels(found, name, whole))
    most = min(levels(found, name, lambda cell: cell["completed"] == 0))
    return f"between {least:g} and {most:g} {unit}"


def delay_noise() -> str:
    ours, thesis = of("delay-noise"), of("delay-noise", "thesis")
    usual = of("delay-noise", "thesis", **{NOISE: 1.0})
    carried = [error([cell]) for cell in thesis if whole(cell) and cell[NOISE] <= 4.0]
    return f"""With the noise of the lab, the limit of the law `thesis` is {ends(usual, DELAY, "ms")} of delay. Most flights are lost {lost_most(thesis)}.
The linear loop of its load position is stable up to 17.7 ms (20 ms of rotor lag). The limit is its innermost loop, whose
gains leave no more phase margin. Up to the limit its error is that of its reference filter, {min(carried):.0f} to {max(carried):.0f} mm, and noise adds little.

The law `plumbline` knows delay and lag, predicts over them and lowers its gains as they grow. It flies {home(ours)},
also with sensors {max(cell[NOISE] for cell in ours):g} times as noisy as those of the lab; the map contains no linear limit. Its error, the median of a
cell's flights, grows with noise times delay: {mm(min(error([cell]) for cell in ours))} at best, {mm(error(of("delay-noise", **{DELAY: 72.0, NOISE: 1.0})))} with the lab's sensors and 72 ms, {mm(max(error([cell]) for cell in ours))} in the far corner.
The limit is not stability but the noise that the rotors are commanded to follow.
"""


def latency_noise() -> str:
    ours, thesis = of("latency-noise"), of("latency-noise", "thesis", **{NOISE: 1.0})
    return f"""The latency is added to every sensor, including the inertial unit, and the autopilot knows it. The limit of `thesis`, which
predicts nothing, is {ends(thesis, LATENCY, "ms")}. `plumbline` flies {home(ours)}; its error grows with noise times latency,
{mm(error(of("latency-noise", **{LATENCY: 80.0, NOISE: 1.0})))} at 80 ms with the lab's noise.
"""


def long_delays() -> str:
    sweeps = {"delay": ("long-delay", DELAY), "latency": ("long-latency", LATENCY)}
    cells = {
        word: sorted(of(sweep), key=lambda cell, name=name: cell[name])
        for word, (sweep, name) in sweeps.items()
    }
    rows = [
        f"| {one[DELAY]:g} ms | {one['completed']} | {mm(error([one]))} | {other['completed']} | {mm(error([other]))} |"
        for one, other in zip(cells["delay"], cells["latency"], strict=True)
    ]
    lost = [cell for found in cells.values() for cell in found if cell["lost"]]
    first = {
        word: min((cell[sweeps[word][1]] for cell in found if not whole(cell)), default=None)
        for word, found in cells.items()
    }
    told = [f"from {value:g} ms of {word} on" for word, value in first.items() if value is not None]
    end = (
        f"Flights are lost {' and '.join(told)}, all of them {lost_most(lost)}." if lost else "None is lost."
    )
    return f"""| of 10 flights | delay: completed | median error | latency: completed | median error |
|---|---|---|---|---|
{chr(10).join(rows)}

{end}
"""


def delay_lag() -> str:
    thesis = of("delay-lag", "thesis", **{LAG: 60.0})
    delays = [cell[DELAY] for cell in thesis if cell["completed"]]
    left = (
        f"completes no flight beyond {max(delays):g} ms of delay"
        if delays
        else "tolerates no delay and completes no flight"
    )
    near, far = ([error([cell]) for cell in of("delay-lag", **{DELAY: delay})] for delay in (0.0, 96.0))
    return f"""The autopilot knows both. `plumbline` flies {home(of("delay-lag"))}. A lag of up to 60 ms adds little error: depending on the lag,
{min(near):.0f} to {max(near):.0f} mm without delay and {min(far):.0f} to {max(far):.0f} mm at 96 ms. `thesis` {left} at a lag of 60 ms.
"""


def dropouts() -> str:
    def told(law: str) -> tuple[str, float]:
        found = sorted(of("dropouts", law), key=lambda cell: cell[DROP])
        last = max(cell[DROP] for cell in found if all(map(whole, found[: found.index(cell) + 1])))
        some = [cell for cell in found if cell[DROP] > last and cell["completed"]]
        none = min(cell[DROP] for cell in found if not cell["completed"])
        flown, completed = (sum(cell[key] for cell in some) for key in ("flown", "completed"))
        at = " to ".join(dict.fromkeys(f"{cell[DROP]:g}" for cell in (*some[:1], *some[-1:])))
        between = f", {completed} of {flown} at {at} %" if some else ""
        return f"completes all flights up to {last:g} %{between} and none at {none:g} %", last

    ours, last = told("plumbline")
    errors = [error(of("dropouts", **{DROP: share})) for share in (0.0, last)]
    return f"""Every sensor but the inertial unit loses single readings at random (`SIM_DROP_PCT`, 10 seeds each). `plumbline` {ours};
the median error is {errors[0]:.1f} mm with all readings and {errors[1]:.1f} mm at {last:g} %. The limit is not the flight itself but
an estimate that does not settle before the lift or after it. `thesis` {told("thesis")[0]}.
"""


def wind_gusts() -> str:
    calm = {wind: error(of("wind-gusts", **{WIND: wind, GUSTS: 0.0})) for wind in (0.0, 5.0, 10.0)}
    borne = max(levels(of("wind-gusts"), GUSTS, whole))
    beyond = [cell for cell in of("wind-gusts") if cell[GUSTS] > borne]
    flown, completed = (sum(cell[key] for cell in beyond) for key in ("flown", "completed"))
    lost = (
        f" With more gusts {flown - completed} of {flown} flights are lost, most of them {lost_most(beyond)}."
        if beyond
        else ""
    )
    return f"""All flights complete up to {max(cell[WIND] for cell in of("wind-gusts")):g} m/s of steady wind with gusts of {borne:g} m/s; the error of {calm[0.0]:.0f} mm in still air becomes {calm[5.0]:.0f} at 5 m/s and {calm[10.0]:.0f} at 10 m/s
without gusts, and {mm(error(of("wind-gusts", **{WIND: 10.0, GUSTS: borne})))} at 10 m/s with gusts of {borne:g} m/s: the autopilot detects a gust only by its effect, and the
error grows with the wind because drag is quadratic.{lost}
"""


def mass_length() -> str:
    found = of("mass-length")
    masses, lengths = of("mass-length", **{LENGTH: 0.7}), of("mass-length", **{MASS: 0.1})
    borne, flown = levels(masses, MASS, whole), levels(lengths, LENGTH, whole)
    to_twice = [error([cell]) for cell in masses if cell[MASS] in borne and cell[MASS] <= 0.2]
    heavier = [error([cell]) for cell in masses if cell[MASS] in borne and cell[MASS] > 0.2]
    usual, shortest, longest = (
        error(of("mass-length", **{MASS: 0.1, LENGTH: length})) for length in (0.7, flown[0], flown[-1])
    )
    too_light = levels(found, MASS, lambda cell: cell["completed"] == 0)
    too_short = levels(found, LENGTH, lambda cell: cell["completed"] == 0)
    beyond = f" and {min(heavier):.0f} to {max(heavier):.0f} mm beyond" if heavier else ""
    return f"""Case C. The autopilot learns the mass: it flies {min(borne) / 0.1:g} to {max(borne) / 0.1:g} times the assumed 0.1 kg, with {min(to_twice):.0f} to {max(to_twice):.0f} mm of error up to
twice{beyond}. A load of {max(too_light) / 0.1:g} times the assumed mass is not lifted, whatever the length
of its cable: its pull is too weak to show that the cable is taut ("Cable never taut, landing").

The law is not told the length: with the assumed load, it flies cables of {flown[0]:g} to {flown[-1]:g} m where it assumes 0.7 m, and
the error of {usual:.1f} mm grows to {shortest:.1f} mm at {flown[0]:g} m and {longest:.1f} mm at {flown[-1]:g} m. On {max(too_short):g} m or less no load is
lifted ("Cable pulls at ... m, landing"): a cable may be at most 9 % shorter than assumed.
"""


def delay_unknown() -> str:
    found = sorted(of("delay-unknown"), key=lambda cell: cell[DELAY])
    good = levels(found, DELAY, whole)[-1]
    none = levels(found, DELAY, lambda cell: cell["completed"] == 0)[0]
    below = [cell for cell in found if cell[DELAY] <= good]
    flown, completed = (sum(cell[key] for cell in below) for key in ("flown", "completed"))
    near = [error([cell]) for cell in below if cell[DELAY] >= 28.0]
    early = max((cell for cell in below if cell[DELAY] < 28.0), key=lambda cell: error([cell]))
    return f"""The autopilot assumes 40 ms (`delay-unknown`, {found[0]["flown"]} seeds each): {completed} of {flown} flights complete with a true delay of 0 to {good:g} ms, with {min(near):.0f} to {max(near):.0f} mm from 28 ms on, and
none from {none:g} ms. With less delay than assumed the prediction is too long, and the loop rings: {mm(error([early]))} at {early[DELAY]:g} ms. The law is
designed to tolerate 12 ms of unknown delay.
"""


MADE = {
    "delay-noise": delay_noise,
    "latency-noise": latency_noise,
    "long-delays": long_delays,
    "delay-lag": delay_lag,
    "dropouts": dropouts,
    "wind-gusts": wind_gusts,
    "mass-length": mass_length,
    "delay-unknown": delay_unknown,
}


def marks(name: str) -> tuple[str, str]:
    return f"<!-- {name}: make robustness -->\n", f"<!-- end of {name} -->"


@pytest.mark.parametrize("name", MADE)
def test_the_page_says_what_was_flown(name: str) -> None:
    begin, end = marks(name)
    text = PAGE.read_text(encoding="utf-8")
    assert f"{begin}{MADE[name]()}{end}" in text, f"run: python {Path(__file__).name}"


def main() -> None:
    """Put it into the page."""
    for name, made in MADE.items():
        write_between(PAGE, *marks(name), made())


if __name__ == "__main__":
    main()
