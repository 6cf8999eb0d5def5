"""What an application does with MAVSDK: `python mavsdk_flight.py ADDRESS STEP...`; its observations as JSON.

Steps are done in the given order. MAVSDK's own log goes to standard output, as by default.
"""

from __future__ import annotations

import json
import math
import os
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

from mavsdk import ComponentType, Configuration, Mavsdk, MavsdkError
from mavsdk.plugins.action import Action
from mavsdk.plugins.follow_me import Config as FollowConfig
from mavsdk.plugins.follow_me import FollowMe, TargetLocation
from mavsdk.plugins.ftp import Ftp
from mavsdk.plugins.geofence import Geofence
from mavsdk.plugins.gripper import Gripper
from mavsdk.plugins.info import Info
from mavsdk.plugins.log_files import LogFiles, LogFilesResult
from mavsdk.plugins.mission import Mission, MissionItem, MissionPlan
from mavsdk.plugins.mission_raw import MissionItem as RawItem
from mavsdk.plugins.mission_raw import MissionRaw
from mavsdk.plugins.offboard import (
    AccelerationNed,
    Attitude,
    AttitudeRate,
    Offboard,
    PositionNedYaw,
    VelocityBodyYawspeed,
    VelocityNedYaw,
)
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import FlightMode, LandedState, Telemetry
from mavsdk.plugins.winch import Winch, WinchError

LONG_S = 120.0  # on a busy machine
LOST_ON_THE_WAY = ("TIMEOUT", "BUSY", "NOT_RECEIVED_YET")
RETURN_M = 3.0
DEGREE_M = 111_319.5  # of latitude
NAN = math.nan
Plugin = TypeVar("Plugin")


class Pilot:
    """One connected application."""

    def __init__(self, system: Any) -> None:
        self.told: dict[str, Any] = {}
        self.system = system
        self._plugins: dict[type, Any] = {}
        self.action = self.plugin(Action)
        self.telemetry = self.plugin(Telemetry)
        self.texts: list[str] = []
        self.telemetry.subscribe_status_text(lambda text, *_: self.texts.append(text.text))
        self.modes: list[str] = []
        self.telemetry.subscribe_flight_mode(lambda mode, *_: self.modes.append(FlightMode(mode).name))
        self._turn = threading.Event()

    def plugin(self, kind: type[Plugin]) -> Plugin:
        """The plug-in of that kind, which lives as long as the application.

        MAVSDK 4.1.0 dies of a segmentation fault when Python's garbage collector destroys one in flight.
        """
        if kind not in self._plugins:
            self._plugins[kind] = kind(self.system)  # type: ignore[call-arg]
        return cast(Plugin, self._plugins[kind])

    def until(self, what: str, condition: Callable[[], bool], timeout_s: float = LONG_S) -> None:
        """Wait until telemetry shows the condition."""
        for _ in range(round(timeout_s / 0.05)):
            if condition():
                return
            self._turn.wait(0.05)
        raise AssertionError(f"in vain waited for: {what}; modes {self.modes[-5:]}, texts {self.texts[-5:]}")

    def mode(self, name: str) -> None:
        self.until(name, lambda: bool(self.modes) and self.modes[-1] == name)

    def landed(self, state: LandedState) -> None:
        self.until(state.name, lambda: self.telemetry.landed_state() == state)

    def height(self) -> float:
        return float(self.telemetry.position().relative_altitude_m)

    def home_e7(self) -> tuple[int, int]:
        self.until("home", lambda: self.telemetry.health().is_home_position_ok)
        home = self.telemetry.home()
        return round(home.latitude_deg * 1e7), round(home.longitude_deg * 1e7)

    def again(self, act: Callable[[], Any]) -> Any:
        """Act, and act again if a message was lost, as a pilot does; `told` counts the repetitions."""
        for _ in range(5):
            try:
                return act()
            except MavsdkError as error:
                if not any(word in str(error) for word in LOST_ON_THE_WAY):
                    raise
                self.told["again"] = self.told.get("again", 0) + 1
                self._turn.wait(1.0)
        return act()

    # ---- steps

    def ready(self) -> None:
        """Wait for what every example of MAVSDK waits for."""
        self.until("health_all_ok", self.telemetry.health_all_ok)
        health = self.telemetry.health()
        assert health.is_global_position_ok
        assert health.is_home_position_ok
        assert health.is_armable
        version = self.again(self.plugin(Info).get_version)
        self.told["version"] = [version.flight_sw_major, version.flight_sw_minor]

    def telemetry_seen(self) -> None:
        """Every stream that there is a page for."""
        seen: dict[str, Any] = {}
        streams = (
            "position",
            "home",
            "in_air",
            "armed",
            "attitude_quaternion",
            "attitude_euler",
            "velocity_ned",
            "gps_info",
            "raw_gps",
            "battery",
            "flight_mode",
            "health",
            "landed_state",
            "heading",
            "altitude",
            "unix_epoch_time",
            "position_velocity_ned",
            "attitude_angular_velocity_body",
            "imu",
            "odometry",
            "scaled_imu",
            "actuator_output_status",
            "rc_status",
        )
        for name in ("scaled_imu", "actuator_output_status", "rc_status"):
            getattr(self.telemetry, f"set_rate_{name}")(10.0)
        heard = {
            name: getattr(self.telemetry, f"subscribe_{name}")(
                lambda value, *_, name=name: seen.setdefault(name, value)
            )
            for name in streams
        }
        self.until("all streams", lambda: len(seen) == len(streams))
        for name, handle in heard.items():  # so many callbacks leave Python no time for the rest
            getattr(self.telemetry, f"unsubscribe_{name}")(handle)
        battery = seen["battery"]
        self.told["battery"] = [battery.voltage_v, battery.remaining_percent]
        self.told["satellites"] = seen["gps_info"].num_satellites
        # the vehicle stands: weight, no rotation, rotors off
        for name in ("imu", "scaled_imu"):
            assert abs(seen[name].acceleration_frd.down_m_s2 + 9.81) < 0.5
        assert seen["actuator_output_status"].active == 4
        assert seen["actuator_output_status"].actuator[0] == 1000.0
        assert not seen["rc_status"].was_available_once
        fast: list[Any] = []
        self.telemetry.set_rate_position(20.0)
        self.telemetry.subscribe_position(lambda value, *_: fast.append(value))
        self.until("positions at 20 Hz", lambda: len(fast) >= 20, 3.0)
        self.telemetry.set_rate_position(0.0)
        origin = self.telemetry.get_gps_global_origin()
        self.told["origin"] = [origin.latitude_deg, origin.longitude_deg]

    def parameters(self) -> None:
        param = self.plugin(Param)
        everything = param.get_all_params()
        real, whole = ({p.name for p in some} for some in (everything.float_params, everything.int_params))
        self.told["parameters"] = {"real": "MIS_SPEED" in real, "whole": "MIS_SHAPE" in whole}
        param.set_param_float("MIS_SPEED", 1.25)
        assert param.get_param_float("MIS_SPEED") == 1.25
        param.set_param_float("MIS_SPEED", 1.5)
        param.set_param_int("MIS_SHAPE", 1)
        assert param.get_param_int("MIS_SHAPE") == 1
        self.action.set_takeoff_altitude(1.5)
        assert self.action.get_takeoff_altitude() == 1.5
        self.action.set_return_to_launch_altitude(RETURN_M)
        assert self.action.get_return_to_launch_altitude() == RETURN_M

    def missions(self) -> None:
        raw = self.plugin(MissionRaw)
        x, y = self.home_e7()
        items = [
            RawItem(seq, 6, 16, int(seq == 0), 1, 0.0, 0.0, 0.0, NAN, x + 100 * seq, y - 70 * seq, 1.5, 0)
            for seq in range(300)
        ]
        raw.upload_mission(items)
        back = raw.download_mission()
        assert [(i.seq, i.x, i.y, i.z) for i in back] == [(i.seq, i.x, i.y, i.z) for i in items]
        assert all(math.isnan(i.param4) for i in back)
        raw.clear_mission()
        assert raw.download_mission() == []

    def fences(self) -> None:
        raw = self.plugin(MissionRaw)
        home = self.home_e7()
        corners = ((-2, -2), (-2, 4), (4, 4), (4, -2))
        fence = [
            RawItem(seq, 3, 5001, 0, 1, 4.0, 0.0, 0.0, 0.0, home[0] + x * 1000, home[1] + y * 1000, 0.0, 1)
            for seq, (x, y) in enumerate(corners)
        ]
        raw.upload_geofence(fence)
        assert [(i.x, i.y) for i in raw.download_geofence()] == [(i.x, i.y) for i in fence]
        rally = [RawItem(0, 3, 5100, 0, 1, 0.0, 0.0, 0.0, 0.0, *home, 2.0, 2)]
        raw.upload_rally_points(rally)
        assert [(i.x, i.y) for i in raw.download_rallypoints()] == [home]
        self.plugin(Geofence).clear_geofence()

    def take_off(self) -> None:
        self.again(self.action.arm)
        self.until("armed", self.telemetry.armed)
        self.action.takeoff()
        self.mode("TAKEOFF")
        self.landed(LandedState.IN_AIR)
        self.mode("HOLD")
        assert self.telemetry.in_air()

    def arm(self) -> None:
        self.again(self.action.arm)
        self.until("armed", self.telemetry.armed)

    def go_to(self) -> None:
        self._go_to(1.0, 2.5)

    def go_away(self) -> None:
        """Go far enough for a return to climb first."""
        self._go_to(1.6, 2.5)

    def _go_to(self, north: float, height: float) -> None:
        home = self.telemetry.home()
        place = (home.latitude_deg + north / DEGREE_M, home.longitude_deg)
        self.action.goto_location(*place, home.absolute_altitude_m + height, NAN)

        def there() -> bool:
            position = self.telemetry.position()
            return abs(position.latitude_deg - place[0]) < 0.2 / DEGREE_M

        self.until("the place", there)

    def upload(self) -> None:
        home = self.telemetry.home()

        def item(north: float, east: float, **how: Any) -> MissionItem:
            return MissionItem(
                home.latitude_deg + north / DEGREE_M, home.longitude_deg + east / DEGREE_M, 2.0, 1.5,
                how.get("fly_through", True), NAN, NAN, MissionItem.CameraAction.NONE,
                NAN, NAN, NAN, NAN, NAN, MissionItem.VehicleAction.NONE,
            )  # fmt: skip

        plan = MissionPlan([item(1.0, 0.0), item(1.0, 1.5, fly_through=False), item(0.0, 1.5)])
        self.mission = self.plugin(Mission)
        self.again(lambda: self.mission.upload_mission(plan))
        back = self.again(lambda: self.mission.download_mission().mission_items)
        assert len(back) == 3
        for ours, theirs in zip(plan.mission_items, back, strict=True):
            assert abs(ours.latitude_deg - theirs.latitude_deg) < 1e-7
            assert ours.relative_altitude_m == theirs.relative_altitude_m

    def fly_mission(self) -> None:
        """Start, pause on the way, continue to the end."""
        done: list[int] = []
        left: list[int] = []  # in the same reports: MAVSDK calls back in another thread than that of queries

        def told(progress: Any, *_: object) -> None:
            done.append(progress.current)
            left.append(progress.total - progress.current)

        self.mission.subscribe_mission_progress(told)
        self.again(self.mission.start_mission)
        self.mode("MISSION")
        self.until("the second item", lambda: bool(done) and done[-1] >= 1)
        self.again(self.mission.pause_mission)
        self.mode("HOLD")
        assert not self.mission.is_mission_finished()
        self.again(self.mission.start_mission)
        self.mode("MISSION")
        self.until("the end of the mission", self.mission.is_mission_finished)
        self.until("the progress that ends it", lambda: left[-1] == 0)
        self.told["progress"] = sorted(set(done))

    def upload_and_fly(self) -> None:
        """A mission that is started in the air right after its upload, before its paths can be prepared."""
        self.upload()
        self.mission.start_mission()
        self.mode("MISSION")
        self.until("the end of the mission", self.mission.is_mission_finished)
        self.mode("HOLD")

    def dated(self) -> None:
        """In the air: the times since arming and take-off."""
        heard: list[Any] = []
        info = self.plugin(Info)
        info.subscribe_flight_information(lambda flight, *_: heard.append(flight))
        self.until("when it was armed", lambda: bool(heard) and heard[-1].duration_since_arming_ms > 0)
        assert 0 < heard[-1].duration_since_takeoff_ms <= heard[-1].duration_since_arming_ms
        assert heard[-1].flight_uid > 0

    def offboard(self) -> None:
        """Places, then velocities, as the examples of MAVSDK do it."""
        offboard = self.plugin(Offboard)
        offboard.set_position_ned(PositionNedYaw(0.0, 0.0, -2.0, NAN))
        offboard.start()
        self.mode("OFFBOARD")
        offboard.set_position_ned(PositionNedYaw(0.8, 0.0, -2.0, NAN))
        velocities = self.telemetry.position_velocity_ned
        self.until("the place", lambda: abs(velocities().position.north_m - 0.8) < 0.15)
        offboard.set_velocity_ned(VelocityNedYaw(0.0, 0.4, 0.0, NAN))
        self.until("the velocity", lambda: abs(velocities().velocity.east_m_s - 0.4) < 0.15)
        offboard.set_velocity_ned(VelocityNedYaw(0.0, 0.0, 0.0, NAN))
        self.until("rest", lambda: abs(velocities().velocity.east_m_s) < 0.1)
        offboard.stop()
        self.mode("HOLD")

    def heading(self, degrees: float) -> None:
        """Wait until the nose points there, as the application sees it."""

        def there() -> bool:
            return abs(math.remainder(self.telemetry.heading().heading_deg - degrees, 360.0)) < 3.0

        self.until(f"heading {degrees:g}", there)

    def yaw(self) -> None:
        """A place with a yaw, then every MAVSDK setpoint that turns the nose."""
        home, offboard = self.telemetry.home(), self.plugin(Offboard)
        self.heading(90.0)
        height = home.absolute_altitude_m + 2.5
        self.action.goto_location(home.latitude_deg, home.longitude_deg, height, 0.0)
        self.heading(0.0)
        self.mode("HOLD")
        offboard.set_position_ned(PositionNedYaw(0.0, 0.0, -2.5, 0.0))
        offboard.start()
        self.mode("OFFBOARD")
        offboard.set_position_ned(PositionNedYaw(0.0, 0.0, -2.5, 215.0))
        self.heading(215.0)
        offboard.set_velocity_ned(VelocityNedYaw(0.0, 0.0, 0.0, 180.0))
        self.heading(180.0)
        offboard.set_velocity_body(VelocityBodyYawspeed(0.4, 0.0, 0.0, 0.0))
        seen = self.telemetry.position_velocity_ned
        self.until("the velocity along the nose", lambda: seen().velocity.north_m_s < -0.3)
        offboard.set_velocity_body(VelocityBodyYawspeed(0.0, 0.0, 0.0, 30.0))
        rates = self.telemetry.attitude_angular_velocity_body
        self.until("the yaw rate", lambda: abs(rates().yaw_rad_s - math.radians(30.0)) < 0.03)
        offboard.stop()
        self.mode("HOLD")
        self.until("no yaw rate", lambda: abs(rates().yaw_rad_s) < 0.02)

    def accelerate(self) -> None:
        """An acceleration alone, there and back to rest."""
        offboard, seen = self.plugin(Offboard), self.telemetry.position_velocity_ned
        offboard.set_acceleration_ned(AccelerationNed(0.0, 0.3, 0.0))
        offboard.start()
        self.mode("OFFBOARD")
        self.until("speed", lambda: seen().velocity.east_m_s > 0.5)
        offboard.set_acceleration_ned(AccelerationNed(0.0, -0.3, 0.0))
        self.until("rest", lambda: seen().velocity.east_m_s < 0.1)
        offboard.stop()
        self.mode("HOLD")

    def body_rates(self) -> None:
        """A yaw rate with a thrust, then an attitude with a yaw."""
        offboard, rates = self.plugin(Offboard), self.telemetry.attitude_angular_velocity_body
        offboard.set_attitude_rate(AttitudeRate(0.0, 0.0, 20.0, 0.5))
        offboard.start()
        self.mode("OFFBOARD")
        self.until("the yaw rate", lambda: abs(rates().yaw_rad_s - math.radians(20.0)) < 0.03)
        offboard.set_attitude(Attitude(0.0, 0.0, 90.0, 0.5))
        self.heading(90.0)
        offboard.stop()
        self.mode("HOLD")

    def follow(self) -> None:
        """The load at 8.5 m, 6 m behind somebody who walks north."""
        follower, seen = self.plugin(FollowMe), self.telemetry.position_velocity_ned
        self.until("its parameters", lambda: follower.get_config().max_tangential_vel_m_s == 5.0)
        follower.set_config(FollowConfig(8.5, 6.0, 0.1, FollowConfig.FollowAltitudeMode(0), 5.0, 180.0))
        follower.start()
        self.mode("FOLLOW_ME")
        self.until("its own heartbeat", follower.is_active)
        home, begun = self.telemetry.home(), time.monotonic()

        def walked_m() -> float:
            return 10.0 + 0.5 * (time.monotonic() - begun)

        def behind() -> bool:
            walked = walked_m()
            place = home.latitude_deg + walked / DEGREE_M, home.longitude_deg, home.absolute_altitude_m
            follower.set_target_location(TargetLocation(*place, 0.0, 0.0, 0.0))
            load, speed = seen().position, seen().velocity.north_m_s
            return abs(load.north_m - walked + 6.0) < 0.2 and speed > 0.05 and self.height() > 9.0

        self.until("the load behind its target", behind)
        follower.stop()
        self.mode("HOLD")

    def winch(self) -> None:
        """Lower and raise the load by the plug-in that communicates with the winch component."""
        winch, lengths = self.plugin(Winch), []
        winch.subscribe_status(lambda status, *_: lengths.append(status.line_length_m))
        self.until("a winch", lambda: bool(lengths))
        self.told["components"] = sorted(self.system.component_ids())
        begun = lengths[-1]
        winch.relative_length_control(1, 0.3, 0.2)
        self.until("a longer cable", lambda: lengths[-1] > begun + 0.25)
        winch.rate_control(1, -0.1)
        self.until("a shorter cable", lambda: lengths[-1] < begun + 0.2)
        winch.hold(1)
        try:
            winch.deliver(1)
        except WinchError as error:
            self.told["deliver"] = str(error)

    def hold(self) -> None:
        self.action.hold()
        self.mode("HOLD")

    def come_back(self) -> None:
        self.again(self.action.return_to_launch)
        self.mode("RETURN_TO_LAUNCH")
        self.until("disarmed", lambda: not self.telemetry.armed())
        self.landed(LandedState.ON_GROUND)

    def land(self) -> None:
        self.again(self.action.land)
        self.mode("LAND")
        self.until("disarmed", lambda: not self.telemetry.armed())
        self.landed(LandedState.ON_GROUND)

    def disarm(self) -> None:
        """On the ground, before any other request."""
        self.again(self.action.disarm)
        self.until("disarmed", lambda: not self.telemetry.armed())

    def gripper(self) -> None:
        """Release the load and take it again, on the ground."""
        gripper = self.plugin(Gripper)
        self.again(lambda: gripper.release(1))
        self.again(lambda: gripper.grab(1))

    def log(self) -> None:
        """The log of the finished flight, by the log protocol; its folder by FTP."""
        names = [entry.name for entry in self.plugin(Ftp).list_directory("/fs/microsd/log").entries]
        logs = self.plugin(LogFiles)
        sizes = [-1, 0]
        while sizes[-1] != sizes[-2]:  # it is written for a second after disarming
            self._turn.wait(1.0)
            entry = logs.get_entries()[-1]
            sizes.append(entry.size_bytes)
        over, results = threading.Event(), []

        def hear(result: Any, *_: Any) -> None:
            if result != LogFilesResult.NEXT:
                results.append(result.name)
                over.set()

        path = Path("downloaded.ulg").absolute()
        logs.download_log_file_async(entry, str(path), hear)
        assert over.wait(LONG_S), "no end of the log"
        self.told["log"] = [results[0], entry.size_bytes, str(path), names[-1]]


def main(address: str, steps: list[str]) -> None:
    with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
        mavsdk.add_any_connection(address)
        pilot = Pilot(mavsdk.first_autopilot(LONG_S))
        for step in steps:
            print(f"== {step}", flush=True)
            try:
                getattr(pilot, step)()
            except Exception as error:
                sys.exit(f"{step}: {type(error).__name__} {error}\n{pilot.texts}")
        told = {**pilot.told, "texts": pilot.texts, "modes": pilot.modes}
        print(json.dumps(told), flush=True)
        # MAVSDK 4.1.0 at times dies of a segmentation fault while it is destroyed, whatever the vehicle was
        os._exit(0)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit("ADDRESS STEP... are missing (steps are the methods of Pilot): udpin://0.0.0.0:14540 ready")
    main(sys.argv[1], sys.argv[2:])
