"""Rotors with different lags, commanded so that all follow with the same lag."""

from __future__ import annotations

import math

import numpy as np
import pytest

from autopilot.control.actuators.lag_equalisation import equalise_lags, with_lag_columns
from autopilot.control.actuators.mixer import FORCE, new_rotors
from autopilot.control.actuators.rotor_model import actuation_constants
from autopilot.vehicle.layout import PLUS
from autopilot.vehicle.rotors import mixer_table

PERIOD, TAU = 4e-3, 0.03
FACTORS = (1.0, 2.0, 0.5, 0.0)
UNLIKE = tuple(rotor._replace(lag=factor) for rotor, factor in zip(PLUS, FACTORS, strict=True))
ACTUATION = actuation_constants(0.0, TAU, PERIOD)


def flown(layout, wanted, limited, vehicle):
    """Forces that rotors with their own lags give, tick by tick, and the commanded forces."""
    table, rotors, gives = (
        with_lag_columns(mixer_table(layout), layout, ACTUATION),
        new_rotors(),
        np.zeros(len(layout)),
    )
    found, asked = [], []
    for force in wanted:
        rotors[FORCE, : len(layout)] = force
        equalise_lags(rotors, table, vehicle, limited)
        command = rotors[FORCE, : len(layout)].copy()
        kept = np.array([math.exp(-PERIOD / (r.lag * TAU)) if r.lag else 0.0 for r in layout])
        gives = command + kept * (gives - command)
        found.append(gives)
        asked.append(command)
    return np.array(found), np.array(asked)


def test_all_lag_as_the_one_that_is_told(bebop):
    wanted = 1.0 + 0.05 * np.sin(0.1 * np.arange(200))
    found, _ = flown(UNLIKE, wanted, 0.0, bebop)
    alike, kept = np.zeros(200), math.exp(-PERIOD / TAU)
    for k in range(200):
        alike[k] = wanted[k] + kept * ((alike[k - 1] if k else 0.0) - wanted[k])
    assert found == pytest.approx(np.repeat(alike[:, None], 4, axis=1), abs=1e-12)


def test_limits_are_kept_and_made_up_for(bebop):
    """A slow rotor cannot be commanded beyond its greatest force; it reaches the wanted force
    nevertheless."""
    found, asked = flown(UNLIKE, np.full(300, 1.9), 1.0, bebop)
    assert asked.max() <= bebop.rotor_max
    assert asked.min() >= bebop.rotor_min
    assert found[-1] == pytest.approx(np.full(4, 1.9), abs=1e-6)


def test_rotors_that_are_alike_are_asked_for_what_is_wanted(bebop):
    wanted = [0.3, 1.7, 0.1]
    _, asked = flown(PLUS, wanted, 1.0, bebop)
    assert (asked == np.repeat(np.array(wanted)[:, None], 4, axis=1)).all()
