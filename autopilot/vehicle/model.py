"""A vehicle with cable and load: the record of both the true and the assumed vehicle, and the keys of a file.

The simulator loads the true vehicle, the autopilot the assumed one, by which `gcs check` judges missions too.
Body frame FLU, SI; a name ends in its unit. `docs/vehicles.md` is made from this class.
"""

from __future__ import annotations

from math import hypot, inf, isfinite
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from autopilot.vehicle.layout import MAX_ROTOR_FORCE_N, MAX_ROTORS, MIN_ROTORS, Layout, Rotor, regular_layout
from autopilot.vehicle.rotors import is_controllable, mixer_table, thrust_and_moment_per_force

MIN_ROTOR_MAX_N = 0.01
# The load rests at half the length of the cable beside the vehicle: from there the cable reaches this height.
_RESTING_REACH = 0.75**0.5
# Distance of the feet from the centre of mass, in radii of gyration. The push of the ground on the feet turns
# lighter bodies so fast that sub-steps of 0.5 ms cannot resolve it: vehicles tumbled from 17 on.
_MAX_FEET_RADII = 15.0
_BATTERY_KEYS = ("battery_cells", "battery_capacity_mah", "battery_resistance_ohm", "battery_hover_w")

# sizes that a file may leave out, as shares of arm_m; `bebop` and `heavy` state theirs, which are similar
ARM_RATIOS = {
    "gear_height_m": 0.5,
    "gear_spread_m": 0.65,
    "rotor_reach_m": 1.6,
    "rotor_height_m": 0.25,
    "rotor_radius_m": 0.6,
}


def _quantity(unit: str, low: float, high: float, text: str, default: Any = ...) -> Any:
    """A number in `low` ... `high`, required unless there is a default."""
    return Field(default, ge=low, le=high, description=text, json_schema_extra={"unit": unit})


def _force(unlimited: float, low: float, high: float) -> Any:
    """The type of a rotor force: `low` ... `high`, or `unlimited`."""

    def check(value: float) -> float:
        if value == unlimited or low <= value <= high:
            return value
        raise PydanticCustomError("force", f"must be {low:g} ... {high:g}, or {unlimited:g} for no limit")

    return AfterValidator(check)


Moment = Annotated[float, Field(ge=1e-6, le=100.0)]


def _no_matrix(moments: Any) -> Any:
    """The moments of inertia, unless they are the rows of a matrix."""
    try:
        is_matrix = np.ndim(moments) > 1
    except ValueError:  # rows of different lengths
        is_matrix = False
    if is_matrix:
        raise PydanticCustomError(
            "moments", "must be three numbers; of a matrix give the diagonal, in axes in which the rest is 0"
        )
    return moments


Moments = Annotated[tuple[Moment, Moment, Moment], BeforeValidator(_no_matrix)]
Offset = Annotated[float, Field(ge=-1.0, le=1.0)]
RotorMin = Annotated[float, _force(-inf, -MAX_ROTOR_FORCE_N, MAX_ROTOR_FORCE_N)]
RotorMax = Annotated[float, _force(inf, MIN_ROTOR_MAX_N, MAX_ROTOR_FORCE_N)]


class OneRotor(BaseModel):
    """A rotor at any place. Its axis is upright."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    x_m: float = _quantity("m", -5.0, 5.0, "place forward of the centre of mass")
    y_m: float = _quantity("m", -5.0, 5.0, "place to the left of the centre of mass")
    spin: Literal["+", "-"] = Field(description="as in `spin` of the vehicle")
    thrust_factor: float = _quantity(
        "", 0.1, 10.0, "share of `rotor_min_n` and `rotor_max_n` that are its limits", 1.0
    )
    torque_factor: float = _quantity("", 0.1, 10.0, "share of `torque_ratio_m` that is its own", 1.0)
    lag_factor: float = _quantity("", 0.0, 10.0, "share of `rotor_tau_s` that is its lag", 1.0)


class Vehicle(BaseModel):
    """A vehicle, its cable and its load, SI. Values out of range or inconsistent are refused when it is made.

    Assumptions: principal axes are the body axes; the cable is massless and inextensible; the rotors' axes
    are upright; drag is -(linear + quadratic |v|) v on the velocity v relative to the air.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    name: str = Field("", description="what it is called; the programs go by the name of the file")
    believed: str = Field(
        "",
        description="the vehicle that autopilot and `gcs check` take it for, a shipped name or a file beside "
        "this one; keys that are left out are as there",
    )
    rotors: int = Field(4, ge=MIN_ROTORS, le=MAX_ROTORS, description="number of rotors")
    frame: Literal["plus", "x"] = Field(
        "plus",
        description="rotors at equal angles, counterclockwise from the rear; `plus`: an arm points backward, "
        "`x`: the gap between two",
    )
    spin: str = Field(
        "",
        description="a sign a rotor: `+` turns the vehicle counterclockwise, seen from above, and itself "
        "clockwise, `-` the other way; if left out `-+-+` and so on",
    )
    rotor: tuple[OneRotor, ...] = Field(
        (),
        strict=False,
        max_length=MAX_ROTORS,
        description="rotors at any places, each a table [[rotor]], in place of `rotors`, `frame` and `spin`",
    )

    parameters: dict[str, float] = Field(
        {},
        description="parameters of the autopilot with which this vehicle is delivered, a table [parameters] "
        "with names and values; beside a belief they are the autopilot's too",
    )

    # the range of the gains that grow with the mass (QP_) ends at 62 kg
    quad_mass_kg: float = _quantity("kg", 0.01, 60.0, "mass of the vehicle without its load")
    load_mass_kg: float = _quantity("kg", 0.001, 100.0, "mass of the load")
    cable_length_m: float = _quantity("m", 0.05, 100.0, "length of the cable")
    arm_m: float = _quantity("m", 0.01, 5.0, "from the centre of mass to a rotor's axis")
    attachment_m: tuple[Offset, Offset, Offset] = Field(
        (0.0, 0.0, 0.0),
        strict=False,
        description="where the cable is attached: forward, left and upward of the centre of mass",
        json_schema_extra={"unit": "m"},
    )
    imu_position_m: tuple[Offset, Offset, Offset] = Field(
        (0.0, 0.0, 0.0),
        strict=False,
        description="where the inertial unit sits, as `attachment_m`",
        json_schema_extra={"unit": "m"},
    )
    antenna_position_m: tuple[Offset, Offset, Offset] = Field(
        (0.0, 0.0, 0.0),
        strict=False,
        description="where the antenna of the satellite receiver sits, as `attachment_m`",
        json_schema_extra={"unit": "m"},
    )
    inertia_kg_m2: Moments = Field(
        strict=False,  # TOML has lists, not tuples
        description="moments of inertia about the forward, left and upward axis",
        json_schema_extra={"unit": "kg m^2"},
    )
    gravity_m_s2: float = _quantity("m/s^2", 0.1, 30.0, "acceleration of gravity")

    rotor_min_n: RotorMin = Field(
        allow_inf_nan=True, description="least force of one rotor", json_schema_extra={"unit": "N"}
    )
    rotor_max_n: RotorMax = Field(
        allow_inf_nan=True, description="greatest force of one rotor", json_schema_extra={"unit": "N"}
    )
    torque_ratio_m: float = _quantity("m", 1e-5, 1.0, "drag torque of a rotor for each newton of its force")
    rotor_tau_s: float = _quantity("s", 0.0, 1.0, "first-order lag of the rotor force", 0.0)

    quad_drag_n_s_m: float = _quantity("N s/m", 0.0, 100.0, "linear drag of the vehicle", 0.0)
    quad_drag_quadratic_n_s2_m2: float = _quantity(
        "N s^2/m^2", 0.0, 100.0, "quadratic drag of the vehicle", 0.0
    )
    spin_drag_n_m_s2: float = _quantity(
        "N m s^2/rad^2", 0.0, 100.0, "moment against a rotation, for each square of its rate", 0.0
    )
    load_drag_n_s_m: float = _quantity("N s/m", 0.0, 100.0, "linear drag of the load", 0.0)
    load_drag_quadratic_n_s2_m2: float = _quantity("N s^2/m^2", 0.0, 100.0, "quadratic drag of the load", 0.0)

    gear_height_m: float = _quantity(
        "m", 1e-3, 10.0, "height of the centre of mass as the vehicle stands on its feet"
    )
    gear_spread_m: float = _quantity("m", 1e-3, 10.0, "the four feet stand at (+-spread, +-spread)")
    rotor_reach_m: float = _quantity("m", 1e-3, 10.0, "from the centre of mass to a blade's tip")
    rotor_height_m: float = _quantity("m", 0.0, 10.0, "height of the rotor plane above the centre of mass")
    load_radius_m: float = _quantity(
        "m", 1e-3, 10.0, "height of the load's centre as it rests on the ground", 0.02
    )

    # a cable of links and a load that rotates, only in the simulated world: docs/realism-cable.md
    cable_links: int = Field(
        0,
        ge=0,
        le=64,
        description="links of the simulated cable; 0: it is massless, its length fixed, and the load a point",
    )
    cable_mass_kg_m: float = _quantity("kg/m", 1e-4, 2.0, "mass of a metre of cable, if it has links", 0.0024)
    cable_drag_coefficient: float = _quantity("", 0.0, 5.0, "drag coefficient of a cable of links", 1.2)
    cable_stiffness_n: float = _quantity("N", 100.0, 1e7, "tension per strain of a cable of links", 2e4)
    cable_damping_n_s: float = _quantity(
        "N s", 0.0, 1e4, "tension per rate of strain of a cable of links", 10.0
    )
    load_hook_m: float = _quantity(
        "m", 0.0, 5.0, "height above the centre of the load at which a cable of links is attached", 0.0
    )
    load_gyration_m: float = _quantity(
        "m", 0.0, 5.0, "radius of gyration across its upright axis of a load that turns; 0: a point", 0.0
    )
    load_gyration_upright_m: float = _quantity(
        "m", 1e-4, 5.0, "radius of gyration of the load about its upright axis", 0.02
    )
    load_pressure_m: float = _quantity(
        "m", -5.0, 5.0, "how far forward of its centre the drag of a load that turns acts", 0.0
    )
    load_spin_drag_n_m_s2: float = _quantity(
        "N m s^2/rad^2",
        0.0,
        100.0,
        "moment against a rotation of the load, for each square of its rate",
        0.0,
    )

    # the sub-step near the ground resolves contacts up to this frequency: docs/plant.md
    contact_frequency_rad_s: float = _quantity(
        "rad/s", 20.0, 200.0, "natural frequency of a body on the ground", 150.0
    )
    contact_damping_ratio: float = _quantity("", 0.0, 1.5, "damping ratio of a body on the ground", 0.7)
    friction: float = _quantity("", 0.0, 5.0, "Coulomb coefficient of the ground", 0.6)
    slip_rate_1_s: float = _quantity(
        "1/s", 1e-3, 600.0, "rate at which friction below the Coulomb limit brakes a slide", 500.0
    )

    # docs/realism-plant.md explains each of these and gives the sources of the numbers
    rotor_radius_m: float = _quantity("m", 1e-3, 5.0, "radius of a rotor")
    air_density_kg_m3: float = _quantity("kg/m^3", 0.01, 10.0, "density of the air", 1.225)
    rotor_drag_1_s: float = _quantity(
        "1/s", 0.0, 10.0, "induced drag of the rotors, for each kilogram that they carry; 0: none", 0.0
    )
    rotor_flap_rad_s_m: float = _quantity(
        "rad s/m", 0.0, 0.5, "tilt of a rotor's disc for each m/s of air across it; 0: none", 0.0
    )
    blade_stiffness_n_m_rad: float = _quantity(
        "N m/rad", 0.0, 1000.0, "moment at the hub of a rotor whose disc is tilted", 0.0
    )
    ground_effect: float = _quantity(
        "", 0.0, 5.0, "thrust gained near the ground, of what the formula says; 0: none", 0.0
    )
    downwash: float = _quantity(
        "", 0.0, 5.0, "speed of the rotors' wake at load and cable, of what the formula says; 0: none", 0.0
    )
    cable_diameter_m: float = _quantity("m", 0.0, 0.1, "diameter of the cable, for its drag; 0: no drag", 0.0)
    thrust_curve: float = _quantity(
        "", 0.0, 1.0, "quadratic share of a rotor's force in its throttle, the rest is linear", 0.0
    )
    thrust_curve_known: float = _quantity(
        "", 0.0, 1.0, "the share by which the forces asked for are made throttle", 0.0
    )
    esc_steps: float = _quantity(
        "", 0.0, 65535.0, "values of the throttle that a speed controller knows; 0: any", 0.0
    )
    esc_speed_controlled: bool = Field(
        False,
        description="whether a speed controller holds the speed as the voltage falls, as far as it allows",
    )
    battery: bool = Field(
        False,
        description="whether voltage and charge of the battery limit the rotors; if true, the next four keys "
        "are required",
    )
    # the defaults are a Bebop's: what the autopilot reports where no battery is simulated, and limits nothing
    battery_cells: int = Field(3, ge=1, le=24, description="lithium cells in series")
    battery_capacity_mah: float = _quantity("mAh", 10.0, 1e6, "charge of the full battery", 1200.0)
    battery_resistance_ohm: float = _quantity("ohm", 0.0, 10.0, "internal resistance of the battery", 0.06)
    battery_hover_w: float = _quantity("W", 0.1, 1e5, "electrical power in hover without the load", 65.0)
    battery_charge: float = _quantity("", 0.0, 1.0, "share of the charge at the beginning, 0.25: 25 %", 1.0)

    @property
    def layout(self) -> Layout:
        """The positions of its rotors and how they differ."""
        if not self.rotor:
            signs = self.spin or ("-+" * MAX_ROTORS)[: self.rotors]
            spins = tuple(1.0 if sign == "+" else -1.0 for sign in signs)
            return regular_layout(self.rotors, self.frame == "plus", spins)
        return tuple(
            Rotor(
                r.x_m / self.arm_m,
                r.y_m / self.arm_m,
                r.torque_factor * (1.0 if r.spin == "+" else -1.0),
                r.thrust_factor,
                r.lag_factor,
            )
            for r in self.rotor
        )

    @property
    def greatest_thrust_n(self) -> float:
        """Thrust (N) at which the first rotor reaches its limit."""
        return thrust_and_moment_per_force(mixer_table(self.layout))[0] * self.rotor_max_n

    @property
    def hover_force_n(self) -> float:
        """Force (N) of a rotor of strength 1 while the vehicle hovers with its load."""
        weight = (self.quad_mass_kg + self.load_mass_kg) * self.gravity_m_s2
        return weight / thrust_and_moment_per_force(mixer_table(self.layout))[0]

    @property
    def limited(self) -> bool:
        """Whether the force of a rotor has an upper limit."""
        return self.rotor_max_n < inf

    @model_validator(mode="before")
    @classmethod
    def _with_default_sizes(cls, table: Any) -> Any:
        if not isinstance(table, dict):
            return table
        arm = table.get("arm_m")
        # a missing or wrong arm is reported once, and not for each size derived from it
        length = arm if isinstance(arm, int | float) and 0.01 <= arm <= 5.0 else 1.0
        sizes = {key: share * length for key, share in ARM_RATIOS.items()}
        return {**sizes, **table}

    @model_validator(mode="after")
    def _check_consistency(self) -> Vehicle:
        if not self.rotor_min_n < self.rotor_max_n:
            raise ValueError(
                f"rotor_max_n = {self.rotor_max_n:g}; must be > rotor_min_n = {self.rotor_min_n:g}"
            )
        if self.limited and not isfinite(self.rotor_min_n):
            raise ValueError(
                f"rotor_min_n = {self.rotor_min_n:g}; must be finite because rotor_max_n = "
                f"{self.rotor_max_n:g} is; write rotor_max_n = inf for rotors without limits"
            )
        if not self.load_hook_m <= 0.5 * self.cable_length_m:
            raise ValueError(
                f"load_hook_m = {self.load_hook_m:g}; must be <= half of cable_length_m = "
                f"{self.cable_length_m:g}, which reaches to the load's centre"
            )
        x, y, z = self.inertia_kg_m2
        if not (x <= y + z and y <= x + z and z <= x + y):
            raise ValueError(
                f"inertia_kg_m2 = {[x, y, z]}; each must be <= the sum of the other two, or no body has it; "
                "check their order, about the forward, left and upward axis, and that all are in kg m^2"
            )
        reach = max(
            hypot(self.rotor_reach_m, self.rotor_height_m),
            hypot(self.gear_height_m, self.gear_spread_m, self.gear_spread_m),
        )
        greatest = self.quad_mass_kg * reach**2  # all of the mass at the tips of the rotors, or at the feet
        if max(x, y, z) > greatest:
            raise ValueError(
                f"inertia_kg_m2 = {[x, y, z]}; a body of {self.quad_mass_kg:g} kg within {reach:.2g} m has "
                f"{greatest:.2g} at most; check that all are in kg m^2, quad_mass_kg, and arm_m, from which "
                "rotor_reach_m follows where it is left out"
            )
        curved = self.thrust_curve != self.thrust_curve_known
        if not self.limited and (self.battery or self.esc_steps or curved):
            raise ValueError(
                f"rotor_max_n = {self.rotor_max_n:g}; must be finite, because battery, esc_steps or "
                "thrust_curve say what becomes of a share of it"
            )
        missing = [key for key in _BATTERY_KEYS if key not in self.model_fields_set] if self.battery else []
        if missing:
            raise ValueError(
                f"battery = true; needs {', '.join(missing)} too (their defaults are those of a "
                "Bebop, 0.4 kg)"
            )
        if not self.esc_steps.is_integer():
            raise ValueError(f"esc_steps = {self.esc_steps:g}; must be a whole number")
        self._check_rest()
        self._check_rotors()
        return self

    def _check_rest(self) -> None:
        """Whether vehicle and load can stand and lie on the ground."""
        height = self.gear_height_m + self.attachment_m[2] - self.load_radius_m
        highest = _RESTING_REACH * self.cable_length_m
        if height > highest:
            raise ValueError(
                f"cable_length_m = {self.cable_length_m:g}; must be >= {height / _RESTING_REACH:.3g}, so "
                "that the load can lie beside the vehicle, whose gear_height_m is "
                f"{self.gear_height_m:g} (half of arm_m where it is left out)"
            )
        feet = hypot(self.gear_height_m, self.gear_spread_m, self.gear_spread_m)
        least = self.quad_mass_kg * (feet / _MAX_FEET_RADII) ** 2
        if min(self.inertia_kg_m2) < least:
            raise ValueError(
                f"inertia_kg_m2 = {list(self.inertia_kg_m2)}; each must be >= {least:.3g} for a vehicle of "
                f"this mass with feet {feet:.2g} m from its centre, or it tumbles on the ground; check "
                "arm_m, from which gear_height_m and gear_spread_m follow where they are left out"
            )

    @classmethod
    def _default(cls, key: str) -> Any:
        return cls.model_fields[key].default

    def _check_rotors(self) -> None:
        given = [key for key in ("rotors", "frame", "spin") if getattr(self, key) != self._default(key)]
        if self.rotor and given:
            raise ValueError(f"{given[0]}: leave it out, because [[rotor]] says where each rotor is")
        if self.rotor and len(self.rotor) < MIN_ROTORS:
            raise ValueError(
                f"rotor: there must be {MIN_ROTORS} ... {MAX_ROTORS} tables [[rotor]], not {len(self.rotor)}"
            )
        if set(self.spin) - {"+", "-"} or (self.spin and len(self.spin) != self.rotors):
            raise ValueError(f'spin = "{self.spin}"; must be {self.rotors} signs + or -, one a rotor')
        if not is_controllable(self.layout):
            raise ValueError(
                "rotor places and spins: the vehicle cannot be held level with these; put rotors on all "
                "sides, and let them turn both ways"
            )
