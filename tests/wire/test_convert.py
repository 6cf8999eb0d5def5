"""Frames and units of the messages: compared with explicit axes and SciPy, and converted there and back."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from autopilot.geometry.frames import enu_from_ned, flu_from_frd, quat_enu_flu_from_ned_frd
from autopilot.geometry.linear import Vec3
from autopilot.geometry.so3 import Quat
from autopilot.wire.codec import Fields, FrameWriter, decode, layout_of
from autopilot.wire.convert.flight import (
    LoadState,
    cascade_errors_values,
    load_setpoint_values,
    load_state_values,
    read_load_state,
    rotor_state_values,
    wind_state_message,
)
from autopilot.wire.convert.geodesy import (
    EARTH_RADIUS_M,
    Home,
    enu_from_geodetic,
    geodetic_from_enu,
    home_from_text,
)
from autopilot.wire.convert.scaling import int16
from autopilot.wire.convert.simulator import (
    NO_FORCES,
    Forces,
    HilActuatorControls,
    HilGps,
    HilSensor,
    HilStateQuaternion,
    LoadSensor,
    Odometry,
    load_sensor_record,
    odometry_record,
    padded_forces,
    read_hil_actuator_controls,
    read_hil_gps,
    read_hil_sensor,
    read_hil_state_quaternion,
)
from autopilot.wire.convert.telemetry import (
    altitude_values,
    attitude_quaternion_values,
    attitude_target_values,
    attitude_values,
    euler_ned_frd,
    global_position_int_message,
    gps_global_origin_message,
    gps_raw_int_message,
    heading_cdeg,
    home_position_message,
    local_position_ned_values,
    position_target_local_ned_values,
    vfr_hud_values,
    winch_status_message,
)
from autopilot.wire.dialect import plumbline as mavlink
from tests.doubles.messages import (
    hil_actuator_controls_message,
    hil_gps_message,
    hil_sensor_message,
    hil_state_quaternion_message,
    load_sensor_message,
    odometry_message,
)

FLOAT32 = 2.0**-23  # relative spacing of float32
DEG_E7_M = EARTH_RADIUS_M * math.pi / 180.0 * 1e-7  # m northwards of one unit of latitude
HOME = Home()
NAN = math.nan
NO_VECTOR = (NAN, NAN, NAN)  # it was not measured
NED_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FRD_FLU = np.diag([1.0, -1.0, -1.0])

quick = settings(max_examples=60, deadline=None, derandomize=True)
numbers = st.floats(-1e4, 1e4)
vectors = st.tuples(numbers, numbers, numbers)
unmeasured = st.just(NO_VECTOR)
positive = st.floats(0.0, 1e4)
times = st.integers(0, 2**63)
small = st.floats(-300.0, 300.0)
small_vectors = st.tuples(small, small, small)


def _quat(seed: int) -> Quat:
    x, y, z, w = Rotation.random(rng=np.random.default_rng(seed)).as_quat()
    sign = 1.0 if w >= 0.0 else -1.0
    return (float(sign * w), float(sign * x), float(sign * y), float(sign * z))


quats = st.integers(0, 10**6).map(_quat)


def same_side(q: Quat, other: Quat) -> Quat:
    """q or -q: the same rotation, whichever is nearer to the other."""
    return (-q[0], -q[1], -q[2], -q[3]) if np.dot(q, other) < 0.0 else q


def written(values: Callable[..., Any], message_type: Any) -> Callable[..., Fields]:
    """The fields of a message whose numbers are what `values` returns, as machine code writes them."""
    return lambda *arguments: (layout_of(message_type), values(*arguments))


attitude = written(attitude_values, mavlink.MAVLink_attitude_message)
attitude_quaternion = written(attitude_quaternion_values, mavlink.MAVLink_attitude_quaternion_message)
attitude_target = written(attitude_target_values, mavlink.MAVLink_attitude_target_message)
local_position_ned = written(local_position_ned_values, mavlink.MAVLink_local_position_ned_message)
position_target_local_ned = written(
    position_target_local_ned_values, mavlink.MAVLink_position_target_local_ned_message
)
altitude_above_home = written(altitude_values, mavlink.MAVLink_altitude_message)
vfr_hud = written(vfr_hud_values, mavlink.MAVLink_vfr_hud_message)
load_state = written(load_state_values, mavlink.MAVLink_load_state_message)
load_setpoint = written(load_setpoint_values, mavlink.MAVLink_load_setpoint_message)
cascade_errors = written(cascade_errors_values, mavlink.MAVLink_cascade_errors_message)
rotor_state = written(rotor_state_values, mavlink.MAVLink_rotor_state_message)


class LoadSetpoint(NamedTuple):
    """The arguments of `load_setpoint_values`."""

    time_us: int
    phase: int
    control_mode: int
    seq: int
    position: Vec3
    velocity: Vec3
    acceleration: Vec3
    q_cable_c: Vec3
    elapsed: float
    duration: float
    requested_position: Vec3
    requested_velocity: Vec3


class CascadeErrors(NamedTuple):
    """The arguments of `cascade_errors_values`."""

    time_us: int
    control_mode: int
    e_x: Vec3
    e_v: Vec3
    e_q: Vec3
    e_q_dot: Vec3
    e_R: Vec3
    e_Omega: Vec3
    psi_R: float
    psi_q: float
    thrust: float
    moment: Vec3


class WindState(NamedTuple):
    """The arguments of `wind_state_message`."""

    time_us: int
    wind: Vec3
    gust: Vec3


class RotorState(NamedTuple):
    """The arguments of `rotor_state_values`."""

    time_us: int
    source: int
    forces: Forces
    force_min: float
    force_max: float
    saturated: int
    rotors: int = 4


def read_load_setpoint(m: Any) -> LoadSetpoint:
    return LoadSetpoint(
        m.time_usec,
        m.phase,
        m.control_mode,
        m.seq,
        enu_from_ned((m.x, m.y, m.z)),
        enu_from_ned((m.vx, m.vy, m.vz)),
        enu_from_ned((m.ax, m.ay, m.az)),
        enu_from_ned((m.qx, m.qy, m.qz)),
        m.elapsed,
        m.duration,
        enu_from_ned((m.asked_x, m.asked_y, m.asked_z)),
        enu_from_ned((m.asked_vx, m.asked_vy, m.asked_vz)),
    )


def read_cascade_errors(m: Any) -> CascadeErrors:
    return CascadeErrors(
        m.time_usec,
        m.control_mode,
        enu_from_ned(tuple(m.e_x)),
        enu_from_ned(tuple(m.e_v)),
        enu_from_ned(tuple(m.e_q)),
        enu_from_ned(tuple(m.e_q_dot)),
        flu_from_frd(tuple(m.e_r)),
        flu_from_frd(tuple(m.e_omega)),
        m.psi_r,
        m.psi_q,
        m.thrust,
        flu_from_frd(tuple(m.moment)),
    )


def read_wind_state(m: Any) -> WindState:
    return WindState(m.time_usec, enu_from_ned(tuple(m.wind)), enu_from_ned(tuple(m.gust)))


def read_rotor_state(m: Any) -> RotorState:
    forces = padded_forces((*m.force, *m.more_force))
    saturated = m.saturated | m.more_saturated << 8
    return RotorState(m.time_usec, m.source, forces, m.force_min, m.force_max, saturated, m.rotors or 4)


def over_the_wire(message: Any) -> Any:
    received, junk = decode(FrameWriter(1, 25).frame(message))
    assert junk == 0
    return received[0].message


def named(message: Any) -> Any:
    """The fields of a message by name, as they were before they were packed."""
    if not isinstance(message, tuple):
        return message
    layout, values = message
    fields, rest = {}, list(values)
    for name, length in zip(layout.type.ordered_fieldnames, layout.type.array_lengths, strict=True):
        fields[name] = tuple(rest[:length]) if length else rest[0]
        del rest[: length or 1]
    assert rest == []
    return SimpleNamespace(**fields)


def name_of(message: Any) -> str:
    """The name of the test of a message."""
    return getattr(message[0].type if isinstance(message, tuple) else message, "msgname", "")


def assert_close(got: Any, sent: Any, absolute: float = 1e-6, relative: float = FLOAT32) -> None:
    """Compare field by field; with float32 rounding unless stated otherwise."""
    assert type(got) is type(sent)
    for name, one, other in zip(sent._fields, got, sent, strict=True):
        if other is None or isinstance(other, bool | int):
            assert one == other, name
        else:
            assert one == pytest.approx(other, rel=relative, abs=absolute, nan_ok=True), name


RECORDS: dict[str, tuple[st.SearchStrategy[Any], Callable[..., Any], Callable[[Any], Any]]] = {
    "hil_sensor": (
        st.builds(
            HilSensor,
            times,
            vectors,
            vectors,
            vectors,
            positive,
            numbers,
            numbers,
            st.integers(0, 0x1FFF),
            st.integers(0, 255),
        ),
        hil_sensor_message,
        read_hil_sensor,
    ),
    "load_sensor": (
        st.builds(
            LoadSensor,
            times,
            unmeasured | vectors,
            unmeasured | vectors,
            unmeasured | vectors,
            positive,
            positive,
            positive,
            st.integers(0, 2),
        ),
        load_sensor_message,
        load_sensor_record,
    ),
    "hil_actuator_controls": (
        st.builds(
            HilActuatorControls,
            times,
            st.tuples(*(numbers,) * 14),
            st.booleans(),
            st.booleans(),
            st.booleans(),
            numbers,
        ),
        hil_actuator_controls_message,
        read_hil_actuator_controls,
    ),
    "load_state": (
        st.builds(
            LoadState,
            times,
            st.integers(0, 2),
            vectors,
            vectors,
            vectors,
            vectors,
            positive,
            numbers,
            st.booleans(),
            st.integers(0, 65535),
        ),
        load_state,
        read_load_state,
    ),
    "load_setpoint": (
        st.builds(
            LoadSetpoint,
            times,
            st.integers(0, 9),
            st.integers(0, 4),
            st.integers(0, 65535),
            vectors,
            vectors,
            vectors,
            vectors,
            positive,
            positive | st.just(NAN),
            vectors,
            vectors,
        ),
        load_setpoint,
        read_load_setpoint,
    ),
    "cascade_errors": (
        st.builds(
            CascadeErrors,
            times,
            st.integers(0, 4),
            *[vectors] * 6,
            numbers,
            numbers,
            numbers,
            vectors,
        ),
        cascade_errors,
        read_cascade_errors,
    ),
    "rotor_state": (
        st.builds(
            RotorState,
            times,
            st.integers(0, 2),
            st.tuples(*(numbers,) * 14),
            numbers,
            positive | st.just(math.inf),
            st.integers(0, 2**14 - 1),
            st.integers(4, 14),
        ),
        rotor_state,
        read_rotor_state,
    ),
    "wind state": (
        st.builds(WindState, times, vectors, vectors),
        wind_state_message,
        read_wind_state,
    ),
}


@pytest.mark.parametrize("name", RECORDS)
@given(st.data())
@quick
def test_a_record_comes_back(name: str, data: st.DataObject) -> None:
    records, build, read = RECORDS[name]
    record = data.draw(records)
    assert_close(read(over_the_wire(build(*record))), record)


@given(
    st.tuples(
        *(times, vectors, quats, unmeasured | vectors, unmeasured | vectors),
        *(positive, positive, positive, st.integers(0, 255)),
    )
)
@quick
def test_odometry_comes_back(fields: Any) -> None:
    sent = Odometry(*fields)
    if math.isnan(sent.velocity[0]):
        sent = sent._replace(velocity_std=NAN)
    # a quaternion that is half a turn away may come back with the other sign
    got = odometry_record(over_the_wire(odometry_message(*fields)))
    got = got._replace(quat_wxyz=same_side(got.quat_wxyz, sent.quat_wxyz))
    assert_close(got, sent)


def test_the_covariance_of_odometry_is_diagonal_and_in_its_place() -> None:
    message = odometry_message(1, (1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0), NO_VECTOR, NO_VECTOR, 0.1, 0.2, 0.3)
    triangle = np.zeros((6, 6))
    triangle[np.triu_indices(6)] = message.pose_covariance
    assert np.array_equal(triangle, np.diag(triangle.diagonal()))
    assert triangle.diagonal() == pytest.approx([0.01] * 3 + [0.04] * 3)
    assert math.isnan(message.velocity_covariance[0])
    assert all(math.isnan(v) for v in (message.vx, message.vy, message.vz, message.rollspeed))


@given(
    st.tuples(
        *(times, st.integers(0, 6), small_vectors, small_vectors),
        *(st.floats(0.0, 600.0), st.floats(0.0, 600.0), st.integers(0, 255)),
    )
)
@quick
def test_hil_gps_comes_back_on_its_lattice(fields: Any) -> None:
    sent = HilGps(*fields)
    got = read_hil_gps(over_the_wire(hil_gps_message(*fields, home=HOME)), HOME)
    assert_close(got, sent, absolute=0.5 * 0.01 + 0.1 * DEG_E7_M + 1e-9)  # half of the coarsest step


@given(
    st.tuples(
        *(times, quats, small_vectors, small_vectors, small_vectors), *(st.floats(0.0, 600.0), small_vectors)
    )
)
@quick
def test_the_true_state_comes_back_on_its_lattice(fields: Any) -> None:
    sent = HilStateQuaternion(*fields)
    message = over_the_wire(hil_state_quaternion_message(*fields, home=HOME))
    got = read_hil_state_quaternion(message, HOME)
    got = got._replace(quat_wxyz=same_side(got.quat_wxyz, sent.quat_wxyz))
    assert_close(got, sent, absolute=0.5 * DEG_E7_M + 1e-9)


@given(quats, vectors, vectors)
@quick
def test_axes_and_attitude_against_matrices(quat: Any, position: Any, rate: Any) -> None:
    message = odometry_message(0, position, quat, position, rate, 1.0, 1.0, 1.0)
    assert (message.x, message.y, message.z) == tuple(NED_ENU @ position)
    assert (message.vx, message.vy, message.vz) == tuple(NED_ENU @ position)
    assert (message.rollspeed, message.pitchspeed, message.yawspeed) == tuple(FRD_FLU @ rate)
    w, x, y, z = quat
    R = NED_ENU @ Rotation.from_quat([x, y, z, w]).as_matrix() @ FRD_FLU
    w, x, y, z = message.q
    # products of a few rounded numbers of size 1
    assert Rotation.from_quat([x, y, z, w]).as_matrix() == pytest.approx(R, abs=1e-14)


@given(quats)
@quick
def test_euler_angles_against_scipy(quat: Any) -> None:
    w, x, y, z = quat
    R = NED_ENU @ Rotation.from_quat([x, y, z, w]).as_matrix() @ FRD_FLU
    roll, pitch, yaw = euler_ned_frd(quat)
    # ill conditioned near a pitch of 90 degrees: the rotation is compared, not the angles
    assert Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix() == pytest.approx(R, abs=1e-7)


@pytest.mark.parametrize(
    ("yaw_enu_deg", "heading_deg"), [(90.0, 0.0), (0.0, 90.0), (-90.0, 180.0), (180.0, 270.0), (45.0, 45.0)]
)
def test_headings_a_pilot_would_name(yaw_enu_deg: float, heading_deg: float) -> None:
    half = math.radians(yaw_enu_deg) / 2.0
    assert heading_cdeg((math.cos(half), 0.0, 0.0, math.sin(half))) == heading_deg * 100.0


def test_a_vehicle_that_pitches_down_and_flies_east() -> None:
    # nose east, 10 degrees nose down: FLU pitch is positive nose down
    half = math.radians(10.0) / 2.0
    quat = (math.cos(half), 0.0, math.sin(half), 0.0)
    told = named(attitude(5_000, quat, (0.1, 0.2, 0.3)))
    assert (told.roll, told.pitch, told.yaw) == pytest.approx(
        (0.0, math.radians(-10.0), math.radians(90.0)), abs=1e-15
    )
    assert (told.rollspeed, told.pitchspeed, told.yawspeed) == (0.1, -0.2, -0.3)
    assert told.time_boot_ms == 5
    local = named(local_position_ned(0, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)))
    assert (local.x, local.y, local.z, local.vx, local.vy, local.vz) == (2.0, 1.0, -3.0, 5.0, 4.0, -6.0)
    hud = named(vfr_hud((3.0, 0.0, 4.0), quat, 7.0, 0.55, Home(0.0, 0.0, 100.0)))
    assert (hud.groundspeed, hud.airspeed, hud.climb, hud.alt, hud.heading, hud.throttle) == (
        3.0, 5.0, 4.0, 107.0, 90, 55,
    )  # fmt: skip
    place = named(global_position_int_message(0, (0.0, 0.0, 3.0), (1.0, 2.0, 3.0), quat, HOME))
    assert (place.relative_alt, place.vx, place.vy, place.vz, place.hdg) == (3000, 200, 100, -300, 9000)


@given(quats, vectors, st.integers(0, 2**40))
@quick
def test_telemetry_comes_back(quat: Any, vector: Any, now_us: int) -> None:
    told = over_the_wire(attitude_quaternion(now_us, quat, vector))
    got = quat_enu_flu_from_ned_frd((told.q1, told.q2, told.q3, told.q4))
    assert abs(np.dot(got, quat)) == pytest.approx(1.0, abs=FLOAT32)
    rates = (told.rollspeed, told.pitchspeed, told.yawspeed)
    assert flu_from_frd(rates) == pytest.approx(vector, rel=FLOAT32)
    assert told.time_boot_ms == now_us // 1000 % 2**32
    local = over_the_wire(local_position_ned(now_us, vector, vector))
    position, velocity = (local.x, local.y, local.z), (local.vx, local.vy, local.vz)
    assert enu_from_ned(position) == enu_from_ned(velocity) == pytest.approx(vector, rel=FLOAT32)


WILD = (1e30, -1e30, math.inf)
WILD_NAN = (NAN, NAN, NAN)
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
SKEW = (NAN, NAN, NAN, NAN)


@pytest.mark.parametrize(("v", "quat"), [(WILD, UPRIGHT), (WILD_NAN, UPRIGHT), (WILD, SKEW)])
def test_no_state_however_wild_raises(v: Any, quat: Any) -> None:
    messages = [
        hil_sensor_message(0, v, v, v, v[0], v[0], v[0], 0),
        odometry_message(0, v, quat, v, v, v[0], v[0], v[0]),
        load_sensor_message(0, v, v, v, v[0], v[0], v[0]),
        hil_gps_message(0, 3, v, v, v[0], v[0], 10, home=HOME),
        hil_state_quaternion_message(0, quat, v, v, v, v[0], v, home=HOME),
        hil_actuator_controls_message(0, (v[0],) * 14, True, True),
        load_state(0, 0, v, v, v, v, v[0], v[0], True, 10**9),
        load_setpoint(0, 0, 0, 10**9, v, v, v, v, v[0], v[0], v, v),
        cascade_errors(0, 0, v, v, v, v, v, v, v[0], v[0], v[0], v),
        rotor_state(0, 0, (v[0],) * 14, v[0], v[0], 0),
        wind_state_message(0, v, v),
        attitude(0, quat, v),
        attitude_quaternion(0, quat, v),
        local_position_ned(0, v, v),
        global_position_int_message(0, v, v, quat, HOME),
        gps_raw_int_message(0, 3, v, v, v[0], v[0], 10, HOME),
        altitude_above_home(0, v[0], HOME),
        vfr_hud(v, quat, v[0], v[0], HOME),
        home_position_message(0, v, HOME),
        gps_global_origin_message(0, HOME),
        position_target_local_ned(0, v, v, v),
        attitude_target(0, quat, v, v[0]),
        winch_status_message(0, v[0], v[0]),
    ]
    for message in messages:
        over_the_wire(message)
    assert read_hil_gps(over_the_wire(messages[3]), HOME).satellites == 10
    odometry_record(over_the_wire(messages[1]))


@pytest.mark.parametrize(
    ("value", "expected"),
    [(0.4, 0), (0.6, 1), (-0.6, -1), (1e9, 32767), (-1e9, -32768), (math.inf, 32767), (NAN, 0)],
)
def test_integers_round_and_saturate(value: float, expected: int) -> None:
    assert int16(value) == expected
    struct.pack("<h", int16(value))


HOMES = [
    HOME,
    Home(0.0, 0.0, 0.0),
    Home(-35.363261, 149.16523, 584.0),
    Home(-16.8, 179.99999, 5.0),
    Home(70.0, -180.0, -3.0),
]


@pytest.mark.parametrize("home", HOMES)
@given(
    st.integers(-10_000_000, 10_000_000), st.integers(-10_000_000, 10_000_000), st.integers(-(10**6), 10**6)
)
@quick
def test_geodetic_coordinates_are_restored_exactly(home: Home, north: int, east: int, up: int) -> None:
    latitude, longitude, altitude = geodetic_from_enu((0.0, 0.0, 0.0), home)
    turn = 3_600_000_000
    longitude = (longitude + east + turn // 2) % turn - turn // 2
    latitude, altitude = latitude + north, altitude + up
    position = enu_from_geodetic(latitude, longitude, altitude, home)
    assert geodetic_from_enu(position, home) == (latitude, longitude, altitude)


@pytest.mark.parametrize("home", HOMES)
@given(st.tuples(numbers, numbers, numbers))
@quick
def test_positions_are_restored_to_half_a_step(home: Home, position: Any) -> None:
    back = enu_from_geodetic(*geodetic_from_enu(position, home), home)
    # half a step, and the rounding of degrees in float64 (1e-14 of 180 degrees is 0.2 micrometres)
    assert back[:2] == pytest.approx(position[:2], abs=0.5 * DEG_E7_M + 1e-6)
    assert back[2] == pytest.approx(position[2], abs=0.5e-3 + 1e-9)


def test_north_and_east_are_where_a_map_has_them() -> None:
    latitude, longitude, _ = geodetic_from_enu((1000.0, 2000.0, 0.0), HOME)
    # 1 degree of latitude is 111.3 km, of longitude that times the cosine of the latitude
    assert latitude * 1e-7 - HOME.latitude_deg == pytest.approx(2.0 / 111.3, rel=1e-3)
    assert longitude * 1e-7 - HOME.longitude_deg == pytest.approx(
        1.0 / 111.3 / math.cos(math.radians(HOME.latitude_deg)), rel=1e-3
    )


def test_home_from_text() -> None:
    assert home_from_text("47.4, 8.5,488") == Home(47.4, 8.5, 488.0)


@pytest.mark.parametrize("text", ["", "1,2", "1,2,3,4", "a,2,3", "91,0,0", "0,181,0", "nan,0,0", "0,0,1e9"])
def test_a_home_that_is_nowhere_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="home"):
        home_from_text(text)


V = (1.0, 2.0, 3.0)
NED = [2.0, 1.0, -3.0]
FRD = [1.0, -2.0, -3.0]
CENTI_NED = [200, 100, -300]
ON_THE_WIRE: list[tuple[Any, dict[str, list[Any]]]] = [
    (
        hil_sensor_message(0, V, V, V, 101325.0, 0.0, 0.0, 0),
        {"xacc yacc zacc": FRD, "xgyro ygyro zgyro": FRD, "xmag ymag zmag": FRD, "abs_pressure": [1013.25]},
    ),
    (
        odometry_message(0, V, UPRIGHT, V, V, 1.0, 1.0, 1.0),
        {
            "x y z": NED,
            "vx vy vz": NED,
            "rollspeed pitchspeed yawspeed": FRD,
            "frame_id child_frame_id": [1, 1],
        },
    ),
    (
        load_sensor_message(0, V, V, V, 1.0, 1.0, 1.0),
        {"x y z": NED, "vx vy vz": NED, "dx dy dz": FRD, "fields": [7]},
    ),
    (
        hil_gps_message(0, 3, V, V, 1.0, 2.0, 9, home=HOME),
        {"vn ve vd": CENTI_NED, "eph epv": [100, 200], "alt": [3000], "cog": [2657]},
    ),
    (
        hil_state_quaternion_message(0, UPRIGHT, V, V, V, 1.0, (0.0, 0.0, 9.80665), home=HOME),
        {"rollspeed pitchspeed yawspeed": FRD, "vx vy vz": CENTI_NED, "xacc yacc zacc": [0, 0, -1000]},
    ),
    (
        load_state(0, 1, V, V, V, V, 4.0, 5.0, True, 6),
        {
            "x y z": NED,
            "vx vy vz": NED,
            "qx qy qz": NED,
            "qx_dot qy_dot qz_dot": NED,
            "distance tension slack_events taut source": [4.0, 5.0, 6, 1, 1],
        },
    ),
    (
        load_setpoint(0, 5, 3, 7, V, V, V, V, 1.0, 2.0, V, V),
        {
            "x y z": NED,
            "vx vy vz": NED,
            "ax ay az": NED,
            "qx qy qz": NED,
            "asked_x asked_y asked_z": NED,
            "asked_vx asked_vy asked_vz": NED,
            "elapsed duration seq phase control_mode": [1.0, 2.0, 7, 5, 3],
        },
    ),
    (
        cascade_errors(0, 3, V, V, V, V, V, V, 0.1, 0.2, 4.0, V),
        {
            **{name: [tuple(NED)] for name in ("e_x", "e_v", "e_q", "e_q_dot")},
            **{name: [tuple(FRD)] for name in ("e_r", "e_omega", "moment")},
            "psi_r psi_q thrust control_mode": [0.1, 0.2, 4.0, 3],
        },
    ),
    (
        rotor_state(0, 2, padded_forces((1.0, 2.0, 3.0, 4.0)), 0.0, math.inf, 9),
        {"force": [(1.0, 2.0, 3.0, 4.0)], "force_min force_max saturated source": [0.0, math.inf, 9, 2]},
    ),
    (wind_state_message(0, V, V), {"wind": [tuple(NED)], "gust": [tuple(NED)]}),
    (
        position_target_local_ned(0, V, V, V),
        {"x y z": NED, "vx vy vz": NED, "afx afy afz": NED, "type_mask": [0xC00]},
    ),
    (
        attitude_target(0, UPRIGHT, V, 0.5),
        {"body_roll_rate body_pitch_rate body_yaw_rate thrust": [*FRD, 0.5]},
    ),
]


@pytest.mark.parametrize(("message", "expected"), ON_THE_WIRE, ids=name_of)
def test_every_field_has_its_axis_and_its_sign(message: Any, expected: dict[str, list[Any]]) -> None:
    """Written out, because a wrong axis in a builder and in its reader would cancel."""
    for names, values in expected.items():
        assert [getattr(named(message), name) for name in names.split()] == values, names


def test_full_scale_of_the_actuators() -> None:
    message = hil_actuator_controls_message(4000, padded_forces((0.0, 0.98, 1.96, 3.92, 0.49)), True, True)
    assert message.controls[:7] == [0.0, 0.5, 1.0, 2.0, 0.0, 0.0, 0.25]
    assert len(message.controls) == 16
    assert (message.time_usec, message.mode & 128, message.flags & 1) == (4000, 128, 1)
    assert hil_actuator_controls_message(0, NO_FORCES, False, False).mode & 128 == 0
