"""One flown experiment, read from its telemetry, with the times that divide it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.axes import Floats
from gcs.analysis.record import FlightMeta
from gcs.analysis.samples import CARRIED, MISSION, Samples, samples_of
from gcs.analysis.telemetry import load_telemetry
from gcs.analysis.tracks import Telemetry
from gcs.experiments.plan import Experiment
from gcs.folders import TLOG_FILE
from gcs.report.build import META_FILE, load_meta

DIVERGED_M = 2.0  # nearly three cable lengths of the nominal vehicle: tracking has failed
_AT_REST_M_S = 1e-6  # desired speeds are single precision


@dataclass(frozen=True)
class ExperimentFlight:
    """A flown experiment. Times are on the vehicle's clock; in figures they count from `start_s`."""

    experiment: Experiment
    meta: FlightMeta
    telemetry: Telemetry
    samples: Samples
    start_s: float  # the signals begin
    rest_s: float  # the reference stops moving
    end_s: float  # the load begins to be lowered, or the flight is lost
    lost: bool  # the error exceeded DIVERGED_M, or the autopilot gave up

    def since_start(self, time_s: Floats) -> Floats:
        """Seconds since the signals began."""
        return np.asarray(time_s - self.start_s)

    def signal_window(self, time_s: Floats) -> slice:
        """The samples from the beginning of the signals to the end."""
        return slice(*np.searchsorted(time_s, (self.start_s, np.nextafter(self.end_s, np.inf))))

    @property
    def duration_s(self) -> float:
        """From the beginning of the signals to the end."""
        return self.end_s - self.start_s


def read_flight(directory: Path, experiment: Experiment) -> ExperimentFlight:
    """The flight in `directory`."""
    telemetry = load_telemetry(directory / TLOG_FILE)
    return experiment_flight(telemetry, experiment, load_meta(directory / META_FILE))


def experiment_flight(telemetry: Telemetry, experiment: Experiment, meta: FlightMeta) -> ExperimentFlight:
    """The flight from telemetry that has already been read."""
    samples = samples_of(telemetry)
    setpoint = telemetry.setpoint
    speed = np.linalg.norm(setpoint.velocity_m_s, axis=1)
    in_mission = setpoint.phase == MISSION
    moving = np.flatnonzero(in_mission & (speed > _AT_REST_M_S))
    span = telemetry.span_s or (0.0, 0.0)
    if len(moving):
        first = moving[0]
        start = float(setpoint.time_s[first] - setpoint.elapsed_s[first])
        next_sample = min(int(moving[-1]) + 1, len(setpoint.time_s) - 1)
        rest = float(setpoint.time_s[next_sample])
    else:
        start, rest = span
    end, lost = _end(telemetry, samples, start, span[1])
    return ExperimentFlight(experiment, meta, telemetry, samples, start, rest, end, lost)


def _end(telemetry: Telemetry, samples: Samples, start_s: float, last_s: float) -> tuple[float, bool]:
    """The end of the flight, and whether it was lost: the last time at which the load is carried or, if
    earlier, the time at which it diverged."""
    setpoint = telemetry.setpoint
    not_carried = (setpoint.time_s >= start_s) & ~np.isin(setpoint.phase, CARRIED)
    end = float(setpoint.time_s[int(np.argmax(not_carried)) - 1]) if not_carried.any() else last_s
    gave_up = (
        bool(not_carried.any())
        and setpoint.phase[int(np.argmax(not_carried))] == mavlink.PLUMBLINE_PHASE_FAILSAFE
    )
    error = np.linalg.norm(samples.error_m, axis=1)
    diverged = (samples.time_s >= start_s) & (samples.time_s <= end) & (error > DIVERGED_M)
    if diverged.any():
        return float(samples.time_s[int(np.argmax(diverged))]), True
    return end, gave_up
