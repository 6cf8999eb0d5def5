"""Profiles: the shipped ones are sound, and a wrong one gets one line that says what is wrong."""

from __future__ import annotations

from math import isnan, sqrt

import pytest

from sitl.sensors.files import load_profile, parse_profile
from sitl.sensors.profile import reported_std
from sitl.sensors.shipped import PROFILES, ProfileError

GOOD = """
description = "test"
[imu]
accel_noise_m_s2 = 0.0
gyro_noise_rad_s = 0
[mocap]
rate_hz = 200
position_noise_m = 0.001
attitude_noise_rad = 0.001
"""


def test_shipped_profiles() -> None:
    assert PROFILES.names() == ("field", "gps", "ideal", "lab", "lab-blind", "lab-real", "rtk", "rtk-blind")
    for name in PROFILES.names():
        profile = load_profile(name)
        assert profile.description
        # a sensor must locate the vehicle and one the load, except in the blind profiles
        assert profile.mocap or profile.gnss
        sees = profile.load_tracker or profile.cable_sensor
        assert bool(sees) == (not name.endswith("-blind"))


def test_lab_is_what_it_is_called() -> None:
    lab = load_profile("lab")
    assert lab.mocap is not None
    assert lab.load_tracker is not None
    for tracker in (lab.mocap, lab.load_tracker):
        assert (tracker.rate_hz, tracker.latency_ms, tracker.position_noise_m) == (200.0, 4.0, 0.001)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("rate_hz = 200", "rate_hz = 0", "mocap.rate_hz = 0; must be > 0 and at most 20000"),
        ("rate_hz = 200", "rate_hz = inf", "mocap.rate_hz = inf; must be > 0 and at most 20000"),
        ("rate_hz = 200", "rate_hz = nan", "mocap.rate_hz = nan; must be > 0 and at most 20000"),
        (
            "rate_hz = 200",
            'rate_hz = "often"',
            'mocap.rate_hz = "often"; must be a number > 0, or "tick" (a reading at every tick)',
        ),
        ("rate_hz = 200", "", "mocap.rate_hz is missing"),
        ("rate_hz = 200", "rate_hz = 200\nrate = 3", "mocap.rate: unknown key; write rate_hz (in hertz)"),
        ("_m = 0.001", "_m = -1", "mocap.position_noise_m = -1; must be >= 0 and <= 1e+06"),
        ("_m = 0.001", "_m = nan", "mocap.position_noise_m = nan; must be a finite number"),
        ("_m = 0.001", '_m = "1 mm"', 'mocap.position_noise_m = "1 mm"; must be a number'),
        ("_m = 0.001", "_m = true", "mocap.position_noise_m = true; must be a number"),
        ("rate_hz = 200", "rate_hz = 200\nloss = 1.5", "mocap.loss = 1.5; must be >= 0 and <= 1"),
        ("[mocap]", "[mocup]", "mocup: unknown key; write mocap"),
        (
            "[imu]",
            "[gnss]\n[imu]",
            "; ".join(
                f"sitl/sensors/foo.toml: gnss.{key} is missing"
                for key in ("rate_hz", "fix", "horizontal_noise_m", "vertical_noise_m")
            ),
        ),
        ('description = "test"', "description = 3", "description = 3; must be a text in quotes"),
        ('description = "test"', 'description = "test"\nmocap = 3', "not TOML: "),
        ("[mocap]", "[mocap", "not TOML: "),
    ],
)
def test_what_is_wrong_is_said_in_one_line(old: str, new: str, complaint: str) -> None:
    parse_profile(GOOD, "good.toml")
    with pytest.raises(ProfileError) as error:
        parse_profile(GOOD.replace(old, new), "sitl/sensors/foo.toml")
    text = str(error.value)
    assert text.startswith("sitl/sensors/foo.toml:")
    assert complaint in text
    assert "\n" not in text


def test_imu_must_be_there() -> None:
    with pytest.raises(ProfileError, match=r"x\.toml: imu is missing"):
        parse_profile('description = "blind"', "x.toml")


def test_something_must_tell_where_the_vehicle_is() -> None:
    with pytest.raises(ProfileError, match=r"^x\.toml: has neither mocap nor gnss; one of them must tell "):
        parse_profile(GOOD[: GOOD.index("[mocap]")], "x.toml")


def test_choice_names_what_is_allowed() -> None:
    text = GOOD + '[cable_sensor]\nkind = "sonar"\nrate_hz = 30\ndirection_noise_rad = 0\n'
    with pytest.raises(ProfileError, match=r'cable_sensor\.kind = "sonar"; must be "camera" or "encoder"'):
        parse_profile(text, "x.toml")


def test_file_of_a_user(tmp_path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(GOOD)
    mocap = load_profile(str(path)).mocap
    assert mocap is not None
    assert mocap.rate_hz == 200.0
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(ProfileError, match="not a text file"):
        load_profile(str(path))


def test_unknown_name_lists_the_known() -> None:
    with pytest.raises(ProfileError) as error:
        load_profile("labb")
    assert str(error.value) == (
        "unknown sensors 'labb'; did you mean lab? shipped: field, gps, ideal, lab, lab-blind, "
        "lab-real, rtk, rtk-blind; or the path of a file"
    )


def test_stated_deviations() -> None:
    ideal, rtk = load_profile("ideal"), load_profile("rtk")
    perfect = reported_std(ideal, 1.0)
    assert 0.0 < perfect.mocap_position <= 1e-4
    assert 0.0 < perfect.load_velocity <= 1e-3
    assert isnan(perfect.gnss_horizontal)
    assert rtk.gnss is not None
    expected = sqrt(rtk.gnss.horizontal_noise_m**2 + rtk.gnss.horizontal_correlated_m**2)
    assert reported_std(rtk, 3.0).gnss_horizontal == pytest.approx(3.0 * expected)
    assert reported_std(rtk, 0.0).gnss_horizontal > 0.0
