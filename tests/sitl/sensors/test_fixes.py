"""Fixes that float and fixes that are lost: how often, how long, how wrong, and how HIL_GPS reports them."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest

from autopilot.wire.dialect import plumbline as mavlink
from sitl.hil import HilSimulator
from sitl.sensors.files import parse_profile
from sitl.sensors.gnss import FIXED, FLOATING, LOST
from sitl.sensors.shipped import ProfileError

SIGMAS = 4.0  # suspicious distance of a statistic from its expectation, in its own standard errors
LYING = (0.0, 0.0, 0.0, 0.0)


def qualities(flown, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Quality and position of each fix."""
    found = []
    for _ in range(round(seconds * 1e6 / flown.settings.tick_us)):
        found += [(m.reading.quality, m.reading.position) for m in flown.tick(LYING).gnss]
    return np.array([q for q, _ in found]), np.array([p for _, p in found])


def spells(flags: np.ndarray) -> np.ndarray:
    """Lengths of the runs of True."""
    edges = np.diff(np.concatenate([[0], flags.astype(int), [0]]))
    return np.flatnonzero(edges == -1) - np.flatnonzero(edges == 1)


def test_fixes_float_as_often_and_as_long_as_stated(core) -> None:
    flown = core("rtk", SIM_GPS_FLT=12.0, SIM_GPS_FLT_S=2.0, SIM_GPS_FLT_M=0.3, SIM_RATE_HZ=100)
    quality, places = qualities(flown, 1400.0)
    assert set(quality) == {FIXED, FLOATING}
    floats = spells(quality == FLOATING)
    # every 5 s of a fix, for 2 s: once in 7 s
    assert len(floats) == pytest.approx(200, abs=SIGMAS * sqrt(200))
    assert floats.mean() * 0.1 == pytest.approx(2.05, abs=SIGMAS * 2.0 / sqrt(len(floats)))
    wrong = places - flown.state.x_quad
    assert wrong[quality == FIXED].std() < 0.03
    # correlated over a minute: some twenty independent numbers on each axis
    assert wrong[quality == FLOATING].std() == pytest.approx(0.3, rel=SIGMAS / sqrt(2 * 60))


def test_a_lost_fix_comes_back_floating(core) -> None:
    flown = core("rtk", SIM_GPS_LOST=20.0, SIM_GPS_LOST_S=1.0, SIM_GPS_FLT_S=2.0, SIM_RATE_HZ=100)
    quality, _ = qualities(flown, 472.0)
    lost = spells(quality == LOST)
    # every 3 s of a fix, floating or not, for 1 s
    assert len(lost) == pytest.approx(472.0 / 4.0, abs=SIGMAS * sqrt(118))
    assert lost.mean() * 0.1 == pytest.approx(1.05, abs=SIGMAS / sqrt(len(lost)))
    after = quality[1:][(quality[:-1] == LOST) & (quality[1:] != LOST)]
    # unless it takes less than a period to settle
    assert np.mean(after == FLOATING) > 0.85


def test_a_plain_receiver_never_floats(core) -> None:
    quality, _ = qualities(core("gps", SIM_GPS_FLT=60.0, SIM_GPS_LOST=60.0, SIM_RATE_HZ=100), 60.0)
    assert set(quality) == {FIXED, LOST}
    text = 'description = "x"\n[imu]\naccel_noise_m_s2 = 0\ngyro_noise_rad_s = 0\n[gnss]\nfix = "3d"\n'
    text += "rate_hz = 5\nhorizontal_noise_m = 1\nvertical_noise_m = 1\nhorizontal_velocity_noise_m_s = 1\n"
    text += "vertical_velocity_noise_m_s = 1\n"
    assert parse_profile(text, "x.toml").gnss is not None
    with pytest.raises(ProfileError, match="float_per_min"):
        parse_profile(text + "float_per_min = 1", "x.toml")


def test_what_hil_gps_says(answerer, messages) -> None:
    settings = {"SIM_GPS_FLT": 60.0, "SIM_GPS_FLT_S": 0.5, "SIM_GPS_FLT_M": 0.25, "SIM_GPS_LOST": 60.0}
    simulator = HilSimulator.build(sensors="rtk", settings=settings | {"SIM_GPS_LOST_S": 0.3})
    sent = answerer(LYING).fly(simulator, 5000)
    fixes = [m for datagram in sent for m in messages(datagram) if m.get_type() == "HIL_GPS"]
    told = {m.fix_type: (m.eph, m.epv) for m in fixes}
    assert told.keys() == {
        mavlink.GPS_FIX_TYPE_NO_FIX,
        mavlink.GPS_FIX_TYPE_RTK_FLOAT,
        mavlink.GPS_FIX_TYPE_RTK_FIXED,
    }
    assert told[mavlink.GPS_FIX_TYPE_RTK_FLOAT] == (25, 25)
    assert told[mavlink.GPS_FIX_TYPE_RTK_FIXED] == (1, 2)
    assert min(told[mavlink.GPS_FIX_TYPE_NO_FIX]) >= 65534
