"""docs/vehicles.md lists every key of a vehicle file as the schema has it.

To write the page anew: python tests/documentation/test_vehicles.py > docs/vehicles.md
"""

from __future__ import annotations

import re
from pathlib import Path

from pydantic.fields import FieldInfo

from autopilot.control.believed import believed_rotor_watch
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.layout import MAX_ROTOR_FORCE_N, MAX_ROTORS, MIN_ROTORS
from autopilot.vehicle.model import ARM_RATIOS, MIN_ROTOR_MAX_N, Moment, Offset, OneRotor, Vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.vehicle.shipped import VEHICLES
from missions.toml_files import bounds

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "vehicles.md"
HEAD = """# Vehicles

A vehicle is one TOML file that describes multirotor, cable and load. The shipped vehicles are the files in
`autopilot/vehicle/vehicles`:

{shipped}

`--vehicle NAME|FILE` of `sitl`, `autopilot`, `gcs fly`, `gcs check`, `gcs upload` and `gcs sweep` takes one
of these names or the path of a custom file; to write one, copy a shipped file. All programs read the same
file:

* The simulator flies it. Its `SIM_` parameters change single values of it
  ([parameters.md](parameters.md)).
* The autopilot uses it as its model: `VEH_`, `BAT_`, `PLB_DRAG`, `EST_GEAR_H` (`gear_height_m`) and
  `EST_LOAD_H` (`load_radius_m`) start with its numbers, and `WNC_LEN_MAX` with about four times the
  length of its cable. The autopilot ignores the drag of load and rotation, the other keys of the ground,
  and the effects of air and voltage on the rotors ([realism-plant.md](realism-plant.md)).
* `gcs check` judges missions by it: masses, cable, rotors, and the drag of the vehicle.
* A table `[parameters]` contains parameters of the autopilot with which the vehicle is delivered, like an
  airframe file of other autopilots. `heavy-real` sets `MIS_ROTOR_MARG` 35 and `MIS_INFEASIBLE` 1: its paths
  leave room for unknown effects, and are flown slower where necessary. Parameters that you set take
  precedence. The table may contain the parameters of a custom law, estimator or planner; flights without this
  one are then refused, and `gcs check` refuses the vehicle, unless `--ignore NAME` of `gcs fly`, `gcs check`
  and `autopilot` names them. A sweep with several laws needs no option: what one of the laws defines has no
  effect on the others.

The truth and the autopilot's model are two sets of the same values. There are three ways to make them
differ:

* One file specifies both. A file with `believed = "bebop"` is the truth, which the simulator flies, while
  the autopilot and `gcs check` use `bebop`. It contains the keys that differ; omitted keys have the values
  of `bebop`. `bebop-real` and `heavy-real` are such files.
* Settings change one of them: `gcs fly hover --set SIM_LOAD_MASS=0.15` makes the load heavier than the
  autopilot assumes, `--set VEH_LOAD_MASS=0.15` makes the assumed load heavier than the true one.
* The two programs read two files (`sitl --vehicle a.toml`, `autopilot --vehicle b.toml`).

```text
believed = "bebop"                     # a shipped name, or a file beside this one
rotor_tau_s = 0.030
attachment_m = [0.008, -0.004, -0.020]
downwash = 1.0

[parameters]                           # of the autopilot
MIS_ROTOR_MARG = 30
```

## Keys

A key ends in its unit. A number outside its range, an unknown key or a missing key is refused with a line
that names the key, the value found and the allowed values. A key without a default is required.

| key | unit | range | default | meaning |
|---|---|---|---|---|
"""
ROTORS = """
The vehicle must be able to stand, and its load to lie half a cable length beside it: the cable is at least
1.16 times as long as the attachment is above the resting load. The feet are at most 15 radii of gyration from
the centre of mass, where the square of this radius is the least moment of inertia over the mass: the push of
the ground turns a lighter body so fast that it tumbles. Where the sizes of the gear are left out, they grow
with `arm_m`: an arm of 2.8 m with the cable and the inertia of `bebop` is refused for both reasons. No moment
of inertia may be greater than that of the whole mass at the tips of the rotors, or at the feet if these are
farther.

## How exact lengths and masses must be

The autopilot learns the weight of the load. It learns the length of the cable from a tracker only, and the
weight of the vehicle roughly.

`bebop` flew `hover` with assumed cables of 0.5 to 3 m, eight flights each, and with true ones that were up to
5 % longer or shorter. With `lab`, also with up to 9 % shorter ones, its greatest error was 2 to 4 mm in all
of them: trackers show the true length. With `rtk` the assumed length decides how high the load is, so that an
error of 5 % of 3 m made the greatest error 0.16 m instead of 0.05 m. A tracked load whose cable is shorter by
10 % or more is not lifted; the text names the length at which the cable pulls. One that is longer by up to
25 % is flown.

While the vehicle flies with a slack cable, what the cable seems to pull is learned as an error of
`VEH_QUAD_MASS` ([estimator-derivation.md](estimator-derivation.md#pull-and-drag)). `bebop` flew `hover`
and `case-b` with errors of -25 to 25 % of it with `lab` and `rtk`, and of -25 to 20 % with `gps`, eight
flights each. The greatest error in `case-b` was, as a median in mm:

| error of `VEH_QUAD_MASS` | -25 % | -20 % | -15 % | -10 % | -5 % | 0 | 5 % | 10 % | 15 % | 20 % | 25 % |
|---|---|---|---|---|---|---|---|---|---|---|---|
| `lab` | 16 | 12 | 10 | 8 | 6 | 4 | 4 | 4 | 5 | 6 | 13 |
| `rtk` | 42 | 39 | 41 | 39 | 40 | 40 | 39 | 39 | 38 | 39 | 40 |

With -30 % no load was lifted. With `rtk` the cable was [never found
taut](troubleshooting.md#cable-never-taut-landing-), and neither was it with 30 %. With `lab` it went
[slack](troubleshooting.md#cable-slack-falling-with-the-load-to-catch-it) while the load was lifted, and the
load fell to the ground; with 30 % `case-b` was flown with an error of 57 mm.

## How heavy or light the load may be

The rotors decide it: `gcs check` refuses a load that they cannot carry. Vehicles of 1 to 3 kg whose rotors
gave 2.2 times the weight flew `hover`, `delivery` and `square` with loads of 0.1 to 5 times their own mass on
cables of 0.3 to 2 m, with `ideal`, `lab`, `rtk` and other sensors. The cable came taut at 0.15 m/s, and the
error did not depend on the load. The cable of a load without a tracker counts as taut once it pulls with most
of the load's weight, which takes longer with heavier loads: 17 s for five times the mass of the vehicle
instead of 3 s for half of it. The law `lqr` lost loads of five times the mass.

The cable counts as taut once it has pulled with three tenths of the load's weight for a tenth of a second. A
load that is very light beside its vehicle is not felt: measured, its pull varies by 0.4 % of the vehicle's
weight (one standard deviation) with the noise of the inertial unit, and by 3 % with the vibration of
`lab-real` and `field`. A vehicle of 1.2 kg lifted loads of 0.7 % of its mass and more with `lab`, 0.5 % with
`rtk` and `gps`, 5 % with `field`, and 10 % with `lab-real`; with lighter ones, some or all flights ended with
`Cable never taut`. `gcs check` and `gcs fly` warn of a load below 1 %, and of one below 10 % because of
vibration.

## How slow the rotors may be

The greater `rotor_tau_s`, the lower the bandwidth at which the law controls the attitude, and the position
cannot be held with an attitude that follows more slowly than twice its own bandwidth, 2.5 rad/s. `bebop`,
`heavy`, `octorotor` and the vehicle of `gcs new vehicle` flew `hover` with `ideal`, `lab` and `rtk`:

| `rotor_tau_s` | 0.1 | 0.2 | 0.22 | 0.25 | 0.3 | 0.4 ... 1 |
|---|---|---|---|---|---|---|
| attitude bandwidth, rad/s | 9.0 to 9.4 | 4.9 to 5.6 | 4.6 to 5.3 | 4.2 to 4.9 | 3.6 to 4.5 | 0.5 to 4.0 |
| greatest error, m | 0.08 | 0.5 | 0.7 | 1.9, a fifth lost | all lost | all lost |

`gcs check` and `gcs fly` warn below 5.8 rad/s, and refuse a vehicle below 4.2 rad/s. A delay lowers the
bandwidth far less, because the law predicts over it: with 200 ms that the autopilot knew (`VEH_ACT_DELAY`),
`bebop` and `heavy` kept 8 rad/s and flew `hover` with errors of 0.03 to 0.1 m.

## Rotors

Rotors are counted counterclockwise from above, starting at the rear, or to the left of the gap at the rear:
`rotors = 4` is the plus quadrotor of (2-13) with rotor 1 behind, 2 right, 3 ahead and 4 left. For any other
layout, list the rotors, each with its position:

```text
[[rotor]]
x_m = 0.25
y_m = -0.18
spin = "+"
thrust_factor = 1.2
```

Folding arms, coaxial pairs and rotors of different size are allowed as long as they can hold the vehicle
level. The rotor axes are upright. `VEH_ARM_LEN`, `VEH_TORQUE`, `VEH_ROTOR_MIN` and `VEH_ROTOR_MAX` scale
the positions, torques and limits of the file. No parameter sets the positions of the rotors: `sitl` and
`autopilot` read them from their files.

**Which rotor may fail.** The thrust and moments that n rotors can produce together form a polytope. The
vehicle can be held if the point of its weight without a moment lies inside. The distance to the nearest
face is the moment that remains available in every direction (the degree of controllability of Du, Quan and
others). For six rotors at equal angles, in newtons of one rotor of the shipped `hexarotor`, whose rotors
give 24 N:

| signs | all six, level and yaw | one lost, level moments | one lost, yaw as well |
|---|---|---|---|
| `+-+-+-`, as most hexarotors have them | 32 | 16 | 0, whichever |
| `++--+-`, as shipped | 25 | 16 | 11 to 13 for rotors 1 to 4; none for 5 and 6 |

With alternating signs a lost rotor leaves no yaw moment: the opposite rotor turns the other way, so in
balance both must give the same force, which is now zero. With `++--+-` the loss of any of four rotors only
reduces the margin. When rotor 5 or 6 is lost, the autopilot gives up the heading: the vehicle turns at
about 7 rad/s, and thrust, roll and pitch are controlled as before.

The autopilot detects a lost rotor by its speed, which the speed controllers report every 20 ms (ESC_STATUS
on the simulator link). A rotor counts as lost after three consecutive reports of a force that is less than
30 % of the expected force by more than 3 % of the rotor's greatest force. The expected force falls at once
with the commanded one, and rises towards it with a time constant of ten times the sum of the delays
(`VEH_ACT_DELAY`, `VEH_IMU_DELAY`), the lag `VEH_ROTOR_TAU` and 60 ms for three reports: {bebop_s:.1f} s for
`bebop`, {hexarotor_s:.1f} s for `hexarotor`. If the other rotors can fly the vehicle, the mixer is recomputed
for them, and the vehicle lands with its load. Three rotors cannot fly a quadrotor.

```sh
gcs fly case-b --vehicle hexarotor --set SIM_ENGINE_FAIL=4 --set SIM_ENGINE_AT_S=40   # rotor 3 stops
```

| key of [[rotor]] | unit | range | default | meaning |
|---|---|---|---|---|
"""
TAIL = """
In addition to its range, a value must fit the others: `rotor_max_n` is greater than `rotor_min_n`, which is
finite unless `rotor_max_n` is `inf`; none of the three moments of inertia is greater than the sum of the
other two. If `rotor_max_n` is `inf`, the mixer of the autopilot applies no limits (`VEH_ROTOR_LIM` 0).

Drag is -(linear + quadratic |v|) v, where v is the velocity relative to the air. [plant.md](plant.md)
explains the keys of the ground.

Every program reports an error in the file in this form:

```text
{wrong}
```
"""
WHAT = {
    "bebop-real": "a realistic Bebop, which the autopilot takes for `bebop`: slower rotors with drag, "
    "battery sag and downwash on the load, and the cable a centimetre off the centre "
    "([realism-plant.md](realism-plant.md))",
    "heavy-real": "the same for `heavy`, with paths that leave room for these effects",
    "bebop": "the default: a Parrot Bebop with a load, Table 4-1 of the thesis, with assumed values where it "
    "has none",
    "heavy": "2 kg with a load of 0.5 kg on 2 m of cable: not a real vehicle, but of typical dimensions",
    "hexarotor": "5 kg with a load of 1.5 kg on 1 m of cable: not a real vehicle either; it lands with its "
    "load after the loss of any one rotor",
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
PLACES = ("attachment_m", "imu_position_m", "antenna_position_m")
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
    "rotors": f"{MIN_ROTORS} ... {MAX_ROTORS}",
    "rotor_min_n": f"{-MAX_ROTOR_FORCE_N:g} ... {MAX_ROTOR_FORCE_N:g}, or -inf",
    "rotor_max_n": f"{MIN_ROTOR_MAX_N:g} ... {MAX_ROTOR_FORCE_N:g}, or inf",
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
    elif key in PLACES:
        allowed = "three of " + two_bounds(FieldInfo.from_annotation(Offset))
    else:
        allowed = RANGES.get(key) or two_bounds(field)
    if key in ARM_RATIOS:
        default = f"{ARM_RATIOS[key]:g} `arm_m`"
    elif key == "name":
        default = "the file's"
    elif key in PLACES:
        default = "the centre"
    elif isinstance(field.default, bool):
        default = f"`{str(field.default).lower()}`"
    elif key in ("frame", "spin", "rotor", "believed", "parameters"):
        default = f"`{field.default}`" if field.default and not field.is_required() else ""
    else:
        default = "" if field.is_required() else f"{field.default:g}"
    return f"| `{key}` | {unit} | {allowed} | {default} | {field.description} |\n"


def watch_s(vehicle: str) -> float:
    """The time constant with which the force expected of a rotor rises, s."""
    table = autopilot_parameters(load_vehicle(vehicle))
    return 1.0 / table["CTL_RATE_HZ"] / believed_rotor_watch(table)


def page() -> str:
    """The page as it should be."""
    shipped = "\n".join(f"* `{name}`: {WHAT[name]}" for name in VEHICLES.names())
    rows = "".join(row(key, field) for key, field in Vehicle.model_fields.items())
    rows += ROTORS.format(bebop_s=watch_s("bebop"), hexarotor_s=watch_s("hexarotor"))
    rows += "".join(row(key, field) for key, field in OneRotor.model_fields.items())
    return HEAD.format(shipped=shipped) + rows + TAIL.format(wrong="\n".join(WRONG))


def test_the_page_is_what_the_schema_has() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run: python tests/documentation/test_vehicles.py"


def test_a_key_ends_in_its_unit() -> None:
    def plain(text: str) -> str:
        return re.sub(r"[^a-z0-9]", "", text.lower())

    for key, field in Vehicle.model_fields.items():
        unit = (field.json_schema_extra or {}).get("unit", "")
        # a radian is a number: a key names it only where it could otherwise be taken for a frequency
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
    """The error message of a vehicle that cannot be read."""
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
