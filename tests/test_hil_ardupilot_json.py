from __future__ import annotations

import json
import struct
from dataclasses import replace
from math import cos, inf, nan, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_sim.hil.ardupilot_json import (
    ServoPacket,
    parse_servos,
    roll_pitch_yaw,
    share,
    side_shares,
    state_message,
)
from rover_sim.hil.states import NedState

AT_REST = NedState(
    time_s=0.005,
    position_m=(0.0, 0.0, 0.0),
    velocity_m_s=(0.0, 0.0, 0.0),
    quaternion=(1.0, 0.0, 0.0, 0.0),
    rate_rad_s=(0.0, 0.0, 0.0),
    specific_force_m_s2=(0.0, 0.0, -9.80665),
)
# By hand: magic 18458 = 0x481a, 1200 Hz = 0x04b0, count 0, four times 1500 = 0x05dc, twelve times 1000 = 0x03e8.
FIRST_PACKET = bytes.fromhex("1a48 b004 00000000" + "dc05" * 4 + "e803" * 12)


def test_the_first_packet_of_the_autopilot_is_read() -> None:
    assert len(FIRST_PACKET) == 40
    assert parse_servos(FIRST_PACKET) == ServoPacket(1200, 0, (1500,) * 4 + (1000,) * 12)


def test_a_packet_of_32_channels_is_read() -> None:
    data = bytes.fromhex("8173 f000 07000000" + "2b07" * 32)  # 29569, 240 Hz, count 7, 1835 us
    assert len(data) == 72
    assert parse_servos(data) == ServoPacket(240, 7, (1835,) * 32)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\x1a",
        FIRST_PACKET[:-1],
        FIRST_PACKET + b"\0",
        FIRST_PACKET + b"\0" * 32,  # 72 bytes with the magic of 40
        b"\x81\x73" + FIRST_PACKET[2:],  # 40 bytes with the magic of 72
        b"\x1b" + FIRST_PACKET[1:],
        b'\n{"timestamp":0.1}\n' + b" " * 21,  # 40 bytes of another physics
    ],
)
def test_what_is_no_packet_is_none(data: bytes) -> None:
    assert parse_servos(data) is None


@given(st.binary(max_size=100))
def test_no_datagram_breaks_the_reader(data: bytes) -> None:
    packet = parse_servos(data)
    assert packet is None or len(data) in (40, 72)


@pytest.mark.parametrize(
    ("pwm_us", "expected"),
    [(1500, 0.0), (2000, 1.0), (1000, -1.0), (1750, 0.5), (1250, -0.5), (0, 0.0), (900, -1.0), (2200, 1.0)],
)
def test_a_pulse_asks_for_a_share_of_full_speed(pwm_us: int, expected: float) -> None:
    assert share(pwm_us) == expected


def test_left_is_servo_1_and_right_is_servo_3() -> None:
    pwm = [1000] * 16
    pwm[0], pwm[2] = 2000, 1250
    assert side_shares(ServoPacket(240, 1, tuple(pwm))) == (1.0, -0.5)


def test_outputs_that_are_not_driven_turn_no_wheel() -> None:
    assert side_shares(ServoPacket(240, 1, (0,) * 16)) == (0.0, 0.0)


def test_the_state_is_the_line_of_the_reference() -> None:
    """The example of ArduPilot's format, byte for byte."""
    assert state_message(0.005, AT_REST) == (
        b'\n{"timestamp":0.005,"imu":{"gyro":[0.0,0.0,0.0],"accel_body":[0.0,0.0,-9.80665]},'
        b'"position":[0.0,0.0,0.0],"attitude":[0.0,0.0,0.0],"velocity":[0.0,0.0,0.0]}\n'
    )


@pytest.mark.parametrize("bad", [nan, inf, -inf])
def test_what_is_not_finite_is_never_sent(bad: float) -> None:
    vector = (0.0, bad, 0.0)
    for state in (
        replace(AT_REST, position_m=vector),
        replace(AT_REST, velocity_m_s=vector),
        replace(AT_REST, rate_rad_s=vector),
        replace(AT_REST, specific_force_m_s2=vector),
        replace(AT_REST, quaternion=(bad, 0.0, 0.0, 0.0)),
    ):
        with pytest.raises(ValueError, match="JSON"):
            state_message(0.005, state)
    with pytest.raises(ValueError, match="JSON"):
        state_message(bad, AT_REST)


def test_a_turn_to_the_right_is_a_positive_yaw() -> None:
    half = pi / 4
    assert roll_pitch_yaw((cos(half), 0.0, 0.0, sin(half))) == pytest.approx((0.0, 0.0, pi / 2))


def test_a_raised_nose_is_a_positive_pitch() -> None:
    assert roll_pitch_yaw((cos(0.1), 0.0, sin(0.1), 0.0)) == pytest.approx((0.0, 0.2, 0.0))


def test_a_nose_straight_up_has_a_pitch() -> None:
    assert roll_pitch_yaw((cos(pi / 4), 0.0, sin(pi / 4), 0.0))[1] == pytest.approx(pi / 2)


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_the_attitude_is_the_rotation_of_the_quaternion(roll: float, pitch: float, yaw: float) -> None:
    """Against the product of three half-angle quaternions, yaw first."""
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    for angle, axis in ((yaw, 2), (pitch, 1), (roll, 0)):
        c, s = cos(angle / 2), sin(angle / 2)
        v = [s if index == axis else 0.0 for index in range(3)]
        w, x, y, z = (
            w * c - x * v[0] - y * v[1] - z * v[2],
            w * v[0] + x * c + y * v[2] - z * v[1],
            w * v[1] + y * c + z * v[0] - x * v[2],
            w * v[2] + z * c + x * v[1] - y * v[0],
        )
    assert np.allclose(roll_pitch_yaw((w, x, y, z)), (roll, pitch, yaw), atol=1e-6)


@given(st.floats(0.0, 1e6), st.tuples(*[st.floats(-1e6, 1e6)] * 3))
def test_any_state_is_one_line_that_reads_back(time_s: float, vector: tuple[float, float, float]) -> None:
    data = state_message(time_s, replace(AT_REST, position_m=vector, velocity_m_s=vector))
    assert data[:1] == data[-1:] == b"\n"
    assert data.count(b"\n") == 2
    assert b" " not in data
    read = json.loads(data)
    assert list(read) == ["timestamp", "imu", "position", "attitude", "velocity"]
    assert (read["timestamp"], tuple(read["position"])) == (time_s, vector)


def test_the_layout_is_packed() -> None:
    assert struct.calcsize("<HHI16H") == 40
    assert struct.calcsize("<HHI32H") == 72
