"""Tiles, things on the ground and what is left out of a frame."""

from __future__ import annotations

import numpy as np
import pytest

from rover_sim.sim.raster_scene import STRIDES, View, make_apron, make_tiles
from rover_sim.sim.rasteriser import Rasteriser
from rover_sim.sim.stone_store import StoneStore
from tests.camera_factory import field, lens, look, world
from worlds.geometry import rotation_from_quaternion
from worlds.types import FloatArray, HeightField


def ahead(x: float = 0.0) -> View:
    """A level camera at (x, 0, 1) that looks along +x."""
    camera = lens(pitch_deg=0.0)
    pose = look(camera, x, 0.0, 1.0)
    return View(pose.position_w, rotation_from_quaternion(pose.quaternion_w), camera.focal_px, 320, 240)


def test_a_point_is_projected_where_it_should() -> None:
    # 4 m ahead, 1 m left, 0.5 m down: column 160 - f / 4, row 120 + f / 8, key 1 / 4.
    view = ahead()
    u, v, w, k = view.matrix() @ [4.0, 1.0, 0.5, 1.0]
    assert (u / w, v / w, k / w) == pytest.approx((160 - view.focal_px / 4, 120 + view.focal_px / 8, 0.25))


def test_spheres_in_and_out_of_sight() -> None:
    centres = np.array([[5.0, 0, 1], [-5.0, 0, 1], [5.0, 5.0, 1], [5.0, 5.0, 1], [0.0, 0, 1]])
    radii = np.array([0.1, 0.1, 0.1, 1.5, 0.1])
    # At 5 m the view is 3.85 m to each side; the fourth sphere reaches into it, the last one surrounds the lens.
    np.testing.assert_array_equal(ahead().sees(centres, radii), [True, False, False, True, True])


def test_tiles_cover_the_map_and_know_their_error() -> None:
    heights = np.zeros((70, 101))
    heights[40, 50] = 0.3
    tiles = make_tiles(HeightField(heights, 0.1, (0.0, 0.0)))
    assert len(tiles.corner) == 3 * 4
    assert (np.diff(tiles.error_m, axis=1) >= 0).all()
    spiky = (tiles.corner == [32, 32]).all(axis=1)
    # Row 40, column 50 is drawn with strides 1 and 2, and missed from stride 4 on.
    errors = tiles.error_m[spiky][0]
    assert errors[0] == 0.0
    assert errors[STRIDES.index(4)] >= 0.3 - 1e-12
    assert (tiles.error_m[~spiky][:, :3] == 0).all()


def test_flat_ground_is_drawn_with_the_coarsest_stride() -> None:
    tiles, _ = make_tiles(field(20.0, 0.1)).choose(ahead())
    assert (tiles[:, 2] == STRIDES[-1]).all()


def test_tiles_behind_the_camera_are_left_out() -> None:
    tiles, _ = make_tiles(field(20.0, 0.1)).choose(ahead(x=3.0))
    # Bounding spheres of tiles of 3.2 m have a radius of 2.27 m.
    assert (tiles[:, 1] * 0.1 - 10.0 + 1.6 + 2.27 >= 3.0).all()


def test_things_are_made_when_the_camera_comes_near() -> None:
    store = StoneStore(world(rocks=[(3.0, 0.0, 0.3, 0.2), (-40.0, 1.0, 0.5, 0.4)], ground=field(90.0, 0.5)).shapes)
    assert store.owner.tolist() == [1, 2]
    assert store.centre_w[:, :2].tolist() == [[3.0, 0.0], [-40.0, 1.0]]
    assert len(store.faces) == 0
    assert len(store.choose(ahead())) == 1
    assert {int(block) for block in store.face_block} == {0, 1}  # the other one is behind the camera, but not far
    before = store.faces.copy()
    assert store.choose(ahead(3.9)).shape == (0, 4)
    np.testing.assert_array_equal(store.faces, before)
    store.choose(ahead(-38.0))
    assert len(store.faces) > len(before)
    np.testing.assert_array_equal(store.faces[: len(before)], before)


def test_a_chosen_range_holds_one_thing_and_its_own_vertices() -> None:
    store = StoneStore(world(rocks=[(3.0, 0.0, 0.3, 0.2), (4.0, 1.0, 0.5, 0.4), (8.0, 0.5, 0.1, 0.1)]).shapes)
    chosen = store.choose(ahead())
    assert len(chosen) == 3
    for place, (first, last, first_face, last_face) in enumerate(chosen):
        used = store.faces[first_face:last_face]
        assert (used.min(), used.max()) == (first, last - 1)
        assert (store.face_block[first_face:last_face] == place).all()
        corners = store.vertices_w[used]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        np.testing.assert_allclose(store.normals[first_face:last_face], normal, atol=1e-6)


def test_a_full_store_forgets_and_draws_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    made = world(rocks=[(3.0, 0.0, 0.3, 0.2), (9.0, 1.0, 0.5, 0.4)])
    camera = lens(64, 48, pitch_deg=10.0)
    fresh = Rasteriser(made).render(camera, look(camera, 6.0, 0.0, 1.0))
    monkeypatch.setattr("rover_sim.sim.stone_store.MOST_FACES", 0)
    used = Rasteriser(made)
    used.render(camera, look(camera, 0.0, 0.0, 1.0))
    again = used.render(camera, look(camera, 6.0, 0.0, 1.0))
    for name in ("image", "depth_m", "ids"):
        np.testing.assert_array_equal(getattr(again, name), getattr(fresh, name))


def test_far_rocks_are_drawn_with_fewer_faces_and_the_smallest_not_at_all() -> None:
    store = StoneStore(world(rocks=[(2.0, 0.0, 0.3, 0.2), (9.0, 0.0, 0.1, 0.1), (9.5, 1.0, 0.02, 0.02)]).shapes)

    def faces(x: float) -> list[int]:
        return [int(last - first) for _, _, first, last in store.choose(ahead(x))]

    fine, coarse, octahedron = 24 + 2 * 24 * 6 + 24, 12 + 2 * 12 * 3 + 12, 8
    assert faces(0.0) == [fine, coarse, coarse]
    assert faces(-30.0) == [coarse, octahedron, octahedron]
    assert faces(-200.0) == [octahedron]


def test_a_world_without_rocks_has_nothing_to_choose() -> None:
    assert StoneStore(world().shapes).choose(ahead()).shape == (0, 4)


def test_a_large_world_has_the_shadows_around_the_camera() -> None:
    # A post of 2 m, the sun 30 degrees high in the west: its shadow is 3.46 m long, wherever the camera has been.
    def brightness(x: float, visited: float | None = None) -> tuple[float, float]:
        renderer = Rasteriser(world(field(240.0, 0.5), cylinders=[(x, 0.0, 0.5, 2.0)], sun=(180.0, 30.0)))
        camera = lens(120, 120, pitch_deg=90.0)
        if visited is not None:
            renderer.render(camera, look(camera, visited, 0.0, 5.0))
        image = renderer.render(camera, look(camera, x + 4.0, 0.0, 5.0)).image.astype(float).mean(axis=2)
        # Looking down, the top of the picture is where the camera heads, east.
        row = round(60 + 2.0 / 5.0 * camera.focal_px)
        return float(image[row, 55:65].mean()), float(image[20, 55:65].mean())

    for shade, light in (brightness(0.0), brightness(90.0), brightness(90.0, visited=-100.0)):
        assert shade < 0.75 * light


def test_the_apron_faces_up_and_starts_at_the_edge() -> None:
    ground = field(10.0, 0.5)
    apron = make_apron(ground)
    a, b, c = (apron.vertices_m[apron.faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    assert (normal[:, 2] > 0).all()
    # Its area on the plan is that of both squares of ring width without the map.
    assert normal[:, 2].sum() / 2 == pytest.approx(610.0**2 - 10.0**2, rel=1e-3)


def test_new_heights_show_in_the_next_picture() -> None:
    ground = field(10.0, 0.25)
    renderer = Rasteriser(world(ground))
    camera = lens(64, 48, pitch_deg=90.0)
    pose = look(camera, 0.0, 0.0, 3.0)
    assert float(renderer.render(camera, pose).depth_m[24, 32]) == pytest.approx(3.0, abs=1e-3)
    renderer.update_ground(ground.heights_m + 0.5)
    assert float(renderer.render(camera, pose).depth_m[24, 32]) == pytest.approx(2.5, abs=1e-3)
    with pytest.raises(ValueError, match="heights of shape"):
        renderer.update_ground(np.zeros((3, 3)))


def test_a_new_mound_casts_a_shadow() -> None:
    ground = field(10.0, 0.1)
    renderer = Rasteriser(world(ground, sun=(0.0, 30.0)))
    camera = lens(240, 240, pitch_deg=90.0)
    pose = look(camera, 0.0, 0.0, 4.0)
    before = renderer.render(camera, pose).image.astype(float)
    heights: FloatArray = ground.heights_m.copy()
    heights[45:56, 48:53] = 0.4
    renderer.update_ground(heights)
    after = renderer.render(camera, pose).image.astype(float)
    # West of the mound, 0.5 m from its middle: half way down its shadow of 0.69 m.
    row = round(120 + 0.5 / 4.0 * camera.focal_px)
    assert after[row, 110:130].mean() < 0.75 * before[row, 110:130].mean()
