from __future__ import annotations

from math import cos, sin

import numpy as np
import pytest

from rover_sim.sim.rasteriser import Rasteriser
from rover_sim.sim.renderer import RenderedImage, make_renderer
from rover_sim.sim.rut_kernels import press_rut
from rover_sim.sim.ruts import RutField
from tests.sim_factory import make_world, slope
from worlds.geometry import quaternion_from_rotation
from worlds.types import CameraModel, Pose, World

CAMERA = CameraModel(200, 150, 200.0)
RIM = (0.165, 0.057)
DEPTH_M = 0.03


def track(ruts: RutField, y: float, depth_m: float = DEPTH_M, length_m: float = 3.0) -> None:
    """A straight rut along x, in the middle of the map."""
    for x in np.arange(-length_m / 2, length_m / 2, 0.01):
        press_rut(ruts.view, (float(x), y), (1.0, 0.0), RIM, depth_m, 0.0)
        ruts.reserve()


def looking(eye: tuple[float, float, float], pitch: float, yaw: float = 0.0) -> Pose:
    """A camera that looks along ``yaw``, ``pitch`` below the horizon."""
    forward = np.array([cos(pitch) * cos(yaw), cos(pitch) * sin(yaw), -sin(pitch)])
    right = np.array([sin(yaw), -cos(yaw), 0.0])
    axes = np.column_stack([right, np.cross(forward, right), forward])
    return Pose(np.array(eye), quaternion_from_rotation(axes))


def world_and_ruts(slope_deg: float = 0.0) -> tuple[World, RutField]:
    world = make_world(slope(slope_deg, 12.0))
    return world, RutField(world.ground)


def both(pose: Pose, slope_deg: float = 0.0) -> tuple[RenderedImage, RenderedImage]:
    """The same view without and with a rut along x at y = 0.01."""
    world, ruts = world_and_ruts(slope_deg)
    renderer = Rasteriser(world, ruts)
    before = renderer.render(CAMERA, pose)
    track(ruts, 0.01)
    return before, renderer.render(CAMERA, pose)


def test_ruts_elsewhere_change_nothing() -> None:
    world, ruts = world_and_ruts()
    pose = looking((0.0, 0.0, 1.0), 0.7)
    plain = make_renderer(world).render(CAMERA, pose)
    track(ruts, -4.0)
    renderer = make_renderer(world, ruts)
    assert np.array_equal(renderer.render(CAMERA, pose).image, plain.image)
    assert np.array_equal(renderer.render(CAMERA, pose).depth_m, plain.depth_m)


def test_ground_out_of_reach_of_a_rut_of_the_same_tile_looks_as_without_it() -> None:
    before, after = both(looking((-1.0, 0.3, 0.6), 0.7))
    columns = slice(0, 60)  # at least half a metre to the left of the track
    assert (before.image != after.image).any()
    assert np.array_equal(after.image[:, columns], before.image[:, columns])
    assert np.array_equal(after.depth_m[:, columns], before.depth_m[:, columns])


def test_from_above_the_floor_of_a_rut_is_as_deep_as_the_wheel_pressed_it() -> None:
    before, after = both(looking((0.0, 0.0, 1.0), np.pi / 2))
    assert before.depth_m == pytest.approx(1.0, abs=1e-4)
    column = np.indices(after.depth_m.shape)[1]
    # Yaw 0 and straight down: rows run against x, columns against y.
    y = -(column + 0.5 - 100.0) / 200.0
    floor = np.abs(y - 0.01) < 0.03
    bank = np.abs(np.abs(y - 0.01) - 0.087) < 0.005
    outside = np.abs(y - 0.01) > 0.16
    assert after.depth_m[floor] == pytest.approx(1.0 + DEPTH_M, abs=1e-3)
    assert (after.depth_m[bank] < 0.995).all()
    assert after.depth_m[outside] == pytest.approx(1.0, abs=1e-4)
    assert (after.ids == before.ids).all()


def test_an_oblique_view_meets_the_floor_where_the_line_of_sight_does() -> None:
    pitch = 0.7
    before, after = both(looking((-0.6, 0.01, 0.6), pitch))
    column = 100
    for row in (60, 75, 90, 105):
        down = pitch + np.arctan((row + 0.5 - 75.0) / 200.0)
        # Along the middle of the rut, whose floor is level: depth along the camera's axis to a plane below the eye.
        for image, height in ((before, 0.6), (after, 0.6 + DEPTH_M)):
            along_axis = height / sin(down) * cos(down - pitch)
            assert image.depth_m[row, column] == pytest.approx(along_axis, abs=2e-3)


def test_on_a_slope_the_rut_lies_below_the_slope() -> None:
    before, after = both(looking((0.0, 0.0, 1.0), np.pi / 2), slope_deg=15.0)
    middle = (75, 98)
    assert before.depth_m[middle] == pytest.approx(1.0, abs=5e-3)
    # Held along the vertical.
    assert after.depth_m[middle] - before.depth_m[middle] == pytest.approx(DEPTH_M, abs=2e-3)


def test_the_wall_toward_the_sun_lies_in_its_own_shadow() -> None:
    world, ruts = world_and_ruts()
    track(ruts, 0.01)
    image = Rasteriser(world, ruts).render(CAMERA, looking((0.0, 0.0, 0.8), np.pi / 2)).image.astype(float).mean(axis=2)
    plain = Rasteriser(world).render(CAMERA, looking((0.0, 0.0, 0.8), np.pi / 2)).image.astype(float).mean(axis=2)
    # The sun stands at an azimuth of 120 degrees: over +y, to the left of the picture.
    assert world.scenario.sun.azimuth_deg == 120.0
    profile, ground = image[40:110].mean(axis=0), plain[40:110].mean()
    left_wall = round(100 - (0.01 + RIM[1]) * 250)
    right_wall = round(100 - (0.01 - RIM[1]) * 250)
    assert profile[left_wall - 3 : left_wall + 4].min() < 0.75 * ground
    assert profile[right_wall - 3 : right_wall + 4].max() > 1.05 * ground


def test_far_ruts_are_a_faint_darker_line_and_shallow_ones_fainter() -> None:
    pose = looking((-5.5, 0.0, 1.0), 0.2)
    change = []
    for depth in (0.0005, 0.02):
        world, ruts = world_and_ruts()
        plain = Rasteriser(world).render(CAMERA, pose)
        track(ruts, 0.0, depth, 6.0)
        seen = Rasteriser(world, ruts).render(CAMERA, pose)
        assert seen.depth_m == pytest.approx(plain.depth_m, rel=0.05)
        difference = np.abs(seen.image.astype(float) - plain.image.astype(float)).mean(axis=2)
        change.append(difference[plain.depth_m < 8.0].mean())
    assert 0.0 < change[0] < 0.3 * change[1]


def test_pictures_of_ruts_repeat_to_the_byte() -> None:
    pose = looking((-0.6, 0.1, 0.7), 0.8)
    first, second = (both(pose)[1] for _ in range(2))
    assert first.image.tobytes() == second.image.tobytes()
