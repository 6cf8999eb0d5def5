"""One flight: flown in this process, and its results."""

from __future__ import annotations

import io
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal

from autopilot.shell.atomic_file import write_atomically
from autopilot.vehicle.parameters import DEFAULT_LAW
from autopilot.wire.tlog import TlogWriter, read_tlog
from gcs.errors import GcsError, write_error
from gcs.folders import (
    PAGE_FILE,
    SENSORS_FOLDER,
    TLOG_FILE,
    check_no_other_results,
    make_folder,
    reserved,
)
from gcs.foreign_mission import ForeignMission
from gcs.mission_files import load
from gcs.workflows.flight_meta import meta_of
from gcs.workflows.flight_options import FlightOptions
from missions import model
from missions.nearest import did_you_mean
from plumbline.arguments import (
    called_by_scripts,
    checked_flags,
    errors_for_python,
    file_path,
    positive,
    reworded_for_python,
    setting_arguments,
    text,
    whole_number,
)
from plumbline.frames import as_frame
from plumbline.made_files import name_or_path
from plumbline.missions import Mission
from plumbline.references import estimator_reference, law_reference, planner_reference

if TYPE_CHECKING:
    from gcs.analysis.readings import Readings
    from gcs.analysis.record import FlightMeta, Record
    from gcs.analysis.samples import Samples
    from gcs.analysis.tracks import Telemetry
    from plumbline.sensors import Sensors
    from plumbline.vehicles import Vehicle

Settings = Mapping[str, float]  # parameters of simulator (SIM_) and autopilot by name


@called_by_scripts
def fly(
    mission: str | Path | model.Mission,
    *,
    law: str | type = DEFAULT_LAW,
    estimator: str | type | None = None,
    planner: str | type | None = None,
    sensors: str | Path | Sensors = "lab",
    vehicle: str | Path | Vehicle = "bebop",
    seed: int = 1,
    settings: Settings | None = None,
    timeout_s: float | None = None,
    force: bool = False,
    log_sensors: bool = False,
    quiet: bool = True,
) -> Flight:
    """Fly a mission from take-off to landing, as fast as this machine can.

    `mission`: the name of a shipped mission, the path of a file, also of a `.plan` or `.waypoints` file of
    another ground station, or a `Mission`. `sensors` and `vehicle`: a
    shipped name, the path of a file, a `Sensors` or a `Vehicle`. `law`: the name of a shipped law,
    `FILE.py:CLASS`, `MODULE:CLASS` (docs/laws.md), or the class itself. `estimator` and `planner`: a custom
    estimator or path planner, given in the same ways (docs/estimators.md, docs/planners.md). `settings`:
    parameters of the simulator (`SIM_...`) and of the autopilot that differ from their defaults. `seed`:
    seed of all noise. `timeout_s`: time limit of the flight in seconds of the vehicle's clock; by default one
    and a half times the expected duration plus a minute.
    `force`: fly the mission even if it exceeds the limits of the vehicle. `log_sensors`: keep every reading
    of every sensor and the true state, for `Flight.readings`. `quiet=False` shows progress on stderr,
    including compilation, which takes a minute or more before the first flight. A setting that may be
    unintended, or has no effect, causes a warning.

    A lost flight is a result: see `Flight.outcome`. `Error` if there is no such mission, vehicle, sensor
    profile, law, estimator, planner or parameter, if a value is not a number or out of its range, if a custom
    law, estimator or planner fails before the flight, or if the vehicle cannot fly the mission.
    """
    from autopilot.shell.options import MAX_SEED
    from gcs.workflows.in_process_flight import fly_in_process

    if isinstance(mission, ForeignMission):
        mission_file = mission.name  # it is flown as it is
    else:
        given = Mission.of(mission) if isinstance(mission, model.Mission) else mission
        mission_file = name_or_path("mission", given)
    flown = mission if isinstance(mission, model.Mission) else _load(mission_file)
    options = FlightOptions(
        mission=mission_file,
        law=law_reference(law),
        sensors=name_or_path("sensors", sensors),
        vehicle=name_or_path("vehicle", vehicle),
        seed=whole_number("seed", seed, 0, MAX_SEED),
        speed=None,
        real_time=False,
        out=None,
        settings=setting_arguments(settings),
        connect=None,
        quiet=quiet,
        force=force,
        overwrite=False,
        limit_s=None if timeout_s is None else positive("timeout_s", timeout_s),
        log_sensors=log_sensors,
        estimator=estimator_reference(estimator),
        planner=planner_reference(planner),
    )
    log, sensor_log = io.BytesIO(), io.BytesIO()
    started_s = time.perf_counter()
    with errors_for_python():
        outcome = fly_in_process(
            flown, options, TlogWriter(log), _warn, sensor_log.write if log_sensors else None
        )
    wall_s = time.perf_counter() - started_s
    meta = meta_of(flown, options, outcome, wall_s)
    if flown is mission:  # the path of its file is of interest to the command alone
        meta = replace(meta, mission=flown.name)
    return Flight(log.getvalue(), meta, flown, sensor_log.getvalue())


def _load(mission: str) -> model.Mission:
    with errors_for_python():
        return load(mission)


def _warn(line: str) -> None:
    """Warn, at the line that called `fly`, of an option that is possible but may be unintended."""
    warnings.warn(reworded_for_python(line), stacklevel=5)


class Flight:
    """A finished flight: flown by `fly`, or read by `load`.

    `tlog` is the telemetry as the bytes of a `.tlog`, the same as those of `gcs fly`.
    """

    def __init__(
        self,
        tlog: bytes,
        meta: FlightMeta,
        mission: model.Mission | None = None,
        sensor_log: bytes = b"",
        folder: Path | None = None,
    ) -> None:
        """`folder`: that of the recorded flight; `sensor_log`: as described in `sitl.sensor_log`."""
        self._given_mission = mission
        self._sensor_log, self._folder = sensor_log, folder
        self.tlog = tlog
        self._meta = meta

    @classmethod
    def load(cls, path: str | Path) -> Flight:
        """Read a recorded flight: a directory written by `gcs fly` or `report`, or a `.tlog` of `gcs capture`
        or of another ground station. Data that the telemetry lacks is read from meta.json beside it, if
        that file exists.

        `Error` if there is no telemetry.
        """
        from gcs.workflows.report import find_log, meta_beside

        with errors_for_python():
            log = find_log(file_path("path", path))
            return cls(log.read_bytes(), meta_beside(log), folder=log.parent)

    @cached_property
    def mission(self) -> model.Mission | None:
        """The mission that was flown. That of a flight that was read is the shipped one, or that of its file
        if this is unchanged; otherwise it is made of the uploaded items, whose places are rounded to a
        centimetre, and None if these are not in the telemetry."""
        from gcs.workflows.recorded_mission import recorded_mission

        return self._given_mission or recorded_mission(self._tracks, self._meta)

    @property
    def settings(self) -> dict[str, float | str]:
        """The parameters that were changed for this flight, by name; empty if nothing is known of them."""
        return dict(self._meta.settings)

    @property
    def outcome(self) -> str:
        """`completed`, `diverged`, `timeout` or `refused`; for a flight that was read also an outcome derived
        from its telemetry (docs/report.md)."""
        return self._meta.outcome or str(self.summary["outcome"])

    @property
    def reason(self) -> str:
        """Why the flight was not completed; an empty text if it was, or if the reason is unknown."""
        return self._meta.reason or ""

    @cached_property
    def summary(self) -> Record:
        """The figures of the flight: the keys of `gcs fly --json` (docs/report.md)."""
        from gcs.analysis.record import flight_record

        return flight_record(self._tracks, self._meta, self._samples)

    def telemetry(self, kind: Literal["pandas", "polars", "arrow"] = "pandas") -> Any:
        """The table of flight.parquet (docs/report.md): a row for each sample of the true load, with units in
        the column names; as a pandas or polars DataFrame, or as an Arrow table."""
        from gcs.analysis.parquet import flight_table

        return as_frame(flight_table(self._tracks, self._samples, self._meta.to_json()), kind)

    def readings(self, sensor: str, kind: Literal["pandas", "polars", "arrow"] = "pandas") -> Any:
        """The readings of one sensor (docs/sensors.md), in the order in which they arrived: `imu`, `mocap`,
        `load_tracker`, `cable_sensor`, `gnss`, `barometer` and `magnetometer`, as far as these are fitted,
        and `rotor_speed`; or, as `truth`, the true state at each tick. As a pandas or polars DataFrame, or as
        an Arrow table.

        `Error` if there is no such sensor, or if the flight was flown without `log_sensors=True`.
        """
        tables = self._readings.tables
        if text("sensor", sensor, "imu") not in tables:
            hint = did_you_mean(sensor, tables)
            raise GcsError(f"readings {sensor!r}: there are none; {hint}must be one of {', '.join(tables)}")
        return as_frame(tables[sensor], kind)

    @property
    def calibration(self) -> dict[str, Any]:
        """What is known of the sensors whose readings were kept (noise, delays, lever arms), and of vehicle
        and place (docs/sensors.md). `Error` if the flight was flown without `log_sensors=True`."""
        return self._readings.calibration

    @property
    def _readings(self) -> Readings:
        if self._kept_readings is None:
            raise GcsError(
                "the readings of this flight were not kept; fly it with log_sensors=True, or gcs fly "
                "--log-sensors"
            )
        return self._kept_readings

    @cached_property
    def _kept_readings(self) -> Readings | None:
        from gcs.analysis.readings import load_readings, readings_of

        if self._sensor_log:
            return readings_of(self._sensor_log, self._samples.end_s)
        return None if self._folder is None else load_readings(self._folder / SENSORS_FOLDER)

    def plot(self, name: str = "overview") -> Picture:
        """One picture of the report: overview, track, position, error, angles, psi, rotors or tension."""
        from gcs.report.plots import PICTURES, View
        from gcs.report.style import style

        pictures = {picture.name: picture for picture in PICTURES}
        if text("plot", name, "error") not in pictures:
            hint = did_you_mean(name, pictures)
            raise GcsError(f"plot {name!r}: there is none; {hint}must be one of {', '.join(pictures)}")
        view = View(self._tracks, self._samples, self.summary, self._meta)

        def draw(picture_format: str) -> bytes:
            with TemporaryDirectory() as folder, style():
                file = Path(folder) / f"{name}.{picture_format}"
                pictures[name].draw(view, file)
                return file.read_bytes()

        return Picture(draw)

    @checked_flags
    def report(
        self, out: str | Path, quiet: bool = True, pictures: bool = False, *, overwrite: bool = False
    ) -> Path:
        """Write the files of `gcs fly`, without the logs of its programs, into the directory `out`; returns
        the path of the page. With `pictures` also write the pictures that `gcs fly --pictures` draws.

        `Error` if the directory holds another flight, unless `overwrite=True`, which replaces that flight
        and deletes all its files. The same flight may be written again; its logs, and the files that were
        made on demand, are kept.
        """
        folder = file_path("out", out)
        with errors_for_python():
            make_folder(folder)
            check_no_other_results(folder, TLOG_FILE)
            with reserved(folder):
                self._write(folder, quiet, pictures, overwrite)
        return folder / PAGE_FILE

    def _write(self, folder: Path, quiet: bool, pictures: bool, overwrite: bool) -> None:
        from gcs.analysis.readings import write_readings
        from gcs.report.build import write_meta
        from gcs.workflows.report import make_report
        from gcs.workflows.vehicle_processes import LOGS

        earlier = _log_in(folder)
        if earlier not in (b"", self.tlog) and not overwrite:
            raise GcsError(
                f"report out: {folder} holds another flight; name another folder, or give overwrite=True"
            )
        readings = self._kept_readings  # read before their files may be replaced
        new_meta: FlightMeta | None = self._meta
        if earlier == self.tlog:
            write_meta(folder, self._meta)
            new_meta = None
        else:
            for name in LOGS:  # of the flight that is replaced
                (folder / name).unlink(missing_ok=True)
            write_atomically(folder / TLOG_FILE, self.tlog)
        make_report(folder / TLOG_FILE, folder, new_meta, quiet, pictures=("png",) if pictures else ())
        if readings is not None:
            write_readings(folder / SENSORS_FOLDER, readings)

    @cached_property
    def _tracks(self) -> Telemetry:
        from gcs.analysis.telemetry import telemetry_of

        return telemetry_of(read_tlog(io.BytesIO(self.tlog)))

    @cached_property
    def _samples(self) -> Samples:
        from gcs.analysis.samples import samples_of

        return samples_of(self._tracks)

    def __repr__(self) -> str:
        error_m = self.summary["load_error_max_m"]
        error = "" if error_m is None else f", load error at most {1e3 * error_m:.1f} mm"
        name = self._meta.mission if self._given_mission is None else self._given_mission.name
        return f"<Flight {name or 'of an unknown mission'}: {self.outcome}{error}>"

    def _repr_png_(self) -> bytes:
        return self.plot().png


def _log_in(folder: Path) -> bytes:
    """The telemetry of the flight that a folder holds; empty if it holds none."""
    file = folder / TLOG_FILE
    try:
        return file.read_bytes() if file.exists() else b""
    except OSError as error:
        raise write_error(error, file, option="") from None


class Picture:
    """A picture, which a notebook shows. `png` has the bytes of a PNG."""

    def __init__(self, draw: Callable[[str], bytes]) -> None:
        self._draw = draw  # in a format
        self.png = draw("png")

    def save(self, path: str | Path) -> None:
        """Write it to a file, as PNG, PDF or SVG by the ending of its name; an existing file is replaced."""
        from gcs.report.plots import PICTURE_FORMATS

        file = file_path("path", path)
        ending = file.suffix.lower().removeprefix(".") or "png"
        if ending not in PICTURE_FORMATS:
            raise GcsError(f"{file}: a picture is written as PNG, PDF or SVG; name it {file.stem}.pdf")
        try:
            write_atomically(file, self.png if ending == "png" else self._draw(ending))
        except OSError as error:
            message = (
                f"{file}: cannot be written: {error.strerror}; name a file in a folder that can be written"
            )
            raise GcsError(message) from None

    def _repr_png_(self) -> bytes:
        return self.png
