"""The experiments of chapter 4 of the thesis: the flights, and the results that the thesis prints."""

from __future__ import annotations

from typing import NamedTuple

CASES = ("case-a", "case-b", "case-b-extended", "case-c")
LAWS = ("thesis", "lqr")  # 3-2 and A-2
VEHICLES = ("thesis", "bebop")

CASE_NAMES = {
    "case-a": "Case A",
    "case-b": "Case B",
    "case-b-extended": "Case B extended",
    "case-c": "Case C",
}
LAW_NAMES = {"thesis": "NGC", "lqr": "LQR"}  # as the thesis calls them
VEHICLE_NAMES = {
    "thesis": "idealised vehicle (no rotor limits, no lag, no drag)",
    "bebop": "true vehicle (each rotor 0 ... 1.96 N, 20 ms lag, drag)",
}
VEHICLE_SHORT = {"thesis": "idealised", "bebop": "true"}
SENSORS = "ideal"
SEED = 1


class Experiment(NamedTuple):
    """One flight."""

    case: str
    law: str
    vehicle: str

    @property
    def name(self) -> str:
        """Its directory under flights/."""
        return f"{self.case}-{self.law}-{self.vehicle}"

    @property
    def title(self) -> str:
        """Its title for display."""
        return f"{CASE_NAMES[self.case]}, {LAW_NAMES[self.law]}, {VEHICLE_SHORT[self.vehicle]} vehicle"


# every number that 4-4 prints; keys of the flight record
_PRINTED: dict[tuple[str, str], dict[str, float]] = {
    ("case-a", "thesis"): {"rise_time_90_s": 0.61, "overshoot_pct": 15.0, "settling_time_5pct_s": 1.26},
    ("case-a", "lqr"): {"rise_time_90_s": 1.36, "overshoot_pct": 23.0, "settling_time_5pct_s": 4.75},
    ("case-b", "lqr"): {"load_error_max_m": 1.1},
}


def printed_results(experiment: Experiment) -> dict[str, float]:
    """The printed results for this case and law. The thesis had one vehicle; both vehicles here are compared
    with it."""
    return dict(_PRINTED.get((experiment.case, experiment.law), {}))


def experiments() -> tuple[Experiment, ...]:
    """All experiments. The long flights come first, so that no core starts one near the end."""
    return tuple(
        Experiment(case, law, vehicle) for case in reversed(CASES) for vehicle in VEHICLES for law in LAWS
    )


def in_reading_order(experiment: Experiment) -> tuple[int, int, int]:
    """Sort key: case, then vehicle, then law, as in the tables."""
    return (
        CASES.index(experiment.case),
        VEHICLES.index(experiment.vehicle),
        LAWS.index(experiment.law),
    )
