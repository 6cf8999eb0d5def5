"""What the flights of a cell of a sweep share: flights with one law and the same settings, and any seed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from autopilot.core.flight_core import Setup
from autopilot.geometry.packed import Row, packed
from autopilot.onboard.onboard import build_setup, mission_plan
from autopilot.own.own_code import OwnCode, parameters_for
from autopilot.services.mission_store import StoredMission
from autopilot.supervisor.state import Area, MissionPlan
from autopilot.trajectory.prepare import PathLimits
from autopilot.vehicle.file import belief_of, load_belief, load_vehicle
from autopilot.vehicle.layout import Layout
from autopilot.vehicle.parameters import apply_settings
from autopilot.vehicle.rates import control_divider
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items import WireItem
from gcs.batch.reuse import file_digests
from gcs.closed_loop import Conditions
from gcs.expected_flight import expected_flight_s, time_limit_s
from gcs.foreign_mission import home_of
from gcs.mission_items import areas_of, items_of
from gcs.sweep.plan import simulator_settings
from gcs.sweep.wire import wire_of
from missions.model import Mission
from sitl.plant.records import Truth
from sitl.sensors.files import load_profile
from sitl.sensors.overrides import with_overrides
from sitl.sensors.profile import Profile
from sitl.settings import Settings, settings_of
from sitl.vehicles.sim_parameters import apply as apply_parameters
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import truth_of


@dataclass(frozen=True)
class Cell:
    """Everything about a flight except its seed."""

    mission: Mission
    setup: Setup
    plan: MissionPlan
    area: Area
    item_count: int  # number of mission items
    limit_us: int  # longest time that the flight may last
    truth: Truth
    layout: Layout
    profile: Profile
    settings: Settings
    wire: Row


def cell_of(mission: Mission, conditions: Conditions) -> Cell:
    """The cell to which a flight under these conditions belongs. ValueError if it cannot be flown."""
    settings, own = tuple(conditions.settings.items()), conditions.own
    # files and custom code may change under the same name: their digests are part of the cache's key
    return _cell(
        mission,
        conditions.vehicle,
        conditions.sensors,
        settings,
        own,
        (*own.digests, *_own_files(conditions)),
        conditions.limit_s,
        conditions.ignored,
    )


def _own_files(conditions: Conditions) -> tuple[str, ...]:
    """Digests of the user's own files of vehicle, assumed vehicle and sensors."""
    names = [conditions.sensors]
    if Path(conditions.vehicle).is_file():
        names += [conditions.vehicle, str(belief_of(conditions.vehicle))]
    return tuple(file_digests(names).values())


@lru_cache(maxsize=8)
def _cell(
    mission: Mission,
    vehicle: str,
    sensors: str,
    set_values: tuple[tuple[str, float], ...],
    own: OwnCode,
    digests: tuple[str, ...],
    limit_s: float | None,
    ignored: frozenset[str],
) -> Cell:
    home = home_of(mission)
    file = load_vehicle(vehicle)
    table = parameters_for(load_belief(vehicle), own, ignored=ignored)
    apply_settings(table, set_values)
    truth = truth_of(file)
    sim_table = sim_parameters(truth)
    for name, value in simulator_settings(dict(set_values)).items():
        sim_table.set(name, value)
    settings = settings_of(sim_table)
    profile = load_profile(sensors)
    divider = control_divider(1e6 / settings.tick_us, table)
    setup = build_setup(table, divider, own)
    items = items_of(mission, home)
    plan = (
        _plan(items, home, setup.settings.limits) if setup.planner is None else _own_plan(items, home, setup)
    )
    return Cell(
        mission=mission,
        setup=setup,
        plan=plan,
        area=Area.of(areas_of(mission), home),
        item_count=len(items),
        limit_us=round(1e6 * time_limit_s(expected_flight_s(mission, table), limit_s)),
        truth=apply_parameters(truth, sim_table),
        layout=file.layout,
        profile=profile,
        settings=settings,
        wire=packed(wire_of(with_overrides(profile, settings.overrides), settings.noise_scale, home)),
    )


def _own_plan(items: tuple[WireItem, ...], home: Home, setup: Setup) -> MissionPlan:
    """The plan of a mission by a custom planner."""
    return mission_plan(StoredMission(items), home, setup.settings.limits, planner=setup.planner)


@lru_cache(maxsize=64)
def _plan(items: tuple[WireItem, ...], home: Home, limits: PathLimits) -> MissionPlan:
    """The plan of a mission; cached, as shaping its paths takes seconds and depends on nothing else."""
    return mission_plan(StoredMission(items), home, limits)
