"""For any command the plant gives finite numbers, the same ones compiled and in plain Python."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.plant.by_value import advance, advance_many, initial_state

CALM = (0.0, 0.0, 0.0)
ROOT = Path(__file__).resolve().parents[3]

# flies through every mode and prints the bits of where it arrives
SCRIPT = """
import json, sys
from sitl.plant import step
from sitl.plant.by_value import advance, initial_state
from sitl.vehicles.truth import load_truth

def numbers(value):
    return [value] if isinstance(value, float) else [n for part in value for n in numbers(part)]

truth = load_truth("bebop")
state = initial_state(truth)._replace(x_quad=(-0.35, 0.0, 0.08), omega_body=(0.05, 0.02, -0.1))
seen, lines = set(), []

def fly(state, lift, ticks):
    command = (lift, lift * 0.9999, lift, lift * 1.0002)
    for _ in range(ticks):
        state = advance(state, truth, command, (0.2, 0.1, 0.0), 4e-3)
        seen.add((state.taut, state.load_on_ground))
        lines.append([number.hex() for number in numbers(tuple(state))])
    return state

# lands and takes off with the load
fly(fly(state, 0.0, 10), 1.9, 120)
# above a load that stays on the ground
above = state._replace(
    x_quad=(0.0, 0.0, 0.72), q_cable=(0.0, 0.0, -1.0), omega_body=(0.0, 0.0, 0.0), taut=1.0,
    rotor_force=(1.1,) * 4,
)
fly(above, 1.1, 20)
# thrown upwards with the rotors stopping, so that the cable goes slack, and caught
thrown = above._replace(
    x_load=(0.0, 0.0, 9.0), x_quad=(0.0, 0.0, 9.7), v_load=(0.0, 0.0, 5.0), v_quad=(0.0, 0.0, 5.0)
)
fly(fly(thrown, 0.0, 40), 1.9, 40)
json.dump({"jit": hasattr(step.advance, "py_func"), "modes": sorted(seen), "bits": lines}, sys.stdout)
"""


def _numbers(value):
    return [value] if isinstance(value, float) else [n for part in value for n in _numbers(part)]


def _all_finite(state):
    return all(math.isfinite(n) for n in _numbers(tuple(state)))


def test_machine_code_and_plain_python_agree_to_the_bit():
    records = []
    for disabled in ("0", "1"):
        environment = {**os.environ, "NUMBA_DISABLE_JIT": disabled}
        run = subprocess.run(
            [sys.executable, "-c", SCRIPT],
            cwd=ROOT,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        records.append(json.loads(run.stdout))
    jitted, plain = records
    assert (jitted["jit"], plain["jit"]) == (True, False)
    assert jitted["modes"] == plain["modes"]
    # slack and taut, each in the air and with the load on the ground
    assert plain["modes"] == [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]]
    assert jitted["bits"] == plain["bits"]


@settings(max_examples=60)
@given(commands=st.lists(st.tuples(*[st.floats(-1e3, 1e3)] * 4), min_size=1, max_size=12))
@pytest.mark.parametrize("name", ["bebop", "thesis"])
def test_no_command_makes_the_state_infinite(name, commands, request):
    truth = request.getfixturevalue(name)
    state = initial_state(truth)
    for command in commands:
        state = advance_many(state, truth, command, (10.0, -10.0, 3.0), 4e-3, 25)
        assert _all_finite(state)
        assert math.hypot(*state.quat_wxyz) == pytest.approx(1.0, abs=1e-9)


def test_one_sided_full_thrust_tumbles_within_bounds(bebop, aloft):
    state = aloft(bebop, height=2000.0)
    for _ in range(1500):
        state = advance(state, bebop, (1.96, 1.96, 0.0, 0.0), CALM, 4e-3)
        assert _all_finite(state)
    assert state.diverged == 0.0
    assert 20.0 < math.hypot(*state.omega_body) < 120.0


def test_tumbling_into_the_ground_under_full_thrust_stays_finite(bebop):
    state = initial_state(bebop)
    for _ in range(2500):
        state = advance(state, bebop, (1.96, 0.0, 0.0, 1.96), CALM, 4e-3)
        assert _all_finite(state)
        assert state.x_quad[2] > -0.1
    assert state.diverged == 0.0


def test_diverged_is_a_value_and_stays(thesis, aloft):
    state = aloft(thesis)
    while not state.diverged:
        before, state = state, advance(state, thesis, (1e3, 0.0, 0.0, 0.0), CALM, 4e-3)
    assert _all_finite(state)
    assert state._replace(diverged=0.0) == before
    assert advance(state, thesis, (1.0,) * 4, CALM, 4e-3) == state


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_infinite_commands_and_wind_diverge_and_do_not_spread(thesis, aloft, bad):
    start = aloft(thesis)
    for command, wind in (((bad, 1.0, 1.0, 1.0), CALM), ((1.0,) * 4, (bad, 0.0, 0.0))):
        state = advance(start, thesis._replace(quad_drag=0.1), command, wind, 4e-3)
        assert state.diverged == 1.0
        assert state._replace(diverged=0.0) == start


def test_the_load_may_pass_through_the_vehicle(thesis):
    """Where both meet the cable has no direction: the last one is kept."""
    start = initial_state(thesis)._replace(x_quad=(0.0, 0.0, 50.0), x_load=(0.0, 0.0, 50.0))
    state = advance(start, thesis, (0.0,) * 4, CALM, 4e-3)
    assert state.q_cable == start.q_cable
    assert _all_finite(state)


def test_a_step_of_nothing_changes_nothing(bebop, aloft):
    start = aloft(bebop, q=(0.3, 0.1, -1.0), q_dot=(1.0, 0.0, 0.0))
    state = advance(start, bebop, (1.0,) * 4, CALM, 0.0)
    for field in ("x_load", "v_load", "x_quad", "v_quad", "quat_wxyz", "omega_body", "rotor_force"):
        assert getattr(state, field) == pytest.approx(getattr(start, field), abs=1e-14), field


def test_a_long_step_is_divided(bebop, aloft):
    start = aloft(bebop, q=(0.3, 0.1, -1.0), rotor_force=(1.2,) * 4)
    command = (1.3, 1.2, 1.2, 1.2)
    long = advance(start, bebop, command, CALM, 20e-3)
    short = advance_many(start, bebop, command, CALM, 4e-3, 5)
    for field in ("x_load", "v_load", "x_quad", "v_quad", "quat_wxyz", "omega_body", "rotor_force"):
        assert getattr(long, field) == pytest.approx(getattr(short, field), abs=1e-12), field
