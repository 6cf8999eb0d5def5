"""The column map of a recording, a TOML file: its columns, how it was recorded, and the assumed load."""

from __future__ import annotations

from collections.abc import Iterator
from os import PathLike
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from gcs.recorded.load_model import LoadModel
from missions.toml_files import FileError, TomlFiles

Column = Annotated[int, Field(ge=0, le=9999)]
ThreeColumns = Annotated[list[Column], Field(min_length=3, max_length=3)]
FourColumns = Annotated[list[Column], Field(min_length=4, max_length=4)]
Positive = Annotated[float, Field(gt=0.0, le=1e6, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, le=1e6, allow_inf_nan=False)]
Finite = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]


class MapError(FileError):
    """The column map is wrong."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid")


class VehicleColumns(_Table):
    """The vehicle's measured pose, in a frame whose z is up; body z up, too."""

    position: ThreeColumns
    quaternion: FourColumns
    quaternion_order: Literal["xyzw", "wxyz"] = "wxyz"


class LoadColumns(_Table):
    """The load's measured position."""

    position: ThreeColumns


class Tracking(_Table):
    """Noise of the measured poses, and of the jerk of the motion."""

    noise_m: Positive = 1e-3  # of the difference between measured and smoothed course
    grid_noise_m: Positive = 4e-4  # the same while times of rows are inferred
    jerk_density: Positive = 100.0  # m^2/s^5


class Attachment(_Table):
    """Attachment point of the cable and direction of the thrust, in the tracked body."""

    below_m: Finite = 0.0
    thrust_tilt: Annotated[list[Finite], Field(min_length=2, max_length=2)] = [0.0, 0.0]


class ModelTable(_Table):
    """Parameters of `LoadModel`; the default length is the median distance from attachment to load."""

    length_m: Positive | None = None
    drag_per_m: Finite = 0.0
    wash_per_s2: Finite = 0.0
    swirl_per_s2: Finite = 0.0
    wash_radius_m: Positive = 0.5
    wash_delay_s: NotNegative = 0.0
    acceleration_share: Finite = 0.0
    push_x_m_s2: Finite = 0.0
    push_y_m_s2: Finite = 0.0
    mass_ratio: NotNegative
    vehicle_drag_per_s: Finite = 0.0
    tilt_share: Positive = 1.0
    turbulence_m_s2: Positive = 0.05
    turbulence_s: Positive = 3.0
    force_density: Positive = 0.05
    seen_m: Positive = 2e-3
    seen_s: NotNegative = 0.0
    tilt_noise: Positive = 0.03
    tilt_per_accel: NotNegative = 0.0
    tilt_walk: Positive = 1e-3


ParameterName = Literal[
    "length_m",
    "drag_per_m",
    "wash_per_s2",
    "swirl_per_s2",
    "wash_radius_m",
    "wash_delay_s",
    "acceleration_share",
    "push_x_m_s2",
    "push_y_m_s2",
]


class Identify(_Table):
    """The parameters of the load that `gcs identify` estimates."""

    parameters: Annotated[list[ParameterName], Field(min_length=1)] = ["length_m", "drag_per_m"]


class ColumnMap(_Table):
    """A column map. Columns are counted from 0; SI units."""

    rate_hz: Annotated[float, Field(gt=1.0, le=10000.0)] | None = None  # of rows without a time
    jitter_s: Positive = 1e-3  # and the standard deviation of their times
    time: Column | None = None  # s
    gravity_m_s2: Positive = 9.81
    vehicle: VehicleColumns | None = None
    load: LoadColumns | None = None
    tracking: Tracking = Tracking()
    attachment: Attachment = Attachment()
    model: ModelTable
    identify: Identify = Identify()

    @model_validator(mode="after")
    def _consistent(self) -> ColumnMap:
        if self.time is not None and self.rate_hz is not None:
            raise ValueError("has both time and rate_hz; rows that have a time need no rate")
        used: dict[int, str] = {}
        for name, column in self._columns():
            if column in used:
                raise ValueError(f"{name} = {column}; is {used[column]} already")
            used[column] = name
        return self

    def _columns(self) -> Iterator[tuple[str, int]]:
        if self.time is not None:
            yield "time", self.time
        vehicle, load = self.vehicle, self.load
        lists = {
            "vehicle.position": vehicle.position if vehicle else (),
            "vehicle.quaternion": vehicle.quaternion if vehicle else (),
            "load.position": load.position if load else (),
        }
        for name, columns in lists.items():
            yield from ((f"{name}[{i}]", column) for i, column in enumerate(columns))

    def load_model(self, length_m: float) -> LoadModel:
        """The model; `length_m` is used if the map gives no length."""
        given = self.model.model_dump()
        given["length_m"] = given["length_m"] or length_m
        return LoadModel(gravity_m_s2=self.gravity_m_s2, **given)


MAPS = TomlFiles("column map", MapError, "gcs.recorded.maps")


def load_map(name_or_path: str | PathLike[str]) -> ColumnMap:
    """The map of a shipped name or of a file; MapError if there is none, or it is wrong."""
    read = MAPS.read(name_or_path)
    return MAPS.record(ColumnMap, MAPS.table(read.text, read.where), read.where)
