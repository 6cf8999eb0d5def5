"""How long an item has been flown: over its legs, over a pause, and not over a repetition."""

from __future__ import annotations

import io

import numpy as np
import pytest

from autopilot.onboard.onboard import Onboard
from autopilot.wire.codec import FrameWriter
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.tlog import TlogWriter, read_tlog
from gcs.analysis.item_time import item_began_s
from gcs.analysis.parquet import flight_columns
from gcs.analysis.samples import samples_of
from gcs.analysis.telemetry import telemetry_of
from gcs.analysis.tracks import ItemTrack, SetpointTrack
from gcs.closed_loop import Conditions, fly
from missions.fileformat import load_mission
from sitl.hil import HilSimulator

TICK_S = 0.02
LIFT, HOLD, MISSION = (
    mavlink.PLUMBLINE_PHASE_LIFT,
    mavlink.PLUMBLINE_PHASE_HOLD,
    mavlink.PLUMBLINE_PHASE_MISSION,
)
ARMED = mavlink.PLUMBLINE_PHASE_ARMED
Leg = tuple[int, int, float]  # phase, item, duration


def flown(*legs: Leg, reached: tuple[tuple[float, int], ...] = ()) -> tuple[np.ndarray, np.ndarray]:
    """Times, and for how long the item has been flown at each of them."""
    times, elapsed, phases, items = [], [], [], []
    begin_s = 0.0
    for phase, item, duration_s in legs:
        since_s = np.arange(0.0, duration_s - 1e-9, TICK_S)
        times.append(begin_s + since_s)
        elapsed.append(since_s.astype(np.float32).astype(float))
        phases += len(since_s) * [phase]
        items += len(since_s) * [item]
        begin_s += duration_s
    time_s, none = np.concatenate(times), np.zeros((len(phases), 3))
    setpoint = SetpointTrack(
        time_s=time_s,
        **dict.fromkeys(
            ("position_m", "velocity_m_s", "acceleration_m_s2", "requested_m", "requested_m_s", "q_cable_c"),
            none,
        ),
        elapsed_s=np.concatenate(elapsed),
        duration_s=np.full(len(phases), np.nan),
        item=np.array(items),
        phase=np.array(phases),
        control_mode=np.zeros(len(phases), dtype=int),
    )
    messages = ItemTrack(
        np.array([t for t, _ in reached]), np.array([item for _, item in reached], dtype=int)
    )
    return time_s, time_s - item_began_s(setpoint, messages)


def test_the_hold_of_an_item_belongs_to_it() -> None:
    time_s, since_s = flown((LIFT, 0, 2.0), (MISSION, 1, 3.0), (MISSION, 1, 4.0), (MISSION, 2, 1.0))
    expected = np.select([time_s < 2.0 - 1e-9, time_s < 9.0 - 1e-9], [time_s, time_s - 2.0], time_s - 9.0)
    assert since_s == pytest.approx(expected, abs=1e-5)


def test_a_pause_does_not_count_and_shifts_nothing() -> None:
    pause = (HOLD, 1, 1.0), (HOLD, 1, 5.0)
    time_s, since_s = flown((MISSION, 1, 3.0), *pause, (MISSION, 1, 2.0), *pause, (MISSION, 1, 4.0))
    in_item = (time_s < 3.0) | ((time_s >= 9.0) & (time_s < 11.0)) | (time_s >= 17.0)
    assert since_s[in_item] == pytest.approx(TICK_S * np.arange(in_item.sum()), abs=1e-5)
    paused = (time_s >= 3.0) & (time_s < 9.0)
    assert since_s[paused] == pytest.approx(time_s[paused] - 3.0, abs=1e-5), "since the phase began"


def test_an_item_that_is_repeated_begins_again() -> None:
    """A jump back to the item itself: only that it was reached tells the rounds apart."""
    rounds = ((MISSION, 1, 3.0), (MISSION, 1, 2.0)) * 3
    time_s, since_s = flown(*rounds, reached=((5.013, 1), (10.004, 1), (15.0, 1)))
    assert since_s == pytest.approx(np.mod(time_s + 1e-9, 5.0), abs=1e-5)


def test_the_same_item_of_another_flight_is_not_a_resumption() -> None:
    between = (HOLD, 2, 1.0), (ARMED, 0, 1.0), (LIFT, 0, 1.0)
    time_s, since_s = flown((MISSION, 1, 3.0), *between, (MISSION, 1, 2.0))
    again = time_s >= 6.0
    assert since_s[again] == pytest.approx(time_s[again] - 6.0, abs=1e-5)


def test_a_vehicle_that_states_no_times_has_none() -> None:
    track = dict.fromkeys(SetpointTrack.__dataclass_fields__, np.zeros(0))
    assert item_began_s(SetpointTrack(**track), ItemTrack(np.zeros(0), np.zeros(0, dtype=int))).shape == (0,)


def test_the_time_of_a_path_that_was_paused_is_that_of_the_path() -> None:
    """Of Case B with and without a pause: at the same time of the item the load is asked to be at the same
    place, once it is at speed again."""
    pause = ((19.0, 0.0), (24.0, 1.0))  # time, and parameter of DO_PAUSE_CONTINUE

    def columns(commands: tuple[tuple[float, float], ...]) -> dict[str, np.ndarray]:
        waiting, writer, log = list(commands), FrameWriter(254, 190), io.BytesIO()

        def pause_and_continue(onboard: Onboard, _: HilSimulator) -> bool:
            if waiting and onboard.now_us >= waiting[0][0] * 1e6:
                parameters = (waiting.pop(0)[1], *6 * [0.0])
                number = mavlink.MAV_CMD_DO_PAUSE_CONTINUE
                message = mavlink.MAVLink_command_long_message(1, 1, number, 0, *parameters)
                onboard.receive_ground(writer.frame(message), "other")
            return True

        watch = pause_and_continue if commands else None  # without one it takes half of the time
        assert fly(load_mission("case-b"), Conditions(), TlogWriter(log), watch).name == "completed"
        log.seek(0)
        telemetry = telemetry_of(read_tlog(log))
        return flight_columns(telemetry, samples_of(telemetry))

    plain, paused = columns(()), columns(pause)
    item = np.bincount(plain["mission_item"][plain["in_mission"]]).argmax()  # the signals
    (in_plain, in_paused) = (one["in_mission"] & (one["mission_item"] == item) for one in (plain, paused))
    again = in_paused & (paused["time_s"] > 24.0) & (paused["item_time_s"] > 5.0)
    assert again.sum() > 500
    for axis in "xyz":
        name = f"load_asked_{axis}_m"
        expected = np.interp(
            paused["item_time_s"][again], plain["item_time_s"][in_plain], plain[name][in_plain]
        )
        assert paused[name][again] == pytest.approx(expected, abs=1e-4), axis
