"""docs/files.md and docs/messages.md are generated from the schemas of files and from the dialect.

To write the pages anew: python tests/documentation/test_reference.py
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from importlib.resources import files
from pathlib import Path
from typing import Any, get_args

import pytest
from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from autopilot.wire.dialect import plumbline as mavlink
from missions.schema import ITEMS, FileSpec, SineSpec, TermSpec
from missions.toml_files import bounds
from sitl.sensors.profile import Profile

DOCS = Path(__file__).parents[2] / "docs"
FILES_HEAD = """# Keys of files

Every key that a mission file and a sensor profile may have, made of the schemas that read them. A key ends
in its unit; numbers are finite. A key without a default must be there. How the files are meant is in
[missions.md](missions.md) and [sensors.md](sensors.md); the keys of a vehicle file are in
[vehicles.md](vehicles.md), what a flight leaves behind in [report.md](report.md) and
[cli.md](cli.md#gcs-fly).

## Mission

"""
MESSAGES_HEAD = """# Messages

The messages, commands and enumerations that Plumbline's dialect adds to MAVLink's `common`, made of
`autopilot/wire/dialect/plumbline.xml`. What is spoken of `common`, and how, is in [mavlink.md](mavlink.md).

"""
TABLES = {
    "items": "1 ... 1000 tables",
    "terms": "1 ... 32 tables",
    "factors": "0 ... 3 tables",
    "points": "2 ... 1000 rows of four numbers",
}
# meanings of keys whose schema has no description
MEANINGS = {
    "terms": "added to each other",
    "factors": "sines, multiplied with each other and the envelope",
    "latency_ms": "from measurement to delivery; `SIM_SENS_LAT_MS` is added",
    "loss": "share of readings that are lost one by one; `SIM_DROP_PCT` is added",
    "outages_per_min": "how often the sensor falls silent, by chance",
    "outage_s": "for how long on average",
    "rate_hz": "readings per second",
    "accel_noise_m_s2": "accelerometer: white noise of a reading",
    "accel_bias_m_s2": "drawn once at switch-on",
    "accel_walk_m_s2": "growth of the bias in one second",
    "accel_range_m_s2": "full scale",
    "gyro_noise_rad_s": "gyroscope: white noise of a reading",
    "gyro_bias_rad_s": "drawn once at switch-on",
    "gyro_walk_rad_s": "growth of the bias in one second",
    "gyro_range_rad_s": "full scale",
    "position_noise_m": "white noise of a reading",
    "position_bias_m": "drawn once at switch-on",
    "position_walk_m": "growth of the bias in one second",
    "attitude_noise_rad": "white noise about each axis",
    "velocity_noise_m_s": "white noise; none: velocity is not measured",
    "rate_noise_rad_s": "white noise; none: the body rate is not measured",
    "kind": "a camera sees the load in a cone about the body's down axis; encoders need a taut cable",
    "direction_noise_rad": "white noise across the direction",
    "mounting_bias_rad": "how crooked it is fitted, drawn once",
    "mounting_walk_rad": "growth of that in one second",
    "half_angle_deg": "of the cone in which a camera sees the load",
    "fix": "what the receiver says that it has",
    "horizontal_noise_m": "white noise of a fix",
    "vertical_noise_m": "white noise of a fix",
    "horizontal_correlated_m": "an error that wanders",
    "vertical_correlated_m": "an error that wanders",
    "correlation_s": "time over which the wandering error forgets itself",
    "horizontal_velocity_noise_m_s": "white noise of the velocity",
    "vertical_velocity_noise_m_s": "white noise of the velocity",
    "satellites": "in view",
    "height_noise_m": "white noise of a reading, as height",
    "height_drift_m": "an error that wanders",
    "strength_gauss": "of the earth's field at home",
    "inclination_deg": "how far the field points below the horizon",
    "declination_deg": "how far it points east of north",
    "noise_gauss": "white noise about each axis",
    "hard_iron_gauss": "field of the vehicle itself, drawn once",
    "hard_iron_walk_gauss": "growth of that in one second",
    "vibration_m_s2": "acceleration by rotors out of balance, RMS at hover before the low-pass (0.5 ... 5 on "
    "real frames); `SIM_VIB_ACC` replaces it",
    "vibration_rad_s": "the same as angular rate (0.02 ... 0.1); `SIM_VIB_GYR` replaces it",
    "vibration_broadband": "white part as a share of these two (0.1 ... 0.5); `SIM_VIB_BROAD` replaces it",
    "lowpass_hz": "cut-off of the low-pass that the vibration goes through (40 ... 200); `SIM_IMU_LPF_HZ` "
    "replaces it",
    "jitter_ms": "mean of an exponentially distributed time that is added to the latency of each reading "
    "(1 ... 10); `SIM_SENS_JIT_MS` replaces it",
    "jitter_max_ms": "the longest such time; none: five times the mean; `SIM_SENS_JITMAX` replaces it",
    "time_offset_ms": "by how much the times that readings carry are too late (-5 ... 5); "
    "`SIM_SENS_OFS_MS` is added",
    "position_correlated_m": "an error that wanders (0.0002 ... 0.002); `SIM_TRK_ERR_M` replaces it",
    "calibration_error_m": "distortion of the room: an error that depends on the place "
    "(0.0002 ... 0.002); `SIM_TRK_CAL_M` replaces it",
    "calibration_length_m": "distance over which the distortion varies once (1 ... 5)",
    "horizontal_multipath_m": "error by reflected signals, which is not stated (0.005 ... 0.05 with RTK, "
    "0.5 ... 3 without); `SIM_GPS_MP_M` replaces it",
    "vertical_multipath_m": "the same upwards",
    "multipath_s": "time over which it forgets itself (10 ... 100)",
    "float_per_min": "how often an RTK fix begins to float (0 ... 2); `SIM_GPS_FLT` replaces it",
    "float_s": "for how long on average, also after a lost fix (1 ... 30)",
    "float_error_m": "error of a floating fix, which is stated (0.1 ... 0.5)",
    "lost_per_min": "how often the fix is lost, and said to be (0 ... 1); `SIM_GPS_LOST` replaces it",
    "lost_s": "for how long on average (0.5 ... 10)",
    "motor_field_gauss": "field of the motors' currents at hover (0.005 ... 0.05); `SIM_MAG_MOT` replaces it",
}
KEYS = "| key | must be | default | meaning |\n|---|---|---|---|\n"


def table_of(annotation: Any) -> type[BaseModel] | None:
    """The table that a key holds, required or optional; None if it holds no table."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((table for table in map(table_of, get_args(annotation)) if table is not None), None)


def rules(annotation: Any) -> list[Any]:
    """Bounds in an annotation, also of an optional value."""
    found = [rule for rule in getattr(annotation, "__metadata__", ()) if isinstance(rule, FieldInfo)]
    return [rule for field in found for rule in field.metadata] + [
        rule for argument in get_args(annotation) for rule in rules(argument)
    ]


def allowed(key: str, field: FieldInfo) -> str:
    """What the value must be."""
    if key in TABLES:
        return TABLES[key]
    words = re.findall(r"'(\w+)'", str(field.annotation)) if "Literal" in str(field.annotation) else []
    if words:
        return " or ".join(f'`"{word}"`' for word in words)
    if field.annotation is bool:
        return "`true` or `false`"
    if key == "rate_hz":
        return '> 0 and <= 20000, or `"tick"`'
    if "str" in str(field.annotation):
        return "text" if "list" not in str(field.annotation) else "texts"
    signs = {Gt: ">", Ge: ">=", Lt: "<", Le: "<="}
    bound = bounds(field) or " and ".join(
        f"{signs[type(rule)]} {getattr(rule, type(rule).__name__.lower()):g}"
        for rule in rules(field.annotation)
        if type(rule) in signs
    )
    assert bound, f"no bound of {key} is known"
    return bound


def default(field: FieldInfo) -> str:
    """The value that applies if the key is left out."""
    if field.is_required():
        return ""
    value = field.get_default(call_default_factory=True)
    return "none" if value is None or value in ([], "") else f"`{value:g}`"


def rows(spec: type[BaseModel]) -> str:
    """A row for each key of a table."""
    return KEYS + "".join(
        f"| `{key}` | {allowed(key, field)} | {default(field)} | {field.description or MEANINGS[key]} |\n"
        for key, field in spec.model_fields.items()
    )


def files_page() -> str:
    """The page of the keys of files."""
    text = FILES_HEAD + rows(FileSpec)
    for kind, item in ITEMS.items():
        text += f'\n### Item `type = "{kind}"`\n\n'
        text += rows(item) if item.model_fields else "No other keys.\n"
    text += "\n### `[[items.terms]]` of signals\n\n" + rows(TermSpec)
    text += "\n### `[[items.terms.factors]]`\n\n" + rows(SineSpec)
    text += "\n## Sensor profile\n\nDeviations are one sigma per axis. A table that is left out is a sensor "
    text += (
        "that is not fitted; one of `mocap` and `gnss` must be there.\n\n"
        + KEYS
        + "| `description` | text |  | one line for lists |\n"
    )
    for name, field in Profile.model_fields.items():
        spec = table_of(field.annotation)
        if spec is not None:
            said = " ".join((spec.__doc__ or "").split())
            text += f"\n### `[{name}]`\n\n{said}\n\n{rows(spec)}"
    return text


def dialect() -> ET.Element:
    """What the dialect adds to `common`."""
    return ET.fromstring((files("autopilot.wire.dialect") / "plumbline.xml").read_text(encoding="utf-8"))


def said(element: ET.Element) -> str:
    """The description of an element, as a cell of a table."""
    found = element.find("description")
    return " ".join((element.text if found is None else found.text or "").split()).replace("|", "\\|")


def messages_page() -> str:
    """The page of the dialect."""
    root, text = dialect(), MESSAGES_HEAD
    for message in root.iter("message"):
        text += f"## {message.get('name')} ({message.get('id')})\n\n{said(message)}\n\n"
        text += "| field | type | unit | meaning |\n|---|---|---|---|\n"
        for field in message.iter("field"):
            kind, unit = field.get("type", ""), field.get("units", "")
            what = f"{said(field)} {field.get('enum') or ''}".strip()
            text += f"| `{field.get('name')}` | {kind} | {unit} | {what} |\n"
        text += "\n"
    for enum in root.iter("enum"):
        text += f"## {enum.get('name')}\n\n{said(enum)}\n\n| value | name | meaning |\n|---|---|---|\n"
        for entry in enum.iter("entry"):
            parameters = "; ".join(f"{p.get('index')}: {said(p)}" for p in entry.iter("param") if p.text)
            meaning = said(entry) + (f" ({parameters})" if parameters else "")
            text += f"| {entry.get('value')} | `{entry.get('name')}` | {meaning} |\n"
        text += "\n"
    return text.rstrip() + "\n"


PAGES = {"files.md": files_page, "messages.md": messages_page}


@pytest.mark.parametrize("name", PAGES)
def test_the_page_is_what_the_code_has(name: str) -> None:
    written = (DOCS / name).read_text(encoding="utf-8")
    assert written == PAGES[name](), "run: python tests/documentation/test_reference.py"


def test_every_message_of_the_dialect_is_spoken() -> None:
    for message in dialect().iter("message"):
        assert mavlink.mavlink_map[int(message.get("id", ""))].msgname == message.get("name")


if __name__ == "__main__":
    for page, made in PAGES.items():
        (DOCS / page).write_text(made(), encoding="utf-8")
