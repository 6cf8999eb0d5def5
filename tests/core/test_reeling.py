"""The winch laid out for a stretch, compared with the winch that is moved tick by tick."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from autopilot.control.records import Cable
from autopilot.core.flight_core import commanded_rate, with_cable_now
from autopilot.core.reeling import (
    ACCEL,
    COMMANDED_RATE,
    GROWTH,
    LENGTH,
    RATE,
    TAUT_LENGTH,
    commanded_rate_at,
    move_winch,
    reeling_table,
)
from autopilot.core.tick import Winch
from autopilot.geometry.packed import pack, unpack
from autopilot.guidance.legs import Reel
from autopilot.supervisor.quiescence import Stretch, uncontrolled_stretch
from autopilot.supervisor.state import CableState, Flight, Phase
from tests.doubles.craft import Craft

PERIOD_US = 4000
TICKS = 900  # 3.6 s, longer than either leg
OUT = Reel((1.0, 2.0, 1.5), 2.2, 0.25, 0.9, 1.3)
IN = Reel((1.0, 2.0, 1.5), 2.6, -0.3, 0.8, 0.0)


def times(leg_start_us: int, first_us: int) -> NDArray[np.float64]:
    return (first_us - leg_start_us + PERIOD_US * np.arange(TICKS)) * 1e-6


@pytest.mark.parametrize("leg", [OUT, IN], ids=["out", "in"])
@pytest.mark.parametrize("length_m", [None, 0.7, 1.1])
def test_the_winch_laid_out_is_the_winch_moved_tick_by_tick(leg: Reel, length_m: float | None) -> None:
    first_us, leg_start_us = 8_000_000, 7_998_765
    flight = Flight(
        phase=Phase.MISSION,
        legs=(leg,),
        leg_start_us=leg_start_us,
        cable=CableState(length_m=length_m, taut_length_m=0.7123),
    )
    table = reeling_table(leg, times(leg_start_us, first_us), flight.cable, PERIOD_US * 1e-6)
    for at in range(1, TICKS):
        now_us = first_us + PERIOD_US * at
        before = flight.cable
        flight = with_cable_now(flight, now_us)
        cable, row = flight.cable, table[at]
        assert cable.length_m is not None
        growth = 0.0 if before.length_m is None else cable.length_m - before.length_m
        assert (row[LENGTH], row[RATE], row[ACCEL]) == (cable.length_m, cable.reel_rate, cable.reel_accel)
        assert (row[GROWTH], row[TAUT_LENGTH]) == (growth, cable.taut_length_m)
        assert row[COMMANDED_RATE] == commanded_rate(flight, now_us, PERIOD_US * 1e-6)


def test_a_tick_receives_its_row_and_ticks_without_one_change_nothing() -> None:
    rows, first_us = Craft(sensors="ideal").onboard.core.rows, 8_000_000
    stretch = uncontrolled_stretch(0, 0, False)._replace(first_us=first_us, period_us=PERIOD_US)
    pack(stretch, rows.stretch, 0)
    pack(Winch(Cable(0.7), 0.0, False), rows.winch, 0)
    table = reeling_table(OUT, times(first_us, first_us), CableState(length_m=0.7), PERIOD_US * 1e-6)
    for at in (0, TICKS):
        move_winch(rows, table, first_us + PERIOD_US * at)
        assert unpack(Winch, rows.winch, 0) == Winch(Cable(0.7), 0.0, False)
        assert unpack(Stretch, rows.stretch, 0).taut_length == stretch.taut_length
    assert commanded_rate_at(rows, table, first_us + PERIOD_US * TICKS) == 0.0
    now_us = first_us + PERIOD_US * 250
    move_winch(rows, table, now_us)
    length, rate, accel, growth, taut_length, commanded = table[250].tolist()
    assert unpack(Winch, rows.winch, 0) == Winch(Cable(length, rate, accel), growth, False)
    assert unpack(Stretch, rows.stretch, 0).taut_length == taut_length
    assert commanded_rate_at(rows, table, now_us) == commanded
    assert 0.0 < growth < rate * PERIOD_US * 1e-6 + 1e-12
    assert length == pytest.approx(0.7 + sum(table[1:251, GROWTH]))
