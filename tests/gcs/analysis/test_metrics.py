"""Figures of synthetic flights, compared with values calculated by hand."""

from dataclasses import replace

import numpy as np
import pytest

from autopilot.trajectory.transfer import transfer
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items.records import WireItem
from gcs.analysis.metrics import clock_numbers
from gcs.analysis.record import FlightMeta, flight_record
from gcs.analysis.samples import CARRIED
from gcs.analysis.step import Step, find_step, step_response
from gcs.analysis.telemetry import telemetry_of
from gcs.analysis.tracks import ItemTrack
from tests.doubles import recorded_flights as flights
from tests.gcs import tolerances

HEIGHT = 0.25
OMEGA, ZETA = 5.0, 0.5
OMEGA_D = OMEGA * np.sqrt(1.0 - ZETA**2)


def second_order(t):
    """Unit step response of a second-order lag, zero before."""
    s = np.clip(t, 0.0, None)
    decay = np.exp(-ZETA * OMEGA * s)
    return 1.0 - decay * (np.cos(OMEGA_D * s) + ZETA * OMEGA / OMEGA_D * np.sin(OMEGA_D * s))


def finely(predicate):
    """First and last time at which the predicate of the exact response holds, on a grid of a microsecond."""
    t = np.arange(0.0, 4.0, 1e-6)
    held = np.flatnonzero(predicate(second_order(t)))
    return t[held[0]], t[held[-1]]


def record(flight, **meta):
    return flight_record(flight.telemetry(), FlightMeta(**meta))


@pytest.fixture(scope="module")
def step_record():
    path = flights.half_sine_step(HEIGHT, 0.78)

    def error(t):
        e = np.zeros((len(t), 3))
        e[:, 1] = HEIGHT * second_order(t) - path(t)[:, 1]
        return e

    return record(flights.flight(6.0, path, error))


def test_step_response_of_a_second_order_lag(step_record):
    assert step_record["step_height_m"] == pytest.approx(HEIGHT, rel=tolerances.WIRE_RELATIVE)
    rise, _ = finely(lambda y: y >= 0.9)
    assert step_record["rise_time_90_s"] == pytest.approx(rise, abs=tolerances.CROSSING_S)
    _, settled = finely(lambda y: np.abs(y - 1.0) > 0.05)
    assert step_record["settling_time_5pct_s"] == pytest.approx(settled, abs=tolerances.CROSSING_S)
    overshoot = 100.0 * np.exp(-np.pi * ZETA / np.sqrt(1.0 - ZETA**2))
    assert step_record["overshoot_pct"] == pytest.approx(overshoot, rel=tolerances.PEAK_RELATIVE)


def test_a_load_that_is_where_it_shall_be_rises_with_the_half_sine():
    found = record(flights.flight(4.0, flights.half_sine_step(HEIGHT, 0.78)))
    # (1 - cos(pi s)) / 2 = level
    assert found["rise_time_90_s"] == pytest.approx(
        0.78 * np.arccos(1.0 - 2.0 * 0.9) / np.pi, abs=tolerances.CROSSING_S
    )
    assert found["settling_time_5pct_s"] == pytest.approx(
        0.78 * np.arccos(1.0 - 2.0 * 0.95) / np.pi, abs=tolerances.CROSSING_S
    )
    assert found["overshoot_pct"] == pytest.approx(0.0, abs=tolerances.WIRE_RELATIVE * 100.0)
    assert found["load_error_max_m"] <= tolerances.WIRE_M


def test_the_first_sample_of_the_mission_need_not_be_the_first_of_the_step():
    rest = 1.5
    path = flights.half_sine_step(HEIGHT, 0.78)
    found = record(flights.flight(5.0, lambda t: path(t - rest)))
    assert found["rise_time_90_s"] == pytest.approx(
        0.78 * np.arccos(1.0 - 2.0 * 0.9) / np.pi, abs=tolerances.CROSSING_S
    )


def waypoint(duration_s, rest_s=0.0):
    """A move of 3 m along x from rest to rest, as between waypoints: it leaves rest with u^7."""

    def path(t):
        go = [transfer((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), duration_s, s)[0] for s in (t - rest_s).tolist()]
        return np.array(go)

    return path


@pytest.mark.parametrize("rest_s", [0.0, 1.5])
def test_a_move_to_a_waypoint_counts_from_where_it_leaves_rest(rest_s):
    """It has a hundredth of its peak speed only after 13 % of its time, from which rise and settling were
    counted."""
    duration = 4.0
    u = np.linspace(0.0, 1.0, 1_000_001)
    # transfer: from its definition, the integral of u^6 (1 - u)^6
    share = np.cumsum(u**6 * (1.0 - u) ** 6)
    share /= share[-1]
    found = record(flights.flight(6.5, waypoint(duration, rest_s)))
    assert found["step_height_m"] == pytest.approx(3.0, rel=tolerances.WIRE_RELATIVE)
    for key, level in (("rise_time_90_s", 0.9), ("settling_time_5pct_s", 0.95)):
        expected = duration * u[np.searchsorted(share, level)]
        assert found[key] == pytest.approx(expected, abs=flights.TICK_S + tolerances.CROSSING_S), key


def test_a_path_that_returns_has_no_step_response():
    out = waypoint(2.0)
    found = record(flights.flight(6.0, lambda t: out(t) - out(t - 3.0)))
    keys = ("step_height_m", "rise_time_90_s", "overshoot_pct", "settling_time_5pct_s")
    assert {key: found[key] for key in keys} == dict.fromkeys(keys)


def _ramp(t, begin, end):
    return np.clip((t - begin) / (end - begin), 0.0, 1.0)


T = np.arange(0.0, 4.0, 0.01)


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(np.zeros((len(T), 3)), id="rest"),
        pytest.param(np.stack((np.sin(T), 0 * T, 0 * T), axis=1), id="sine"),
        pytest.param(np.stack((_ramp(T, 1, 2), _ramp(T, 1, 2) ** 2, 0 * T), axis=1), id="bend"),
        pytest.param(np.stack((_ramp(T, 0.5, 1) + _ramp(T, 2, 2.5), 0 * T, 0 * T), axis=1), id="stairs"),
        pytest.param(np.stack((_ramp(T, 1, 2) - 0.3 * _ramp(T, 2, 3), 0 * T, 0 * T), axis=1), id="back"),
        pytest.param(np.stack((_ramp(T, 3, 4), 0 * T, 0 * T), axis=1), id="not held"),
        pytest.param(np.stack((_ramp(T, -1, 1), 0 * T, 0 * T), axis=1), id="moving at the start"),
        pytest.param(0.001 * np.stack((_ramp(T, 1, 2), 0 * T, 0 * T), axis=1), id="a millimetre"),
        pytest.param(np.full((len(T), 3), np.nan), id="unknown"),
    ],
)
def test_what_is_no_step(path):
    assert find_step(T, path, np.gradient(path, T, axis=0)) is None


def test_a_jump_is_a_step():
    path = np.zeros((len(T), 3))
    path[T >= 1.0] = (3.0, 4.0, 0.0)
    step = find_step(T, path, np.zeros_like(path))
    assert step.start_s == pytest.approx(1.0)
    assert step.height_m == pytest.approx(5.0)
    assert step.direction == pytest.approx((0.6, 0.8, 0.0))


def test_a_load_that_never_gets_there_has_no_times():
    step = Step(1.0, 1.0, np.zeros(3), np.array((1.0, 0.0, 0.0)))
    lazy = np.stack((0.5 * _ramp(T, 1, 4), 0 * T, 0 * T), axis=1)
    assert step_response(step, T, lazy)[1:] == (None, 0.0, None)
    assert step_response(step, T, np.full((len(T), 3), np.nan))[1:] == (None, 0.0, None)


def test_errors_of_a_known_error():
    flight = flights.flight(4.0, flights.still)
    mission = np.flatnonzero(flight.mission)
    flight.actual[mission] += (0.003, 0.0, -0.004)
    flight.actual[mission[: len(mission) // 2], 2] = flight.desired[mission[: len(mission) // 2], 2] + 0.004
    flight.actual[mission[-1]] = flight.desired[mission[-1]] + (0.0, 0.012, 0.0)
    flight.estimated = flight.actual + np.array((0.0, 0.0, 0.002))
    found = record(flight)
    n, half = len(mission), len(mission) // 2
    expected = {
        "load_error_max_m": 0.012,
        "load_error_rms_m": np.sqrt(((n - 1) * 0.005**2 + 0.012**2) / n),
        "load_error_final_m": 0.012,
        "load_error_max_x_m": 0.003,
        "load_error_max_y_m": 0.012,
        "load_error_max_z_m": 0.004,
        "load_error_rms_y_m": 0.012 / np.sqrt(n),
        "estimator_error_max_m": 0.002,
        "estimator_error_rms_m": 0.002,
        "estimated_load_error_max_m": np.hypot(0.012, 0.002),
        "estimated_load_error_rms_m": np.sqrt(
            ((half * (0.003**2 + 0.006**2)) + (n - 1 - half) * (0.003**2 + 0.002**2) + 0.012**2 + 0.002**2)
            / n
        ),
    }
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, abs=tolerances.WIRE_M), name
    assert found["samples"] == n == 500
    assert found["matched_fraction"] == 1.0
    assert found["gap_max_s"] == pytest.approx(flights.TICK_S, abs=tolerances.STAMP_S)


def test_a_pause_of_the_mission_is_no_gap():
    flight = flights.flight(4.0, flights.still)
    mission = np.flatnonzero(flight.mission)
    flight.phase[mission[100:300]] = mavlink.PLUMBLINE_PHASE_HOLD
    assert record(flight)["gap_max_s"] == pytest.approx(flights.TICK_S, abs=tolerances.STAMP_S)
    flight.drop = lambda i, kind: kind == "load_state" and mission[400] <= i < mission[410]
    assert record(flight)["gap_max_s"] == pytest.approx(11 * flights.TICK_S, abs=tolerances.STAMP_S)


def test_durations():
    flight = flights.flight(4.0, flights.still)
    found = record(flight, wall_s=2.0)
    assert found["mission_s"] == pytest.approx(4.0, abs=tolerances.STAMP_S)
    assert found["recorded_s"] == pytest.approx(flight.time_s[-1], abs=tolerances.STAMP_S)
    assert found["real_time_factor"] == pytest.approx(flight.time_s[-1] / 2.0)
    # from the first sample of tauten (at 0.5 s, between samples) to the last of set-down
    assert found["flight_s"] == pytest.approx(
        1.5 + 3.0 + 1.0 + 4.0 + 1.0 + 2.0 + 1.0, abs=2.0 * flights.TICK_S
    )


def test_a_setpoint_between_the_stamps_of_the_truth_is_a_cubic():
    def path(t):
        # from rest to rest, with three derivatives zero at both ends
        bump = np.sin(0.25 * np.pi * t) ** 4
        return np.stack((bump, -0.5 * bump, 0.0 * t), axis=1)

    flight = flights.flight(4.0, path)
    flight.drop = lambda i, kind: kind == "load_setpoint" and i % 3 != 0
    found = record(flight)
    # h^4/384 of the fourth derivative is 1e-8 m for h = 24 ms; the rounding of the messages is greater
    assert found["load_error_max_m"] <= 2.0 * tolerances.WIRE_M
    assert found["matched_fraction"] == 1.0


def test_a_silence_is_not_bridged():
    flight = flights.flight(4.0, lambda t: np.stack((t, 0 * t, 0 * t), axis=1))
    begin = np.flatnonzero(flight.mission)[100]
    flight.drop = lambda i, kind: kind == "load_setpoint" and begin <= i < begin + 125
    found = record(flight)
    # a phase counts for half a second after its message, 62 of the 125 samples; none of these has a position
    assert found["samples"] == 500 - 125 + 62
    assert found["matched_fraction"] == pytest.approx((500 - 125) / (500 - 125 + 62))


def test_saturation_and_cascade_count_over_the_mission_only():
    flight = flights.flight(4.0, flights.still)
    mission = np.flatnonzero(flight.mission)
    flight.saturated[: mission[0]] = 0b1111
    flight.saturated[mission[:125]] = 0b0100
    flight.psi_r[:] = 1.5
    flight.psi_q[:] = 1.5
    flight.psi_r[mission] = 0.125
    flight.psi_q[mission] = np.linspace(0.0, 0.25, len(mission))
    flight.force[mission[7]] = (0.25, 1.75, 1.0, 1.0)
    found = record(flight)
    assert found["saturated_fraction"] == pytest.approx(0.25)
    assert found["psi_R_max"] == 0.125
    assert found["psi_q_max"] == pytest.approx(0.25, rel=tolerances.WIRE_RELATIVE)
    assert found["rotor_force_min_n"] == 0.25
    assert found["rotor_force_max_n"] == 1.75


def test_slack_counts_while_the_load_is_carried():
    flight = flights.flight(4.0, flights.still)
    phase = flight.phase
    count = np.zeros(len(phase), dtype=int)

    def slack_at(index):
        count[index:] += 1

    slack_at(np.flatnonzero(phase == mavlink.PLUMBLINE_PHASE_TAUTEN)[3])
    slack_at(np.flatnonzero(phase == mavlink.PLUMBLINE_PHASE_LIFT)[3])
    slack_at(np.flatnonzero(flight.mission)[3])
    slack_at(np.flatnonzero(flight.mission)[40])
    slack_at(np.flatnonzero(phase == mavlink.PLUMBLINE_PHASE_HOLD)[-3])
    slack_at(np.flatnonzero(phase == mavlink.PLUMBLINE_PHASE_LOWER)[9])
    flight.slack_events = (65534 + count) % 65536  # the counter wraps while the load is carried
    assert record(flight)["slack_events"] == 3


BLOW, CALM = (5.0, 0.0, 0.0), (0.0, 0.0, 0.0)


def gusty(back_s):
    """Ten seconds of hovering, 0.2 m off between one second and `back_s` after the beginning."""
    begin = flights.BEFORE_S

    def error(t):
        off = (t >= 1.0 - 1e-9) & (t < back_s - 1e-9)
        return np.where(off, 0.2, 0.01)[:, None] * np.array((0.0, 1.0, 0.0))

    flight = flights.flight(10.0, flights.still, error)
    flight.winds = [(0.0, CALM), (begin + 1.0, BLOW), (begin + 1.2, BLOW), (begin + 3.0, CALM)]
    return flight


def test_a_gust_and_what_came_of_it():
    found = record(gusty(4.5))
    assert found["gusts"] == 1
    assert found["gust_error_max_m"] == pytest.approx(0.2, abs=tolerances.WIRE_M)
    # from 3.0 s to the last sample before 4.5 s
    assert found["gust_recovery_50mm_s"] == pytest.approx(1.5 - flights.TICK_S, abs=flights.TICK_S)


def test_a_gust_that_did_not_take_the_load_along():
    flight = gusty(0.0)
    assert record(flight)["gust_recovery_50mm_s"] == 0.0
    flight.winds = []
    found = record(flight)
    assert (found["gusts"], found["gust_error_max_m"], found["gust_recovery_50mm_s"]) == (0, None, None)


def test_a_gust_without_recovery_has_no_time_of_recovery():
    flight = gusty(1e3)
    found = record(flight)
    assert (found["gusts"], found["gust_recovery_50mm_s"]) == (1, None)


def test_a_gust_that_is_not_over_while_the_load_is_carried_does_not_count():
    flight = gusty(4.5)
    flight.winds = flight.winds[:3]
    assert record(flight)["gusts"] == 0


def test_the_longest_recovery_of_two_gusts():
    flight = gusty(4.5)
    begin = flights.BEFORE_S
    flight.winds += [(begin + 5.0, BLOW), (begin + 6.0, CALM)]
    found = record(flight)
    assert found["gusts"] == 2
    assert found["gust_recovery_50mm_s"] == pytest.approx(1.5 - flights.TICK_S, abs=flights.TICK_S)


def test_snaps_from_takeoff_to_touchdown():
    flight = flights.flight(4.0, flights.still)
    taken_off = flight.time_s[np.flatnonzero(flight.phase == mavlink.PLUMBLINE_PHASE_TAUTEN)[5]]
    lifted = flight.time_s[np.flatnonzero(flight.phase == mavlink.PLUMBLINE_PHASE_LIFT)[5]]
    flight.snaps = [(0.01, 9.0, 9.0), (taken_off, 0.25, 0.125), (lifted, 0.125, 0.0625)]
    after = np.flatnonzero(flight.time_s > lifted)
    flight.tension[after[10]] = 1.75
    flight.tension[after[100]] = 7.0  # 0.8 s later
    found = record(flight)
    assert (found["snaps"], found["snap_speed_max_m_s"], found["snap_impulse_max_n_s"]) == (2, 0.25, 0.125)
    assert found["snap_tension_max_n"] == 1.75


def test_tilt_swing_and_tension():
    flight = flights.flight(4.0, flights.still)
    i = np.flatnonzero(flight.mission)[17]
    angle = np.radians(20.0)
    flight.quat[i] = (np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0)
    flight.q_cable[i] = (0.0, np.sin(2 * angle), -np.cos(2 * angle))
    flight.tension[i] = 2.5
    flight.tension[i + 1] = 0.25
    found = record(flight)
    assert found["tilt_max_deg"] == pytest.approx(20.0, rel=tolerances.WIRE_RELATIVE)
    assert found["swing_max_deg"] == pytest.approx(40.0, rel=tolerances.WIRE_RELATIVE)
    assert (found["tension_min_n"], found["tension_max_n"]) == (0.25, 2.5)


def test_a_hover_without_a_mission_phase_is_judged_while_it_holds():
    flight = flights.flight(4.0, flights.still, lambda t: np.full((len(t), 3), (0.002, 0.0, 0.0)))
    flight.phase[flight.mission] = mavlink.PLUMBLINE_PHASE_HOLD
    found = record(flight)
    assert found["load_error_max_m"] == pytest.approx(0.002, abs=tolerances.WIRE_M)
    assert found["mission_s"] is None


def test_an_attitude_run_has_no_load_position_error():
    flight = flights.flight(4.0, flights.half_sine_step(HEIGHT, 0.5))
    flight.control_mode[flight.mission] = mavlink.PLUMBLINE_CONTROL_QUAD_ATTITUDE
    flight.psi_r[flight.mission] = 0.125
    found = record(flight)
    assert found["load_error_max_m"] is None
    assert found["step_height_m"] is None
    assert (found["psi_R_max"], found["psi_q_max"]) == (0.125, None), "the mode does not define the latter"


def test_the_heartbeat_tells_of_the_landing_before_the_phase():
    flight = flights.flight(4.0, flights.still)
    flight.phase[flight.phase == mavlink.PLUMBLINE_PHASE_DISARMED] = mavlink.PLUMBLINE_PHASE_SET_DOWN
    aloft = flight.telemetry()
    modes = aloft.heartbeat.base_mode.copy()
    modes[-1] = 0
    landed = replace(aloft, heartbeat=replace(aloft.heartbeat, base_mode=modes))
    found = [flight_record(one, FlightMeta())["outcome"] for one in (aloft, landed)]
    assert found == ["incomplete", "completed"]


@pytest.mark.parametrize(
    ("after", "outcome"),
    [(mavlink.PLUMBLINE_PHASE_LOWER, "completed"), (mavlink.PLUMBLINE_PHASE_SET_DOWN, "incomplete")],
)
def test_a_flight_that_takes_off_and_lands_and_nothing_else_is_completed_if_it_lifted_the_load(
    after, outcome
):
    flight = flights.flight(4.0, flights.still)
    landing = flight.phase > mavlink.PLUMBLINE_PHASE_MISSION
    flight.phase[np.isin(flight.phase, CARRIED)] = mavlink.PLUMBLINE_PHASE_TAUTEN
    flight.phase[landing] = after
    flight.phase[-40:] = mavlink.PLUMBLINE_PHASE_DISARMED
    assert record(flight)["outcome"] == outcome


def test_the_figures_of_a_failure():
    """The setpoint of a load that is set down goes on into the ground: that is no error."""
    flight = flights.landing_after_a_failure(0.03)
    found = record(flight)
    assert found["failure_s"] == pytest.approx(flight.texts[-1][0], abs=0.02)
    assert found["load_error_max_m"] == pytest.approx(0.0, abs=1e-6)
    assert found["failure_error_max_m"] == pytest.approx(0.03, abs=1e-6)
    assert found["outcome"] == "interrupted"


def test_a_flight_that_cannot_continue_ends_with_that_report_whatever_its_phase():
    """All rotors are needed: the vehicle falls while its phase is still MISSION."""
    flight = flights.flight(4.0, flights.still)
    mission = np.flatnonzero(flight.mission)
    failed = mission[len(mission) // 2]
    failed_s = float(flight.time_s[failed])
    flight.actual[failed + 1 :, 2] -= 0.5
    flight.psi_r[: failed + 1], flight.psi_r[failed + 1 :] = 0.125, 2.0
    flight.slack_events[failed + 1 :] += 1
    flight.texts.append((failed_s, 0, "Failsafe: rotor 1 lost, the others cannot fly it"))
    found = record(flight, outcome="diverged")
    begins_s = float(flight.time_s[mission[0]])
    assert found["failure_s"] == pytest.approx(failed_s, abs=0.02)
    assert found["load_error_max_m"] == pytest.approx(0.0, abs=1e-6)
    assert found["psi_R_max"] == 0.125
    assert found["slack_events"] == 0
    assert found["mission_s"] == pytest.approx(failed_s - begins_s, abs=2.0 * flights.TICK_S)
    airborne_s = float(flight.time_s[np.flatnonzero(flight.phase == mavlink.PLUMBLINE_PHASE_TAUTEN)[0]])
    assert found["flight_s"] == pytest.approx(failed_s - airborne_s, abs=2.0 * flights.TICK_S)


@pytest.mark.parametrize("change", ["no text", "before the mission ends"])
def test_what_is_no_failure(change):
    flight = flights.landing_after_a_failure(0.03)
    time_s, severity, text = flight.texts.pop()
    if change == "before the mission ends":
        flight.texts.append((time_s - 2.0, severity, text))
    found = record(flight)
    assert (found["failure_s"], found["failure_error_max_m"]) == (None, None)
    assert found["outcome"] == "completed"


@pytest.mark.parametrize(
    ("phases", "error_m", "outcome"),
    [
        (None, 0.0, "completed"),
        ((5, 9), 0.0, "diverged"),
        ((8, 5), 0.0, "incomplete"),
        (None, 6.0, "completed"),  # of a receiver's bias
        (None, np.nan, "diverged"),
    ],
)
def test_outcomes(phases, error_m, outcome):
    flight = flights.flight(2.0, flights.still)
    if phases:
        before, instead = phases
        flight.phase[flight.phase >= before] = instead
        flight.phase[-40:] = instead
    flight.actual[np.flatnonzero(flight.mission)[-50:]] += error_m
    assert record(flight)["outcome"] == outcome
    assert record(flight, outcome="aborted")["outcome"] == "aborted"


@pytest.mark.parametrize(
    ("when", "severity", "outcome"),
    [("mission", 2, "diverged"), ("mission", 4, "completed"), ("ground", 2, "completed")],
)
def test_a_flight_in_which_something_critical_was_told_in_the_air_is_lost(when, severity, outcome):
    flight = flights.flight(2.0, flights.still)
    told_s = float(flight.time_s[np.flatnonzero(flight.mission)[20]]) if when == "mission" else 0.1
    flight.texts.append((told_s, severity, "Law L failed: landing by law plumbline"))
    assert record(flight)["outcome"] == outcome
    telemetry = flight.telemetry()
    setpoint = telemetry.setpoint
    observed = replace(setpoint, elapsed_s=np.full_like(setpoint.elapsed_s, np.nan))
    of_firmware = flight_record(replace(telemetry, setpoint=observed), FlightMeta())
    assert of_firmware["outcome"] == "completed"


@pytest.mark.parametrize(
    ("items", "landing_item", "outcome"),
    [(3, 2, "completed"), (3, 1, "interrupted"), (0, 0, "completed")],
)
def test_a_flight_that_landed_before_its_last_item_was_interrupted(items, landing_item, outcome):
    flight = flights.flight(2.0, flights.still)
    telemetry = flight.telemetry()
    item = telemetry.setpoint.item.copy()
    item[telemetry.setpoint.phase > mavlink.PLUMBLINE_PHASE_MISSION] = landing_item
    none_reached = ItemTrack(np.empty(0), np.empty(0, dtype=np.int64))
    telemetry = replace(
        telemetry,
        setpoint=replace(telemetry.setpoint, item=item),
        mission=tuple(WireItem(*range(len(WireItem._fields))) for _ in range(items)),
        mission_reached=none_reached,
    )
    assert flight_record(telemetry, FlightMeta())["outcome"] == outcome
    reached = replace(
        telemetry, mission_reached=ItemTrack(telemetry.setpoint.time_s[-400:-399], np.array([2]))
    )
    assert flight_record(reached, FlightMeta())["outcome"] == "completed"


def test_lateness_is_known_in_real_time_only():
    flight = flights.flight(2.0, flights.still)
    found = record(flight)
    assert found["rate_hz"] is None
    assert found["late_p99_us"] is None
    assert found["missed_ticks"] == 0


def test_the_clock_is_judged_by_its_worst_second():
    writer = FrameWriter(1, 26)
    rates, late = (249.0, 251.0, 250.0), (300, 900, 500)
    statuses = [
        mavlink.MAVLink_sim_status_message(i, 1.0, rate, us // 3, us, 2 * us, i, 0, 0)
        for i, (rate, us) in enumerate(zip(rates, late, strict=True))
    ]
    records = [decode(writer.frame(status))[0][0] for status in statuses]
    assert clock_numbers(telemetry_of((0, received) for received in records)) == {
        "rate_hz": 250.0,
        "late_p50_us": 300,
        "late_p99_us": 900,
        "late_max_us": 1800,
        "missed_ticks": 2,
    }
