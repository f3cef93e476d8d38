"""Fence, rally points and plan files with the real MAVSDK client, as each persona, over UDP on the loopback."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from rover_sim.autopilot.fence import Circle, Polygon
from rover_sim.autopilot.modes import Mode
from rover_sim.mavlink.mission_file import read_plan, read_plan_areas, write_plan
from rover_sim.mavlink.persona import PERSONAS
from rover_sim.mavlink.plan_items import mission_items
from tests.mavlink_live import HOME, LiveRover, connected_pair, place
from tests.test_mavlink_fence import PLAN, POINTS

AREAS = PLAN[:-1]  # MAVSDK's importer leaves the return point out
Pair = tuple[LiveRover, Any, str]


@pytest.fixture(scope="module", params=PERSONAS)
def pair(request: pytest.FixtureRequest) -> Iterator[Pair]:
    """A live rover of each persona, and MAVSDK's view of it."""
    with connected_pair(PERSONAS[request.param]) as (live, system):
        yield live, system, request.param


def test_a_fence_goes_up_is_kept_and_is_cleared(pair: Pair) -> None:
    from mavsdk.plugins.action import Action, ActionError
    from mavsdk.plugins.geofence import Circle as GeoCircle
    from mavsdk.plugins.geofence import FenceType, Geofence, GeofenceData, Point
    from mavsdk.plugins.geofence import Polygon as GeoPolygon

    live, system, persona = pair
    fence, action = Geofence(system), Action(system)
    corners = [place(live, *corner) for corner in ((-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0))]
    points = [Point(corner.latitude_deg, corner.longitude_deg) for corner in corners]
    pit = place(live, 3.0, 0.0)
    fence.upload_geofence(
        GeofenceData(
            [GeoPolygon(points, FenceType.INCLUSION)],
            [GeoCircle(Point(pit.latitude_deg, pit.longitude_deg), 1.0, FenceType.EXCLUSION)],
        )
    )
    square, circle = live.autopilot.fence.fence.areas
    assert isinstance(square, Polygon)
    assert isinstance(circle, Circle)
    assert square.depth_m(0.0, 0.0) == pytest.approx(5.0, abs=0.02)
    assert circle.centre_w == pytest.approx((3.0, 0.0), abs=0.02)
    back = fence.download_geofence()
    assert [len(polygon.points) for polygon in back.polygons] == [4]
    assert [entry.radius for entry in back.circles] == [1.0]
    if persona != "px4":  # whose fence counts as soon as it is there
        live.locked(lambda: live.autopilot.parameters.set("FENCE_ENABLE", 1))
    action.arm()
    for x_m, allowed in ((9.0, False), (3.2, False), (0.5, True)):
        target = place(live, x_m, 0.0)
        try:
            action.goto_location(target.latitude_deg, target.longitude_deg, target.altitude_m, float("nan"))
        except ActionError:
            assert not allowed
        else:
            assert allowed
    action.hold()
    action.disarm()
    fence.clear_geofence()
    live.until(lambda: live.autopilot.fence.fence.areas == ())
    fence.destroy()
    action.destroy()


def test_rally_points_go_up_and_down_and_return_leads_there(pair: Pair) -> None:
    from mavsdk.plugins.action import Action
    from mavsdk.plugins.mission_raw import MissionRaw

    live, system, _ = pair
    raw, action = MissionRaw(system), Action(system)
    point = place(live, 4.0, 4.0)
    raw.upload_rally_points([_raw_item(5100, 6, point.latitude_e7, point.longitude_e7, 2)])
    (back,) = raw.download_rallypoints()
    assert (back.command, back.x, back.y) == (5100, point.latitude_e7, point.longitude_e7)
    live.locked(partial(_put, live, 3.0, 3.0))
    action.arm()
    action.return_to_launch()
    live.until(lambda: live.autopilot.mode is Mode.RETURN)
    live.until(lambda: live.rover.x_m > 3.3)
    action.hold()
    action.disarm()
    live.locked(partial(_put, live, 0.0, 0.0))
    raw.destroy()
    action.destroy()


def test_the_client_learns_that_the_planner_sent_another_mission(pair: Pair) -> None:
    """MAVSDK takes it from the id in MISSION_CURRENT, without asking."""
    from mavsdk.plugins.mission_raw import MissionRaw

    live, system, _ = pair
    raw = MissionRaw(system)
    changes: list[bool] = []
    raw.subscribe_mission_changed(lambda changed, _: changes.append(changed))
    for x_m in (3.0, 4.0):
        changes.clear()
        items = mission_items([(x_m, 0.0, 0.0)], live.frame, HOME)
        live.locked(partial(live.companion.upload, items, live.rover.time_s))
        live.until(lambda: bool(changes), 3.0)
        assert [item.x for item in raw.download_mission()][-1] == items[-1].x
    raw.destroy()


def test_a_plan_file_goes_through_the_client_and_the_vehicle_and_back(pair: Pair, tmp_path: Path) -> None:
    from mavsdk.plugins.mission_raw import MissionRaw

    live, system, _ = pair
    raw = MissionRaw(system)
    mission = mission_items([(2.0, 0.0, 0.0), (2.0, 2.0, 0.0)], live.frame, HOME, speed_m_s=0.5)
    write_plan(tmp_path / "a.plan", mission, 0.6, AREAS, POINTS)
    read = raw.import_qgroundcontrol_mission(str(tmp_path / "a.plan"))
    assert [(item.command, item.x, item.y, item.param1) for item in read.geofence_items] == [
        (item.command, item.x, item.y, item.params[0]) for item in AREAS
    ]
    assert [(item.command, item.x, item.y) for item in read.rally_items] == [
        (item.command, item.x, item.y) for item in POINTS
    ]
    raw.upload_mission(read.mission_items)
    raw.upload_geofence(read.geofence_items)
    raw.upload_rally_points(read.rally_items)
    live.locked(lambda: live.vehicle.save_plans(tmp_path / "b.waypoints", tmp_path / "b.plan"))
    fence, rally = read_plan_areas(tmp_path / "b.plan")
    assert [(item.command, item.x, item.y, item.params[0]) for item in fence] == [
        (item.command, item.x, item.y, item.params[0]) for item in AREAS
    ]
    assert [(item.command, item.x, item.y) for item in rally] == [(item.command, item.x, item.y) for item in POINTS]
    assert [(item.command, item.x, item.y) for item in read_plan(tmp_path / "b.plan")[-2:]] == [
        (item.command, item.x, item.y) for item in mission[-2:]
    ]
    again = raw.import_qgroundcontrol_mission(str(tmp_path / "b.plan"))
    assert [(item.command, item.x, item.y) for item in again.mission_items[-3:]] == [
        (item.command, item.x, item.y) for item in mission[-3:]
    ]
    assert len(again.geofence_items) == len(AREAS)
    waypoints = raw.import_mission_planner_mission(str(tmp_path / "b.waypoints")).mission_items
    assert [(item.command, item.x, item.y) for item in waypoints[-2:]] == [
        (item.command, item.x, item.y) for item in mission[-2:]
    ]
    raw.clear_mission()
    raw.destroy()


def _put(live: LiveRover, x_m: float, y_m: float) -> None:
    live.rover.x_m, live.rover.y_m = x_m, y_m


def _raw_item(command: int, frame: int, x_e7: int, y_e7: int, kind: int) -> Any:
    from mavsdk.plugins.mission_raw import MissionItem

    return MissionItem(0, frame, command, 1, 1, 0.0, 0.0, 0.0, 0.0, x_e7, y_e7, 0.0, kind)
