"""ArduPilot's own slung payload (SIM_SLUP) beside our load: same firmware, mission, mass and cable.

    PLUMBLINE_ARDUCOPTER=./arducopter python benchmarks/slung_payload.py [--docs docs/autopilots.md]

The firmware flies twice: its own quadrotor with its own payload, with the masses, inertia, thrust and drag
of `iris`, and `iris` in Plumbline's world. Both lift the load, carry it 12 m at 4 m/s, stop hard and wait.

The motion of a pendulum during that wait follows from the motion of the vehicle above it. With displacements
from rest proportional to exp(s t), x of the load relative to the vehicle and k x (k complex) of the vehicle,

    (1 + k) s^2 = -g / L.

k = 0 is a vehicle that does not move, k = -m / (M + m) a vehicle that moves freely. An autopilot that holds
position moves the vehicle with a k that takes energy out of the swing. Period and loss computed from the
observed k are the analytic ones of that flight; any other loss is due to the simulation. (Drag of the load is
neglected: it takes some 1 % of a swing.)
"""

from __future__ import annotations

import argparse
import cmath
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import closing
from importlib.resources import files
from math import atan, degrees, pi, sqrt
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from pymavlink.DFReader import DFReader_binary
from scipy.optimize import least_squares

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import plumbline
from autopilot.vehicle.model import Vehicle
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.tlog import TlogWriter
from gcs.analysis.telemetry import load_telemetry
from gcs.clients.capture import Capture
from gcs.clients.firmware_flight import ARDUPILOT, FirmwareFlight
from gcs.clients.firmware_mission import firmware_items
from gcs.experiments.marked_text import write_between
from gcs.shell.display import FlightDisplay
from gcs.shell.link import UdpSocket, unix_us
from gcs.shell.processes import Processes
from gcs.shell.stopping import StopRequest
from gcs.workflows.flight_loops import run_wall_clock
from missions.fileformat import load_mission

Floats = NDArray[np.float64]

VARIABLE = "PLUMBLINE_ARDUCOPTER"
BEGIN, END = "<!-- slung payload -->\n", "<!-- end of slung payload -->"
PICTURE = Path("images/slung-payload.svg")
CABLES_M = (1.0, 4.0)
DISTANCE_M, LIMIT_S, SPEEDUP = 12.0, 300.0, 5
MISSION = f"""
title = "Hard stop"
description = "Lifts the load, carries it, stops hard and waits while it swings."

[[items]]
type = "takeoff"
altitude_m = 2.0

[[items]]
type = "speed"
speed_m_s = 4.0

[[items]]
type = "waypoint"
east_m = {DISTANCE_M}
north_m = 0.0
altitude_m = 2.0
hold_s = 30.0

[[items]]
type = "land"
"""
# of the firmware in both flights: a slow climb, so that the take-off does not overshoot into the cable, and
# a stop that is smoothed less than by default
SETTINGS = {"WPNAV_SPEED_UP": 50, "WPNAV_ACCEL": 300, "WPNAV_JERK": 20}
GRAVITY = 9.80665  # the firmware's
SPHERE_NS2_M2 = 0.5 * 1.225 * 0.07  # force of its payload at 1 m/s with SIM_SLUP_DRAG 1
WAIT_PERIODS, FIT_PERIODS = (
    2.0,
    3.0,
)  # periods: from the stop until the fit begins, and for which the fit lasts
LOG_RATE_HZ = 10.0  # rate of its payload's log, at which both flights are evaluated


class RecordedFlight(NamedTuple):
    """One flight, a row each 0.1 s: east, north, up; m, s, N. The stop is at time 0."""

    time_s: Floats
    vehicle_m: Floats  # (n, 3)
    below_m: Floats  # (n, 3), of the load relative to the vehicle
    load_m_s: Floats  # (n, 3), as the simulation reports it
    tension_n: Floats


class Swing(NamedTuple):
    """The motion exp(s t), and the vehicle's displacement k relative to that of the load."""

    s: complex  # 1/s
    k: complex
    start_amplitude_m: float  # amplitude at the beginning of the fit

    @property
    def period_s(self) -> float:
        return 2.0 * pi / abs(self.s.imag)

    @property
    def loss(self) -> float:
        """Share of the amplitude that is lost in a period."""
        return 1.0 - float(np.exp(self.s.real * self.period_s))


class FlatGround(UdpSocket):
    """The link to a firmware, which receives 0 m as the height of all terrain: its payload requests the
    terrain below it, and rises for ever if that is unknown."""

    def drain(self) -> list[bytes]:
        """As in the base class; requests for terrain are also answered."""
        found = super().drain()
        writer = FrameWriter(255, mavlink.MAV_COMP_ID_MISSIONPLANNER)
        for one in (one for datagram in found for one in decode(datagram)[0]):
            if one.id == mavlink.MAVLINK_MSG_ID_TERRAIN_REQUEST:
                request = one.message
                for bit in (bit for bit in range(56) if request.mask >> bit & 1):
                    grid = request.lat, request.lon, request.grid_spacing, bit, [0] * 16
                    self.send(writer.frame(mavlink.MAVLink_terrain_data_message(*grid)))
        return found


def model_of(vehicle: Vehicle) -> dict[str, Any]:
    """The vehicle in the form of the firmware's frame file."""
    fast = 15.0
    drag_n = (vehicle.quad_drag_n_s_m + vehicle.quad_drag_quadratic_n_s2_m2 * fast) * fast
    weight_n = vehicle.quad_mass_kg * GRAVITY
    return {
        "mass": vehicle.quad_mass_kg,
        "diagonal_size": vehicle.arm_m,  # the file's name for the arm of the motors
        "moment_inertia": list(vehicle.inertia_kg_m2),
        "num_motors": 4.0,
        "hoverThrOut": weight_n / (4.0 * vehicle.rotor_max_n),
        "propExpo": 0.65,
        **{"pwmMin": 1000.0, "pwmMax": 2000.0, "spin_min": 0.0, "spin_max": 1.0, "slew_max": 0.0},
        **{"refSpd": fast, "refAngle": degrees(atan(drag_n / weight_n)), "refAlt": 0.0, "mdrag_coef": 0.0},
        **{"refVoltage": 12.6, "maxVoltage": 12.6, "refBatRes": 0.0, "battCapacityAh": 0.0},
    }


def fly_firmware_payload(program: Path, mission: Path, vehicle: Vehicle, out: Path) -> RecordedFlight:
    """The firmware's own quadrotor and payload."""
    out.mkdir()
    (out / "model.json").write_text(json.dumps(model_of(vehicle)), encoding="ascii")
    payload = {
        "SIM_SLUP_ENABLE": 1,
        "SIM_SLUP_WEIGHT": vehicle.load_mass_kg,
        "SIM_SLUP_LINELEN": vehicle.cable_length_m,
        "SIM_SLUP_DRAG": vehicle.load_drag_quadratic_n_s2_m2 / SPHERE_NS2_M2,
        "TERRAIN_ENABLE": 1,
        "SR0_EXTRA3": 5,  # the stream with its requests for terrain
    }
    defaults = (files("sitl.interfaces") / "ardupilot.parm").read_text(encoding="ascii")
    lines = [f"{name} {value:.9g}\n" for name, value in (payload | SETTINGS).items()]
    (out / "own.parm").write_text(defaults + "".join(lines), encoding="ascii")
    home = Home()
    steps = load_mission(str(mission)).steps
    items = firmware_items(steps, home, vehicle.cable_length_m, vehicle.gear_height_m, True)
    client = FirmwareFlight(ARDUPILOT, items, LIMIT_S, LIMIT_S)
    with (
        Processes() as processes,
        closing(FlatGround()) as link,
        closing(UdpSocket()) as truth,  # the firmware sends none
        (out / "flight.tlog").open("wb") as file,
        StopRequest("stopping") as stop,
        FlightDisplay(mission.stem, quiet=True) as display,
    ):
        command = [
            *(str(program), "--model", "quad:model.json", "--speedup", str(SPEEDUP)),
            *("--defaults", "own.parm", "--wipe"),
            *("--home", f"{home.latitude_deg},{home.longitude_deg},{home.altitude_m},0"),
            *("--serial0", f"udpclient:{link.address}", "--serial1", "none", "--serial2", "none"),
        ]
        processes.start_program(ARDUPILOT.title, command, out / "firmware.log", out, {})
        capture = Capture(TlogWriter(file), unix_us())
        run_wall_clock(client, capture, link, truth, processes.end_reason, display, stop, lambda: None)
    if client.outcome is None or client.outcome.name != "completed":
        sys.exit(f"the firmware with its own payload: {client.outcome}")
    return flight_from_log(next((out / "logs").glob("*.BIN")))


def flight_from_log(log: Path) -> RecordedFlight:
    """A flight from the firmware's own log: SLUP of the payload, SIM2 of the vehicle."""
    payload, vehicle = [], []
    reader = DFReader_binary(str(log))
    while (m := reader.recv_match(type=["SLUP", "SIM2"])) is not None:
        at_s = m.TimeUS * 1e-6
        if m.get_type() == "SIM2":
            vehicle.append((at_s, m.PE, m.PN, -m.PD))
        else:
            force = sqrt(m.VFN**2 + m.VFE**2 + m.VFD**2)
            payload.append((at_s, m.PE, m.PN, -m.PD, m.VE, m.VN, -m.VD, force))
    rows, places = np.array(payload), np.array(vehicle)
    return with_stop_at_zero(
        rows[:, 0], interpolated(rows[:, 0], places), rows[:, 1:4], rows[:, 4:7], rows[:, 7]
    )


def fly_plumbline(program: Path, mission: Path, vehicle: Path, out: Path) -> RecordedFlight:
    """The same firmware in our world."""
    settings = [word for name, value in SETTINGS.items() for word in ("--set", f"{name}={value}")]
    flight = ["--vehicle", str(vehicle), "--sensors", "rtk", "--out", str(out), "--quiet", *settings]
    command = [
        sys.executable,
        "-m",
        "gcs",
        "fly",
        str(mission),
        "--autopilot",
        f"ardupilot={program}",
        *flight,
    ]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    load = load_telemetry(out / "flight.tlog").load_truth
    rows = np.c_[load.time_s, load.position_m, load.q_cable * load.distance_m[:, None], load.velocity_m_s]
    rows = np.c_[rows, load.tension_n]
    times_s = np.arange(load.time_s[0], load.time_s[-1], 1.0 / LOG_RATE_HZ)
    resampled = interpolated(times_s, rows)
    below = resampled[:, 3:6]
    return with_stop_at_zero(times_s, resampled[:, :3] - below, below, resampled[:, 6:9], resampled[:, 9])


def interpolated(time_s: Floats, rows: Floats) -> Floats:
    """The rows, whose first column is their time, interpolated at these times."""
    return np.array([np.interp(time_s, rows[:, 0], column) for column in rows.T[1:]]).T


def with_stop_at_zero(
    time_s: Floats, vehicle: Floats, below: Floats, velocity: Floats, tension: Floats
) -> RecordedFlight:
    """The flight, with the time at which the vehicle arrives at its waypoint as 0."""
    stop_s = time_s[np.argmax(vehicle[:, 0] > DISTANCE_M - 0.3)]
    return RecordedFlight(time_s - stop_s, vehicle, below, velocity, tension)


def reference_swing(flight: RecordedFlight, cable_m: float) -> Swing:
    """The damped oscillation that fits load and vehicle best, after the stop."""
    period_s = 2.0 * pi * sqrt(cable_m / GRAVITY)
    start_s = WAIT_PERIODS * period_s
    fitted_rows = (flight.time_s > start_s) & (flight.time_s < start_s + FIT_PERIODS * period_s)
    t = flight.time_s[fitted_rows] - start_s
    columns = flight.below_m[fitted_rows, 0], flight.vehicle_m[fitted_rows, 0]

    def fitted(guess: Floats) -> tuple[list[complex], Floats]:
        wave = np.exp(complex(*guess) * t)
        basis = np.c_[wave.real, -wave.imag, np.ones_like(t), t]
        found = [np.linalg.lstsq(basis, column, rcond=None)[0] for column in columns]
        residuals = [basis @ x - column for x, column in zip(found, columns, strict=True)]
        return [complex(x[0], x[1]) for x in found], np.concatenate(residuals)

    best = least_squares(lambda guess: fitted(guess)[1], (-0.1, 2.0 * pi / period_s)).x
    (load, vehicle), _ = fitted(best)
    return Swing(complex(*best), vehicle / load, abs(load))


def pendulum(k: complex, cable_m: float) -> Swing:
    """The swing of an ideal pendulum under a vehicle that moves with this k."""
    s = cmath.sqrt(-GRAVITY / cable_m / (1.0 + k))
    return Swing(s if s.real < 0.0 else -s, k, 0.0)


class Lift(NamedTuple):
    """How the load leaves the ground."""

    tension_n: float  # greatest in the second that follows
    share: float  # speed of the load over that of the vehicle, along the cable, 0.3 s after it came taut
    slack_m: float  # the cable's length less the distance of its ends, when it begins to pull


def rates(flight: RecordedFlight) -> tuple[Floats, Floats]:
    """Speeds (m/s) along the cable, of the vehicle, and, as reported, of the load."""
    up = -flight.below_m / np.linalg.norm(flight.below_m, axis=1)[:, None]
    climb = np.gradient(flight.vehicle_m, flight.time_s, axis=0)
    return np.sum(climb * up, axis=1), np.sum(flight.load_m_s * up, axis=1)


def taut_at(flight: RecordedFlight, cable_m: float) -> int:
    """The last row with a slack cable before the load is carried."""
    height = flight.vehicle_m[:, 2] + flight.below_m[:, 2]
    up = int(np.argmax((height > height[0] + 0.5) & (flight.time_s < 0.0)))
    distance = np.linalg.norm(flight.below_m[:up], axis=1)
    return int(np.flatnonzero(distance < cable_m - 0.005)[-1])


def lift_of(flight: RecordedFlight, cable_m: float, weight_n: float) -> Lift:
    """The lift-off, from the last time that the cable is slack before the load is carried."""
    taut = taut_at(flight, cable_m)
    vehicle, load = rates(flight)
    onset = slice(taut - round(LOG_RATE_HZ), taut + 2)
    taut_rows = flight.tension_n[onset] > 0.05 * weight_n
    distance = np.linalg.norm(flight.below_m[onset], axis=1)[taut_rows]
    return Lift(
        float(flight.tension_n[taut : taut + round(LOG_RATE_HZ) + 1].max()),
        float(load[taut + 4] / vehicle[taut + 4]),
        max(cable_m - float(distance.min()), 0.0),
    )


def carried(flight: RecordedFlight) -> NDArray[np.bool_]:
    """Which rows are between the start of the carrying and the time when all is at rest."""
    return (flight.time_s > -6.0) & (flight.time_s < 20.0)


def max_swing_deg(flight: RecordedFlight) -> float:
    """The greatest angle of the cable against the vertical while the load is carried."""
    below = flight.below_m[carried(flight)]
    return float(np.degrees(np.arctan2(np.hypot(below[:, 0], below[:, 1]), -below[:, 2])).max())


def velocity_mismatch_m_s(flight: RecordedFlight) -> float:
    """The greatest difference between the reported velocity of the load and the rate at which its position
    changes, while it is carried."""
    position = flight.vehicle_m + flight.below_m
    rate = (position[2:] - position[:-2]) / (flight.time_s[2:] - flight.time_s[:-2])[:, None]
    reported = (flight.load_m_s[2:] + 2.0 * flight.load_m_s[1:-1] + flight.load_m_s[:-2]) / 4.0
    return float(np.linalg.norm(rate - reported, axis=1)[carried(flight)[1:-1]].max())


def queue_rows(cable_m: float, vehicle: Vehicle, flights: Sequence[RecordedFlight]) -> list[str]:
    """The table's rows of one cable; the flights are theirs and ours."""
    m, M = vehicle.load_mass_kg, vehicle.quad_mass_kg
    fixed, moving = pendulum(0.0, cable_m).period_s, pendulum(-m / (M + m), cable_m).period_s
    weight_n = m * GRAVITY
    swings = [reference_swing(flight, cable_m) for flight in flights]
    ideal = [pendulum(swing.k, cable_m) for swing in swings]
    lifts = [lift_of(flight, cable_m, weight_n) for flight in flights]
    same_pendulum = "the same of a pendulum under that vehicle"
    rows: list[tuple[str, str, list[str]]] = [
        (f"**cable of {cable_m:g} m**", "", ["", ""]),
        ("tension at lift-off, maximum", f"weight {weight_n:.2f} N", [f"{x.tension_n:.2f} N" for x in lifts]),
        (
            "speed of the load along the cable, 0.3 s later",
            "that of the vehicle",
            [f"{x.share:.0%}" for x in lifts],
        ),
        (
            "slack with which the cable pulls already",
            "0",
            [f"{1e3 * x.slack_m:.0f} mm" for x in lifts],
        ),
        ("swing of carrying and stop, maximum", "", [f"{max_swing_deg(x):.0f} degrees" for x in flights]),
        (
            f"amplitude {WAIT_PERIODS:g} periods after the stop",
            "",
            [f"{1e3 * x.start_amplitude_m:.0f} mm" for x in swings],
        ),
        ("period of the swing", f"{moving:.2f} to {fixed:.2f} s", [f"{x.period_s:.2f} s" for x in swings]),
        (same_pendulum, "", [f"{x.period_s:.2f} s" for x in ideal]),
        ("swing lost in a period", "", [f"{x.loss:.0%}" for x in swings]),
        (same_pendulum, "", [f"{x.loss:.0%}" for x in ideal]),
        (
            "velocity of the load less the rate of its position, maximum",
            "0",
            [f"{velocity_mismatch_m_s(x):.2f} m/s" for x in flights],
        ),
    ]
    return [f"| {what} | {analytic} | {' | '.join(cells)} |" for what, analytic, cells in rows]


def draw(flights: Sequence[RecordedFlight], cable_m: float, path: Path) -> None:
    """Draw lift-off and swing of both flights, side by side."""
    plt.rcParams["svg.hashsalt"] = "plumbline"
    figure, (lift, swing) = plt.subplots(1, 2, figsize=(9.0, 3.2), layout="constrained")
    for flight, name, colour in zip(flights, ("ArduPilot's own", "here"), ("C1", "C0"), strict=True):
        taut = taut_at(flight, cable_m)
        shown = slice(taut - 10, taut + 26)
        since_s = flight.time_s[shown] - flight.time_s[taut]
        vehicle, load = rates(flight)
        lift.plot(since_s, vehicle[shown], colour, linestyle=":", label=f"{name}: vehicle")
        lift.plot(since_s, load[shown], colour, label=f"{name}: load")
        after = (flight.time_s > -5.0) & (flight.time_s < 15.0)
        swing.plot(flight.time_s[after], flight.below_m[after, 0], colour, label=name)
    lift.set(title="Lift-off", xlabel="since the cable came taut (s)", ylabel="speed along the cable (m/s)")
    swing.set(title="Hard stop", xlabel="since the stop (s)", ylabel="load ahead of the vehicle (m)")
    for axes in (lift, swing):
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    figure.savefig(path, metadata={"Date": None})


def main() -> None:
    """Fly all, print the table, and with `--docs` write it into the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--docs", type=Path)
    parser.add_argument("--out", type=Path, help="where the flights are left")
    options = parser.parse_args()
    if not os.access(os.environ.get(VARIABLE, ""), os.X_OK):
        parser.error(f"{VARIABLE} must name the program of ArduCopter (docs/autopilots.md)")
    program = Path(os.environ[VARIABLE]).resolve()
    out = options.out or Path(tempfile.mkdtemp())
    out.mkdir(exist_ok=True)
    mission = out / "hard-stop.toml"
    mission.write_text(MISSION, encoding="utf-8")
    lines = ["| | analytic | ArduPilot's own | here |", "|---|---|---|---|"]
    for cable_m in CABLES_M:
        vehicle = plumbline.Vehicle.load("iris").replace(name=f"iris-{cable_m:g}m", cable_length_m=cable_m)
        file = out / f"{vehicle.name}.toml"
        vehicle.save(file)
        firmware_flight = fly_firmware_payload(program, mission, vehicle, out / f"theirs-{cable_m:g}m")
        plumbline_flight = fly_plumbline(program, mission, file, out / f"ours-{cable_m:g}m")
        rows = queue_rows(cable_m, vehicle, (firmware_flight, plumbline_flight))
        print("\n".join(rows), flush=True)
        lines += rows
        if options.docs and cable_m == CABLES_M[0]:
            draw((firmware_flight, plumbline_flight), cable_m, options.docs.parent / PICTURE)
    if options.docs:
        write_between(options.docs, BEGIN, END, "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
