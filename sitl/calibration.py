"""What is known of a simulated vehicle and its sensors, for those who evaluate logged readings."""

from __future__ import annotations

from math import isfinite, sqrt
from typing import Any

from autopilot.geometry.linear import ZERO
from autopilot.vehicle.layout import Layout, Rotor
from autopilot.wire.convert.geodesy import Home
from sitl.plant.records import Truth
from sitl.sensors.imu import with_errors
from sitl.sensors.overrides import with_overrides
from sitl.sensors.profile import Profile, Sampled
from sitl.settings import SECOND_US, Settings
from sitl.world import LATENCY, LOSS, STAMP_OFFSET, WorldRows, fitted_sensors

SENSOR_NAMES = ("imu", "mocap", "load_tracker", "cable_sensor", "gnss", "barometer", "magnetometer")


def calibration(
    truth: Truth, profile: Profile, settings: Settings, home: Home, layout: Layout, seed: int, rows: WorldRows
) -> dict[str, Any]:
    """The contents of sensors.json (docs/sensors.md), at the beginning of the flight."""
    tick_s = settings.tick_us / SECOND_US
    places = {"imu": truth.imu_position, "gnss": truth.antenna_position}
    sensors: dict[str, dict[str, Any]] = {}
    tables = fitted_sensors(with_overrides(profile, settings.overrides))
    for row, (name, table) in enumerate(zip(SENSOR_NAMES, tables, strict=True)):
        if table is None:
            continue
        delivery = rows.delivery[row]
        sensors[name] = {
            **table.model_dump(),
            "period_s": table.period_s(tick_s) if isinstance(table, Sampled) else tick_s,
            "latency_ms": int(rows.clock[row, LATENCY]) / 1000.0,
            "loss": float(delivery[LOSS]),
            "lever_arm_m": list(places.get(name, ZERO)),
        }
        if "time_offset_ms" in sensors[name]:
            sensors[name]["time_offset_ms"] = float(delivery[STAMP_OFFSET]) / 1000.0
    for kind, unit in (("accel", "m_s2"), ("gyro", "rad_s")):
        noise = sensors["imu"][f"{kind}_noise_{unit}"]
        sensors["imu"][f"{kind}_noise_density_{unit}_sqrt_hz"] = noise * sqrt(tick_s)
    inertial = with_errors(profile.imu.config(tick_s, truth.gravity), truth.imu_position, settings.imu_axes)
    for kind, axes in (("accel", inertial.accel_axes), ("gyro", inertial.gyro_axes)):
        sensors["imu"][f"{kind}_axes"] = [list(row) for row in axes]
    if profile.magnetometer is not None:
        field = profile.magnetometer.config(tick_s).field
        sensors["magnetometer"]["field_east_north_up_gauss"] = list(field)
    return {
        "seed": seed,
        "tick_s": tick_s,
        "noise_scale": settings.noise_scale,
        "gravity_m_s2": truth.gravity,
        "home": {
            "latitude_deg": home.latitude_deg,
            "longitude_deg": home.longitude_deg,
            "altitude_m": home.altitude_m,
        },
        "vehicle": {
            "mass_kg": truth.quad_mass,
            "inertia_kg_m2": list(truth.inertia),
            "load_mass_kg": truth.load_mass,
            "cable_length_m": truth.cable_length,
            "attachment_m": list(truth.attachment),
            "rotor_lag_s": truth.rotor_tau,
            "rotor_max_n": truth.rotor_max if isfinite(truth.rotor_max) else None,
            "rotors": [_rotor(rotor, truth) for rotor in layout],
            "actuator_delay_s": settings.actuator_delay_us / SECOND_US,
        },
        "sensors": sensors,
    }


def _rotor(rotor: Rotor, truth: Truth) -> dict[str, Any]:
    return {
        "position_m": [rotor.x * truth.arm, rotor.y * truth.arm, truth.rotor_height],
        "moment_per_force_m": rotor.yaw * truth.torque_ratio,
        "strength": rotor.strength,
    }
