from __future__ import annotations

import numpy as np
import pytest

from perception.ground import height_over
from rover_sim.learning.rendered_views import RenderedView, make_world, plane_around, rendered_views
from worlds.types import HeightField


@pytest.fixture(scope="module")
def view() -> RenderedView:
    return next(rendered_views(make_world(7, 0.0), 1))


def test_a_rock_in_the_open_covers_what_its_outline_covers(view: RenderedView) -> None:
    rocks = view.rocks
    # Those whose box of pixels touches no other rock's are hidden by nothing; a hull is slightly larger than a rock.
    open_ones = [i for i in np.flatnonzero(rocks.seen_px >= 60) if not rocks.cut[i] and alone(view, int(rocks.ids[i]))]
    assert len(open_ones) >= 3
    assert rocks.seen_share[open_ones] == pytest.approx(1.0, abs=0.15)


def alone(view: RenderedView, identity: int) -> bool:
    rows, columns = np.nonzero(view.truth.ids == identity)
    around = view.truth.ids[rows.min() - 1 : rows.max() + 2, columns.min() - 1 : columns.max() + 2]
    return set(np.unique(around)) <= {0, identity}


def test_a_rock_is_cut_where_the_border_shows_it(view: RenderedView) -> None:
    ids, rocks = view.truth.ids, view.rocks
    border = set(np.concatenate([ids[0], ids[-1], ids[:, 0], ids[:, -1]]).tolist())
    for identity, cut in zip(rocks.ids.tolist(), rocks.cut, strict=True):
        assert cut or identity not in border


def test_ranges_are_level_distances_from_the_camera(view: RenderedView) -> None:
    assert view.frame.camera_pose is not None
    eye, first = view.frame.camera_pose.position_w, view.rocks.position_w[0]
    assert view.rocks.range_m[0] == pytest.approx(np.hypot(first[0] - eye[0], first[1] - eye[1]))
    assert (view.rocks.range_m <= 12.0).all()


def test_views_repeat_and_the_believed_plane_may_be_wider() -> None:
    world = make_world(4, 0.06)
    near, wide = next(rendered_views(world, 1)), next(rendered_views(world, 1, plane_reach_m=4.0))
    again = next(rendered_views(world, 1))
    assert (near.frame.image == again.frame.image).all()
    assert (near.frame.image == wide.frame.image).all()
    assert near.frame.ground is not None
    assert wide.frame.ground is not None
    assert wide.frame.ground.point_w == pytest.approx(near.frame.ground.point_w)
    assert not np.allclose(wide.frame.ground.normal_w, near.frame.ground.normal_w)


def test_a_plane_is_the_ground_where_the_ground_is_one() -> None:
    x = np.arange(-5.0, 5.1, 0.5)
    ground = HeightField(np.tile(0.1 * x, (len(x), 1)), 0.5, (-5.0, -5.0))
    plane = plane_around(ground, 1.0, 2.0, 3.0)
    assert plane.point_w == pytest.approx([1.0, 2.0, 0.1])
    assert plane.normal_w == pytest.approx(np.array([-0.1, 0.0, 1.0]) / np.hypot(0.1, 1.0))
    assert height_over(plane, np.array([3.0, -4.0, 0.3])) == pytest.approx(0.0, abs=1e-9)
