"""The data of an environment, from its options: vehicle, sensors, path, and the draws of each episode."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from autopilot.core.flight_core import Setup
from autopilot.geometry.linear import Vec3
from autopilot.geometry.packed import packed
from autopilot.guidance.jet_table import COLUMNS
from autopilot.vehicle.file import load_belief
from autopilot.vehicle.parameters import LAWS, apply_settings, autopilot_parameters
from autopilot.vehicle.rates import divider
from autopilot.wire.parameter_names import unknown_parameter_text
from autopilot.wire.parameter_table import ParameterError, ParameterTable
from gcs.closed_loop import Conditions
from gcs.errors import GcsError, input_error
from gcs.mission_files import load
from gcs.sweep.cell import Cell, cell_of
from gcs.sweep.drawing import drawn_number, draws_whole_numbers
from gcs.sweep.plan import simulator_settings
from gcs.workflows.flight_inputs import check_flight_inputs
from gcs.workflows.flight_options import SIMULATOR_PREFIX
from missions.model import Mission
from missions.nearest import did_you_mean
from missions.toml_files import FileError
from plumbline.arguments import errors_for_python
from plumbline.learning.actions import action_size
from plumbline.learning.observations import observation_size
from plumbline.learning.options import EnvOptions
from plumbline.learning.paths import path_of
from plumbline.learning.records import ACTIONS, ActionModel, ObservationModel, Reward, TaskModel
from sitl.plant.records import Truth
from sitl.settings import Settings, settings_of
from sitl.vehicles.sim_parameters import apply as apply_parameters
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import load_truth
from sitl.world import Floats, WorldRows, command_capacity, new_world

HOVER_AT: Vec3 = (0.0, 0.0, 3.0)  # m, of the load
SETTLE_S = 2.0  # for which the simulator flies before an episode, if the estimate is observed
RATE_GAIN: Vec3 = (20.0, 20.0, 8.0)  # 1/s
_LAW = "thesis"  # tracks an acceleration, and flies before an episode
_FIXED = ("SIM_RATE_HZ", "SIM_LOSS_PCT")  # the same for all episodes


@dataclass(frozen=True)
class Draw:
    """The random numbers of an episode."""

    seed: int
    offset: Vec3  # m, of the load from its desired position
    first_row: int  # row of the path
    values: tuple[float, ...]  # of the randomised parameters


class Scenario:
    """The data of an environment. `Error` (plumbline.Error) if the options are invalid."""

    def __init__(self, options: EnvOptions) -> None:
        self.options = options
        self.estimated = options.observation == "estimate"
        self._names = tuple(options.randomise)
        self._lows = tuple(float(low) for low, _ in options.randomise.values())
        self._highs = tuple(float(high) for _, high in options.randomise.values())
        self.cell = self._cell()
        self.tick_us = self.cell.settings.tick_us
        self.ticks = self._ticks()
        for values in (self._lows, self._highs):
            self._conditions(values)
        self._ranges = tuple(
            (low, high, draws_whole_numbers(low, high, [self._simulator.describe(name)]))
            for name, low, high in zip(self._names, self._lows, self._highs, strict=True)
        )
        self.reference, self.task = self._reference(), self._task()

    # ---- what is random

    def draw(self, rng: np.random.Generator) -> Draw:
        """Draw the next episode; each draw takes the same number of random numbers, used or not."""
        u_x, u_y, u_z, u_row, seed, *others = rng.random(5 + len(self._names)).tolist()
        width = 2.0 * self.options.start_m
        offset = (width * (u_x - 0.5), width * (u_y - 0.5), width * (u_z - 0.5))
        first_row = 0
        if self.options.start == "random":
            first_row = int(u_row * len(self.reference)) // self.ticks * self.ticks
        values = tuple(
            drawn_number(low, high, u, whole)
            for (low, high, whole), u in zip(self._ranges, others, strict=True)
        )
        return Draw(int(seed * 2**31), offset, first_row, values)

    def world(self, draw: Draw) -> tuple[WorldRows, Truth, Settings]:
        """The world of an episode before it begins, the load at rest on the ground."""
        truth, settings = self._conditions(draw.values)
        if truth.chain.links > 0:
            raise GcsError(
                f"cable_links = {truth.chain.links}; must be 0, as the learning environments have no links"
            )
        return new_world(truth, self.cell.profile, settings, draw.seed, self.cell.layout), truth, settings

    def max_capacities(self) -> tuple[int, int]:
        """How many commands, and readings of one sensor, can be in transit at most in any episode."""
        commands, readings = [], []
        for values in (self._lows, self._highs):
            rows, _, settings = self.world(Draw(1, HOVER_AT, 0, values))
            commands.append(command_capacity(settings))
            readings.append(rows.queue.shape[1])
        return max(commands), max(readings)

    def _conditions(self, values: tuple[float, ...]) -> tuple[Truth, Settings]:
        """The true vehicle, and the settings of the simulator, in an episode."""
        if not values:
            return self.cell.truth, self.cell.settings
        table = self._simulator
        for name, value in zip(self._names, values, strict=True):
            if name not in table and name.startswith(SIMULATOR_PREFIX):
                raise GcsError(f"randomise {unknown_parameter_text(name, table.names)}")
            if name not in table or name in _FIXED:
                hint = "" if name in table else did_you_mean(name, table.names)
                reason = f"{hint}must be a parameter of the simulator that may change"
                raise GcsError(f"randomise {name}: {reason}")
            try:
                table.set(name, value)
            except ParameterError as error:
                raise GcsError(f"randomise {error}") from None
        return apply_parameters(self._vehicle, table), settings_of(table)

    @cached_property
    def _vehicle(self) -> Truth:
        return load_truth(self.options.vehicle_file)

    @cached_property
    def _simulator(self) -> ParameterTable:
        table = sim_parameters(self._vehicle)
        for name, value in simulator_settings(dict(self.options.settings)).items():
            table.set(name, value)
        return table

    # ---- what is the same for all episodes

    def setup_of(self, law: str) -> Setup:
        """The setup of the autopilot for flying with a law. `Error` if there is no law of that name."""
        if law not in LAWS:
            hint = did_you_mean(law, LAWS)
            raise GcsError(f"law {law!r}: there is none of that name; {hint}must be one of {', '.join(LAWS)}")
        return self._cell(law).setup

    def _cell(self, law: str = _LAW) -> Cell:
        options = self.options
        given = {name: float(value) for name, value in options.settings.items()}
        if "CTL_LAW" in given:
            raise GcsError(
                "settings: CTL_LAW has no effect: actions fly an environment; LawPolicy flies a law"
            )
        given = {"CTL_RATE_HZ": given.get("SIM_RATE_HZ", 250.0), **given}
        with errors_for_python():
            check_flight_inputs(options.vehicle_file, options.sensors_file, given.items())
        all_settings = {**given, "CTL_LAW": float(LAWS.index(law))}
        conditions = Conditions(
            vehicle=options.vehicle_file, sensors=options.sensors_file, settings=all_settings
        )
        try:
            cell = cell_of(self._mission(), conditions)
        except FileError as error:
            raise input_error(error) from None
        except ValueError as error:
            raise GcsError(str(error)) from None
        if cell.setup.control_every != 1:
            raise GcsError("CTL_RATE_HZ: must be SIM_RATE_HZ in an environment")
        return cell

    def _mission(self) -> Mission:
        mission = self.options.mission
        if isinstance(mission, Mission):
            return mission
        return load("hover" if mission is None else str(mission))

    def _ticks(self) -> int:
        rate = 1e6 / self.tick_us
        try:
            return divider(rate, self.options.rate_hz, "rate_hz")
        except ValueError as error:
            raise GcsError(str(error)) from None

    def _reference(self) -> Floats:
        if self.options.mission is None:
            table = np.zeros((1, COLUMNS))
            table[0, :3] = HOVER_AT
            return table
        parameters = autopilot_parameters(load_belief(self.options.vehicle_file))
        apply_settings(parameters, self.options.settings.items())
        setup = self.cell.setup
        tick_s, name = self.tick_us * 1e-6, self._mission().name
        return path_of(self.cell.plan, setup.settings, parameters["MIS_SPEED"], tick_s, name)

    def _task(self) -> TaskModel:
        options, setup = self.options, self.cell.setup
        vehicle, kind = setup.vehicle, ACTIONS[options.action]
        weight = (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity
        strength = sum(rotor.strength for rotor in setup.layout)
        limited = setup.limited != 0.0 and np.isfinite(vehicle.rotor_max)
        action = ActionModel(
            kind=kind,
            vehicle=vehicle,
            limited=setup.limited,
            weight=weight,
            min_force=vehicle.rotor_min if limited else 0.0,
            max_force=vehicle.rotor_max if limited else 2.0 * weight / strength,
            strength=strength,
            rates=_vec3(options.max_rate_rad_s),
            rate_gain=RATE_GAIN,
            accel=_vec3(options.max_accel_m_s2),
            gains=setup.law.gains,
            filters=setup.law.filters,
        )
        numbers = action_size(kind, len(setup.layout))
        observation_model = ObservationModel(numbers, options.history, options.preview, options.preview_s)
        reward = Reward(**{name: float(value) for name, value in options.reward.items()})
        settle = round(SETTLE_S * 1e6 / self.tick_us) if self.estimated else 0
        return TaskModel(action, observation_model, reward, self.ticks, options.reach_m, settle)

    @property
    def size(self) -> int:
        """How many numbers an observation has."""
        return observation_size(self.task.observation_model)

    @property
    def row(self) -> Floats:
        """The task as a row of numbers."""
        return packed(self.task)


def _vec3(values: Any) -> Vec3:
    x, y, z = (float(value) for value in values)
    return (x, y, z)
