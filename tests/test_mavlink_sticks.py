"""Sticks over MAVLink: axes and neutral points per persona, overrides, who may steer, interlock and time-out."""

from __future__ import annotations

import math

import pytest

from planner.mobility import STOP
from rover_sim.autopilot.modes import Mode
from rover_sim.autopilot.sticks import Sticks
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.persona import ARDUPILOT, GENERIC, PERSONAS, PX4, Persona
from tests.mavlink_rig import FOOTPRINT, Station, Yard

LEAVE, LET_GO, LET_GO_HIGH = 65535, 0, 65534
TICK_S = 1.0 / 48.0


def sticks(thrust: int, steer: int = 0, twist: int = 0, *, target: int = 1) -> Message:
    return mavlink.MAVLink_manual_control_message(target, 0, steer, thrust, twist, 0)


def override(**pulses: int) -> Message:
    first = [pulses.get(f"c{channel}", LEAVE) for channel in range(1, 9)]
    return mavlink.MAVLink_rc_channels_override_message(1, 1, *first, *(pulses.get(f"c{n}", 0) for n in range(9, 19)))


def neutral(persona: Persona) -> int:
    return persona.steering.neutral_thrust


def driver(persona: Persona, system: int = 255) -> tuple[Yard, Station]:
    """An armed rover in Manual whose sticks are centred."""
    station = Station(system)
    yard = Yard(station, persona=persona)
    assert yard.autopilot.arm() is None
    assert yard.autopilot.set_mode(Mode.MANUAL) is None
    say(yard, station, sticks(neutral(persona)))
    return yard, station


def say(yard: Yard, station: Station, message: Message, seconds: float = 0.0) -> None:
    """Send the message now and at 20 Hz until the time has passed."""
    end = yard.time_s + seconds
    while True:
        station.send(message, yard.time_s)
        yard.step(0.05)
        if yard.time_s >= end - 1e-9:
            return


def texts(station: Station) -> list[str]:
    return [message.text for message in station.take("STATUSTEXT")]


def timeout_s(yard: Yard, persona: Persona) -> float:
    return yard.autopilot.parameters[persona.steering.stick_time]


@pytest.mark.parametrize("persona", PERSONAS.values())
def test_full_ahead_is_the_rovers_own_top_speed(persona: Persona) -> None:
    yard, station = driver(persona)
    say(yard, station, sticks(1000), 4.0)
    assert yard.autopilot.motion.linear_m_s == pytest.approx(FOOTPRINT.max_speed_m_s)
    assert yard.autopilot.motion.yaw_rate_rad_s == 0.0


@pytest.mark.parametrize(("persona", "astern"), [(ARDUPILOT, -1000), (PX4, 0), (GENERIC, -1000)])
def test_astern_and_to_the_right(persona: Persona, astern: int) -> None:
    yard, station = driver(persona)
    say(yard, station, sticks(astern), 4.0)
    assert yard.autopilot.motion.linear_m_s == pytest.approx(-FOOTPRINT.max_speed_m_s)
    say(yard, station, sticks(neutral(persona), 1000), 4.0)
    assert yard.autopilot.motion.yaw_rate_rad_s == pytest.approx(-FOOTPRINT.max_yaw_rate_rad_s)  # clockwise


def test_half_deflection_counts_from_the_edge_of_the_dead_band() -> None:
    yard, station = driver(ARDUPILOT)
    say(yard, station, sticks(525), 4.0)
    assert yard.autopilot.motion.linear_m_s == pytest.approx(0.5 * FOOTPRINT.max_speed_m_s)
    say(yard, station, sticks(50), 0.1)
    assert yard.autopilot.motion == STOP


@pytest.mark.parametrize(("persona", "turns"), [(ARDUPILOT, False), (PX4, False), (GENERIC, True)])
def test_twist_steers_where_nothing_is_agreed(persona: Persona, turns: bool) -> None:
    yard, station = driver(persona)
    say(yard, station, sticks(neutral(persona), 0, -1000), 1.0)
    assert (yard.autopilot.motion.yaw_rate_rad_s > 0.0) is turns


def test_a_thrust_below_px4s_range_is_no_thrust() -> None:
    """QGroundControl's virtual pad sends it for rovers: PX4 ignores the axis."""
    yard, station = driver(PX4)
    say(yard, station, sticks(-800), 0.3)
    assert yard.autopilot.motion == STOP


def test_axes_are_let_go_by_int16_max() -> None:
    yard, station = driver(ARDUPILOT)
    say(yard, station, sticks(800, 500), 0.5)
    say(yard, station, sticks(32767, 500), 0.1)
    assert yard.autopilot.pilot.sticks == Sticks(0.0, 0.5)
    say(yard, station, sticks(32767, 32767), 0.1)
    assert not yard.autopilot.pilot.sticks
    assert yard.autopilot.motion == STOP
    assert texts(station)[-1] != "Sticks lost, hold"  # let go, not lost


@pytest.mark.parametrize("persona", PERSONAS.values())
def test_overrides_steer_through_the_calibrated_pulses(persona: Persona) -> None:
    yard, station = driver(persona)
    say(yard, station, override(c1=1500, c3=1500))
    say(yard, station, override(c1=1500, c3=2000), 4.0)
    assert yard.autopilot.motion.linear_m_s == pytest.approx(FOOTPRINT.max_speed_m_s)
    say(yard, station, override(c1=1000, c3=1500), 4.0)
    assert yard.autopilot.motion.yaw_rate_rad_s == pytest.approx(FOOTPRINT.max_yaw_rate_rad_s)
    assert yard.autopilot.motion.linear_m_s == 0.0


def test_overrides_leave_and_release_channels() -> None:
    yard, station = driver(ARDUPILOT)
    say(yard, station, override(c3=1500, c9=1700, c18=1234))
    say(yard, station, override(c3=1800), 0.1)
    assert yard.vehicle._context.channels == {1: 1500, 3: 1800, 9: 1700, 18: 1234}
    request = mavlink.MAVLink_command_long_message(1, 1, 512, 0, 65, 0, 0, 0, 0, 0, 0)
    (shown,) = yard.ask(station, request, "RC_CHANNELS")
    assert (shown.chancount, shown.chan3_raw, shown.chan9_raw, shown.chan18_raw) == (18, 1800, 1700, 1234)
    assert shown.chan2_raw == 65535
    say(yard, station, override(c9=65535, c18=LET_GO_HIGH))
    assert yard.vehicle._context.channels == {1: 1500, 3: 1800, 9: 1700}
    say(yard, station, override(c3=LET_GO))
    assert yard.autopilot.motion == STOP
    say(yard, station, override(c1=LET_GO))
    assert yard.autopilot.pilot.sticks is None
    assert yard.ask(station, request, "RC_CHANNELS") == []  # nothing is held


def test_a_channel_that_is_not_refreshed_is_lost_though_others_are() -> None:
    yard, station = driver(GENERIC)
    say(yard, station, override(c3=1500))
    say(yard, station, override(c1=1500, c3=2000), 0.5)
    assert yard.autopilot.motion.linear_m_s > 0.2
    say(yard, station, override(c1=1500), timeout_s(yard, GENERIC) + 0.1)
    assert yard.autopilot.motion == STOP


def test_pulses_that_are_none_are_ignored() -> None:
    yard, station = driver(ARDUPILOT)
    for pulse in (1, 799, 2201, 65000):
        say(yard, station, override(c3=pulse))
    assert yard.autopilot.motion == STOP


@pytest.mark.parametrize(("persona", "reverse_rest"), [(ARDUPILOT, 500), (GENERIC, 500), (PX4, 0)])
def test_arming_is_refused_with_a_stick_off_centre(persona: Persona, reverse_rest: int) -> None:
    """A self-centring stick rests at 500 in QGroundControl, its virtual pad at 0: each is off centre somewhere."""
    station = Station()
    yard = Yard(station, persona=persona)
    say(yard, station, sticks(reverse_rest))
    arm = mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    (answer,) = yard.ask(station, arm, "COMMAND_ACK")
    assert (answer.result, yard.autopilot.armed) == (mavlink.MAV_RESULT_FAILED, False)
    assert any(text.startswith("PreArm: sticks not centred: throttle") for text in texts(station))
    request = mavlink.MAVLink_command_long_message(1, 1, 512, 0, 1, 0, 0, 0, 0, 0, 0)
    (health,) = yard.ask(station, request, "SYS_STATUS")
    assert not health.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK
    say(yard, station, sticks(neutral(persona)))
    (answer,) = yard.ask(station, arm, "COMMAND_ACK")
    assert (answer.result, yard.autopilot.armed) == (mavlink.MAV_RESULT_ACCEPTED, True)


def test_deflected_sticks_do_not_keep_it_from_driving_by_itself() -> None:
    yard, station = driver(ARDUPILOT)
    say(yard, station, sticks(500), 0.2)
    assert yard.autopilot.goto((5.0, 0.0, 0.0)) is None


def test_sticks_are_ignored_until_centred_after_a_change_to_manual() -> None:
    yard, station = driver(ARDUPILOT)
    yard.autopilot.set_mode(Mode.HOLD)
    say(yard, station, sticks(700), 0.2)
    yard.autopilot.set_mode(Mode.MANUAL)
    say(yard, station, sticks(700), 0.5)
    assert yard.autopilot.motion == STOP
    assert "Sticks ignored until they are centred" in texts(station)
    say(yard, station, sticks(0))
    say(yard, station, sticks(700), 0.5)
    assert yard.autopilot.motion.linear_m_s > 0.1


def test_forced_arming_does_not_set_it_off() -> None:
    yard, station = driver(ARDUPILOT)
    yard.autopilot.disarm()
    say(yard, station, sticks(900))
    assert yard.autopilot.arm(force=True) is None
    say(yard, station, sticks(900), 0.5)
    assert yard.autopilot.motion == STOP


@pytest.mark.parametrize(
    ("persona", "after", "mode"),
    [(ARDUPILOT, 3.0, Mode.HOLD), (PX4, 0.5, Mode.RETURN), (GENERIC, 0.5, Mode.HOLD)],
)
def test_lost_sticks_stop_the_wheels_in_time_and_say_so(persona: Persona, after: float, mode: Mode) -> None:
    yard, station = driver(persona)
    say(yard, station, sticks(1000), 2.0)
    last_s = yard.time_s
    station.send(sticks(1000), last_s)
    while yard.autopilot.mode is Mode.MANUAL:
        moving = yard.autopilot.motion != STOP
        yard.step()
        assert yard.time_s < last_s + after + 0.1
    assert moving
    assert yard.autopilot.motion == STOP
    assert yard.rover.wheels == (0.0,) * 4
    # The step that stopped the wheels is a tick back.
    assert after <= yard.time_s - last_s <= after + 0.05
    assert yard.autopilot.mode is mode
    yard.step(0.1)
    assert f"Sticks lost, {mode.name.lower()}" in texts(station)
    assert station.take("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_CRITICAL


@pytest.mark.parametrize(
    ("persona", "name", "value", "mode"),
    [
        (ARDUPILOT, "FS_THR_ENABLE", 0, Mode.MANUAL),
        (GENERIC, "FS_STICK_ACT", 0, Mode.MANUAL),
        (PX4, "NAV_RCL_ACT", 1, Mode.HOLD),
    ],
)
def test_what_happens_after_a_loss_is_a_parameter(persona: Persona, name: str, value: int, mode: Mode) -> None:
    yard, station = driver(persona)
    assert yard.autopilot.parameters.set(name, value)
    assert yard.autopilot.parameters.set(persona.steering.stick_time, 0.3)
    say(yard, station, sticks(1000), 1.0)
    yard.step(0.35)
    assert yard.autopilot.motion == STOP
    assert yard.autopilot.mode is mode
    assert any(text.startswith("Sticks lost, ") for text in texts(station))
    if mode is Mode.MANUAL:  # sticks that come back must be centred first
        say(yard, station, sticks(1000), 0.3)
        assert yard.autopilot.motion == STOP
        say(yard, station, sticks(neutral(persona)))
        say(yard, station, sticks(1000), 0.3)
        assert yard.autopilot.motion.linear_m_s > 0.0


def test_a_return_that_is_not_possible_becomes_a_hold() -> None:
    yard, station = driver(PX4)
    say(yard, station, sticks(1000), 1.0)
    yard.rover.position_sd_m = 50.0
    yard.step(0.6)
    assert yard.autopilot.mode is Mode.HOLD


def test_lost_sticks_matter_in_manual_only() -> None:
    yard, station = driver(ARDUPILOT)
    yard.autopilot.goto((9.0, 0.0, 0.0))
    yard.step(4.0)
    assert yard.autopilot.mode is Mode.GUIDED
    assert not any("lost" in text for text in texts(station))


@pytest.mark.parametrize(
    ("persona", "allowed", "system", "steers"),
    [
        (ARDUPILOT, None, 255, True),
        (ARDUPILOT, None, 245, False),  # MAVSDK
        (ARDUPILOT, 245, 245, True),
        (ARDUPILOT, 245, 255, False),
        (ARDUPILOT, 0, 245, True),
        (PX4, None, 245, True),
        (GENERIC, None, 245, True),
        (GENERIC, 7, 245, False),
    ],
)
def test_which_system_may_steer(persona: Persona, allowed: int | None, system: int, steers: bool) -> None:
    station = Station(system)
    yard = Yard(station, persona=persona)
    if allowed is not None:
        assert yard.autopilot.parameters.set("MAV_GCS_SYSID", allowed)
    yard.autopilot.arm()
    yard.autopilot.set_mode(Mode.MANUAL)
    for kind in (sticks(neutral(persona)), sticks(1000)):
        say(yard, station, kind, 0.3)
    assert (yard.autopilot.motion.linear_m_s > 0.0) is steers


def test_one_steers_at_a_time_and_the_next_one_once_the_first_is_lost() -> None:
    """Two programs of the same system number, as QGroundControl and MAVProxy are."""
    first, second = Station(255, 190), Station(255, 230)
    yard = Yard(first, second)
    yard.autopilot.arm()
    yard.autopilot.set_mode(Mode.MANUAL)
    yard.autopilot.parameters.set("FS_THR_ENABLE", 0)
    for _ in range(20):
        second.send(sticks(-1000), yard.time_s + 0.01)
        say(yard, first, sticks(0))
    say(yard, first, sticks(800), 0.5)
    second.send(sticks(-1000), yard.time_s)
    yard.step()
    assert yard.autopilot.motion.linear_m_s > 0.0
    yard.step(3.1)
    assert yard.autopilot.motion == STOP
    say(yard, second, sticks(0))
    say(yard, second, sticks(-1000), 0.5)
    assert yard.autopilot.motion.linear_m_s < 0.0


def test_a_frame_that_was_overtaken_is_not_taken() -> None:
    yard, station = driver(ARDUPILOT)
    say(yard, station, sticks(900), 0.5)
    late = station.packer.pack(sticks(900))
    say(yard, station, sticks(0))
    station.send_bytes(late, yard.time_s)
    yard.step(0.1)
    assert yard.autopilot.motion == STOP


def test_sequence_numbers_wrap_and_may_begin_anew_after_a_pause() -> None:
    yard, station = driver(ARDUPILOT)
    for number in (100, 200, 30, 90):
        station.packer._mav.seq = number
        say(yard, station, sticks(600))
        assert yard.autopilot.pilot.sticks is not None
        assert yard.autopilot.pilot.sticks.throttle == 0.6
        station.packer._mav.seq = number + 1
        say(yard, station, sticks(0))
    yard.step(0.6)
    station.packer._mav.seq = 20
    say(yard, station, sticks(600))
    assert yard.autopilot.pilot.sticks is not None
    assert yard.autopilot.pilot.sticks.throttle == 0.6


@pytest.mark.parametrize("target", [0, 1, 7])
def test_sticks_for_another_vehicle_are_not_ours(target: int) -> None:
    yard, station = driver(ARDUPILOT)
    say(yard, station, sticks(1000, target=target), 0.3)
    assert (yard.autopilot.motion.linear_m_s > 0.0) is (target != 7)


def test_manual_drives_without_a_pose() -> None:
    yard, station = driver(ARDUPILOT)
    yard.rover.position_sd_m = math.nan
    say(yard, station, sticks(1000), 1.0)
    assert yard.autopilot.motion.linear_m_s > 0.2
