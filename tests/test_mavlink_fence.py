"""Fence and rally points over the mission protocol: transfers, hard cases, and what ground stations see of a breach."""

from __future__ import annotations

import math

import pytest

from rover_sim.autopilot.fence import Circle, Polygon
from rover_sim.autopilot.modes import Mode
from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.persona import ARDUPILOT, PERSONAS, PX4, Persona
from rover_sim.mavlink.plan_ids import plan_id
from rover_sim.mavlink.wire import WireItem
from tests.mavlink_rig import Station, Yard
from tests.test_mavlink_mission import (
    ACCEPTED,
    CANCELLED,
    DENIED,
    ITEMS,
    NO_SPACE,
    UNSUPPORTED,
    count,
    download,
    put,
    talk,
    upload,
)
from tests.test_mavlink_persona import command, result
from worlds.scenario import Origin

FRAME = LocalFrame(Origin())
MISSION, FENCE, RALLY, ALL = 0, 1, 2, 255
RETURN_POINT, INSIDE, OUTSIDE, CIRCLE_IN, CIRCLE_OUT, RALLY_POINT = 5000, 5001, 5002, 5003, 5004, 5100
INVALID, INVALID_PARAM1, UNSUPPORTED_FRAME = 5, 6, 2


def item(number: int, x_m: float, y_m: float, first: float = 0.0, frame: int = 0) -> WireItem:
    place = FRAME.to_geo((x_m, y_m, 0.0))
    return WireItem(frame, number, (first, 0.0, 0.0, 0.0), place.latitude_e7, place.longitude_e7, 0.0)


def polygon(number: int, *corners: tuple[float, float], says: float | None = None) -> list[WireItem]:
    return [item(number, x_m, y_m, len(corners) if says is None else says) for x_m, y_m in corners]


SQUARE = polygon(INSIDE, (-4, -4), (4, -4), (4, 4), (-4, 4))
PLAN = [
    *SQUARE,
    *polygon(OUTSIDE, (1, 1), (2, 1), (1, 2)),
    item(CIRCLE_OUT, 3, -3, 0.5),
    item(RETURN_POINT, 1, 0, frame=3),
]
POINTS = [item(RALLY_POINT, 3, 3, frame=3), item(RALLY_POINT, -3, -3, frame=3)]


@pytest.fixture
def station() -> Station:
    return Station()


@pytest.fixture
def other() -> Station:
    return Station(255, 230)


@pytest.fixture
def yard(station: Station, other: Station) -> Yard:
    return Yard(station, other)


def test_a_fence_goes_up_down_and_into_the_autopilot(yard: Yard, station: Station, other: Station) -> None:
    assert upload(yard, station, PLAN, FENCE) == [ACCEPTED]
    assert download(yard, other, FENCE) == PLAN
    square, triangle, circle = yard.autopilot.fence.fence.areas
    assert isinstance(square, Polygon)
    assert isinstance(triangle, Polygon)
    assert isinstance(circle, Circle)
    assert (square.inclusion, triangle.inclusion, circle.inclusion) == (True, False, False)
    assert square.corners_w[1] == pytest.approx((4.0, -4.0), abs=0.02)  # 1e-7 degrees are 1.1 cm
    assert circle.radius_m == 0.5
    assert yard.autopilot.fence.fence.return_w == pytest.approx((1.0, 0.0, 0.0), abs=0.02)
    assert download(yard, station, MISSION) == []
    assert download(yard, station, RALLY) == []


def test_rally_points_go_up_and_down_and_the_rover_returns_to_one(yard: Yard, station: Station) -> None:
    assert upload(yard, station, POINTS, RALLY) == [ACCEPTED]
    assert download(yard, station, RALLY) == POINTS
    yard.rover.x_m, yard.rover.y_m = 2.5, 2.0
    yard.step()
    assert result(yard, station, command(400, 1.0)) == 0
    assert result(yard, station, command(20)) == 0
    yard.step(8.0)
    assert math.hypot(yard.rover.x_m - 3.0, yard.rover.y_m - 3.0) < 0.4


@pytest.mark.parametrize(
    ("items", "code"),
    [
        (polygon(INSIDE, (0, 0), (1, 0)), INVALID_PARAM1),  # two corners are no area
        (polygon(INSIDE, (0, 0), (1, 0), (1, 1), says=2.0), INVALID_PARAM1),
        (polygon(INSIDE, (0, 0), (1, 0), (1, 1), says=3.5), INVALID_PARAM1),
        (polygon(INSIDE, (0, 0), (1, 0), (1, 1), says=math.nan), INVALID_PARAM1),
        (polygon(INSIDE, (0, 0), (1, 0), (1, 1), says=4.0), INVALID),  # one is missing
        ([*SQUARE[:3], item(INSIDE, -4, 4, 5)], INVALID_PARAM1),  # another number than the first said
        ([*SQUARE[:3], item(OUTSIDE, -4, 4, 4)], INVALID),  # inclusion and exclusion mixed
        ([*SQUARE[:2], item(CIRCLE_OUT, 0, 0, 1), *SQUARE[2:]], INVALID),
        ([item(CIRCLE_IN, 0, 0, 0.0)], INVALID_PARAM1),
        ([item(CIRCLE_IN, 0, 0, math.inf)], INVALID_PARAM1),
        ([item(RETURN_POINT, 0, 0), item(RETURN_POINT, 1, 0)], INVALID),
        ([item(RALLY_POINT, 0, 0)], UNSUPPORTED),
        ([item(16, 0, 0)], UNSUPPORTED),
        ([item(5005, 0, 0, 5.0)], UNSUPPORTED),  # a circle about home is a parameter here
        ([item(CIRCLE_IN, 0, 0, 5.0, frame=1)], UNSUPPORTED_FRAME),
        ([WireItem(0, CIRCLE_IN, (5.0, 0, 0, 0), 2_000_000_000, 0, 0.0)], 10),
        ([WireItem(0, CIRCLE_IN, (5.0, 0, 0, 0), 0, 2_000_000_000, 0.0)], 11),
        ([WireItem(0, CIRCLE_IN, (5.0, 0, 0, 0), -384064000, 0, 0.0)], INVALID),  # another continent
    ],
)
def test_a_bad_fence_ends_with_its_own_code_and_the_old_one_stays(
    yard: Yard, station: Station, items: list[WireItem], code: int
) -> None:
    assert upload(yard, station, PLAN, FENCE) == [ACCEPTED]
    fence = yard.autopilot.fence.fence
    assert upload(yard, station, items, FENCE) == [code]
    assert download(yard, station, FENCE) == PLAN
    assert yard.autopilot.fence.fence is fence


def test_a_bad_rally_point_and_the_old_ones_stay(yard: Yard, station: Station) -> None:
    upload(yard, station, POINTS, RALLY)
    assert upload(yard, station, [POINTS[0], SQUARE[0]], RALLY) == [UNSUPPORTED]
    assert upload(yard, station, [item(RALLY_POINT, 0, 0, frame=7)], RALLY) == [UNSUPPORTED_FRAME]
    assert download(yard, station, RALLY) == POINTS


def test_too_many_items_partial_lists_and_requests_beyond_the_end(yard: Yard, station: Station) -> None:
    assert talk(yard, station, count(1001, FENCE)) == ([], [NO_SPACE])
    assert talk(yard, station, count(101, RALLY)) == ([], [NO_SPACE])
    for kind in (FENCE, RALLY):
        partial = mavlink.MAVLink_mission_write_partial_list_message(1, 1, 0, 0, kind)
        (answer,) = yard.ask(station, partial, "MISSION_ACK")
        assert (answer.type, answer.mission_type) == (UNSUPPORTED, kind)
        (answer,) = yard.ask(station, mavlink.MAVLink_mission_request_int_message(1, 1, 0, kind), "MISSION_ACK")
        assert (answer.type, answer.mission_type) == (13, kind)


def test_a_fence_cut_off_in_the_middle_leaves_the_old_one(yard: Yard, station: Station, other: Station) -> None:
    upload(yard, station, PLAN, FENCE)
    talk(yard, station, count(4, FENCE))
    talk(yard, station, put(0, SQUARE[0], FENCE))
    assert talk(yard, other, count(4, FENCE)) == ([], [DENIED])
    assert talk(yard, other, put(1, SQUARE[1], FENCE)) == ([], [DENIED])
    assert talk(yard, other, mavlink.MAVLink_mission_request_list_message(1, 1, FENCE)) == ([], [DENIED])
    yard.step(9.0)
    (answer,) = station.take("MISSION_ACK")
    assert (answer.type, answer.mission_type) == (CANCELLED, FENCE)
    assert "Fence upload timeout" in [message.text for message in other.take("STATUSTEXT")]
    assert download(yard, other, FENCE) == PLAN


def test_a_cancelled_upload_leaves_the_old_one(yard: Yard, station: Station) -> None:
    upload(yard, station, POINTS, RALLY)
    talk(yard, station, count(2, RALLY))
    yard.ask(station, mavlink.MAVLink_mission_ack_message(1, 1, CANCELLED, RALLY))
    assert talk(yard, station, put(0, POINTS[0], RALLY)) == ([], [CANCELLED])
    assert download(yard, station, RALLY) == POINTS


def test_uploads_of_different_lists_do_not_disturb_each_other(yard: Yard, station: Station, other: Station) -> None:
    assert talk(yard, station, count(len(ITEMS))) == ([0], [])
    assert upload(yard, other, PLAN, FENCE) == [ACCEPTED]
    assert talk(yard, station, put(0)) == ([1], [])
    assert upload(yard, station, ITEMS) == [ACCEPTED]


@pytest.mark.parametrize("kind", [FENCE, RALLY, ALL])
def test_clearing(yard: Yard, station: Station, kind: int) -> None:
    lists = {MISSION: ITEMS, FENCE: PLAN, RALLY: POINTS}
    for each, items in lists.items():
        upload(yard, station, items, each)
    (answer,) = yard.ask(station, mavlink.MAVLink_mission_clear_all_message(1, 1, kind), "MISSION_ACK")
    assert (answer.type, answer.mission_type, answer.opaque_id) == (ACCEPTED, kind, 0)
    for each, items in lists.items():
        assert len(download(yard, station, each)) == (0 if kind in (each, ALL) else len(items))
    assert bool(yard.autopilot.fence.fence.areas) == (kind == RALLY)
    assert bool(yard.autopilot.returns.rally_w) == (kind == FENCE)


def test_mavlink_1_has_no_fence_and_no_rally_points(yard: Yard, station: Station) -> None:
    """A frame of MAVLink 1 that carries a mission type all the same, as pymavlink packs it."""
    station.packer.version_1 = True
    assert talk(yard, station, count(4, FENCE)) == ([], [UNSUPPORTED])
    assert talk(yard, station, put(0, POINTS[0], RALLY)) == ([], [UNSUPPORTED])
    assert talk(yard, station, mavlink.MAVLink_mission_request_list_message(1, 1, FENCE)) == ([], [UNSUPPORTED])
    assert talk(yard, station, mavlink.MAVLink_mission_clear_all_message(1, 1, RALLY)) == ([], [UNSUPPORTED])
    assert talk(yard, station, count(3)) == ([0], [])


def test_ids_tell_when_a_list_has_changed(yard: Yard, station: Station, other: Station) -> None:
    yard.step(1.1)
    assert other.take("MISSION_CURRENT")[-1].fence_id == 0
    for kind, items in ((MISSION, ITEMS), (FENCE, PLAN), (RALLY, POINTS)):
        upload(yard, station, items, kind)
        (repeated,) = yard.ask(station, put(len(items) - 1, items[-1], kind), "MISSION_ACK")
        request = mavlink.MAVLink_mission_request_list_message(1, 1, kind)
        (total,) = yard.ask(other, request, "MISSION_COUNT")
        assert repeated.opaque_id == total.opaque_id == plan_id(items) != 0
    current = other.take("MISSION_CURRENT")[-1]
    assert (current.mission_id, current.fence_id) == (plan_id(ITEMS), plan_id(PLAN))
    assert current.rally_points_id == plan_id(POINTS)
    upload(yard, station, PLAN[:-1], FENCE)
    changed = other.take("MISSION_CURRENT")[-1]  # at once
    assert (changed.mission_id, changed.fence_id) == (plan_id(ITEMS), plan_id(PLAN[:-1]))


def test_a_download_is_of_one_list_whoever_replaces_it(yard: Yard, station: Station, other: Station) -> None:
    upload(yard, station, PLAN, FENCE)
    yard.ask(other, mavlink.MAVLink_mission_request_list_message(1, 1, FENCE), "MISSION_COUNT")
    upload(yard, station, SQUARE, FENCE)
    request = mavlink.MAVLink_mission_request_int_message(1, 1, len(PLAN) - 1, FENCE)
    (last,) = yard.ask(other, request, "MISSION_ITEM_INT")
    assert WireItem.of(last) == PLAN[-1]
    yard.step(11.0)
    assert talk(yard, other, request) == ([], [13])
    assert download(yard, other, FENCE) == SQUARE


def test_the_fence_switch_and_what_is_told_of_a_breach(yard: Yard, station: Station) -> None:
    upload(yard, station, SQUARE, FENCE)
    yard.step(1.1)
    assert station.take("FENCE_STATUS") == []  # off
    assert not station.take("SYS_STATUS")[-1].onboard_control_sensors_enabled & mavlink.MAV_SYS_STATUS_GEOFENCE
    assert result(yard, station, command(207, 2.0)) == 2
    assert result(yard, station, command(207, 1.0)) == 0
    assert [value.param_value for value in station.take("PARAM_VALUE")] == [1.0]
    assert result(yard, station, command(400, 1.0)) == 0
    yard.rover.x_m = 4.5
    yard.step(0.1)
    (status,) = station.take("FENCE_STATUS")[-1:]
    assert (status.breach_status, status.breach_count, status.breach_type) == (1, 1, 3)
    assert yard.time_s * 1e3 - 200 < status.breach_time <= yard.time_s * 1e3
    assert station.take("HEARTBEAT")[-1].system_status == 5  # critical
    assert "Fence breached, return" in [message.text for message in station.take("STATUSTEXT")]
    yard.step(1.1)
    health = station.take("SYS_STATUS")[-1]
    assert health.onboard_control_sensors_enabled & mavlink.MAV_SYS_STATUS_GEOFENCE
    assert not health.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_GEOFENCE
    yard.step(15.0)  # it turns around first
    assert station.take("FENCE_STATUS")[-1].breach_status == 0
    assert result(yard, station, command(207, 0.0)) == 0
    assert yard.autopilot.allows((99.0, 0.0, 0.0))


def test_a_target_outside_of_the_fence_is_denied(yard: Yard, station: Station) -> None:
    upload(yard, station, SQUARE, FENCE)
    yard.autopilot.parameters.set("FENCE_ENABLE", 1)
    assert result(yard, station, command(400, 1.0)) == 0
    for x_m, expected in ((9.0, 2), (2.0, 0)):
        place = FRAME.to_geo((x_m, 0.0, 0.0))
        message = mavlink.MAVLink_command_int_message(
            1, 1, 0, 192, 0, 0, -1.0, 1.0, 0.0, math.nan, place.latitude_e7, place.longitude_e7, 0.0
        )
        assert result(yard, station, message) == expected
    assert "Guided: the target is outside of the fence" in [message.text for message in station.take("STATUSTEXT")]
    assert yard.autopilot.mode is Mode.GUIDED


@pytest.mark.parametrize("persona", PERSONAS.values(), ids=PERSONAS)
def test_each_persona_has_its_own_switches(persona: Persona) -> None:
    station = Station()
    yard = Yard(station, persona=persona)
    names = set(yard.autopilot.parameters.names)
    assert ("GF_ACTION" in names) == (persona is PX4)
    assert ("FENCE_ENABLE" in names) == (persona is not PX4)
    assert result(yard, station, command(207, 1.0)) == (3 if persona is PX4 else 0)
    assert upload(yard, station, SQUARE, FENCE) == [ACCEPTED]
    yard.step()
    assert yard.autopilot.fence.on
    yard.autopilot.mode = Mode.SMART_RETURN
    shown = persona.numbers[Mode.SMART_RETURN if persona is ARDUPILOT else Mode.RETURN]
    assert persona.custom_mode(yard.autopilot) == shown
