"""The pool of flights with a flight function of the test: cores, reuse, failure, interruption."""

from __future__ import annotations

import json
from importlib.metadata import version

import pytest

from gcs.batch import reuse
from gcs.batch.programs import ProgramBackend
from gcs.errors import EXIT_DONE, EXIT_ERROR, EXIT_NOT_MET, GcsError
from gcs.experiments import run
from gcs.experiments.plan import CASES, LAWS, VEHICLES, Experiment, experiments
from gcs.experiments.store import experiment_origin, is_flown, prepare

CODE = "0123456789abcdef"
CORES = (0, 3)
A = Experiment("case-a", "thesis", "thesis")


@pytest.fixture(autouse=True)
def _code_of_the_test(monkeypatch):
    written_by(monkeypatch, CODE)


def written_by(monkeypatch, code):
    """From now on, `code` is the version of the code that flies."""
    monkeypatch.setattr(reuse, "code_fingerprint", lambda entries: code)


class Sky:
    """Flights that last a few moments and leave what `gcs fly` leaves."""

    def __init__(self, moments=3, exit_code=EXIT_DONE, outcome="completed"):
        self.begun = []
        self.most = 0
        self.in_the_air = {}
        self.moments, self.exit_code, self.outcome = moments, exit_code, outcome
        self.paused = 0
        self.terminated = []

    def start(self, experiment, directory, core):
        prepare(directory)
        assert core not in self.in_the_air, "two flights on one core"
        self.begun.append(experiment)
        flight = Flight(self, experiment, directory, core)
        self.in_the_air[core] = flight
        self.most = max(self.most, len(self.in_the_air))
        return flight

    def pause(self):
        self.paused += 1
        for flight in list(self.in_the_air.values()):
            flight.moment()


class Flight:
    def __init__(self, sky, experiment, directory, core):
        self.sky, self.experiment, self.directory, self.core = sky, experiment, directory, core
        self.left, self.result = sky.moments, sky.exit_code
        self.exit_code = None

    @property
    def running(self):
        return self.exit_code is None

    def moment(self):
        self.left -= 1
        if self.left:
            return
        del self.sky.in_the_air[self.core]
        leave(self.directory, self.experiment, self.sky.outcome)
        self.exit_code = self.result

    def last_line(self):
        return f"moment {self.left}"

    def exit_report(self):
        return "gcs ended with exit code 1: no room"

    def terminate(self):
        self.sky.terminated.append(self.experiment)

    def finish(self):
        assert self.experiment in self.sky.terminated, "asked to end before it is waited for"
        self.sky.in_the_air.pop(self.core, None)


def leave(directory, experiment, outcome="completed", **changes):
    meta = {
        "mission": experiment.case,
        "law": experiment.law,
        "vehicle": experiment.vehicle,
        "sensors": "ideal",
        "seed": 1,
        "outcome": outcome,
        "version": version("plumbline"),
        "settings": {},
        **changes,
    }
    (directory / "meta.json").write_text(json.dumps(meta))
    (directory / "flight.tlog").write_bytes(b"")


def fly(sky, directory, plan=None, fresh=False, stop=lambda: False, tell=lambda ended, running: None):
    """Fly; return how many flights were missing, and whether all of them were flown."""
    waiting = run.missing(experiments() if plan is None else plan, directory, fresh)
    crew = ProgramBackend(CORES, lambda e, core: sky.start(e, directory / e.name, core), sky.pause)
    return len(waiting), run.fly_missing(waiting, directory, crew, tell, stop)


def is_stored(directory, experiment):
    return is_flown(directory / experiment.name, experiment_origin(experiment))


def test_the_plan_is_every_case_law_and_vehicle_once():
    assert len(experiments()) == 16
    assert set(experiments()) == {Experiment(c, w, v) for c in CASES for w in LAWS for v in VEHICLES}


def test_all_are_flown_one_on_each_core_and_none_again(tmp_path):
    sky, seen = Sky(), []
    assert fly(sky, tmp_path, tell=lambda ended, running: seen.append((ended, running))) == (16, True)
    assert sorted(sky.begun) == sorted(experiments())
    assert sky.most == len(CORES)
    titles = [title for title, _ in seen[0][1]]
    assert titles == [experiment.title for experiment in experiments()[:2]]
    assert sorted(experiment for ended, _ in seen for experiment, _ in ended) == sorted(experiments())
    assert seen[-1][1] == ()
    again = Sky()
    assert fly(again, tmp_path) == (0, True)
    assert again.begun == []


def test_fresh_flies_all_anew(tmp_path):
    fly(Sky(), tmp_path)
    assert fly(Sky(), tmp_path, fresh=True) == (16, True)


def test_other_code_flies_anew(tmp_path, monkeypatch):
    fly(Sky(), tmp_path)
    written_by(monkeypatch, "other")
    assert fly(Sky(), tmp_path) == (16, True)


@pytest.mark.parametrize(
    "changes",
    [{"law": "lqr"}, {"sensors": "lab"}, {"seed": 2}, {"version": "0"}, {"settings": {"SIM_WIND_E": 1.0}}],
    ids=str,
)
def test_a_flight_of_other_settings_is_not_this_one(tmp_path, changes):
    fly(Sky(), tmp_path, [A])
    assert is_stored(tmp_path, A)
    leave(tmp_path / A.name, A, **changes)
    assert not is_stored(tmp_path, A)


@pytest.mark.parametrize("file", ["meta.json", "flight.tlog", "flown.json"])
def test_a_directory_that_lacks_a_file_is_flown_again(tmp_path, file):
    fly(Sky(), tmp_path)
    (tmp_path / A.name / file).unlink()
    sky = Sky()
    assert fly(sky, tmp_path) == (1, True)
    assert sky.begun == [A]


@pytest.mark.parametrize("text", ["", "[1]", "{", '"flown"'])
def test_a_broken_mark_is_no_mark(tmp_path, text):
    fly(Sky(), tmp_path, [A])
    (tmp_path / A.name / "flown.json").write_text(text)
    assert not is_stored(tmp_path, A)


def test_a_lost_flight_is_a_result_an_interrupted_one_is_not(tmp_path):
    fly(Sky(exit_code=EXIT_NOT_MET, outcome="diverged"), tmp_path, [A])
    assert is_stored(tmp_path, A)
    leave(tmp_path / A.name, A, "interrupted")
    assert not is_stored(tmp_path, A)


def test_a_flight_that_fails_ends_it_in_one_line(tmp_path):
    with pytest.raises(GcsError, match="Case C, NGC, idealised vehicle: gcs ended with exit code 1: no room"):
        fly(Sky(exit_code=EXIT_ERROR), tmp_path)


def test_flights_that_ended_well_beside_a_failure_are_kept(tmp_path):
    sky = Sky(moments=1)
    good, bad = experiments()[:2]

    def start(experiment, directory, core):
        flight = Sky.start(sky, experiment, directory, core)
        flight.result = EXIT_ERROR if experiment == bad else EXIT_DONE
        return flight

    sky.start = start
    with pytest.raises(GcsError, match="no room"):
        fly(sky, tmp_path)
    assert is_stored(tmp_path, good) and not is_stored(tmp_path, bad)


def test_interrupted_it_keeps_what_is_flown_and_goes_on_from_there(tmp_path):
    sky = Sky()
    assert fly(sky, tmp_path, stop=lambda: sky.paused == 7) == (16, False)
    kept = [e for e in experiments() if is_stored(tmp_path, e)]
    assert len(kept) == 4
    assert len(sky.terminated) == 2 and not set(sky.terminated) & set(kept)
    rest = Sky()
    assert fly(rest, tmp_path) == (12, True)
    assert not set(rest.begun) & set(kept)


def test_a_flight_begun_anew_does_not_count_by_its_old_mark(tmp_path):
    fly(Sky(), tmp_path, [A])
    sky = Sky()
    assert fly(sky, tmp_path, [A], fresh=True, stop=lambda: sky.paused == 1) == (1, False)
    assert not is_stored(tmp_path, A)
