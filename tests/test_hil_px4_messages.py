"""PX4's HIL messages against values worked by hand from the fields' units."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_sim.hil import px4_messages
from rover_sim.hil.px4_messages import Controls, Fields, due
from rover_sim.mavlink.dialect import Message, Packer, Parser, mavlink
from rover_sim.mavlink.geodesy import GeoPoint
from rover_sim.sim.ned_state import NedState
from rover_sim.sim.sensed import FieldSample, FixType, GnssSample, ImuSample, PressureSample, Sensed

IMU = ImuSample(rate_rad_s=(0.1, 0.2, 0.3), specific_force_m_s2=(1.0, 2.0, -9.5))
PLACE = GeoPoint(47.397742, 8.545594, 488.25)
NOTHING = Sensed(0.0, IMU, None, None, None)


def over_the_wire(message: Message) -> Message:
    """As the other side decodes it, with the rounding of single floats."""
    (decoded,) = Parser().datagram(Packer(1, 200).pack(message))
    return decoded


def fix(velocity: tuple[float, float, float], kind: FixType = FixType.RTK_FIXED) -> GnssSample:
    return GnssSample(1.0, kind, 18, (0.0, 0.0, 0.0), velocity, 0.012, 0.02, 0.05)


def controls(values: list[float], mode: int, flags: int = 1) -> Controls:
    padded = [*values, *[0.0] * (16 - len(values))]
    return px4_messages.parse_controls(mavlink.MAVLink_hil_actuator_controls_message(8000, padded, mode, flags))


def test_a_step_without_news_flags_the_inertial_unit_only() -> None:
    message = over_the_wire(px4_messages.hil_sensor(4000, NOTHING))
    assert message.fields_updated == 0b111111
    assert (message.time_usec, message.id) == (4000, 0)
    assert (message.xacc, message.yacc, message.zacc) == (1.0, 2.0, -9.5)
    assert (message.xgyro, message.ygyro, message.zgyro) == pytest.approx((0.1, 0.2, 0.3))


def test_gauss_hectopascals_and_degrees() -> None:
    field, air = FieldSample((21.5, -0.8, 42.7)), PressureSample(95_523.0, 488.0, 11.8)
    message = over_the_wire(px4_messages.hil_sensor(4000, Sensed(0.0, IMU, field, air, None)))
    assert message.fields_updated == 0b111 | 0b111000 | 0b111000000 | 0b1101000000000
    assert (message.xmag, message.ymag, message.zmag) == pytest.approx((0.215, -0.008, 0.427))
    assert (message.abs_pressure, message.pressure_alt) == pytest.approx((955.23, 488.0))
    assert message.temperature == pytest.approx(11.8)
    assert not message.fields_updated & Fields.PRESSURE_DIFFERENCE


def test_a_fix_in_integers() -> None:
    message = over_the_wire(px4_messages.hil_gps(1_577_836_801_000_000, fix((0.3, -0.4, 0.02)), PLACE))
    assert (message.lat, message.lon, message.alt) == (473_977_420, 85_455_940, 488_250)
    assert (message.vel, message.vn, message.ve, message.vd) == (50, 30, -40, 2)
    assert (message.eph, message.epv, message.satellites_visible) == (1, 2, 18)
    assert message.fix_type == mavlink.GPS_FIX_TYPE_RTK_FIXED
    assert message.cog == 30687  # atan2(-0.4, 0.3) = -53.13 deg


def test_a_rover_at_rest_has_no_course() -> None:
    assert px4_messages.hil_gps(1, fix((0.01, 0.0, 0.0)), PLACE).cog == 65535


def test_a_course_just_west_of_north_is_no_whole_turn() -> None:
    assert px4_messages.hil_gps(1, fix((10.0, -0.00001, 0.0)), PLACE).cog == 0


def test_no_fix_tells_no_place() -> None:
    message = over_the_wire(px4_messages.hil_gps(1, fix((1.0, 0.0, 0.0), FixType.NONE), PLACE))
    assert (message.fix_type, message.lat, message.lon, message.satellites_visible) == (1, 0, 0, 0)
    assert (message.eph, message.epv, message.vel, message.cog) == (65535,) * 4


def test_the_truth_in_integers() -> None:
    half = math.sqrt(0.5)
    truth = NedState(0.0, (1.0, 2.0, 3.0), (0.5, -0.25, 0.1), (half, 0.0, 0.0, half), (0.1, 0.2, 0.3), (0, 0, -9.80665))
    message = over_the_wire(px4_messages.hil_state_quaternion(4000, truth, PLACE))
    assert message.attitude_quaternion == pytest.approx([half, 0.0, 0.0, half])
    assert (message.vx, message.vy, message.vz) == (50, -25, 10)
    assert (message.xacc, message.yacc, message.zacc) == (0, 0, -1000)
    assert (message.lat, message.lon, message.alt) == (473_977_420, 85_455_940, 488_250)
    assert message.true_airspeed == 57  # |(0.5, -0.25, 0.1)| = 0.568


def test_controls_of_an_armed_rover() -> None:
    told = controls([0.25, -0.5], 129)
    assert told == Controls(8000, (0.25, -0.5, *[0.0] * 14), armed=True, lockstep=True)
    assert told.side_shares == (-0.5, 0.25)  # Motor 1 is on the right


def test_a_disarmed_rover_has_no_shares() -> None:
    assert controls([0.25, -0.5], 1).side_shares == (0.0, 0.0)


def test_controls_that_are_no_shares_are_cut() -> None:
    assert controls([math.nan, 7.0, -math.inf], 129, flags=0).values[:3] == (0.0, 1.0, 0.0)
    assert not controls([0.0], 129, flags=0).lockstep


def test_the_interval_that_is_asked_for() -> None:
    command, wanted = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION
    zeros = (0.0,) * 5

    def asked(command: int, message: float, interval: float) -> int:
        return px4_messages.asked_interval(
            mavlink.MAVLink_command_long_message(0, 0, command, 0, message, interval, *zeros), 7
        )

    assert asked(command, wanted, 5000.0) == 5000
    assert asked(command, wanted, -1.0) == 0
    assert asked(command, wanted, math.nan) == 7
    assert asked(command, mavlink.MAVLINK_MSG_ID_HIL_GPS, 5000.0) == 7
    assert asked(mavlink.MAV_CMD_DO_SET_MODE, wanted, 5000.0) == 7


@given(st.integers(4000, 400_000), st.integers(0, 10**6))
def test_what_is_due_keeps_its_rate(interval_usec: int, start: int) -> None:
    steps = [4000 * (start + number) for number in range(1, 501)]
    count = sum(due(time_usec, interval_usec) for time_usec in steps)
    assert abs(count - 500 * 4000 / interval_usec) <= 1.0


def test_five_milliseconds_are_four_steps_of_five() -> None:
    assert [due(4000 * step, 5000) for step in range(1, 11)] == [False, True, True, True, True] * 2
    assert not any(due(4000 * step, 0) for step in range(1, 11))
