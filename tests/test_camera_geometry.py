"""Depth and ids of the rasteriser against answers worked by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_sim.sim.raster_scene import View, make_tiles
from rover_sim.sim.renderer import GROUND_ID, SKY_ID, Renderer, make_renderer
from tests.camera_factory import field, lens, look, world
from worlds.types import CameraModel, FloatArray


@pytest.fixture(scope="module")
def plain() -> Renderer:
    return make_renderer(world(field(20.0, 0.25)))


@pytest.fixture(scope="module")
def posts() -> Renderer:
    # One post straight ahead at 5 m, one at 45 degrees to the left (y = +4).
    return make_renderer(world(field(20.0, 0.25), cylinders=[(5.0, 0.0, 0.1, 1.0), (4.0, 4.0, 0.1, 1.0)]))


@pytest.fixture(scope="module")
def small() -> Renderer:
    return make_renderer(world(field(6.0, 0.5), rocks=[(2.0, 0.0, 0.2, 0.15)]))


@pytest.mark.parametrize("pitch_deg", [10.0, 25.0, 60.0])
def test_rows_see_flat_ground_at_known_depth(plain: Renderer, pitch_deg: float) -> None:
    camera = lens(pitch_deg=pitch_deg)
    depth = plain.render(camera, look(camera, 0.0, 0.0, 1.1)).depth_m
    below = np.radians(pitch_deg) + np.arctan((np.arange(240) + 0.5 - 120) / camera.focal_px)
    ground = below > np.radians(7)
    # Slant range h / sin(below), turned into depth along the axis.
    expected = 1.1 / np.sin(below) * np.cos(below - np.radians(pitch_deg))
    np.testing.assert_allclose(depth[ground, 160], expected[ground], rtol=1e-4)


def test_sky_is_above_the_horizon_only(plain: Renderer) -> None:
    camera = lens(pitch_deg=10.0)
    picture = plain.render(camera, look(camera, 0.0, 0.0, 1.1))
    horizon_row = 120 - camera.focal_px * np.tan(np.radians(10.0))
    sky = picture.ids == SKY_ID
    assert sky[: int(horizon_row) - 1].all()
    assert not sky[int(horizon_row) + 3 :].any()
    assert np.isinf(picture.depth_m[sky]).all()
    assert np.isfinite(picture.depth_m[~sky]).all()


def test_a_post_fills_the_columns_it_should(posts: Renderer) -> None:
    camera = lens(pitch_deg=0.0)
    picture = posts.render(camera, look(camera, 0.0, 0.0, 0.5))
    # Tangents to the circle of radius r at distance d: tan = r / sqrt(d^2 - r^2).
    half_px = camera.focal_px * 0.1 / np.sqrt(25 - 0.01)
    columns = np.flatnonzero((picture.ids == 1).any(axis=0))
    assert columns[0] + 0.5 == pytest.approx(160 - half_px, abs=1.0)
    assert columns[-1] + 0.5 == pytest.approx(160 + half_px, abs=1.0)
    assert picture.depth_m[120, 160] == pytest.approx(4.9, abs=0.01)
    assert not (picture.ids == 2).any()  # 45 degrees lies outside half of 75.2 degrees


def test_left_in_the_world_is_left_in_the_picture(posts: Renderer) -> None:
    camera = lens(pitch_deg=0.0)
    picture = posts.render(camera, look(camera, 0.0, 0.0, 0.5, yaw_deg=30.0))
    centre = np.flatnonzero((picture.ids == 2).any(axis=0)).mean() + 0.5
    assert centre == pytest.approx(160 - camera.focal_px * np.tan(np.radians(15.0)), abs=1.0)


def test_no_hole_under_a_camera_close_to_coarse_cells() -> None:
    # Cells of 2 m reach behind the lens: without clipping there would be holes.
    renderer = make_renderer(world(field(40.0, 2.0)))
    for pitch_deg in (25.0, 60.0, 90.0):
        camera = lens(pitch_deg=pitch_deg)
        picture = renderer.render(camera, look(camera, 0.3, 0.2, 0.4))
        below = np.radians(pitch_deg) + np.arctan((np.arange(240) + 0.5 - 120) / camera.focal_px)
        assert (picture.ids[below > 0.05] == GROUND_ID).all()


def test_no_crack_between_levels_of_detail() -> None:
    def bumpy(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.asarray(0.08 * np.sin(9 * x) * np.cos(7 * y) + 0.03 * np.sin(23 * x + 11 * y))

    renderer = make_renderer(world(field(40.0, 0.08, bumpy)))
    camera = lens(pitch_deg=25.0)
    for yaw_deg in range(0, 360, 30):
        picture = renderer.render(camera, look(camera, 1.0, 2.0, 1.2, yaw_deg=yaw_deg))
        assert (picture.ids[40:] == GROUND_ID).all()
        # Seen from above, depth shrinks down the picture but for crests; a crack would be a jump to far behind.
        assert (picture.depth_m[120:] < 4.5).all()


def test_a_tile_further_away_is_drawn_coarser() -> None:
    rng = np.random.default_rng(0)
    ground = field(40.0, 0.08)
    ground.heights_m[:] = 0.01 * rng.standard_normal(ground.heights_m.shape)
    camera = lens()
    pose = look(camera, -18.0, 0.0, 1.1)
    view = View(pose.position_w, np.array([[0, 0, 1.0], [-1, 0, 0], [0, -1, 0]]), camera.focal_px, 320, 240)
    tiles, drops = make_tiles(ground).choose(view)
    distance = np.hypot(tiles[:, 1] * 0.08 - 2.0, tiles[:, 0] * 0.08 - 20.0)
    assert tiles[np.argmin(distance), 2] < tiles[np.argmax(distance), 2]
    assert (drops > 0).all()


@pytest.mark.parametrize("pitch_deg", [-90.0, -30.0, 90.0])
@pytest.mark.parametrize(
    "place", [(0.0, 0.0, 1.0), (10.0, 10.0, 1.0), (9.99, 0.0, 0.3), (30.0, 0.0, 1.0), (0.0, 0.0, -2.0)]
)
def test_any_pose_gives_a_picture(posts: Renderer, pitch_deg: float, place: tuple[float, float, float]) -> None:
    camera = lens(pitch_deg=pitch_deg)
    picture = posts.render(camera, look(camera, *place, yaw_deg=45.0, roll_deg=20.0))
    np.testing.assert_array_equal(np.isinf(picture.depth_m), picture.ids == SKY_ID)
    assert (picture.depth_m > 0).all()


@settings(max_examples=12, deadline=None)
@given(width=st.integers(16, 300), height=st.integers(16, 300), fov_deg=st.floats(10.0, 140.0))
def test_any_size_gives_a_picture_of_that_size(small: Renderer, width: int, height: int, fov_deg: float) -> None:
    camera = CameraModel(width, height, width / 2 / np.tan(np.radians(fov_deg) / 2), pitch_rad=0.4)
    picture = small.render(camera, look(camera, 0.0, 0.0, 1.0))
    assert picture.image.shape == (height, width, 3)
    assert picture.depth_m.shape == picture.ids.shape == (height, width)
    assert [a.dtype.name for a in (picture.image, picture.depth_m, picture.ids)] == ["uint8", "float32", "int32"]


def test_the_largest_picture_is_drawn(small: Renderer) -> None:
    camera = lens(2048, 2048)
    assert small.render(camera, look(camera, 0.0, 0.0, 1.0)).image.shape == (2048, 2048, 3)


@pytest.mark.parametrize("size", [(15, 240), (320, 2049)])
def test_a_size_out_of_range_is_refused(small: Renderer, size: tuple[int, int]) -> None:
    camera = lens(*size)
    with pytest.raises(ValueError, match=r"each side must be 16\.\.2048"):
        small.render(camera, look(camera, 0.0, 0.0, 1.0))


def test_a_focal_length_that_is_no_number_is_refused(small: Renderer) -> None:
    with pytest.raises(ValueError, match="focal length"):
        small.render(CameraModel(32, 32, float("nan")), look(lens(), 0.0, 0.0, 1.0))


def test_the_same_pose_gives_the_same_bytes(small: Renderer) -> None:
    camera = lens()
    first, second = (small.render(camera, look(camera, 0.0, 0.0, 1.0, yaw_deg=5.0)) for _ in range(2))
    np.testing.assert_array_equal(first.image, second.image)
    np.testing.assert_array_equal(first.depth_m, second.depth_m)
