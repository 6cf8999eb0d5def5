"""The keys of a mission file, their units and bounds, and the steps that they define.

Every number is finite, every key known. A key ends in its unit. `Field.description` says in a few words what
the value is; error messages and the documentation quote it.
"""

from __future__ import annotations

from math import radians
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, field_validator, model_validator

from missions import limits, model
from missions.errors import PathError

Seconds = Annotated[float, Field(ge=0.0, le=limits.LONGEST_S)]
RunSeconds = Annotated[float, Field(ge=limits.SHORTEST_RUN_S, le=limits.LONGEST_S)]
EdgeSeconds = Annotated[float, Field(ge=limits.SHORTEST_EDGE_S, le=limits.LONGEST_S)]
Metres = Annotated[float, Field(ge=-limits.FARTHEST_M, le=limits.FARTHEST_M)]
Height = Annotated[
    float,
    Field(ge=limits.LOWEST_M, le=limits.FARTHEST_M, description="height of the load above home"),
]
Degrees = Annotated[float, Field(ge=-limits.LARGEST_TILT_DEG, le=limits.LARGEST_TILT_DEG)]


class Spec(BaseModel):
    """Strict: no unknown keys, no silent conversion, no nan and no infinity."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class Item(Spec):
    """One [[items]] table without its `type`."""

    def step(self) -> model.Step:
        """The step that the item defines."""
        raise NotImplementedError


class TakeoffItem(Item):
    altitude_m: Height

    def step(self) -> model.Step:
        return model.Takeoff(self.altitude_m)


class WaypointItem(Item):
    east_m: Metres = Field(description="east of home")
    north_m: Metres = Field(description="north of home")
    altitude_m: Height
    hold_s: Seconds = Field(0.0, description="time to hold there")

    def step(self) -> model.Step:
        return model.Waypoint(self.east_m, self.north_m, self.altitude_m, self.hold_s)


class SpeedItem(Item):
    speed_m_s: float | None = Field(
        None,
        ge=limits.SLOWEST_M_S,
        le=limits.FASTEST_M_S,
        description="peak speed on the transfers that follow",
    )

    def step(self) -> model.Step:
        return model.Speed(self.speed_m_s)


class FenceItem(Item):
    on: bool = Field(description="whether the vehicle's fence is in force from here on")

    def step(self) -> model.Step:
        return model.SwitchFence(self.on)


class DelayItem(Item):
    duration_s: RunSeconds = Field(description="time to hold the load where it hangs")

    def step(self) -> model.Step:
        return model.Delay(self.duration_s)


class ReturnItem(Item):
    def step(self) -> model.Step:
        return model.ReturnHome()


class LandItem(Item):
    def step(self) -> model.Step:
        return model.Land()


class ReleaseItem(Item):
    def step(self) -> model.Step:
        return model.Release()


class PlaceItem(Item):
    def step(self) -> model.Step:
        return model.PlaceLoad()


class WinchItem(Item):
    length_m: float = Field(
        ge=-limits.LONGEST_CABLE_M,
        le=limits.LONGEST_CABLE_M,
        description="by which the cable gets longer; negative: shorter",
    )
    speed_m_s: float | None = Field(
        None, ge=limits.SLOWEST_REEL_M_S, le=limits.FASTEST_REEL_M_S, description="peak rate of the winch"
    )

    def step(self) -> model.Step:
        return model.Winch(self.length_m, self.speed_m_s)


class SineSpec(Spec):
    period_s: float = Field(
        ge=limits.SHORTEST_PERIOD_S, le=limits.LONGEST_PERIOD_S, description="period of the sine"
    )
    phase_deg: float = Field(
        0.0, ge=-limits.LARGEST_PHASE_DEG, le=limits.LARGEST_PHASE_DEG, description="phase at start_s"
    )
    start_s: Seconds = Field(0.0, description="time of the phase, from the beginning of the signals")

    def sine(self) -> model.Sine:
        return model.Sine(self.period_s, radians(self.phase_deg), self.start_s)


class TermSpec(Spec):
    axis: Literal["x", "y", "z"] = Field(description="x east, y north, z up")
    amplitude_m: Metres = Field(description="height of the envelope")
    start_s: Seconds = Field(0.0, description="beginning of the rise, from the beginning of the signals")
    rise_s: EdgeSeconds = Field(description="duration of the half-cosine rise")
    hold_s: Seconds | None = Field(None, description="time at the top; leave out with fall_s to stay there")
    fall_s: EdgeSeconds | None = Field(None, description="duration of the half-cosine fall")
    factors: list[SineSpec] = Field(default_factory=list, max_length=limits.MAX_FACTORS)
    rise_90_by_s: EdgeSeconds | None = Field(
        None, description="time after start_s by which nine tenths of the rise are to be made"
    )

    @model_validator(mode="after")
    def _hold_and_fall_belong_together(self) -> TermSpec:
        if (self.hold_s is None) != (self.fall_s is None):
            raise ValueError("needs hold_s and fall_s, both or neither (neither: it stays at the top)")
        return self

    @model_validator(mode="after")
    def _arrival_is_of_a_bare_edge(self) -> TermSpec:
        if self.rise_90_by_s is not None and self.factors:
            raise ValueError("has rise_90_by_s and factors; a wave makes no rise that could be timed")
        return self

    def term(self) -> model.Term:
        factors = tuple(factor.sine() for factor in self.factors)
        fall_s = 0.0 if self.fall_s is None else self.fall_s
        return model.Term(
            self.axis,
            self.amplitude_m,
            self.start_s,
            self.rise_s,
            self.hold_s,
            fall_s,
            factors,
            self.rise_90_by_s,
        )


class SignalsItem(Item):
    duration_s: RunSeconds = Field(description="duration of the whole trajectory")
    terms: list[TermSpec] = Field(min_length=1, max_length=limits.MAX_TERMS)

    def step(self) -> model.Step:
        return model.Signals(self.duration_s, tuple(term.term() for term in self.terms))


class TrajectoryItem(Item):
    file: str | None = Field(None, description="CSV file with the columns t_s, east_m, north_m, altitude_m")
    tolerance_m: float | None = Field(
        None,
        ge=limits.FINEST_TOLERANCE_M,
        le=limits.COARSEST_TOLERANCE_M,
        description="within which the path passes the rows of the file; none: 0.001",
    )
    points: list[Annotated[list[float], Field(min_length=4, max_length=4)]] | None = Field(
        None, description="[t_s, east_m, north_m, altitude_m] of each, instead of a file"
    )
    _trajectory: model.Trajectory = PrivateAttr()

    @model_validator(mode="after")
    def _is_a_path(self) -> TrajectoryItem:
        from missions.trajectory import through_points  # loads much

        if (self.file is None) == (self.points is None):
            found = "no file and no points" if self.points is None else "both a file and points"
            raise ValueError(f"has {found}; must have one of them")
        if self.points is not None:
            if self.tolerance_m is not None:
                raise ValueError("has tolerance_m and points, which are passed exactly")
            try:
                self._trajectory = through_points(self.points)
            except PathError as error:
                raise ValueError(str(error).replace("rows", "points", 1)) from None
        return self

    def along(self, trajectory: model.Trajectory) -> TrajectoryItem:
        """The item with the trajectory of its file."""
        self._trajectory = trajectory
        return self

    def step(self) -> model.Step:
        return self._trajectory


class AttitudeItem(Item):
    controlled: Literal["vehicle", "load"] = Field(description="whose attitude is tracked")
    tilt_north_deg: Degrees = Field(0.0, description="largest tilt towards north")
    tilt_east_deg: Degrees = Field(0.0, description="largest tilt towards east")
    duration_s: EdgeSeconds = Field(description="duration of the swing out and back")

    def step(self) -> model.Step:
        north, east = radians(self.tilt_north_deg), radians(self.tilt_east_deg)
        return model.AttitudeRun(self.controlled, north, east, self.duration_s)


ITEMS: dict[str, type[Item]] = {
    "takeoff": TakeoffItem,
    "waypoint": WaypointItem,
    "speed": SpeedItem,
    "fence": FenceItem,
    "delay": DelayItem,
    "signals": SignalsItem,
    "trajectory": TrajectoryItem,
    "attitude": AttitudeItem,
    "return": ReturnItem,
    "release": ReleaseItem,
    "place": PlaceItem,
    "winch": WinchItem,
    "land": LandItem,
}


class FileSpec(Spec):
    title: str = Field(
        min_length=1, max_length=limits.LONGEST_TITLE, description="one line for lists and reports"
    )
    description: str = Field("", description="what the mission is for")
    assumptions: list[str] = Field(default_factory=list, description="values chosen, one sentence each")
    items: list[dict[str, Any]] = Field(
        min_length=1, max_length=limits.MAX_ITEMS, description="the [[items]] in order"
    )

    @field_validator("title")
    @classmethod
    def _is_one_line(cls, title: str) -> str:
        if not title.isprintable():
            raise ValueError("must be one line of printable characters (for lists and reports)")
        return title
