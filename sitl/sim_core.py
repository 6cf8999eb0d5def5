"""The simulated world as an object: one tick at a time, and its true state as records.

The work is done by `sitl.world.world_tick`, on flat arrays. Readings wait there, in `rows.queue`, until they
have left the sensors and are taken out (`sitl.messages`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from autopilot.geometry.entry import entry_point_of
from autopilot.geometry.linear import Vec3
from autopilot.geometry.packed import pack, unpack, width
from autopilot.vehicle.layout import PLUS, Layout
from sitl.plant.chain.records import lay_straight, new_chain
from sitl.plant.records import PlantState, Truth
from sitl.plant.rotors import COMMAND, FORCE, REQUESTED, rotor_table
from sitl.sensors.profile import Profile
from sitl.settings import Settings
from sitl.world import (
    World,
    command_capacity,
    delivery_table,
    model_of,
    new_world,
    pulse_at,
    world_tick,
)

Forces = tuple[float, ...]  # N, one for each rotor
SNAP_SPEED = width(World) - 1  # its index among the numbers of the world
NEVER_US = 2**62  # later than any flight lasts


class SimCore:
    """The true vehicle at time `now_us`. Same arguments and commands: same readings, to the bit."""

    def __init__(
        self, truth: Truth, profile: Profile, settings: Settings, seed: int, layout: Layout = PLUS
    ) -> None:
        self.truth = truth
        self._layout = layout
        self.settings = settings
        self._world: World | None = None
        self._profile = profile
        self._pulse_at_us = settings.pulse_at_us
        self.rows = new_world(truth, profile, settings, seed, layout)
        self.chain = new_chain(truth, self.state)
        self._tick: Callable[..., None] | None = None  # the tick's machine code, after its first use
        self.now_us = 0  # simulated time of this tick
        self.tick_count = 0  # ticks so far

    @property
    def world(self) -> World:
        """The world at this tick."""
        if self._world is None:
            self._world = unpack(World, self.rows.world, 0)
        return self._world

    @property
    def state(self) -> PlantState:
        """The true state of vehicle, cable and load."""
        return self.world.plant

    @state.setter
    def state(self, state: PlantState) -> None:
        self._world = self.world._replace(plant=state)
        pack(self._world, self.rows.world, 0)
        if self.chain is not None:
            lay_straight(self.chain, self.truth, state)

    @property
    def command(self) -> Forces:
        """Commanded forces of the rotors, N."""
        return tuple(self.rows.rotors[COMMAND].tolist()[: len(self._layout)])

    @property
    def rotor_force(self) -> Forces:
        """True forces of the rotors, N."""
        return tuple(self.rows.rotors[FORCE].tolist()[: len(self._layout)])

    @property
    def wind(self) -> Vec3:
        """Wind of the last tick, ENU, m/s."""
        return self.world.wind

    @property
    def released(self) -> bool:
        """Whether the gripper has let the cable go."""
        return self.world.released

    @property
    def snap_speed(self) -> float:
        """Speed (m/s) at which the cable came taut in the last tick; 0: it did not."""
        return float(self.rows.world.item(SNAP_SPEED))

    @property
    def cable_length(self) -> float:
        """Length of the cable in m, whether the gripper holds it or not."""
        return self.world.cable_length

    @property
    def pulse(self) -> Vec3:
        """The gust pulse that blows from this tick to the next."""
        settings = self.settings
        return pulse_at(self._pulse_at_us, settings.pulse_for_us, settings.pulse, self.now_us)

    @property
    def pulse_changes_us(self) -> int:
        """When the gust pulse will next begin or end; NEVER_US if it will not."""
        starts_us = self._pulse_at_us
        if starts_us < 0:
            return NEVER_US
        changes = (starts_us, starts_us + self.settings.pulse_for_us)
        return min((at_us for at_us in changes if at_us > self.now_us), default=NEVER_US)

    def set_tick(self, now_us: int, tick_count: int) -> None:
        """Note that the caller has moved the rows on to this tick by `world_tick`."""
        self._world = None
        self.now_us, self.tick_count = now_us, tick_count

    def tick(self, command: Forces, gripper_open: bool = False, reel_rate: float = 0.0) -> None:
        """Integrate to the next tick; see `world_tick`. Rotors beyond those of `command` stand still."""
        requested = self.rows.rotors[REQUESTED]
        requested[:] = 0.0
        requested[: len(command)] = command
        if self._tick is None:
            self._tick = entry_point_of(world_tick, self.rows, requested, gripper_open, reel_rate, self.chain)
        self._tick(self.rows, requested, gripper_open, reel_rate, self.chain)
        self._world = None
        self.now_us += self.settings.tick_us
        self.tick_count += 1

    def retune(self, truth: Truth, settings: Settings) -> None:
        """Continue with another truth and other settings; tick, latency and cable length stay as they were.

        A gust pulse whose time is moved to a tick that has begun does not blow.
        """
        if settings.pulse_at_us != self.settings.pulse_at_us:
            self._pulse_at_us = settings.pulse_at_us if settings.pulse_at_us > self.now_us else -1
        extra_delay_us = settings.actuator_delay_us - self.settings.actuator_delay_us
        self.truth, self.settings = truth, settings
        rows = self.rows
        pack(model_of(truth, self._profile, settings, self._pulse_at_us), rows.model, 0)
        rows.delivery[:] = delivery_table(self._profile, settings)
        # the commands on their way, oldest first, with room for later ones
        head, length = rows.command_ring
        waiting = np.roll(rows.commands, -head, axis=0)[:length]
        commands = np.zeros((length + command_capacity(settings), waiting.shape[1]))
        commands[:length] = waiting
        commands[:length, 0] += extra_delay_us
        rows.command_ring[0] = 0
        table = rotor_table(self._layout, settings.rotor_shares(len(self._layout)))
        self.rows = rows._replace(commands=commands, rotor_table=table)
