"""docs/vehicles.md lists every key of a vehicle file as the schema has it.

To write the page anew: python tests/documentation/test_vehicles.py > docs/vehicles.md
"""

from __future__ import annotations

import re
from pathlib import Path

from pydantic.fields import FieldInfo

from autopilot.vehicle.file import VEHICLES, load_vehicle
from autopilot.vehicle.layout import FEWEST, GREATEST_FORCE_N, MOST
from autopilot.vehicle.model import LEAST_ROTOR_MAX_N, SHARE_OF_ARM, Moment, Offset, OneRotor, Vehicle
from missions.toml_files import bounds

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "vehicles.md"
HEAD = """# Vehicles

A vehicle is one TOML file: multirotor, cable and load. The shipped ones are the files in
`autopilot/vehicle/vehicles`:

{shipped}

`--vehicle NAME|FILE` of `sitl`, `autopilot`, `gcs fly`, `gcs check`, `gcs upload` and `gcs sweep` takes one
of these names or the path of a file of your own; copy one of them. All of them read it in the same way:

* The simulator flies it. Its `SIM_` parameters change single values of it
  ([parameters.md](parameters.md)).
* The autopilot believes it: `VEH_`, `BAT_` and `PLB_DRAG` begin with its numbers. It uses neither the drag
  of load and rotation, nor anything of the ground, nor what air and voltage do to the rotors
  ([realism-plant.md](realism-plant.md)); the heights at which vehicle and load rest are its `EST_GEAR_H` and
  `EST_LOAD_H`.
* `gcs check` judges missions by it: masses, cable, rotors, and the drag of the vehicle.
* A table `[parameters]` has parameters of the autopilot with which the vehicle is delivered, as an airframe
  file of other autopilots. `heavy-real` brings `MIS_ROTOR_MARG` 40 and `MIS_INFEASIBLE` 1: its paths leave
  room for what nobody knows of it, and are flown slower where they must be. What is set counts before them.

Truth and belief are two values of the same record. Where they are to differ

* let one file say so: a file with `believed = "bebop"` is the truth, which the simulator flies, and the
  autopilot and `gcs check` take it for `bebop`. It has the keys that differ; what it leaves out is as there.
  `bebop-real` and `heavy-real` are such files.
* or give settings: `gcs fly hover --set SIM_LOAD_MASS=0.15` makes the load heavier than is believed,
  `--set VEH_LOAD_MASS=0.15` makes the belief heavier than the load;
* or give the two programs two files (`sitl --vehicle a.toml`, `autopilot --vehicle b.toml`).

```text
believed = "bebop"                     # a shipped name, or a file beside this one
rotor_tau_s = 0.030
attachment_m = [0.008, -0.004, -0.020]
downwash = 1.0

[parameters]                           # of the autopilot
MIS_ROTOR_MARG = 30
```

## Keys

A key ends in its unit. A number outside its range, an unknown key or a missing one is refused with a line
that says which, what was found and what is allowed. A key without a default must be there.

| key | unit | range | default | meaning |
|---|---|---|---|---|
"""
ROTORS = """
## Rotors

Rotors are counted from the rear, or from the left of the gap at the rear, counterclockwise from above:
`rotors = 4` is the plus quadrotor of (2-13) with rotor 1 behind, 2 right, 3 ahead and 4 left. Any other
vehicle lists its rotors, each with its place:

```text
[[rotor]]
x_m = 0.25
y_m = -0.18
spin = "+"
thrust_factor = 1.2
```

Arms that fold, coaxial pairs and rotors of different size are all right as long as the vehicle can be held
level with them. The axes are upright. `VEH_ARM_LEN`, `VEH_TORQUE`,
`VEH_ROTOR_MIN` and `VEH_ROTOR_MAX` scale what the file says of places, torques and limits; where the rotors
are, no parameter says: `sitl` and `autopilot` read it from their files.

**Which rotor may fail.** What n rotors can do together is a polytope of thrust and moments; a vehicle can be
held as far as the point of its weight without a moment lies inside of it. The distance to the nearest face is
the moment that is left in every direction (the degree of controllability of Du, Quan and others). For six
rotors at equal angles, in newtons of one rotor of the shipped `hexarotor`, whose rotors give 24 N:

| signs | all six, level and yaw | one lost, level moments | one lost, yaw as well |
|---|---|---|---|
| `+-+-+-`, as most hexarotors have them | 32 | 16 | 0, whichever |
| `++--+-`, as shipped | 25 | 16 | 11 to 13 for rotors 1 to 4; none for 5 and 6 |

With signs in turn a lost rotor leaves nothing for the yaw: its opposite turns the other way, so that one can
be used only as much as the other is missed. With `++--+-` four of the six can be lost without that anything
changes but the room. When rotor 5 or 6 is lost, the heading is given up: the nose points where it points, the
vehicle turns at about 7 rad/s, and thrust, roll and pitch are flown as before.

The autopilot learns of a lost rotor by its speed, which the speed controllers tell every 20 ms (ESC_STATUS on
the simulator link): three in turn that show less than 30 % of the force that the rotor has been asked for
throughout the last 0.15 s. Where the others can fly the vehicle they are mixed anew, and it lands with its
load. A quadrotor cannot be flown by three.

```text
gcs fly case-b --vehicle hexarotor --set SIM_ENGINE_FAIL=4 --set SIM_ENGINE_AT_S=40   # rotor 3 stops
```

| key of [[rotor]] | unit | range | default | meaning |
|---|---|---|---|---|
"""
TAIL = """
Beyond its range a value must fit the others: `rotor_max_n` is greater than `rotor_min_n`, which is finite
unless `rotor_max_n` is `inf`; none of the three moments of inertia is greater than the sum of the other
two. Where `rotor_max_n` is `inf`, the mixer of the autopilot keeps no limits (`VEH_ROTOR_LIM` 0).

Drag is -(linear + quadratic |v|) v on the velocity v relative to the air. What the values of the ground
stand for is in [plant.md](plant.md).

What is wrong is told like this, by every program:

```text
{wrong}
```
"""
WHAT = {
    "bebop-real": "a Bebop as it may really be, believed to be `bebop`: late rotors that drag, sag and blow "
    "on the load, the cable a centimetre off ([realism-plant.md](realism-plant.md))",
    "heavy-real": "the same of `heavy`, whose paths leave room for it",
    "bebop": "the default: a Parrot Bebop with a load, Table 4-1 of the thesis, assumed where that is silent",
    "heavy": "2 kg with a load of 0.5 kg on 2 m of cable: no real vehicle, sizes as such vehicles have them",
    "hexarotor": "5 kg with a load of 1.5 kg on 1 m of cable: no real vehicle either; it lands with its load "
    "when it has lost any one rotor",
    "iris": "1.5 kg with a load of 0.3 kg on 1 m of cable, of the size of the 3DR Iris, for "
    "third-party autopilots ([autopilots.md](autopilots.md))",
    "octorotor": "7 kg with a load of 2.5 kg on 1 m of cable, of the same kind",
    "thesis": "the vehicle of the thesis's simulations: `bebop` without rotor limits, rotor lag and drag",
}
WRONG = [
    "mine.toml: load_mass_kg = -5; must be >= 0.001 and <= 100 (mass of the load)",
    "mine.toml: quad_mass: unknown key; write quad_mass_kg (in kilograms)",
    "mine.toml: rotors = 3; must be >= 4 and <= 14 (number of rotors)",
    "unknown vehicle 'bepop'; did you mean bebop? shipped: bebop, bebop-real, heavy, heavy-real, "
    "hexarotor, iris, octorotor, thesis; or the path of a file",
]
# keys whose range is more than two bounds
RANGES = {
    "name": "text",
    "believed": "text",
    "esc_speed_controlled": "`true` or `false`",
    "battery": "`true` or `false`",
    "frame": "`plus` or `x`",
    "spin": "text",
    "rotor": "up to 14 tables",
    "parameters": "names and values of [parameters.md](parameters.md)",
    "rotors": f"{FEWEST} ... {MOST}",
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
    elif key == "attachment_m":
        allowed = "three of " + two_bounds(FieldInfo.from_annotation(Offset))
    else:
        allowed = RANGES.get(key) or two_bounds(field)
    if key in SHARE_OF_ARM:
        default = f"{SHARE_OF_ARM[key]:g} `arm_m`"
    elif key == "name":
        default = "the file's"
    elif key == "attachment_m":
        default = "the centre"
    elif isinstance(field.default, bool):
        default = f"`{str(field.default).lower()}`"
    elif key in ("frame", "spin", "rotor", "believed", "parameters"):
        default = f"`{field.default}`" if field.default and not field.is_required() else ""
    else:
        default = "" if field.is_required() else f"{field.default:g}"
    return f"| `{key}` | {unit} | {allowed} | {default} | {field.description} |\n"


def page() -> str:
    """The page as it should be."""
    shipped = "\n".join(f"* `{name}`: {WHAT[name]}" for name in VEHICLES.names())
    rows = "".join(row(key, field) for key, field in Vehicle.model_fields.items())
    rows += ROTORS + "".join(row(key, field) for key, field in OneRotor.model_fields.items())
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
        ('name = "bebop"', "rotors = 3"),
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
