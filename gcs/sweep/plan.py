"""What a sweep flies: laws, seeds and settings. Every flight has its own number.

The flights follow from the plan alone, so that a stopped sweep can be continued, and any flight of it can be
flown again by its number.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any, TypeVar

import numpy as np

from autopilot.own.law import law_name, law_number, own_law_reference
from autopilot.own.own_code import NO_OWN_CODE, OwnCode, parameters_for
from autopilot.own.source import OwnError
from autopilot.own.trial import try_all
from autopilot.shell.watched_calls import watched_calls
from autopilot.vehicle.file import load_belief
from autopilot.vehicle.parameters import apply_settings
from autopilot.vehicle.rates import RateError, control_divider
from autopilot.wire.parameter_names import unknown_parameter_text
from autopilot.wire.parameter_table import ParameterError, ParameterTable
from gcs.closed_loop import Conditions
from gcs.errors import GcsError
from gcs.mission_files import load
from gcs.sweep.drawing import drawn_index, drawn_number, draws_whole_numbers, without_repeats
from gcs.sweep.plan_values import MAX_FLIGHTS, MAX_VALUES, PlanError, VariedParameter, varied_values
from missions.toml_files import FileError
from sitl.sensors.files import load_profile
from sitl.settings import settings_of
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import load_truth

T = TypeVar("T")

_DRAW_SEED = 1  # for drawing the settings of `--sample`: another one would change the meaning of a plan


def simulator_settings(settings: Mapping[str, float]) -> dict[str, float]:
    """Those of the settings, by name, that the simulator takes."""
    return {n: v for n, v in settings.items() if n.startswith("SIM_") and n != "SIM_LOSS_PCT"}


@dataclass(frozen=True)
class Case:
    """One flight of a sweep."""

    index: int
    law: str
    seed: int
    varied: tuple[float, ...]  # in the order of the plan


@dataclass(frozen=True)
class SweepPlan:
    """A sweep. `sample` settings are drawn by Latin hypercube; 0: the grid of all values is flown."""

    mission: str
    vehicle: str
    sensors: str
    laws: tuple[str, ...]
    seeds: tuple[int, ...]
    varied: tuple[VariedParameter, ...]
    settings: tuple[tuple[str, float], ...]  # the same for all flights
    sample: int = 0
    estimator: str = ""  # custom estimator of all flights; empty: the built-in one
    planner: str = ""
    limit_s: float | None = None  # longest time that a flight may last; None: by its expected duration

    def own(self, law: str) -> OwnCode:
        """The custom parts (law, estimator, planner) of a flight with this law."""
        return OwnCode(own_law_reference(law), self.estimator, self.planner)

    @property
    def points(self) -> int:
        """The number of different settings that are flown."""
        return self.sample or math.prod(len(v.values) for v in self.varied)

    @property
    def flights(self) -> int:
        """The number of flights."""
        return len(self.laws) * self.points * len(self.seeds)

    def contains(self, other: SweepPlan) -> bool:
        """Whether every flight of the other plan is one of this plan, which has only more seeds, or more
        values in its grid."""
        if replace(self, seeds=other.seeds, varied=other.varied) != other:
            return False
        if not set(other.seeds) <= set(self.seeds):
            return False
        if self.sample:  # what is drawn depends on all values
            return self.varied == other.varied
        return [v.names for v in self.varied] == [v.names for v in other.varied] and all(
            set(old.values) <= set(new.values) for old, new in zip(other.varied, self.varied, strict=True)
        )

    def cases(self) -> Iterator[Case]:
        """Every flight, in the order of its number: law by law, setting by setting, seed by seed."""
        points = self._points()
        numbered = product(self.laws, points, self.seeds)
        for index, (law, point, seed) in enumerate(numbered):
            yield Case(index, law, seed, point)

    def _points(self) -> list[tuple[float, ...]]:
        if not self.sample:
            return list(product(*(v.values for v in self.varied)))
        from scipy.stats.qmc import LatinHypercube

        fractions = LatinHypercube(len(self.varied), rng=_DRAW_SEED).random(self.sample)
        drawn = [
            tuple(_drawn_value(v, float(fraction)) for v, fraction in zip(self.varied, row, strict=True))
            for row in fractions
        ]
        if any(v.continuous for v in self.varied):
            return drawn
        return without_repeats(drawn, [v.values for v in self.varied], np.random.default_rng(_DRAW_SEED))

    def conditions(self, case: Case) -> Conditions:
        """The conditions under which the flight is flown."""
        varied = {v.name: value for v, value in zip(self.varied, case.varied, strict=True)}
        varied = self.with_followers(varied)
        law = {"CTL_LAW": float(law_number(case.law))}
        settings = {**self.known_to(case.law, {**dict(self.settings), **varied}), **law}
        return Conditions(
            self.vehicle,
            self.sensors,
            case.seed,
            settings,
            self.own(case.law),
            self.limit_s,
            self.foreign_to(case.law),
        )

    def with_followers(self, varied: Mapping[str, T]) -> dict[str, T]:
        """The values of varied parameters by name, also under the names of those that have the same value."""
        followers = {v.name: v.followers for v in self.varied}
        return {name: value for one, value in varied.items() for name in (one, *followers.get(one, ()))}

    def known_to(self, law: str, settings: Mapping[str, T]) -> dict[str, T]:
        """Those of the settings (or of other values) by name that a flight with this law takes: not the
        parameters that only other laws of the plan define."""
        foreign = self.foreign_to(law)
        return {name: value for name, value in settings.items() if name not in foreign}

    def foreign_to(self, law: str) -> frozenset[str]:
        """The parameters that only other laws of the plan define; flights with this law ignore them."""
        return _foreign_parameters(self.laws, self.own(law))

    def to_json(self) -> dict[str, Any]:
        """The plan as plain JSON values."""
        return json.loads(json.dumps(asdict(self)))  # type: ignore[no-any-return]


def from_json(values: Mapping[str, Any]) -> SweepPlan:
    """Inverse of `SweepPlan.to_json`."""
    return SweepPlan(
        mission=values["mission"],
        vehicle=values["vehicle"],
        sensors=values["sensors"],
        laws=tuple(values["laws"]),
        seeds=tuple(values["seeds"]),
        varied=tuple(
            VariedParameter(
                v["name"], tuple(v["values"]), bool(v["continuous"]), tuple(v.get("followers", ()))
            )
            for v in values["varied"]
        ),
        settings=tuple((name, float(value)) for name, value in values["settings"]),
        sample=int(values["sample"]),
        estimator=values["estimator"],
        planner=values["planner"],
        limit_s=values.get("limit_s"),
    )


def _drawn_value(varied: VariedParameter, fraction: float) -> float:
    if varied.continuous:
        return drawn_number(min(varied.values), max(varied.values), fraction, whole=False)
    return varied.values[drawn_index(fraction, len(varied.values))]


def make_plan(
    mission: str,
    vehicle: str,
    sensors: str,
    laws: Sequence[str],
    seeds: Sequence[int],
    varied: Sequence[VariedParameter],
    settings: Mapping[str, float],
    sample: int,
    own: OwnCode = NO_OWN_CODE,
    limit_s: float | None = None,
) -> SweepPlan:
    """The plan; PlanError states what is wrong with it. The estimator and planner of `own` are those of all
    flights."""
    names = [name for v in varied for name in v.names]
    for name in names:
        if names.count(name) > 1:
            raise PlanError(f"--vary {name} is given twice; give all its values in one")
        if name in settings:
            raise PlanError(f"{name} is both varied and set; leave one of the two out")
    if sample and not varied:
        raise PlanError("--sample draws the values of --vary, and there is none")
    _check_laws(laws)
    for law in laws:
        own_of_law = own._replace(law=own_law_reference(law))
        foreign = _foreign_parameters(tuple(laws), own_of_law)
        world, table = _tables(vehicle, own_of_law, foreign)
        if sample:
            varied = [_drawable(one, world, table) for one in varied]
        values = [*varied_values(varied), *settings.items()]
        known_values = [one for one in values if one[0] not in foreign]
        _check_values(world, table, known_values, settings)
        if any(own_of_law):
            known = {name: value for name, value in settings.items() if name not in foreign}
            _try_own_code(vehicle, own_of_law, foreign, known)
    try:
        load(mission)
        load_profile(sensors)
    except GcsError as error:
        raise PlanError(*error.lines) from None
    except ValueError as error:
        raise PlanError(*_error_lines(error)) from None
    settings_in_all = math.prod(len(one.values) for one in varied)
    if sample > settings_in_all and not any(one.continuous for one in varied):
        raise PlanError(
            f"--sample {sample}: these values make {settings_in_all} settings only, and a repeated one is "
            "the same flight again; leave --sample out, and give more --seeds"
        )
    plan = SweepPlan(
        mission,
        vehicle,
        sensors,
        tuple(dict.fromkeys(laws)),
        tuple(seeds),
        tuple(varied),
        tuple(sorted(settings.items())),
        sample,
        own.estimator,
        own.planner,
        limit_s,
    )
    if plan.flights > MAX_FLIGHTS:
        raise PlanError(f"{plan.flights} flights are too many, {MAX_FLIGHTS} at most; --sample takes a few")
    return plan


def own_parameter_names(own: OwnCode) -> frozenset[str]:
    """The names of the parameters that custom classes define."""
    return frozenset(parameter.name for one in own.load_classes() for parameter in one.parameters)


def _foreign_parameters(laws: tuple[str, ...], own: OwnCode) -> frozenset[str]:
    """The parameters that custom classes among `laws` define, but no class of `own`, which flies."""
    of_laws = (own_parameter_names(OwnCode(own_law_reference(law))) for law in laws)
    return frozenset().union(*of_laws) - own_parameter_names(own)


def _check_laws(laws: Sequence[str]) -> None:
    """PlanError if two laws have the same name and could not be distinguished in a table."""
    try:
        names = {law: law_name(law) for law in laws}
    except OwnError as error:
        raise PlanError(f"--law {error}") from None
    for law, name in names.items():
        if list(names.values()).count(name) > 1:
            raise PlanError(f"--law {law}: another law has the name {name}, too; give it `name = ...`")


def _try_own_code(vehicle: str, own: OwnCode, foreign: frozenset[str], settings: Mapping[str, float]) -> None:
    """PlanError if custom code fails in the trial before the flights."""
    table = parameters_for(load_belief(vehicle), own, ignored=foreign)
    apply_settings(table, settings.items())
    try:
        with watched_calls():
            try_all(own, table.values())
    except OwnError as error:
        raise PlanError(str(error)) from None


def _error_lines(error: ValueError) -> tuple[str, ...]:
    """The lines of an error: one for each mistake in a file."""
    return error.problems if isinstance(error, FileError) else (str(error),)


def _tables(vehicle: str, own: OwnCode, foreign: frozenset[str]) -> tuple[ParameterTable, ParameterTable]:
    """The parameters of simulator and autopilot; PlanError states what is wrong with the vehicle."""
    try:
        world = sim_parameters(load_truth(vehicle))
        table = parameters_for(load_belief(vehicle), own, ignored=foreign)
    except ValueError as error:
        raise PlanError(*_error_lines(error)) from None
    return world, table


def _drawable(varied: VariedParameter, world: ParameterTable, table: ParameterTable) -> VariedParameter:
    """What is drawn from a range: whole numbers, if one of the parameters takes no others."""
    low, high = min(varied.values), max(varied.values)
    described = [owner.describe(name) for name in varied.names for owner in (world, table) if name in owner]
    if not (varied.continuous and draws_whole_numbers(low, high, described)):
        return varied
    if high - low >= MAX_VALUES:
        raise PlanError(f"--vary {varied.name}={low:g}:{high:g}: more than {MAX_VALUES} whole numbers")
    return replace(varied, values=tuple(map(float, range(int(low), int(high) + 1))), continuous=False)


def _check_values(
    world: ParameterTable,
    table: ParameterTable,
    values: Sequence[tuple[str, float]],
    settings: Mapping[str, float],
) -> None:
    """PlanError unless all these values can be set; those of `settings` do not vary."""
    for name, value in values:
        if name == "SIM_LOSS_PCT":
            raise PlanError(
                "SIM_LOSS_PCT acts on the ground link, and a sweep flies without one; leave it out"
            )
        if name == "CTL_LAW":
            raise PlanError("CTL_LAW is what --law says; give --law instead")
        option = "--set" if name in settings else "--vary"
        owner = world if name.startswith("SIM_") and name not in table else table
        if name not in owner:
            raise PlanError(f"{option} {unknown_parameter_text(name, [*table.names, *world.names])}")
        try:
            owner.set(name, value)
            if name == "SIM_RATE_HZ":
                settings_of(world)
        except ParameterError as error:
            raise PlanError(f"{option} {error}") from None
    _check_rates(world, table, values)


def _check_rates(world: ParameterTable, table: ParameterTable, values: Sequence[tuple[str, float]]) -> None:
    """PlanError if the law cannot run at one of its rates with one of the simulator's tick rates."""
    tick_rates, law_rates = (
        [value for name, value in values if name == one] for one in ("SIM_RATE_HZ", "CTL_RATE_HZ")
    )
    for tick_hz, law_hz in product(tick_rates or [world["SIM_RATE_HZ"]], law_rates or [table["CTL_RATE_HZ"]]):
        table.set("CTL_RATE_HZ", law_hz)
        try:
            control_divider(tick_hz, table)
        except RateError as error:
            raise PlanError(str(error)) from None
