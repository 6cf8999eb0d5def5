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
import re
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
from gcs.shell.display import FlightDisplay
from gcs.shell.link import UdpSocket, unix_us
from gcs.shell.processes import Processes
from gcs.shell.stopping import StopRequest
from gcs.workflows.flight_loops import run_wall_clock
from missions.fileformat import load_mission

Floats = NDArray[np.float64]

VARIABLE = "PLUMBLINE_ARDUCOPTER"
BEGIN, END = "<!-- slung payload -->", "<!-- end of slung payload -->"
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
WAITED, WATCHED = 2.0, 3.0  # periods: from the stop until the fit begins, and for which the fit lasts
HZ = 10.0  # rate of its payload's log, at which both flights are evaluated


class Flown(NamedTuple):
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
    begins_m: float  # amplitude at the beginning of the fit

    @property
    def period_s(self) -> float:
        return 2.0 * pi / abs(self.s.imag)

    @property
    def lost(self) -> float:
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
                asked = one.message
                for bit in (bit for bit in range(56) if asked.mask >> bit & 1):
                    grid = asked.lat, asked.lon, asked.grid_spacing, bit, [0] * 16
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


def fly_theirs(program: Path, mission: Path, vehicle: Vehicle, out: Path) -> Flown:
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
    shipped = (files("sitl.interfaces") / "ardupilot.parm").read_text(encoding="ascii")
    lines = [f"{name} {value:.9g}\n" for name, value in (payload | SETTINGS).items()]
    (out / "own.parm").write_text(shipped + "".join(lines), encoding="ascii")
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
        run_wall_clock(client, capture, link, truth, processes.ended, display, stop, lambda: None)
    if client.outcome is None or client.outcome.name != "completed":
        sys.exit(f"the firmware with its own payload: {client.outcome}")
    return theirs_of(next((out / "logs").glob("*.BIN")))


def theirs_of(log: Path) -> Flown:
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
    return stopped_at_0(rows[:, 0], at(rows[:, 0], places), rows[:, 1:4], rows[:, 4:7], rows[:, 7])


def fly_ours(program: Path, mission: Path, vehicle: Path, out: Path) -> Flown:
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
    seen = np.arange(load.time_s[0], load.time_s[-1], 1.0 / HZ)
    found = at(seen, rows)
    below = found[:, 3:6]
    return stopped_at_0(seen, found[:, :3] - below, below, found[:, 6:9], found[:, 9])


def at(time_s: Floats, rows: Floats) -> Floats:
    """The rows, whose first column is their time, interpolated at these times."""
    return np.array([np.interp(time_s, rows[:, 0], column) for column in rows.T[1:]]).T


def stopped_at_0(time_s: Floats, vehicle: Floats, below: Floats, velocity: Floats, tension: Floats) -> Flown:
    """The flight, with the time at which the vehicle arrives at its waypoint as 0."""
    there_s = time_s[np.argmax(vehicle[:, 0] > DISTANCE_M - 0.3)]
    return Flown(time_s - there_s, vehicle, below, velocity, tension)


def swing_of(flown: Flown, cable_m: float) -> Swing:
    """The damped oscillation that fits load and vehicle best, after the stop."""
    period_s = 2.0 * pi * sqrt(cable_m / GRAVITY)
    begins_s = WAITED * period_s
    chosen = (flown.time_s > begins_s) & (flown.time_s < begins_s + WATCHED * period_s)
    t = flown.time_s[chosen] - begins_s
    columns = flown.below_m[chosen, 0], flown.vehicle_m[chosen, 0]

    def fitted(guess: Floats) -> tuple[list[complex], Floats]:
        wave = np.exp(complex(*guess) * t)
        basis = np.c_[wave.real, -wave.imag, np.ones_like(t), t]
        found = [np.linalg.lstsq(basis, column, rcond=None)[0] for column in columns]
        missed = [basis @ x - column for x, column in zip(found, columns, strict=True)]
        return [complex(x[0], x[1]) for x in found], np.concatenate(missed)

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


def rates(flown: Flown) -> tuple[Floats, Floats]:
    """Speeds (m/s) along the cable, of the vehicle, and, as reported, of the load."""
    up = -flown.below_m / np.linalg.norm(flown.below_m, axis=1)[:, None]
    climb = np.gradient(flown.vehicle_m, flown.time_s, axis=0)
    return np.sum(climb * up, axis=1), np.sum(flown.load_m_s * up, axis=1)


def taut_at(flown: Flown, cable_m: float) -> int:
    """The last row with a slack cable before the load is carried."""
    height = flown.vehicle_m[:, 2] + flown.below_m[:, 2]
    up = int(np.argmax((height > height[0] + 0.5) & (flown.time_s < 0.0)))
    distance = np.linalg.norm(flown.below_m[:up], axis=1)
    return int(np.flatnonzero(distance < cable_m - 0.005)[-1])


def lift_of(flown: Flown, cable_m: float, weight_n: float) -> Lift:
    """The lift-off, from the last time that the cable is slack before the load is carried."""
    taut = taut_at(flown, cable_m)
    vehicle, load = rates(flown)
    begins = slice(taut - round(HZ), taut + 2)
    pulls = flown.tension_n[begins] > 0.05 * weight_n
    distance = np.linalg.norm(flown.below_m[begins], axis=1)[pulls]
    return Lift(
        float(flown.tension_n[taut : taut + round(HZ) + 1].max()),
        float(load[taut + 4] / vehicle[taut + 4]),
        max(cable_m - float(distance.min()), 0.0),
    )


def carried(flown: Flown) -> NDArray[np.bool_]:
    """Which rows are between the start of the carrying and the time when all is at rest."""
    return (flown.time_s > -6.0) & (flown.time_s < 20.0)


def widest_deg(flown: Flown) -> float:
    """The greatest angle of the cable against the vertical while the load is carried."""
    below = flown.below_m[carried(flown)]
    return float(np.degrees(np.arctan2(np.hypot(below[:, 0], below[:, 1]), -below[:, 2])).max())


def unaccounted_m_s(flown: Flown) -> float:
    """The greatest difference between the reported velocity of the load and the rate at which its position
    changes, while it is carried."""
    place = flown.vehicle_m + flown.below_m
    rate = (place[2:] - place[:-2]) / (flown.time_s[2:] - flown.time_s[:-2])[:, None]
    told = (flown.load_m_s[2:] + 2.0 * flown.load_m_s[1:-1] + flown.load_m_s[:-2]) / 4.0
    return float(np.linalg.norm(rate - told, axis=1)[carried(flown)[1:-1]].max())


def rows_of(cable_m: float, vehicle: Vehicle, flights: Sequence[Flown]) -> list[str]:
    """The table's rows of one cable; the flights are theirs and ours."""
    m, M = vehicle.load_mass_kg, vehicle.quad_mass_kg
    fixed, free = pendulum(0.0, cable_m).period_s, pendulum(-m / (M + m), cable_m).period_s
    weight_n = m * GRAVITY
    swings = [swing_of(flown, cable_m) for flown in flights]
    ideal = [pendulum(swing.k, cable_m) for swing in swings]
    lifts = [lift_of(flown, cable_m, weight_n) for flown in flights]
    under = "the same of a pendulum under that vehicle"
    told: list[tuple[str, str, list[str]]] = [
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
        ("swing of carrying and stop, maximum", "", [f"{widest_deg(x):.0f} degrees" for x in flights]),
        (f"amplitude {WAITED:g} periods after the stop", "", [f"{1e3 * x.begins_m:.0f} mm" for x in swings]),
        ("period of the swing", f"{free:.2f} to {fixed:.2f} s", [f"{x.period_s:.2f} s" for x in swings]),
        (under, "", [f"{x.period_s:.2f} s" for x in ideal]),
        ("swing lost in a period", "", [f"{x.lost:.0%}" for x in swings]),
        (under, "", [f"{x.lost:.0%}" for x in ideal]),
        (
            "velocity of the load less the rate of its position, maximum",
            "0",
            [f"{unaccounted_m_s(x):.2f} m/s" for x in flights],
        ),
    ]
    return [f"| {what} | {analytic} | {' | '.join(cells)} |" for what, analytic, cells in told]


def draw(flights: Sequence[Flown], cable_m: float, path: Path) -> None:
    """Draw lift-off and swing of both flights, side by side."""
    plt.rcParams["svg.hashsalt"] = "plumbline"
    figure, (lift, swing) = plt.subplots(1, 2, figsize=(9.0, 3.2), layout="constrained")
    for flown, name, colour in zip(flights, ("ArduPilot's own", "here"), ("C1", "C0"), strict=True):
        taut = taut_at(flown, cable_m)
        shown = slice(taut - 10, taut + 26)
        since_s = flown.time_s[shown] - flown.time_s[taut]
        vehicle, load = rates(flown)
        lift.plot(since_s, vehicle[shown], colour, linestyle=":", label=f"{name}: vehicle")
        lift.plot(since_s, load[shown], colour, label=f"{name}: load")
        after = (flown.time_s > -5.0) & (flown.time_s < 15.0)
        swing.plot(flown.time_s[after], flown.below_m[after, 0], colour, label=name)
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
        theirs = fly_theirs(program, mission, vehicle, out / f"theirs-{cable_m:g}m")
        ours = fly_ours(program, mission, file, out / f"ours-{cable_m:g}m")
        rows = rows_of(cable_m, vehicle, (theirs, ours))
        print("\n".join(rows), flush=True)
        lines += rows
        if options.docs and cable_m == CABLES_M[0]:
            draw((theirs, ours), cable_m, options.docs.parent / PICTURE)
    if options.docs:
        text = "\n".join(lines) + "\n"
        page = options.docs.read_text(encoding="utf-8")
        made = re.sub(f"{BEGIN}.*{END}", lambda _: f"{BEGIN}\n{text}{END}", page, flags=re.DOTALL)
        options.docs.write_text(made, encoding="utf-8")


if __name__ == "__main__":
    main()
