"""Every law of `autopilot.control.laws` keeps the interface: the arguments of its kernels, a start without a
jump, the same bits compiled and interpreted; and a law in a new file is found and flown.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import math
import os
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import autopilot
import missions
from autopilot.control.actuators import disturbance_observer as observer
from autopilot.control.actuators.disturbance_observer import DisturbanceEstimate
from autopilot.control.actuators.rotor_model import Actuation, advance, queue_rows, steady_actuation
from autopilot.control.actuators.torque_observer import NO_TORQUE
from autopilot.control.believed import believed_actuation, believed_vehicle
from autopilot.control.drag import Drag
from autopilot.control.laws import LAWS, build_law, chosen_law
from autopilot.control.laws.interface import Kernels, Law, kernels_of, law_of, new_rows
from autopilot.control.records import Cable, Command, Reference, State
from autopilot.geometry.linear import Mat3, Vec3
from autopilot.geometry.packed import width
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.law_files import law_files
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.parameter_table import ParameterTable
from tests.doubles.plain_python import in_plain_python

ZERO, EAST, DOWN = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)
LEVEL: Mat3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
TICK = 0.004
BEHIND = {"actuation": Actuation, "observed": DisturbanceEstimate, "cable": Cable}
FOLLOWED: dict[str, dict[str, Any]] = {
    "load_position": {"reference": Reference},
    "quad_position": {"reference": Reference},
    "load_attitude": {"q_d": Vec3, "b1_d": Vec3, "pull": float},
    "quad_attitude": {"R_d": Mat3, "thrust": float},
}
EXACT = 1e-9  # N, N m: a few dozen roundings of 5 N, divided by a period of 4 ms
# N per m/s: the filter of `thesis` begins as if the command one period ago had been the position of the load;
# if it began at the reference itself, it would command 24.5 (measured: 0.82)
SLIP = {"thesis": 1.0}

# N m: the symmetric part of the filtered R_c' of the thesis is of second order; measured 1.2e-6
TURNING = {"thesis": 1e-5}

every_law = pytest.mark.parametrize("law", LAWS.values(), ids=lambda law: law.name)


def parameters(law: Law, **values: float) -> ParameterTable:
    table = autopilot_parameters(load_vehicle("bebop"))
    for name, value in {"CTL_LAW": float(law.number), **values}.items():
        table.set(name, value)
    return table


def interpreted(kernel: Any) -> Any:
    """The Python function of a kernel, compiled or not."""
    return getattr(kernel, "py_func", kernel)


# ---- the interface


def test_laws_are_those_of_the_files() -> None:
    assert {number: law.name for number, law in LAWS.items()} == {f.number: f.name for f in law_files()}
    assert {"thesis", "lqr", "plumbline"} <= {law.name for law in LAWS.values()}


@every_law
def test_kernels_take_and_return_what_the_interface_says(law: Law) -> None:
    assert Kernels._fields == ("start", *FOLLOWED)
    start = get_type_hints(interpreted(law.kernels.start))
    assert start == {"law": law.constants, "state": State, "x_d": Vec3, "v_d": Vec3, "return": law.memory}
    assert list(inspect.signature(interpreted(law.kernels.start)).parameters) == list(start)[:-1]
    for mode, followed in FOLLOWED.items():
        function = interpreted(getattr(law.kernels, mode))
        taken = {"law": law.constants, "memory": law.memory, "state": State, **followed, **BEHIND}
        # in this order: they are called by position
        assert list(inspect.signature(function).parameters) == list(taken), mode
        assert get_type_hints(function) == {**taken, "return": tuple[law.memory, Command]}, mode  # type: ignore[name-defined]


@every_law
def test_records_of_a_law_are_known_by_their_types(law: Law) -> None:
    built = build_law(parameters(law))
    rows = new_rows(built)
    assert type(built) is law.constants
    assert type(rows) is law.rows
    assert law.rows._fields == ("constants", "memory")  # type: ignore[attr-defined]
    assert (len(rows.constants), len(rows.memory)) == (width(law.constants), width(law.memory))
    assert chosen_law(parameters(law)) is law_of(built) is law_of(rows) is law
    assert kernels_of(built) is kernels_of(rows) is law.kernels
    # no two laws share a type: the compiler distinguishes them by their types
    others = [other for other in LAWS.values() if other is not law]
    assert not {law.constants, law.rows} & {
        kind for other in others for kind in (other.constants, other.rows)
    }
    assert law.preview_s(built) >= 0.0
    assert law.ramp_lag_s(built) >= 0.0


# ---- a law that begins


@every_law
@pytest.mark.parametrize("climb", [0.0, 0.4, -0.4])
def test_a_law_that_begins_on_a_steady_climb_goes_on_with_it(law: Law, climb: float) -> None:
    """Thrust equal to the weight and no moment, from the first tick on, with the load as far behind the
    rising reference as this law keeps it; and the same for the vehicle alone."""
    table = parameters(law, PLB_DRAG=0.0, PLB_DRAG_2=0.0, VEH_ACT_DELAY=10.0)
    built, vehicle, constants = build_law(table), believed_vehicle(table), believed_actuation(table)
    cable, observed = Cable(vehicle.cable_length), observer.nominal_in_flight(vehicle)
    flown, v = law.kernels, (0.0, 0.0, climb)
    both = (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity
    alone = vehicle.quad_mass * vehicle.gravity
    for mode, weight in ((flown.load_position, both), (flown.quad_position, alone)):
        carries = mode is flown.load_position
        lag = law.ramp_lag_s(built) if carries else 0.0
        tolerance = EXACT + (SLIP.get(law.name, 0.0) * abs(climb) if carries else 0.0)
        rotors = steady_actuation(weight, queue_rows(constants))
        memory = None
        for k in range(100):
            z = climb * k * TICK
            told = climb * (k * TICK + law.preview_s(built) + lag)
            above = 0.0 if carries else vehicle.cable_length
            place, load = (0.0, 0.0, above + told), (0.0, 0.0, z)
            state = State(load, v, DOWN, ZERO, (0.0, 0.0, z + vehicle.cable_length), v, LEVEL, ZERO)
            reference = Reference((place, v, ZERO, ZERO, ZERO, ZERO, ZERO), EAST)
            if memory is None:
                memory = flown.start(built, state, place, v)
            memory, command = mode(built, memory, state, reference, rotors, observed, cable)
            assert command.thrust == pytest.approx(weight, abs=tolerance), k
            assert command.moment == pytest.approx(ZERO, abs=EXACT)
            rotors = advance(rotors, weight, ZERO, constants)


@every_law
@pytest.mark.parametrize("rate", [0.8, -0.8])
@pytest.mark.parametrize("angle", [0.0, 2.5])
def test_a_law_turns_with_its_heading(law: Law, angle: float, rate: float) -> None:
    """A vehicle over a load at rest turns as commanded: no moment is needed."""
    table = parameters(law, PLB_DRAG=0.0, PLB_DRAG_2=0.0)
    built, vehicle, constants = build_law(table), believed_vehicle(table), believed_actuation(table)
    cable, observed = Cable(vehicle.cable_length), observer.nominal_in_flight(vehicle)
    weight = (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity
    above = (0.0, 0.0, vehicle.cable_length)
    rotors, memory = steady_actuation(weight, queue_rows(constants)), None
    for k in range(round(2.0 / TICK)):
        psi = angle + rate * k * TICK
        c, s = math.cos(psi), math.sin(psi)
        R = ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))
        state = State(ZERO, ZERO, DOWN, ZERO, above, ZERO, R, (0.0, 0.0, rate))
        along = (-rate * s, rate * c, 0.0), (-rate * rate * c, -rate * rate * s, 0.0)
        reference = Reference((ZERO,) * 7, (c, s, 0.0), *along)
        if memory is None:
            memory = law.kernels.start(built, state, ZERO, ZERO)
        memory, command = law.kernels.load_position(built, memory, state, reference, rotors, observed, cable)
    assert command.thrust == pytest.approx(weight, abs=EXACT)
    assert command.moment == pytest.approx(ZERO, abs=TURNING.get(law.name, EXACT))


@every_law
def test_a_law_begins_to_turn_as_its_heading_does(law: Law) -> None:
    """The vehicle is in the commanded state and the heading begins to turn: a moment about the vertical in
    the same sense."""
    table = parameters(law, PLB_DRAG=0.0, PLB_DRAG_2=0.0)
    built, vehicle, constants = build_law(table), believed_vehicle(table), believed_actuation(table)
    behind = steady_actuation(
        (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity, queue_rows(constants)
    )
    at = State(ZERO, ZERO, DOWN, ZERO, (0.0, 0.0, vehicle.cable_length), ZERO, LEVEL, ZERO)
    memory = law.kernels.start(built, at, ZERO, ZERO)
    for update_estimate in (1.0, -1.0):
        reference = Reference(
            (ZERO,) * 7, EAST, (0.0, update_estimate * 0.5, 0.0), (-0.25, update_estimate * 2.0, 0.0)
        )
        _, command = law.kernels.load_position(
            built,
            memory,
            at,
            reference,
            behind,
            observer.nominal_in_flight(vehicle),
            Cable(vehicle.cable_length),
        )
        assert command.moment[:2] == pytest.approx((0.0, 0.0), abs=EXACT)
        if law.name != "thesis":  # which takes it from its filter, which has seen nothing yet
            assert update_estimate * command.moment[2] > 0.5 * vehicle.inertia[2]


@every_law
def test_attitude_modes_begin_at_the_present_rates(law: Law) -> None:
    """In the middle of a swing and a turn that are commanded to continue, the commanded rates are the present
    ones, except for what the filters, of 30 ms, lose in the first tick."""
    table = parameters(law)
    built, vehicle, constants = build_law(table), believed_vehicle(table), believed_actuation(table)
    rng = np.random.default_rng(4)
    weight = (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity
    for _ in range(5):
        state = motion(rng, vehicle.cable_length)
        rotors, observed = (
            steady_actuation(weight, queue_rows(constants)),
            observer.nominal_in_flight(vehicle),
        )
        behind = (rotors, observed, Cable(vehicle.cable_length))
        memory = law.kernels.start(built, state, state.x_load, state.v_load)
        q, q_dot, omega = (np.array(v) for v in (state.q_cable, state.q_cable_dot, state.omega_body))
        q_d = triple(np.cos(TICK) * q + TICK * q_dot)
        _, swung = law.kernels.load_attitude(built, memory, state, q_d, EAST, weight, *behind)
        assert np.linalg.norm(swung.e_q_dot) < 0.3 * np.linalg.norm(q_dot)
        turned = np.array(state.R) @ Rotation.from_rotvec(TICK * omega).as_matrix()
        R_d = (triple(turned[0]), triple(turned[1]), triple(turned[2]))
        _, command = law.kernels.quad_attitude(built, memory, state, R_d, weight, *behind)
        assert np.linalg.norm(command.e_Omega) < 0.3 * np.linalg.norm(omega)


# ---- machine code and Python


def triple(a: Any) -> Vec3:
    return (float(a[0]), float(a[1]), float(a[2]))


def motion(rng: np.random.Generator, length: float) -> State:
    """Load and vehicle in a swing."""
    q = 0.4 * rng.normal(size=3) - [0.0, 0.0, 1.0]
    q = q / np.linalg.norm(q)
    q_dot = np.cross(rng.normal(size=3), q)
    x, v, a = rng.normal(size=(3, 3))
    R = Rotation.from_rotvec(0.3 * rng.normal(size=3)).as_matrix()
    return State(
        triple(x),
        triple(v),
        triple(q),
        triple(q_dot),
        triple(x - length * q),
        triple(v - length * q_dot),
        (triple(R[0]), triple(R[1]), triple(R[2])),
        triple(rng.normal(size=3)),
        triple(a),
    )


def numbers(value: Any) -> Iterator[float]:
    if isinstance(value, tuple):
        for part in value:
            yield from numbers(part)
    else:
        yield float(value)


def fingerprints() -> dict[str, str]:
    """Hashes of all commands and memories of every law in every mode: swinging, slack, standing and lying,
    with a cable that is being reeled, and with commands on their way to the rotors."""
    found = {}
    for law in LAWS.values():
        table = parameters(law, VEH_ACT_DELAY=10.0)
        built, constants = build_law(table), believed_actuation(table)
        for mode in FOLLOWED:
            rng = np.random.default_rng(9)
            digest = hashlib.sha256()
            rotors = steady_actuation(4.9, queue_rows(constants))
            memory = None
            for k in range(12):
                length = 0.7 + 0.02 * k
                state = motion(rng, length)
                jet = tuple(triple(v) for v in rng.normal(size=(7, 3)))
                observed = DisturbanceEstimate(
                    float(rng.uniform(0.05, 0.2)),
                    triple(0.2 * rng.normal(size=3)),
                    1.0,
                    10.0,
                    float(rng.choice([0.0, 3.0])),
                    float(rng.choice([-9.0, 9.0])),
                    0.0,
                    float(rng.choice([0.0, 1.0])),
                    triple(0.2 * rng.normal(size=3)),
                    ZERO,
                    Drag(*(0.1 * rng.random(2))),
                    0.0,
                    ZERO,
                    ZERO,
                    0.0,
                    0.0,
                    triple((*(0.1 * rng.normal(size=2)), 0.0)),
                    float(0.1 * rng.random()),
                    NO_TORQUE._replace(total=triple(0.005 * rng.normal(size=3))),
                )
                q_d, R_d = motion(rng, length).q_cable, motion(rng, length).R
                followed: dict[str, tuple[Any, ...]] = {
                    "load_position": (Reference(jet, EAST),),  # type: ignore[arg-type]
                    "quad_position": (Reference(jet, EAST),),  # type: ignore[arg-type]
                    "load_attitude": (q_d, EAST, 4.9),
                    "quad_attitude": (R_d, 4.9),
                }
                if memory is None:
                    memory = law.kernels.start(built, state, jet[0], jet[1])
                    digest.update(b"".join(struct.pack("<d", x) for x in numbers(memory)))
                memory, command = getattr(law.kernels, mode)(
                    built, memory, state, *followed[mode], rotors, observed, Cable(length, 0.3, -0.5)
                )
                digest.update(b"".join(struct.pack("<d", x) for x in numbers((memory, command))))
                rotors = advance(rotors, command.thrust, command.moment, constants)
            found[f"{law.name} {mode}"] = digest.hexdigest()
    return found


def told(program: str, path: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a Python program that imports the project from `path`."""
    return subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": str(path), **environment},
        cwd=path,
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )


def test_compiled_and_interpreted_laws_agree_to_the_bit_in_every_mode() -> None:
    compiled = fingerprints()
    assert len(compiled) == 4 * len(LAWS)
    assert in_plain_python(fingerprints) == compiled


# ---- a law in a new file

NEW_LAW = '''"""A law that asks for a thrust and counts its ticks."""

from __future__ import annotations

from typing import NamedTuple

from autopilot.control.actuators.disturbance_observer import DisturbanceEstimate
from autopilot.control.actuators.rotor_model import Actuation
from autopilot.control.laws.interface import Kernels, Law
from autopilot.control.records import Cable, Command, Reference, State, Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Mat3, Vec3
from autopilot.geometry.packed import Row
from autopilot.wire.parameter_table import ParameterTable

PARAMETERS = """
[groups]
PRB = "Law probe"

[PRB_THRUST]
text = "Thrust that it asks for"
default = 3.0
range = [0.0, 7.0]
unit = "N"
"""


class ProbeLaw(NamedTuple):
    thrust: float


class ProbeMemory(NamedTuple):
    ticks: int


class ProbeRows(NamedTuple):
    constants: Row
    memory: Row


def build(table: ParameterTable, vehicle: Vehicle) -> ProbeLaw:
    return ProbeLaw(table["PRB_THRUST"])


@kernel
def asked(law: ProbeLaw, memory: ProbeMemory, state: State) -> tuple[ProbeMemory, Command]:
    e = ZERO
    thrust = law.thrust + 0.25 * memory.ticks
    command = Command(thrust, ZERO, e, e, e, e, e, e, 0.0, 0.0, state.q_cable, state.R)
    return ProbeMemory(memory.ticks + 1), command


@kernel
def start(law: ProbeLaw, state: State, x_d: Vec3, v_d: Vec3) -> ProbeMemory:
    return ProbeMemory(0)


@kernel
def position(
    law: ProbeLaw,
    memory: ProbeMemory,
    state: State,
    reference: Reference,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[ProbeMemory, Command]:
    return asked(law, memory, state)


@kernel
def load_attitude(
    law: ProbeLaw,
    memory: ProbeMemory,
    state: State,
    q_d: Vec3,
    b1_d: Vec3,
    pull: float,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[ProbeMemory, Command]:
    return asked(law, memory, state)


@kernel
def quad_attitude(
    law: ProbeLaw,
    memory: ProbeMemory,
    state: State,
    R_d: Mat3,
    thrust: float,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[ProbeMemory, Command]:
    return asked(law, memory, state)


LAW = Law(
    name="probe",
    number=NUMBER,
    constants=ProbeLaw,
    memory=ProbeMemory,
    rows=ProbeRows,
    build=build,
    kernels=Kernels(start, position, position, load_attitude, quad_attitude),
)
'''

FLIGHT = """
import json
import autopilot
from dataclasses import replace
from autopilot.control.records import State
from autopilot.core.flight_core import FlightCore
from autopilot.core.tick import EstimateSummary, control_tick
from autopilot.geometry.packed import pack, unpack
from autopilot.guidance.legs import Hold
from autopilot.onboard.onboard import build_setup
from autopilot.supervisor.state import Phase
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import LAWS, autopilot_parameters

table = autopilot_parameters(load_vehicle("bebop"))
table.set("CTL_LAW", float(LAWS.index("probe")))
table.set("PRB_THRUST", 4.5)
core = FlightCore(build_setup(table, 1))
zero, length = (0.0, 0.0, 0.0), core.setup.vehicle.cable_length
level = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
at = (0.0, 0.0, 2.0)
state = State(at, zero, (0.0, 0.0, -1.0), zero, (0.0, 0.0, 2.0 + length), zero, level, zero)
weight = core.setup.vehicle.load_mass * core.setup.vehicle.gravity
flight = core.flight
core.replace_flight(
    replace(
        flight, phase=Phase.HOLD, legs=(Hold(at),), cable=replace(flight.cable, taut_length_m=length)
    )
)
asked = []
for now_us in (4000, 8000, 12000):
    pack(EstimateSummary(state, True, True, 0.0, weight, 0.0, 0, 0, 0.0, 0), core.rows.summary, 0)
    core.decide(now_us, 4000)
    control_tick(core.rows, core.law_rows, 0)
    asked.append([core.control.command.thrust, sum(core.forces)])
print(json.dumps({"laws": LAWS, "asked": asked, "phase": core.flight.phase.name, "at": autopilot.__file__}))
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A copy of the packages that fly."""
    for package in (autopilot, missions):
        source = Path(str(package.__file__)).parent
        shutil.copytree(source, tmp_path / source.name, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def laws_folder(project: Path) -> Path:
    return project.joinpath(*chosen_law.__module__.split("."))


def test_a_law_in_a_new_file_is_found_and_flown(project: Path) -> None:
    """No other file is touched; its parameters are in the table, its memory is kept from tick to tick."""
    number = len(LAWS)
    (laws_folder(project) / "probe.py").write_text(NEW_LAW.replace("NUMBER", str(number)))
    done = told(FLIGHT, project)
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout)
    assert Path(found["at"]).is_relative_to(project)
    assert found["laws"] == [*(law.name for law in law_files()), "probe"]
    assert found["asked"] == [[4.5, 4.5], [4.75, 4.75], [5.0, 5.0]]
    assert found["phase"] == "HOLD"


def test_two_laws_of_one_number_are_refused(project: Path) -> None:
    (laws_folder(project) / "probe.py").write_text(NEW_LAW.replace("NUMBER", "1"))
    done = told("import autopilot.vehicle.parameters", project)
    assert done.returncode != 0
    assert "lqr 1, probe 1" in done.stderr
    assert "must count from 0" in done.stderr
