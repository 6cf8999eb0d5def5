"""The `sitl` program: sockets, clock and signals around `sitl.hil`."""

from __future__ import annotations

import os
import secrets
import sys
from collections.abc import Callable
from pathlib import Path

import click

from autopilot.shell.compiling import SIMULATOR, Compilation
from autopilot.shell.options import (
    EXIT_ERROR,
    EXIT_USAGE,
    Address,
    Stop,
    StopRequest,
    address_text,
    os_error_text,
    print_errors,
    reduce_latency,
    stop_text,
)
from autopilot.vehicle.shipped import VehicleFileError
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.parameter_table import ParameterError
from sitl.hil import HilSimulator
from sitl.interfaces import PLUMBLINE
from sitl.interfaces.frame import FrameError
from sitl.pacing import Pacing
from sitl.sensor_log import SensorLog
from sitl.sensors.shipped import ProfileError
from sitl.shell.autopilots import AUTOPILOTS, parameter_file
from sitl.shell.link import Link
from sitl.shell.loops import SPIN_NS, run_lockstep, run_real_time, wait_for_autopilot
from sitl.shell.tick_loop import warm_up


def _run_on(cpu: int) -> None:
    try:
        os.sched_setaffinity(0, {cpu})
    except (AttributeError, OSError):
        text = f"--cpu {cpu}: cannot run on this core; leave --cpu out, or name another"
        raise click.UsageError(text) from None


def _append_to(path: Path) -> Callable[[bytes], object]:
    """A function that appends bytes to a new file; it raises ValueError with one line if it cannot."""

    def append(data: bytes) -> None:
        try:
            file.write(data)
            file.flush()
        except OSError as error:
            raise ValueError(f"{path}: {os_error_text(error)}") from None

    try:
        file = path.open("wb")
    except OSError as error:
        raise ValueError(f"{path}: {os_error_text(error)}") from None
    return append


def simulate(
    interface: str,
    sensors: str,
    vehicle: str,
    seed: int,
    speed: float | None,
    lockstep: bool,
    real_time: bool,
    listen: Address | None,
    truth: Address,
    truth_every: int | None,
    settings: tuple[tuple[str, float], ...],
    log_sensors: Path | None,
    home: Home | None,
    cpu: int | None,
    parameters: bool,
    quiet: bool,
) -> None:
    """Run the program with these options of its command (`sitl.shell.command`)."""
    if lockstep and real_time:
        raise click.UsageError("--lockstep and --real-time exclude each other")
    kind = AUTOPILOTS[interface]
    if parameters:
        if kind.run is None:
            raise click.UsageError("--parameters is for third-party autopilots: add --for")
        click.echo(parameter_file(interface))
        return
    if real_time and kind.run is not None and not kind.real_time:
        raise click.UsageError(
            f"--real-time is for {PLUMBLINE}: {interface} waits for the world, and it for it"
        )
    if kind.real_time and (lockstep or speed not in {None, 1.0}):
        raise click.UsageError(
            f"{interface} runs on the wall clock and does not wait: leave --lockstep and --speed out"
        )
    if log_sensors is not None and kind.run is not None:
        raise click.UsageError(f"--log-sensors is for {PLUMBLINE}: {interface} receives other messages")
    real_time = real_time or kind.real_time
    listen = listen or kind.listen
    truth_every = truth_every or kind.truth_every

    if settings:
        from autopilot.shell.setting_names import check_names

        check_names(settings)

    def notify(text: str) -> None:
        if not quiet:
            print(f"sitl: {text}", flush=True)

    link: Link | None = None
    factor = 1.0 if speed is None else speed
    unlimited = lockstep and speed is None
    pacing = Pacing(factor)
    simulator: HilSimulator | None = None
    try:
        # first, so that no message of an autopilot is lost while kernels are compiled
        link = Link(listen, truth, notify)

        def build(log: SensorLog | None = None) -> HilSimulator:
            return HilSimulator.build(
                vehicle,
                sensors,
                seed,
                {**kind.settings, **dict(settings)},
                home,
                not real_time,
                truth_every,
                boot_id=secrets.randbits(63),
                log=log,
            )

        compilation = Compilation((SIMULATOR,), notify)
        warm = build()  # compiles, or loads, every kernel
        if kind.run is not None:
            _ = warm.frame  # FrameError if no third-party firmware flies the vehicle
        warm_up(warm)
        warm.truth_datagram()
        warm.receive(b"")
        warm.advance()
        compilation.done()
        simulator = build(None if log_sensors is None else SensorLog(_append_to(log_sensors)))
        if cpu is not None:
            _run_on(cpu)
        # not if it would spin for most of the time, which would keep other programs from running
        reduce_latency(real_time and simulator.tick_us * 1000 / factor > 4 * SPIN_NS)
        mode = "in lockstep" if unlimited else f"at {factor:g} x real time, slower on a busy machine"
        if real_time:
            mode = f"at {factor:g} x real time, without waiting for answers"
        notify(
            f"vehicle {vehicle}, sensors {sensors}, seed {seed}, {1e6 / simulator.tick_us:g} Hz {mode}; "
            f"waiting for {kind.awaited_name} on {address_text(listen)}"
        )
        with StopRequest() as stop:
            paced = None if unlimited else pacing
            if kind.run is not None:
                kind.run(link, simulator, stop, notify, paced)
                return
            wait_for_autopilot(link, simulator, stop)
            if real_time:
                run_real_time(
                    link,
                    simulator,
                    pacing,
                    stop,
                    notify,
                    send_tick=lambda: link.send(simulator.sensor_datagram()),
                    process=lambda datagram, sender: link.process(datagram, sender, simulator),
                )
            else:
                run_lockstep(link, simulator, stop, notify, paced)
    except (VehicleFileError, ProfileError) as error:
        sys.exit(print_errors("sitl", EXIT_USAGE, *error.problems))
    except FrameError as error:
        sys.exit(print_errors("sitl", EXIT_USAGE, f"--vehicle {vehicle}: {error}"))
    except ParameterError as error:
        sys.exit(print_errors("sitl", EXIT_USAGE, str(error)))
    except ValueError as error:
        sys.exit(print_errors("sitl", EXIT_ERROR, str(error)))
    except Stop as stopped:
        stopped_by = str(stopped)
    finally:
        if link is not None:
            link.close()
    if simulator is not None and link is not None:
        summary = _summary(simulator, real_time, pacing, link.served_s)
        notify(stop_text(simulator.now_us, stopped_by, summary))


def _summary(simulator: HilSimulator, real_time: bool, pacing: Pacing, wall_s: float) -> str:
    if real_time:
        text = pacing.summary(simulator.missed)
    else:
        text = f"{simulator.now_us / 1e6 / max(wall_s, 1e-9):.2f} x real time"
    if simulator.rejected:
        text += f"; {simulator.rejected} commands were not numbers"
    if simulator.diverged:
        text += "; the vehicle left the domain of the model"
    return text
