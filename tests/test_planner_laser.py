"""The laser's map and the way through it."""

from __future__ import annotations

from math import hypot, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planner import navigator
from planner.choice import Place
from planner.corridor import Corridor, SpeedModel, choose_way, corridor, room_speed
from planner.ground_cells import empty_cells, sample
from planner.laser_map import CELL_M, LaserMap, empty_laser_map, mark_free, note_scan
from planner.navigator_state import Decision
from planner.obstacle_map import NO_OBSTACLES, DriveModel
from tests.planner_factory import FOOTPRINT, pose_at
from worlds.geometry import quaternion_from_euler
from worlds.types import BoolArray, FloatArray, GroundPlane, LaserModel, Pose, PoseEstimate, RangeScan

LASER = LaserModel((0.0, 0.0, 0.2))
SPEED, DRIVE = SpeedModel(), DriveModel()
NEED = FOOTPRINT.width_m / 2 + SPEED.margin_m
LEVEL = GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0]))


def _scan(discs: list[tuple[float, float, float]], x: float, y: float, yaw: float, *, pitch: float = 0.0) -> RangeScan:
    """What an exact scanner 0.3 m up sees of discs (x, y, radius); with a pitch also of the level ground."""
    angles = LASER.angles_rad + yaw
    beams = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ranges = np.full(len(angles), np.inf)
    for centre_x, centre_y, radius in discs:
        offset = np.array([centre_x - x, centre_y - y])
        along = beams @ offset
        inside = radius**2 - (offset @ offset - along**2)
        distance = along - np.sqrt(np.maximum(inside, 0.0))
        ranges = np.where(
            (inside > 0.0) & (distance > 0.0) & (distance < LASER.reach_m), np.minimum(ranges, distance), ranges
        )
    if pitch > 0.0:
        drop = np.sin(pitch) * np.cos(LASER.angles_rad)
        ranges = np.minimum(ranges, np.where(drop > 0.3 / LASER.reach_m, 0.3 / np.maximum(drop, 1e-9), np.inf))
    pose = Pose(np.array([x, y, 0.3]), quaternion_from_euler(0.0, pitch, yaw))
    count = len(ranges)
    return RangeScan(0.0, LASER.angles_rad, ranges, np.full(count, 0.02), np.zeros(count), LASER.reach_m, pose, LEVEL)


def _seen(discs: list[tuple[float, float, float]], x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> LaserMap:
    laser_map = empty_laser_map(np.array([x, y]))
    for _ in range(2):
        laser_map = note_scan(laser_map, _scan(discs, x, y, yaw), pose_at(x, y, yaw))
    return laser_map


def _at(laser_map: LaserMap, x: float, y: float) -> float:
    i, j = np.floor((np.array([x, y]) - laser_map.origin_w) / CELL_M).astype(int)
    return float(laser_map.log_odds[i, j])


def _wall(x: float, gap: tuple[float, float]) -> list[tuple[float, float, float]]:
    return [(x, float(y), 0.06) for y in np.arange(-5.0, 5.01, 0.1) if not gap[0] < y < gap[1]]


def test_returns_mark_and_beams_free() -> None:
    laser_map = _seen([(3.0, 0.0, 0.5)])
    assert _at(laser_map, 2.52, 0.0) > 0.0
    assert _at(laser_map, 1.5, 0.0) < 0.0
    assert _at(laser_map, 4.5, 0.0) == 0.0  # in the shadow
    assert _at(laser_map, -2.0, 0.0) == 0.0  # behind, where no beam points
    assert laser_map.sd_m.max() == pytest.approx(hypot(0.02, 0.01 * 3.0), abs=5e-3)


def test_what_has_gone_is_forgotten() -> None:
    laser_map = _seen([(3.0, 0.0, 0.5)])
    for _ in range(9):
        laser_map = note_scan(laser_map, _scan([], 0.0, 0.0, 0.0), pose_at(0.0, 0.0, 0.0))
    assert _at(laser_map, 2.52, 0.0) < 0.0


def test_the_ground_before_a_nose_down_scanner_is_no_obstacle() -> None:
    pitched = note_scan(empty_laser_map(np.zeros(2)), _scan([], 0.0, 0.0, 0.0, pitch=0.1), pose_at(0.0, 0.0, 0.0))
    assert np.isfinite(_scan([], 0.0, 0.0, 0.0, pitch=0.1).ranges_m).any()
    assert not (pitched.log_odds > 0.0).any()


def test_the_map_moves_with_the_rover_and_keeps_what_it_knows() -> None:
    laser_map = _seen([(3.0, 0.0, 0.5)])
    moved = note_scan(laser_map, _scan([], 5.0, 1.0, 0.0), pose_at(5.0, 1.0, 0.0))
    assert not np.array_equal(moved.origin_w, laser_map.origin_w)
    assert _at(moved, 2.52, 0.0) == _at(laser_map, 2.52, 0.0) > 0.0


def test_ground_cells_are_seen_where_beams_have_passed() -> None:
    cells = mark_free(empty_cells(np.zeros(2)), _seen([(3.0, 0.0, 0.5)]), 0.0)
    seen, _ = sample(cells, np.array([[1.0, 0.0], [5.0, 0.0], [-3.0, 0.0], [2.0, 2.0]]))
    assert seen.tolist() == [True, False, False, True]


def test_clearance_is_the_distance_less_a_share_of_the_error() -> None:
    laser_map = _seen([(3.0, 0.0, 0.5)])
    i, j = np.floor((np.array([1.0, 0.0]) - laser_map.origin_w) / CELL_M).astype(int)
    assert laser_map.clearance_m(0.0)[i, j] == pytest.approx(1.5, abs=0.06)
    assert laser_map.clearance_m(0.0)[i, j] - laser_map.clearance_m(1.0)[i, j] == pytest.approx(0.032, abs=0.01)


def _corridor(
    laser_map: LaserMap, goal: tuple[float, float], table: FloatArray = NO_OBSTACLES
) -> tuple[Corridor, Place]:
    place = Place((0.0, 0.0), 0.0, goal, 0.5)
    return corridor(laser_map, table, place, FOOTPRINT, DRIVE, SPEED), place


def test_the_way_goes_through_the_gap_and_keeps_clear() -> None:
    discs = _wall(3.0, (1.0, 2.2))
    found, place = _corridor(_seen(discs), (6.0, 0.0))
    way = choose_way(found, place).way
    assert way is not None
    legs = np.concatenate(
        [np.linspace(a, b, 50) for a, b in zip(way.waypoints_w[:-1], way.waypoints_w[1:], strict=True)]
    )
    distance = np.hypot(*(legs[:, None] - np.array(discs)[None, :, :2]).transpose(2, 0, 1)) - 0.06
    assert distance.min() > FOOTPRINT.width_m / 2
    assert np.hypot(*(way.waypoints_w[-1] - [6.0, 0.0])) < 0.5


def test_a_gap_too_narrow_is_no_way() -> None:
    behind = [(float(x), side, 0.06) for x in np.arange(-3.0, 3.0, 0.1) for side in (-5.0, 5.0)] + _wall(
        -3.0, (9.0, 9.0)
    )
    discs = [*_wall(3.0, (1.0, 1.6)), *behind]
    laser_map = _seen(discs)
    for yaw in (0.0, pi):
        laser_map = note_scan(laser_map, _scan(discs, 0.0, 0.0, yaw), pose_at(0.0, 0.0, yaw))
    found, place = _corridor(laser_map, (6.0, 0.0))
    choice = choose_way(found, place)
    assert choice.way is None
    assert choice.enclosed


def test_obstacles_of_other_eyes_are_kept_clear_of_too() -> None:
    rock = np.array([[2.0, 0.0, 2.0, 0.0, 0.5, 1.0, 1.0]])
    found, place = _corridor(_seen([]), (6.0, 0.0), rock)
    way = choose_way(found, place).way
    assert way is not None
    assert way.length_m > 6.05
    straight, _ = _corridor(_seen([]), (6.0, 0.0))
    assert choose_way(straight, place).way is not None
    assert np.isinf(found.way_cost(np.array([[0.0, 0.0], [5.0, 0.0]]), np.array([6.0, 0.0])))


def test_a_wide_way_round_is_taken_before_a_tight_one() -> None:
    gaps = [(3.0, float(y), 0.06) for y in np.arange(-5.0, 5.01, 0.1) if not (-0.45 < y < 0.45 or 1.2 < y < 3.2)]
    found, place = _corridor(_seen(gaps), (6.0, 0.0))
    way = choose_way(found, place).way
    assert way is not None
    assert way.waypoints_w[:, 1].max() > 1.5


@given(st.lists(st.floats(0.0, 2.0), min_size=2, max_size=8))
def test_speed_grows_with_room(clearances: list[float]) -> None:
    speeds = room_speed(np.sort(np.array(clearances, dtype=np.float32)), FOOTPRINT, SPEED)
    assert (np.diff(speeds) >= -1e-9).all()
    assert speeds.min() >= SPEED.least_m_s
    assert speeds.max() <= FOOTPRINT.max_speed_m_s


def test_speed_falls_in_time_for_a_tight_place() -> None:
    found, _ = _corridor(_seen(_wall(3.0, (-0.45, 0.45))), (6.0, 0.0))
    speeds = [found.speed_m_s(np.array([[x, 0.0], [5.0, 0.0]])) for x in (0.0, 1.0, 2.0, 2.5, 3.0)]
    assert (np.diff(speeds) <= 1e-9).all()
    assert speeds[-1] < 0.6 * speeds[0]
    # At each place the rover can still brake to what the next allows.
    for (x, speed), (later_x, later) in zip(
        zip((0.0, 1.0, 2.0, 2.5), speeds[:-1], strict=True),
        zip((1.0, 2.0, 2.5, 3.0), speeds[1:], strict=True),
        strict=True,
    ):
        assert speed**2 <= later**2 + 2 * SPEED.brake_m_s2 * (later_x - x) + 1e-6


def test_a_rover_too_near_to_something_may_leave() -> None:
    found, place = _corridor(_seen([(0.2, 0.45, 0.1)]), (6.0, 0.0))
    assert choose_way(found, place).way is not None


def _drive_by_laser(
    discs: list[tuple[float, float, float]], goal: tuple[float, float]
) -> tuple[str, FloatArray, BoolArray]:
    """End, track (T, 3) and contacts of a kinematic rover that follows the navigator's ways at its speeds."""
    from dataclasses import replace

    from planner import mobility
    from tests.planner_factory import drive

    state = navigator.begin(goal, 0.5, FOOTPRINT, (0.0, 0.0))
    limits, progress, command = mobility.Limits(), mobility.Progress(), mobility.STOP
    pose, track = np.zeros(3), []
    decision: Decision | None = None
    for tick in range(2400):
        estimate: PoseEstimate = pose_at(pose[0], pose[1], pose[2], tick * 0.05)
        if tick % 2 == 0:
            scan = _scan(discs, pose[0], pose[1], pose[2])
            state, decision = navigator.step(state, None, estimate, tick * 0.05, scan)
            if decision.kind != "drive":
                break
            if decision.changed:
                progress = mobility.Progress()
            assert decision.speed_m_s is not None
            limits = replace(limits, cruise_speed_m_s=decision.speed_m_s)
        assert decision is not None
        wanted, progress = mobility.follow_path(decision.waypoints_w, estimate, FOOTPRINT, limits, progress)
        command = mobility.ramp(command, wanted, limits, 0.05)
        pose = drive(pose, command, 0.05)
        track.append(pose)
    assert decision is not None
    way = np.array(track)
    sin, cos = np.sin(way[:, 2])[:, None], np.cos(way[:, 2])[:, None]
    table = np.array(discs)
    dx, dy = table[:, 0] - way[:, 0:1], table[:, 1] - way[:, 1:2]
    along, aside = dx * cos + dy * sin, dy * cos - dx * sin
    out: FloatArray = np.hypot(
        np.maximum(np.abs(along) - FOOTPRINT.length_m / 2, 0), np.maximum(np.abs(aside) - FOOTPRINT.width_m / 2, 0)
    )
    return decision.kind, way, np.asarray((out < table[:, 2]).any(axis=1))


def test_the_navigator_drives_a_slalom_by_the_scanner_alone() -> None:
    discs = [*_wall(2.5, (0.8, 2.6)), *_wall(5.5, (-2.6, -0.8))]
    end, way, touching = _drive_by_laser(discs, (9.0, 0.0))
    assert end == "arrived"
    assert not touching.any()
    assert np.hypot(*np.diff(way[:, :2], axis=0).T).sum() < 1.6 * 9.0


def test_a_pocket_is_left_by_the_scanner_alone() -> None:
    """A U that opens toward the start, deeper than it is wide."""
    sides = [(float(x), side, 0.06) for x in np.arange(1.5, 4.5, 0.1) for side in (-1.2, 1.2)]
    end_wall = [(4.5, float(y), 0.06) for y in np.arange(-1.2, 1.21, 0.1)]
    end, _, touching = _drive_by_laser([*sides, *end_wall], (8.0, 0.0))
    assert end == "arrived"
    assert not touching.any()


def test_angles_turn_with_the_scanner() -> None:
    laser_map = _seen([(0.0, 3.0, 0.5)], yaw=pi / 2)
    assert _at(laser_map, 0.0, 2.52) > 0.0
