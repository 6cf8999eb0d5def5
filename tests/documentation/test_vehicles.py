"""docs/vehicles.md lists every key of a vehicle file as the schema has it.

To write the page anew: python tests/documentation/test_vehicles.py > docs/vehicles.md
"""

from __future__ import annotations

import re
from pathlib import Path

from pydantic.fields import FieldInfo

from autopilot.vehicle.file import VEHICLES, load_vehicle
from autopilot.vehicle.model import GREATEST_FORCE_N, LEAST_ROTOR_MAX_N, SHARE_OF_ARM, Moment, Vehicle
from missions.toml_files import bounds

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "vehicles.md"
HEAD = """# Vehicles

A vehicle is one TOML file: quadrotor, cable and load. The shipped ones are the files in
`autopilot/vehicle/vehicles`:

{shipped}

`--vehicle NAME|FILE` of `sitl`, `autopilot`, `gcs fly`, `gcs check`, `gcs upload` and `gcs sweep` takes one
of these names or the path of a file of your own; copy one of them. All of them read it in the same way:

* The simulator flies it. Its `SIM_` parameters change single values of it
  ([parameters.md](parameters.md)).
* The autopilot believes it: `VEH_` and `PLB_DRAG` begin with its numbers. It uses neither the drag of
  load and rotation nor anything of the ground; the heights at which vehicle and load rest are its
  `EST_GEAR_H` and `EST_LOAD_H`.
* `gcs check` judges missions by it: masses, cable, rotors, and the drag of the vehicle.

Truth and belief are two values of the same record. Where they are to differ, give the two programs two
files (`sitl --vehicle a.toml`, `autopilot --vehicle b.toml`), or one file and settings: `gcs fly hover
--set SIM_LOAD_MASS=0.15` makes the load heavier than is believed, `--set VEH_LOAD_MASS=0.15` makes the
belief heavier than the load.

## Keys

A key ends in its unit. A number outside its range, an unknown key or a missing one is refused with a line
that says which, what was found and what is allowed. A key without a default must be there.

| key | unit | range | default | meaning |
|---|---|---|---|---|
"""
TAIL = """
Beyond its range a value must fit the others: `rotor_max_n` is greater than `rotor_min_n`, which is finite
unless `rotor_max_n` is `inf`; none of the three moments of inertia is greater than the sum of the other
two. Where `rotor_max_n` is `inf`, the mixer of the autopilot keeps no limits (`VEH_ROTOR_LIM` 0).

Drag is -(linear + quadratic |v|) v on the velocity v relative to the air. What the values of the ground
stand for is in [plant.md](plant.md).

What is wrong is told like this, by every program:

```
{wrong}
```
"""
WHAT = {
    "bebop": "the default: a Parrot Bebop with a load, Table 4-1 of the thesis, assumed where that is silent",
    "heavy": "2 kg with a load of 0.5 kg on 2 m of cable: no real vehicle, sizes as such vehicles have them",
    "thesis": "the vehicle of the thesis's simulations: `bebop` without rotor limits, rotor lag and drag",
}
WRONG = [
    "mine.toml: load_mass_kg = -5; must be >= 0.001 and <= 100 (mass of the load)",
    "mine.toml: quad_mass: unknown key; write quad_mass_kg (in kilograms)",
    "mine.toml: rotors = 6; must be 4 (number of rotors; only quadrotors can be flown)",
    "unknown vehicle 'bepop'; did you mean bebop? shipped: bebop, heavy, thesis; or the path of a file",
]
# keys whose range is more than two bounds
RANGES = {
    "name": "text",
    "rotors": "4",
    "rotor_min_n": f"{-GREATEST_FORCE_N:g} ... {GREATEST_FORCE_N:g}, or -inf",
    "rotor_max_n": f"{LEAST_ROTOR_MAX_N:g} ... {GREATEST_FORCE_N:g}, or inf",
}


def two_bounds(field: FieldInfo) -> str:
    """`>= 0 and <= 1` as `0 ... 1`."""
    low, high = re.fullmatch(r">= (\S+) and <= (\S+)", bounds(field)).groups()
    return f"{low} ... {high}"


def row(key: str, field: FieldInfo) -> str:
    """A row of the table of keys."""
    unit = (field.json_schema_extra or {}).get("unit", "")
    if key == "inertia_kg_m2":
        allowed = "three of " + two_bounds(FieldInfo.from_annotation(Moment))
    else:
        allowed = RANGES.get(key) or two_bounds(field)
    if key in SHARE_OF_ARM:
        default = f"{SHARE_OF_ARM[key]:g} `arm_m`"
    elif key == "name":
        default = "the file's"
    else:
        default = "" if field.is_required() else f"{field.default:g}"
    return f"| `{key}` | {unit} | {allowed} | {default} | {field.description} |\n"


def page() -> str:
    """The page as it should be."""
    shipped = "\n".join(f"* `{name}`: {WHAT[name]}" for name in VEHICLES.names())
    rows = "".join(row(key, field) for key, field in Vehicle.model_fields.items())
    return HEAD.format(shipped=shipped) + rows + TAIL.format(wrong="\n".join(WRONG))


def test_the_page_is_what_the_schema_has() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run: python tests/documentation/test_vehicles.py"


def test_a_key_ends_in_its_unit() -> None:
    def plain(text: str) -> str:
        return re.sub(r"[^a-z0-9]", "", text.lower())

    for key, field in Vehicle.model_fields.items():
        unit = (field.json_schema_extra or {}).get("unit", "")
        # a radian is a number: it is named where nothing else would tell a frequency
        assert plain(key).endswith(plain(unit.replace("/rad^2", ""))), key


def test_the_messages_are_those_of_the_reader(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    bebop = VEHICLES.read("bebop").text
    changes = [
        ("load_mass_kg = 0.1", "load_mass_kg = -5"),
        ("quad_mass_kg", "quad_mass"),
        ('name = "bebop"', "rotors = 6"),
    ]
    said = []
    for change in changes:
        Path("mine.toml").write_text(bebop.replace(*change), encoding="utf-8")
        said.append(message("mine.toml"))
    assert [*said, message("bepop")] == WRONG


def message(name: str) -> str:
    """What is said of a vehicle that cannot be read."""
    try:
        load_vehicle(name)
    except ValueError as error:
        return str(error)
    raise AssertionError(f"{name} was read")


def test_the_page_can_be_found() -> None:
    for other in ("../README.md", "plant.md", "cli.md"):
        assert "vehicles.md" in (DOCS / other).read_text(encoding="utf-8"), other


if __name__ == "__main__":
    print(page(), end="")
