"""The world in kernels against the world of the simulator: the same bits."""

from __future__ import annotations

import numpy as np
import pytest

from gcs.sweep.world import READING, SHOWS, arrived, new_world, tick
from sitl.sensors.files import load_profile
from sitl.sim_core import SimCore, settings_of
from sitl.vehicles.sim_parameters import apply, sim_parameters
from sitl.vehicles.truth import load_truth

TICKS = 600
ROUGH = {
    "SIM_ACT_DELAY_MS": 13.0,
    "SIM_SENS_LAT_MS": 7.0,
    "SIM_DROP_PCT": 10.0,
    "SIM_GUST_STD": 1.0,
    "SIM_WIND_N": 2.0,
    "SIM_NOISE_SCALE": 2.0,
}


@pytest.mark.parametrize(
    ("sensors", "settings"),
    [("lab", {}), ("ideal", {}), ("lab", ROUGH), ("rtk", ROUGH), ("gps", {"SIM_RATE_HZ": 500.0})],
)
def test_same_states_and_readings_as_the_simulator(sensors: str, settings: dict[str, float]) -> None:
    truth = load_truth("bebop")
    table = sim_parameters(truth)
    for name, value in settings.items():
        table.set(name, value)
    truth, profile = apply(truth, table), load_profile(sensors)
    core = SimCore(truth, profile, settings_of(table), 3)
    world, model, buffers = new_world(truth, profile, settings_of(table), 3)
    rng = np.random.default_rng(1)
    counted = 0
    for _ in range(TICKS):
        for sensor, readings in enumerate(core.readings):
            for measurement in readings:
                row = buffers.queue[sensor, arrived(sensor, world.now_us, buffers)]
                found = np.hstack([np.ravel(part) for part in measurement.reading])
                assert row[SHOWS] == measurement.time_us
                assert np.array_equal(row[READING : READING + len(found)], found, equal_nan=True)
                counted += 1
            assert arrived(sensor, world.now_us, buffers) == -1
        # from just below hovering to just above: it hops
        a, b, c, d = rng.uniform(1.0, 1.8, 4).tolist()
        core.tick((a, b, c, d))
        world = tick(world, (a, b, c, d), model, buffers)
        assert world.plant == core.state
    assert counted > TICKS, "hardly a reading was compared"
    assert core.state.x_quad[2] > 0.3, "it never flew"
