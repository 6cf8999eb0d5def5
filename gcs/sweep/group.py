"""Up to eight flights of one cell of a sweep, flown at once while they take the same branches.

A block of ticks is flown in lanes (`gcs.sweep.lane_kernel`). A flight that takes another branch than the
others, or for which the supervisor must decide, is flown alone for some ticks, while the others continue.
Ticks of a block that are not valid for a flight are flown again from its own memory, which is still as it was
when the block began. Every flight is therefore the same to the bit as if it were flown alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from autopilot.core.tick import Winch
from autopilot.geometry.entry import entry_of
from autopilot.geometry.packed import unpack
from gcs.sweep.flight import SweptFlight
from gcs.sweep.lane_kernel import fly_lanes
from gcs.sweep.lane_memory import LaneMemory
from sitl.world import JITTER, LOSS, OUTAGE_CHANCE, WorldModel

FEWEST = 3  # least number of flights for which lanes are faster
_LONGEST, _SHORTEST = 2000, 8  # ticks of a block
_ASIDE = 16  # ticks that a flight is flown alone when the supervisor must decide for it
_ALONE, _MOST_ALONE = 4, 128  # ticks that a flight is flown alone after another branch: more each time

_ENTRIES: dict[type, Callable[..., tuple[int, int]]] = {}  # machine code, by the type of the law's rows


def suits(flight: SweptFlight) -> bool:
    """Whether a flight can be flown in lanes: no reading is lost or late at random, and the cable has no
    links."""
    gnss = unpack(WorldModel, flight.world.model, 0).gnss
    by_chance = flight.world.fate[:, [LOSS, OUTAGE_CHANCE, JITTER]]
    alike = not by_chance.any() and gnss.float_chance == 0.0 and gnss.lost_chance == 0.0
    return alike and flight.chain is None


class Group:
    """Flights of one cell in progress."""

    def __init__(self, flights: Sequence[SweptFlight]) -> None:
        self._flights = flights
        self._memory = LaneMemory(flights)
        self._block = _SHORTEST
        self._alone = [_ALONE] * len(flights)
        self.in_lanes = 0  # ticks that were flown in lanes, of all flights

    def compile(self) -> None:
        """Compile or load the machine code."""
        self._fly_lanes(range(len(self._flights)), 0)

    def run(self) -> None:
        """Fly all flights to their ends."""
        flying = list(range(len(self._flights)))
        for i in flying:
            self._fly_alone(i, 1)
        while len(flying) >= FEWEST:
            self._go_on(flying)
            flying = [i for i in flying if not self._flights[i].flown.outcome]
        for i in flying:
            self._flights[i].run()
        for flight in self._flights:
            flight.conclude()

    def _go_on(self, flying: Sequence[int]) -> None:
        """Fly the flights that are behind, at most until they reach those that are ahead."""
        ticks = [self._flights[i].tick for i in flying]
        tick = min(ticks)
        behind = [i for i, own in zip(flying, ticks, strict=True) if own == tick]
        others = [own for own in ticks if own > tick]
        most = min(others) - tick if others else _LONGEST
        together = self._alike(behind)
        if len(together) < FEWEST or most < _SHORTEST:
            for i in behind:
                self._fly_alone(i, tick + min(most, _ASIDE))
            return
        for i in set(behind) - set(together):
            self._fly_alone(i, tick + self._longer(i))
        ahead = {i: self._undecided(i) for i in together}
        soon = [i for i in together if ahead[i] < _SHORTEST]
        if len(together) - len(soon) < FEWEST:
            last = max(ahead[i] for i in soon) + 1
            for i in together:
                self._fly_alone(i, tick + min(last, most))
        elif soon:
            for i in soon:
                self._fly_alone(i, tick + _ASIDE)
        else:
            self._fly_block(together, min(most, self._block, *ahead.values()))

    def _alike(self, members: Sequence[int]) -> list[int]:
        """The greatest number of these flights that can be flown together."""
        flights = self._flights
        courses: dict[object, list[int]] = {}
        for i in members:
            core = flights[i].core
            if not core.reels:  # otherwise the growth of the cable would be passed on twice
                core.move_cable(flights[i].now_us + flights[i].tick_us)
                courses.setdefault(self._memory.course(i), []).append(i)
        most = max(courses.values(), key=len, default=[])
        if not most:
            return []
        winch = unpack(Winch, flights[most[0]].core.rows.winch, 0)
        reels = winch.grown != 0.0 or winch.cable.rate != 0.0 or winch.cable.accel != 0.0
        return [] if winch.released or reels else most

    def _undecided(self, i: int) -> int:
        """Ticks that a flight can fly before the supervisor must decide, or the ground station has a turn."""
        flight = self._flights[i]
        to_decide = -(-(self._memory.stop_us(i) - flight.now_us) // flight.tick_us) - 1
        return max(min(to_decide, flight.stop_tick(flight.now_us) - flight.tick), 0)

    # ---- in lanes

    def _fly_block(self, members: Sequence[int], ticks: int) -> None:
        """Fly these ticks in lanes, or as many as all flights fly alike."""
        memory = self._memory
        tick = self._flights[members[0]].tick
        flown, parted = self._fly_lanes(members, ticks)
        if not memory.remembers():
            # the estimator was reset or needs a longer memory: the lanes do not hold all of the ring for it
            for i in members:
                self._fly_alone(i, tick + min(flown + 1, ticks))
            return
        astray = [i for lane, i in enumerate(members) if parted >> lane & 1]
        faithful = [i for i in members if i not in astray]
        if faithful:
            self._take_back(faithful, flown + 1 if astray else flown)
        if astray:
            # fewer than `FEWEST` are flown again alone, which is as fast
            if flown > 0 and len(astray) >= FEWEST:
                self._fly_lanes(astray, flown)
                self._take_back(astray, flown)
            for i in astray:
                self._fly_alone(i, tick + flown + (self._longer(i) if faithful else 1))
            self._block = max(self._block // 2, _SHORTEST)
        else:
            self._block = min(2 * self._block, _LONGEST)
            for i in members:
                self._alone[i] = _ALONE

    def _fly_lanes(self, members: Sequence[int], ticks: int) -> tuple[int, int]:
        """Take the members into lanes and call `fly_lanes`, with its result."""
        memory = self._memory
        memory.take(members)
        law = type(memory.law_rows)
        arguments = (
            memory.world,
            memory.core,
            memory.law_rows,
            self._flights[0].cell.wire,
            memory.figures,
            memory.asked,
            ticks,
        )
        if law not in _ENTRIES:
            _ENTRIES[law] = entry_of(fly_lanes, *arguments)
        return _ENTRIES[law](*arguments)

    def _take_back(self, members: Sequence[int], ticks: int) -> None:
        slack = [self._flights[i].slack_events for i in members]
        self._memory.give(members, ticks)
        self.in_lanes += ticks * len(members)
        for i, before in zip(members, slack, strict=True):
            self._flights[i].flown_in_lanes(ticks, before)

    # ---- alone

    def _longer(self, i: int) -> int:
        """The number of ticks to fly a flight alone after it took another branch: more each time."""
        ticks = self._alone[i]
        self._alone[i] = min(2 * ticks, _MOST_ALONE)
        return ticks

    def _fly_alone(self, i: int, last_tick: int) -> None:
        flight = self._flights[i]
        while not flight.flown.outcome and flight.tick < last_tick:
            flight.turn(last_tick)
