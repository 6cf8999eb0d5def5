"""results.json: a list of records, one per flight."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from gcs.analysis.axes import Floats
from gcs.analysis.record import Record, flight_record, jsonable
from gcs.experiments.decay import DEPTH, Decay, decay_of
from gcs.experiments.flight import ExperimentFlight
from gcs.experiments.plan import printed_results

# error function: unit; resolution (single precision on the wire, 20 m from home), below which it counts as
# zero; depth below its peak to which the fit goes: the configuration errors are squares of the others
ERROR_FUNCTIONS: dict[str, tuple[str, float, float]] = {
    "e_x": ("m", 4e-6, DEPTH),
    "e_v": ("m/s", 4e-6, DEPTH),
    "e_q": ("", 1e-6, DEPTH),
    "e_q_dot": ("1/s", 1e-5, DEPTH),
    "e_R": ("", 1e-6, DEPTH),
    "e_Omega": ("rad/s", 1e-5, DEPTH),
    "psi_R": ("", 1e-12, DEPTH**2),
    "psi_q": ("", 1e-12, DEPTH**2),
}


def error_values(flight: ExperimentFlight, name: str) -> tuple[Floats, Floats]:
    """(n,) times and (n,) norms of an error function of the cascade, from the beginning of the signals to the
    end."""
    cascade = flight.telemetry.cascade
    values = getattr(cascade, name)
    window = flight.signal_window(cascade.time_s)
    norm = values if values.ndim == 1 else np.linalg.norm(values, axis=1)
    return cascade.time_s[window], norm[window]


def decays(flight: ExperimentFlight) -> dict[str, Decay]:
    """The decay of each error function."""
    return {
        name: decay_of(*error_values(flight, name), flight.rest_s, resolution, depth)
        for name, (_, resolution, depth) in ERROR_FUNCTIONS.items()
    }


def experiment_record(flight: ExperimentFlight, report_dir: str) -> Record:
    """The record of an experiment: case, law, vehicle; the keys of the flight record; lost_after_s;
    error_functions; printed and difference."""
    record = flight_record(flight.telemetry, flight.meta, flight.samples)
    record["report_dir"] = report_dir
    experiment = flight.experiment
    printed = printed_results(experiment)
    difference = {
        name: None if record[name] is None else record[name] - value for name, value in printed.items()
    }
    return jsonable(
        {
            "case": experiment.case,
            "law": experiment.law,
            **{name: value for name, value in record.items() if name != "law"},
            "lost_after_s": flight.duration_s if flight.lost else None,
            "error_functions": {
                name: {"unit": ERROR_FUNCTIONS[name][0], **decay._asdict()}
                for name, decay in decays(flight).items()
            },
            "printed": printed,
            "difference": difference,
        }
    )


def write_results(path: Path, records: Iterable[Record]) -> None:
    """Write results.json."""
    text = json.dumps(list(records), indent=2, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")
