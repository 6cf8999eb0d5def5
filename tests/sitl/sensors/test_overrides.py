"""The numbers of a profile that parameters replace."""

from __future__ import annotations

import numpy as np
import pytest

from autopilot.geometry.packed import field_offset
from sitl.sensors.files import load_profile
from sitl.sensors.overrides import OVERRIDDEN_KEYS, with_overrides
from sitl.sensors.shipped import PROFILES
from sitl.sensors.vibration import VibrationConfig
from sitl.settings import settings_of
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import load_truth
from sitl.world import WorldModel

TRUTH = load_truth("bebop")


@pytest.mark.parametrize("name", OVERRIDDEN_KEYS)
def test_a_parameter_takes_the_place_of_a_number_and_minus_one_leaves_it(name: str) -> None:
    table = sim_parameters(TRUTH)
    assert table[name] == -1.0
    for profile in (load_profile("lab-real"), load_profile("field")):
        assert with_overrides(profile, settings_of(table).overrides) == profile
        for value in (0.0, 0.25):
            changed = with_overrides(profile, ((name, value),))
            for one in OVERRIDDEN_KEYS[name]:
                for part in one.tables:
                    if getattr(profile, part) is not None:
                        assert getattr(getattr(changed, part), one.key) == value * one.factor
                    else:
                        assert getattr(changed, part) is None
    table.set(name, 0.0)
    assert settings_of(table).overrides == ((name, 0.0),)


def test_every_number_of_every_parameter_is_a_key_of_the_profile() -> None:
    lab, field = load_profile("lab-real"), load_profile("field")
    for keys in OVERRIDDEN_KEYS.values():
        for one in keys:
            for part in one.tables:
                table = getattr(lab, part) or getattr(field, part)
                assert one.key in type(table).model_fields


def test_zeros_everywhere_are_a_profile_that_flies(core) -> None:
    forces = (1.5, 1.5, 1.5, 1.5)
    nothing = {name: 0.0 for name in OVERRIDDEN_KEYS if name not in ("SIM_ACC_NOISE", "SIM_GYR_NOISE")}
    for name, plain in (("lab-real", "lab"), ("field", "rtk")):
        latency = f"[imu]\nlatency_ms = {load_profile(name).imu.latency_ms}\n"
        text = PROFILES.read(plain).text.replace("[imu]\n", latency)
        flown, other = core(name, **nothing), core(text)
        for _ in range(50):
            inertial, expected = flown.tick(forces).imu, other.tick(forces).imu
            assert inertial == expected


def test_vibration_can_be_changed_in_flight(core) -> None:
    flown = core("lab")
    before = flown.rows.model.copy()
    table = sim_parameters(TRUTH)
    table.set("SIM_VIB_ACC", 3.0)
    flown.retune(flown.truth, settings_of(table))
    (changed,) = np.flatnonzero(~((flown.rows.model == before) | np.isnan(before)))
    assert changed == field_offset(WorldModel, "vibration") + field_offset(VibrationConfig, "accel")
    assert (before[changed], flown.rows.model[changed]) == (0.0, 3.0)
