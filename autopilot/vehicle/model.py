"""What a vehicle with cable and load is: the record of both truth and belief, and the keys of a vehicle file.

Truth is the value that the simulator loads, belief the one that the autopilot loads. `gcs check` judges
missions by it. Body frame FLU, SI; a name ends in its unit. `docs/vehicles.md` is made from this class.
"""

from __future__ import annotations

from math import inf, isfinite
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

LEAST_ROTOR_MAX_N = 0.01
GREATEST_FORCE_N = 1000.0

# sizes that a file may leave out, as shares of arm_m; `bebop` and `heavy` state theirs, which are near
SHARE_OF_ARM = {"gear_height_m": 0.5, "gear_spread_m": 0.65, "rotor_reach_m": 1.6, "rotor_height_m": 0.25}


def _quantity(unit: str, low: float, high: float, text: str, default: Any = ...) -> Any:
    """A number of `low` ... `high`, required unless there is a default."""
    return Field(default, ge=low, le=high, description=text, json_schema_extra={"unit": unit})


def _force(unlimited: float, low: float, high: float) -> Any:
    """The type of a rotor force: `low` ... `high`, or `unlimited`."""

    def check(value: float) -> float:
        if value == unlimited or low <= value <= high:
            return value
        raise PydanticCustomError("force", f"must be {low:g} ... {high:g}, or {unlimited:g} for no limit")

    return AfterValidator(check)


Moment = Annotated[float, Field(ge=1e-6, le=100.0)]
RotorMin = Annotated[float, _force(-inf, -GREATEST_FORCE_N, GREATEST_FORCE_N)]
RotorMax = Annotated[float, _force(inf, LEAST_ROTOR_MAX_N, GREATEST_FORCE_N)]


class Vehicle(BaseModel):
    """A vehicle, its cable and its load, SI. A Vehicle is within its ranges and consistent, or there is none.

    Assumptions: principal axes are the body axes; the cable is massless, inextensible and attached at the
    centre of mass; drag is -(linear + quadratic |v|) v on the velocity v relative to the air.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    name: str = Field("", description="what it is called; the programs go by the name of the file")
    rotors: Literal[4] = Field(4, description="number of rotors; only quadrotors can be flown")

    # the gains that grow with the mass (QP_) end at 62 kg
    quad_mass_kg: float = _quantity("kg", 0.01, 60.0, "mass of the vehicle without its load")
    load_mass_kg: float = _quantity("kg", 0.001, 100.0, "mass of the load")
    cable_length_m: float = _quantity("m", 0.05, 100.0, "length of the cable")
    arm_m: float = _quantity("m", 0.01, 5.0, "from the centre of mass to a rotor's axis")
    inertia_kg_m2: tuple[Moment, Moment, Moment] = Field(
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

    # the sub-step near the ground resolves contacts up to this frequency: docs/plant.md
    contact_frequency_rad_s: float = _quantity(
        "rad/s", 20.0, 200.0, "natural frequency of a body on the ground", 150.0
    )
    contact_damping_ratio: float = _quantity("", 0.0, 1.5, "damping ratio of a body on the ground", 0.7)
    friction: float = _quantity("", 0.0, 5.0, "Coulomb coefficient of the ground", 0.6)
    slip_rate_1_s: float = _quantity(
        "1/s", 1e-3, 600.0, "rate at which friction below the Coulomb limit brakes a slide", 500.0
    )

    @property
    def limited(self) -> bool:
        """Whether the force of a rotor has a greatest value."""
        return self.rotor_max_n < inf

    @model_validator(mode="before")
    @classmethod
    def _sizes_follow_the_arm(cls, table: Any) -> Any:
        if not isinstance(table, dict):
            return table
        arm = table.get("arm_m")
        # an arm that is missing or wrong is told of once, and not for each size that follows it
        length = arm if isinstance(arm, int | float) and 0.01 <= arm <= 5.0 else 1.0
        sizes = {key: share * length for key, share in SHARE_OF_ARM.items()}
        return {**sizes, **table}

    @model_validator(mode="after")
    def _consistent(self) -> Vehicle:
        if not self.rotor_min_n < self.rotor_max_n:
            raise ValueError(
                f"rotor_max_n = {self.rotor_max_n:g}; must be > rotor_min_n = {self.rotor_min_n:g}"
            )
        if self.limited and not isfinite(self.rotor_min_n):
            raise ValueError(
                f"rotor_min_n = {self.rotor_min_n:g}; must be finite because rotor_max_n = "
                f"{self.rotor_max_n:g} is; write rotor_max_n = inf for rotors without limits"
            )
        x, y, z = self.inertia_kg_m2
        if not (x <= y + z and y <= x + z and z <= x + y):
            raise ValueError(
                f"inertia_kg_m2 = {[x, y, z]}; each must be <= the sum of the other two, or no body has it"
            )
        return self
