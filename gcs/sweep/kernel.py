"""A stretch of flight in one call of machine code: the tick of the world and the tick of the autopilot, in
turn.

Both are the functions that fly in the processes (`sitl.world.world_tick`, `autopilot.core.tick.fly_tick`),
with the same machine code. Added are only the rounding of the wire between them, and the figures of the
flight.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import overload

from autopilot.core.reeling import commanded_rate_at, move_winch
from autopilot.core.tick import (
    FLOWN,
    TO_DECIDE,
    ControlMemory,
    CoreRows,
    EstimateSummary,
    fly_tick,
    row_at,
    vector_at,
)
from autopilot.geometry.addresses import call_int_kernel_at, call_kernel_at
from autopilot.geometry.compiler import INNER_OPTIONS
from autopilot.geometry.entry import kernel_address_of
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, norm, sub
from autopilot.geometry.packed import Row, pack, unpack, with_field
from autopilot.guidance.legs import LOAD_POSITION
from autopilot.supervisor.quiescence import Stretch
from gcs.sweep.step import NO_RESPONSE, Response, followed
from gcs.sweep.wire import Wire, deliver_readings, put_forces, rounded_reel_rate
from sitl.plant.chain.records import ChainRows
from sitl.plant.records import PlantState
from sitl.plant.rotors import FORCE, REQUESTED
from sitl.world import Floats, World, WorldModel, WorldRows, world_tick


class Figures(NamedTuple):
    """Figures of the mission, accumulated at each tick from the true state."""

    error_max: float  # m, distance from the requested path
    error_square: float  # m^2, summed
    samples: float
    tracking_max: float  # m, distance from the shaped path
    psi_R_max: float
    psi_q_max: float
    saturated: float  # ticks
    ticks: float
    tension_min: float  # N
    tension_max: float
    estimator_error_max: float  # m
    rotor_min: float  # N
    rotor_max: float
    response: Response  # to the step of the requested path, if it is one


NO_FIGURES = Figures(
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, float("inf"), 0.0, 0.0, float("inf"), -float("inf"), NO_RESPONSE
)


@kernel
def _with_path_errors(f: Figures, x_load: Vec3, target: Vec3, requested: Vec3) -> Figures:
    """The figures after a tick at which the load should be at `requested`, and at `target` by the shaped
    path, which the autopilot flies."""
    error = norm(sub(x_load, requested))
    f = with_field(f, "error_max", max(f.error_max, error))
    f = with_field(f, "error_square", f.error_square + error * error)
    f = with_field(f, "samples", f.samples + 1.0)
    return with_field(f, "tracking_max", max(f.tracking_max, norm(sub(x_load, target))))


@kernel
def _with_load(f: Figures, plant: PlantState, believed: Vec3) -> Figures:
    """The figures after a tick at which the load is on the cable, and by the estimate at `believed`."""
    f = with_field(f, "tension_min", min(f.tension_min, plant.tension))
    f = with_field(f, "tension_max", max(f.tension_max, plant.tension))
    return with_field(f, "estimator_error_max", max(f.estimator_error_max, norm(sub(plant.x_load, believed))))


@kernel
def add_to_figures(figures: Row, world: WorldRows, core: CoreRows, requested_path: Any) -> None:
    """Add this tick to the figures: always those of the vehicle, those of the load while it is on the cable,
    and those of the path while the load is to follow it."""
    f, now = unpack(Figures, figures, 0), unpack(World, world.world, 0)
    control, stretch = unpack(ControlMemory, core.control, 0), unpack(Stretch, core.stretch, 0)
    if not now.released:
        if stretch.mode == LOAD_POSITION:
            row = row_at(stretch, now.now_us)
            target, requested = vector_at(core.targets, row, 0), vector_at(requested_path, row, 0)
            f = _with_path_errors(f, now.plant.x_load, target, requested)
            f = with_field(f, "response", followed(f.response, now.plant.x_load, now.now_us))
        f = _with_load(f, now.plant, unpack(EstimateSummary, core.summary, 0).state.x_load)
    min_force, max_force = f.rotor_min, f.rotor_max
    for i in range(world.rotor_table.shape[0]):
        force = world.rotors[FORCE, i]
        min_force, max_force = min(min_force, force), max(max_force, force)
    f = with_field(f, "psi_R_max", max(f.psi_R_max, control.command.psi_R))
    f = with_field(f, "psi_q_max", max(f.psi_q_max, control.command.psi_q))
    f = with_field(f, "saturated", f.saturated + (1.0 if control.mixed.saturated != 0 else 0.0))
    f = with_field(f, "ticks", f.ticks + 1.0)
    f = with_field(f, "rotor_min", min_force)
    pack(with_field(f, "rotor_max", max_force), figures, 0)


class Code(NamedTuple):
    """Addresses of the machine code of the two ticks; 0 if nothing is compiled."""

    world: int
    fly: int


def code_of_world(world: WorldRows, chain: ChainRows | None = None) -> int:
    """The address of the world's tick for such rows, which is compiled or loaded if necessary."""
    if not hasattr(world_tick, "overloads"):
        return 0
    return kernel_address_of(world_tick, world, world.rotors[REQUESTED], False, 0.0, chain)


def code_of_autopilot(core: CoreRows, law_rows: Any) -> int:
    """The address of the autopilot's tick for such rows and any law, compiled or loaded if necessary."""
    if not hasattr(fly_tick, "overloads"):
        return 0
    return kernel_address_of(fly_tick, core, law_rows, 0, 0, 0, 0.0, False)


def call_world_tick(
    code: Code, world: WorldRows, gripper_open: bool, reel_rate: float, chain: ChainRows | None
) -> None:
    """Call `world_tick` by its address."""
    world_tick(world, world.rotors[REQUESTED], gripper_open, reel_rate, chain)


@overload(call_world_tick, jit_options=INNER_OPTIONS)
def _overload_world_tick(code: Any, world: Any, gripper_open: Any, reel_rate: Any, chain: Any) -> Any:
    def called(code: Any, world: Any, gripper_open: Any, reel_rate: Any, chain: Any) -> None:
        call_kernel_at(code.world, (world, world.rotors[REQUESTED], gripper_open, reel_rate, chain))

    return called


def call_fly_tick(
    code: Code,
    core: CoreRows,
    law_rows: Any,
    readings: int,
    now_us: int,
    tick: int,
    dt: float,
    decided: bool,
) -> int:
    """Call `fly_tick` by its address."""
    return fly_tick(core, law_rows, readings, now_us, tick, dt, decided)


@overload(call_fly_tick, jit_options=INNER_OPTIONS)
def _overload_fly_tick(
    code: Any, core: Any, law_rows: Any, readings: Any, now_us: Any, tick: Any, dt: Any, decided: Any
) -> Any:
    def called(
        code: Any, core: Any, law_rows: Any, readings: Any, now_us: Any, tick: Any, dt: Any, decided: Any
    ) -> Any:
        return call_int_kernel_at(code.fly, (core, law_rows, readings, now_us, tick, dt, decided))

    return called


@kernel
def _trace(trace: Floats, world: World, rotors: Floats, count: int) -> None:
    if world.tick < trace.shape[0]:
        row, plant = trace[world.tick], world.plant
        for i in range(3):
            row[i] = plant.x_load[i]
            row[3 + i] = plant.x_quad[i]
        for i in range(4):
            row[6 + i] = plant.quat_wxyz[i]
        for i in range(min(count, row.shape[0] - 10)):
            row[10 + i] = rotors[FORCE, i]


@kernel
def fly_stretch(
    code: Code,
    world: WorldRows,
    core: CoreRows,
    law_rows: Any,
    wire: Row,
    figures: Row,
    requested_path: Floats,
    trace: Floats,
    started: bool,
    decided: bool,
    gripper_open: bool,
    reel_rate: float,
    reeling: Floats,
    stop_tick: int,
    chain: ChainRows | None,
) -> bool:
    """Fly until the supervisor must decide (True) or the tick `stop_tick` has been flown (False).

    `started`: the present tick has been flown; `decided`: except for the law's part, which had to wait for
    the supervisor's decision. `requested_path` (ticks, 21) is the load's requested path, from the first tick
    of the core's stretch on, of which only the number of rows counts where the load follows no path; without
    rows no figures are taken. `trace` (ticks, 14) receives the true state,
    up to its length. `reeling` is the winch at the ticks of the core's stretch, as of
    `autopilot.core.reeling`; without rows its rate is to be `reel_rate` (m/s). `chain` is the memory of a
    cable of links, None for other cables.
    """
    link = unpack(Wire, wire, 0)
    tick_us = unpack(WorldModel, world.model, 0).tick_us
    while True:
        if started and not decided:
            put_forces(core.rotors, core.table, world)
            if reeling.shape[0] > 0:
                before_us = unpack(World, world.world, 0).now_us
                reel_rate = rounded_reel_rate(commanded_rate_at(core, reeling, before_us))
            call_world_tick(code, world, gripper_open, reel_rate, chain)
            if reeling.shape[0] > 0:
                move_winch(core, reeling, unpack(World, world.world, 0).now_us)
        started = True
        now = unpack(World, world.world, 0)
        _trace(trace, now, world.rotors, world.rotor_table.shape[0])
        readings = 0 if decided else deliver_readings(world, now.now_us, link, core.inbox)
        dt = 0.0 if now.tick == 0 else tick_us * 1e-6
        outcome = call_fly_tick(code, core, law_rows, readings, now.now_us, now.tick, dt, decided)
        decided = False
        if outcome == TO_DECIDE:
            return True
        if outcome == FLOWN and requested_path.shape[0] > 0:
            add_to_figures(figures, world, core, requested_path)
        if now.tick >= stop_tick:
            return False
