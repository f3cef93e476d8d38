"""Set points over MAVLink: frames and masks, per persona, and what happens when they stop coming."""

from __future__ import annotations

import math

import pytest

from planner.mobility import STOP
from rover_sim.autopilot.modes import Mode
from rover_sim.autopilot.targets import DriveAlong, DriveAt, Target
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.persona import ARDUPILOT, GENERIC, PERSONAS, PX4, Persona
from rover_sim.mavlink.target_service import Wish, motion
from tests.mavlink_rig import Station, Yard
from worlds.geometry import wrap_angle

NED, OFFSET, BODY, BODY_OFFSET, FRD = 1, 7, 8, 9, 12
VELOCITY_AND_RATE = 1479  # what MAVSDK sends for a body velocity
VELOCITY, VELOCITY_AND_YAW = 3527, 2503
PLACE = 3576
YAW, RATE = 2559, 1535


def local(
    frame: int,
    mask: int,
    place: tuple[float, float, float] = (0.0, 0.0, 0.0),
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    yaw: float = 0.0,
    rate: float = 0.0,
) -> Message:
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, frame, mask, *place, *velocity, 0.0, 0.0, 0.0, yaw, rate
    )


def guided(persona: Persona) -> tuple[Yard, Station]:
    station = Station(245)  # set points are taken from anyone
    yard = Yard(station, persona=persona)
    assert yard.autopilot.arm() is None
    assert yard.autopilot.set_mode(Mode.GUIDED) is None
    return yard, station


def say(yard: Yard, station: Station, message: Message, seconds: float) -> None:
    end = yard.time_s + seconds
    while yard.time_s < end:
        station.send(message, yard.time_s)
        yard.step(0.05)


def texts(station: Station) -> list[str]:
    return [message.text for message in station.take("STATUSTEXT")]


@pytest.mark.parametrize("persona", PERSONAS.values())
@pytest.mark.parametrize("frame", [BODY, BODY_OFFSET, FRD])
def test_body_velocity_and_yaw_rate(persona: Persona, frame: int) -> None:
    yard, station = guided(persona)
    say(yard, station, local(frame, VELOCITY_AND_RATE, velocity=(-0.4, 0.3, 0.0), rate=0.2), 2.0)
    assert yard.autopilot.motion.linear_m_s == pytest.approx(-0.4, abs=1e-6)  # nobody drives sideways
    assert yard.autopilot.motion.yaw_rate_rad_s == pytest.approx(-0.2, abs=1e-6)  # theirs is clockwise


@pytest.mark.parametrize("persona", PERSONAS.values())
def test_a_velocity_in_the_world_turns_the_rover_to_it(persona: Persona) -> None:
    yard, station = guided(persona)
    say(yard, station, local(NED, VELOCITY, velocity=(0.5, 0.0, 0.0)), 8.0)  # north; it begins facing east
    assert yard.rover.yaw_rad == pytest.approx(math.pi / 2, abs=0.03)
    assert yard.autopilot.motion.linear_m_s == pytest.approx(0.5, abs=0.01)
    assert yard.rover.y_m > 1.0


@pytest.mark.parametrize("persona", PERSONAS.values())
@pytest.mark.parametrize(
    ("frame", "place", "ends"),
    [
        (NED, (2.0, 1.0, 0.0), (1.0, 2.0)),
        (OFFSET, (1.0, -1.0, 0.0), (0.0, 2.0)),
        (BODY, (1.0, 0.5, 0.0), (2.0, 0.5)),
        (BODY_OFFSET, (2.0, math.nan, 0.0), None),
    ],
)
def test_places(
    persona: Persona, frame: int, place: tuple[float, float, float], ends: tuple[float, float] | None
) -> None:
    yard, station = guided(persona)
    yard.rover.x_m, yard.rover.y_m = 1.0, 1.0
    yard.step()
    relative = frame != NED
    say(yard, station, local(frame, PLACE, place=place), 0.05)  # once: an offset counts from where it is sent
    if not relative or ends is None:
        say(yard, station, local(frame, PLACE, place=place), 10.0)
    elif persona is ARDUPILOT:
        yard.step(10.0)
    else:
        return  # the place counts as lost before it is reached: see below
    where = (1.0, 1.0) if ends is None else ends
    assert math.hypot(yard.rover.x_m - where[0], yard.rover.y_m - where[1]) < 0.3
    assert ("Set point ignored: mask 3576, place or motion" in texts(station)) is (ends is None)


@pytest.mark.parametrize("persona", PERSONAS.values())
@pytest.mark.parametrize("frame", [0, 3, 5, 6, 10, 11])
def test_a_place_on_earth(persona: Persona, frame: int) -> None:
    yard, station = guided(persona)
    place = yard.frame.to_geo((1.5, 1.0, 0.0))
    message = mavlink.MAVLink_set_position_target_global_int_message(
        0, 1, 1, frame, PLACE, place.latitude_e7, place.longitude_e7, math.nan, *(math.nan,) * 8
    )
    say(yard, station, message, 8.0)
    assert math.hypot(yard.rover.x_m - 1.5, yard.rover.y_m - 1.0) < 0.3
    assert yard.autopilot.motion == STOP
    assert yard.autopilot.mode is Mode.GUIDED


@pytest.mark.parametrize(
    ("wish", "ardupilot", "others"),
    [
        # East-facing rover; north is +y, so a clockwise yaw of 0 is the world's 90 degrees.
        (Wish(False, (0.0, 0.0), None, 0.3), DriveAt(0.0, -0.3), None),
        (Wish(False, (0.0, 2.0), None, 0.3), DriveAt(2.0, -0.3), None),  # east: along its heading
        (Wish(False, (2.0, 0.0), None, 0.3), DriveAt(0.0, -0.3), None),  # north: across it
        (Wish(False, (1.0, 0.0), math.pi / 2, None), DriveAlong(0.0, 1.0), DriveAlong(math.pi / 2, 1.0)),
        (Wish(False, (-1.0, 0.0), 0.0, None), DriveAlong(math.pi / 2, -1.0), DriveAlong(-math.pi / 2, 1.0)),
        (Wish(True, (1.0, 0.0), math.pi / 2, None), DriveAlong(-math.pi / 2, 1.0), DriveAlong(0.0, 1.0)),
        (Wish(True, (-1.0, 0.0), None, None), DriveAlong(0.0, -1.0), None),
        (Wish(False, (0.0, 0.0), None, None), DriveAt(0.0, 0.0), None),
        (Wish(False, None, 0.0, None), DriveAlong(math.pi / 2, 0.0), None),
        (Wish(False, None, None, 0.5), DriveAt(0.0, -0.5), None),
    ],
)
def test_wishes(wish: Wish, ardupilot: Target, others: Target | None) -> None:
    def numbers(target: Target | None) -> tuple[float, ...]:
        if isinstance(target, DriveAt):
            return (target.speed_m_s, target.yaw_rate_rad_s)
        assert isinstance(target, DriveAlong)
        return (wrap_angle(target.heading_rad), target.speed_m_s)

    for by_yaw, wanted in ((True, ardupilot), (False, others or ardupilot)):
        found = motion(wish, 0.0, by_yaw=by_yaw)
        assert type(found) is type(wanted)
        assert numbers(found) == pytest.approx(numbers(wanted), abs=1e-9)
    assert motion(Wish(False, None, None, None), 0.0, by_yaw=True) is None


def test_yaw_alone_turns_on_the_spot_and_a_rate_alone_spins() -> None:
    yard, station = guided(ARDUPILOT)
    say(yard, station, local(NED, YAW, yaw=0.0), 8.0)
    assert yard.rover.yaw_rad == pytest.approx(math.pi / 2, abs=0.15)
    say(yard, station, local(NED, RATE, rate=-0.4), 1.0)
    assert yard.autopilot.motion.yaw_rate_rad_s == pytest.approx(0.4)
    assert yard.autopilot.motion.linear_m_s == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("persona", "after", "mode"), [(ARDUPILOT, 3.0, Mode.GUIDED), (PX4, 1.0, Mode.HOLD), (GENERIC, 1.0, Mode.HOLD)]
)
def test_set_points_that_stop_coming_stop_the_wheels_in_time(persona: Persona, after: float, mode: Mode) -> None:
    yard, station = guided(persona)
    message = local(BODY, VELOCITY_AND_RATE, velocity=(0.8, 0.0, 0.0))
    say(yard, station, message, 2.0)
    last_s = yard.time_s
    station.send(message, last_s)
    while yard.autopilot.motion != STOP:
        yard.step()
        assert yard.time_s < last_s + after + 0.1
    assert after <= yard.time_s - last_s <= after + 0.05
    assert yard.autopilot.mode is mode
    yard.step(0.1)
    assert f"Set points lost, {'stopped' if mode is Mode.GUIDED else 'hold'}" in texts(station)
    beat = station.take("HEARTBEAT")[-1]
    assert beat.system_status == (mavlink.MAV_STATE_ACTIVE if mode is Mode.GUIDED else mavlink.MAV_STATE_CRITICAL)


def test_a_place_is_kept_by_an_ardupilot_and_lost_by_a_px4() -> None:
    for persona, arrives in ((ARDUPILOT, True), (PX4, False)):
        yard, station = guided(persona)
        station.send(local(NED, PLACE, place=(0.0, 3.0, 0.0)), yard.time_s)
        yard.step(9.0)
        assert (abs(yard.rover.x_m - 3.0) < 0.3) is arrives


@pytest.mark.parametrize("persona", PERSONAS.values())
def test_set_points_count_in_guided_only(persona: Persona) -> None:
    yard, station = guided(persona)
    message = local(BODY, VELOCITY_AND_RATE, velocity=(0.8, 0.0, 0.0))
    for mode in (Mode.HOLD, Mode.MANUAL):
        yard.autopilot.set_mode(mode)
        say(yard, station, message, 0.3)
        assert yard.autopilot.motion == STOP
    yard.autopilot.set_mode(Mode.GUIDED)
    assert yard.autopilot.motion == STOP  # those of before are forgotten
    say(yard, station, message, 0.3)
    assert yard.autopilot.motion.linear_m_s > 0.0
    yard.autopilot.goto((-5.0, 0.0, 0.0))  # a place replaces a set point
    yard.step(2.0)
    assert yard.autopilot.has_guided_task


def test_a_px4_follows_set_points_only_once_it_is_in_offboard() -> None:
    """A place is driven to in Hold: set points do not count until somebody asks for Offboard."""
    yard, station = guided(PX4)
    yard.autopilot.goto((5.0, 0.0, 0.0))
    say(yard, station, local(BODY, VELOCITY_AND_RATE, velocity=(-0.3, 0.0, 0.0)), 2.0)
    assert yard.autopilot.has_guided_task
    offboard = mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1.0, 6.0, 0.0, 0, 0, 0, 0)
    yard.ask(station, offboard)
    assert station.take("HEARTBEAT")[-1].custom_mode == 0x60000
    say(yard, station, local(BODY, VELOCITY_AND_RATE, velocity=(-0.3, 0.0, 0.0)), 3.0)
    assert yard.autopilot.motion.linear_m_s == pytest.approx(-0.3)


def test_what_cannot_be_followed_is_told_not_too_often() -> None:
    yard, station = guided(ARDUPILOT)
    say(yard, station, local(3, VELOCITY_AND_RATE), 1.0)
    say(yard, station, local(NED, 0xFFF), 1.0)
    assert [text for text in texts(station) if "ignored" in text] == ["Set point ignored: frame 3"]
    yard.step(5.0)
    say(yard, station, local(NED, 0xFFF), 0.1)
    nan = local(BODY, VELOCITY_AND_RATE, velocity=(math.nan, 0.0, 0.0), rate=math.nan)
    say(yard, station, nan, 0.2)
    assert [text for text in texts(station) if "ignored" in text] == ["Set point ignored: mask 4095, place or motion"]
    assert yard.autopilot.motion == STOP


@pytest.mark.parametrize("persona", PERSONAS.values())
def test_both_kinds_are_announced(persona: Persona) -> None:
    assert persona.capabilities & 0x180 == 0x180
