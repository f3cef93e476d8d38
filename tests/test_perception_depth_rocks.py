from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from perception.depth_rocks import placed_blobs, standing_blobs
from perception.knowledge_base import load_knowledge
from perception.pipeline import View, examine, on_ground
from perception.rock_geometry import outlines
from perception.stereo import StereoView, depth_picture
from perception.two_eyes import with_standing
from rover_sim.sim.renderer import make_renderer
from tests.camera_factory import field, lens, look, world
from worlds.geometry import to_the_right
from worlds.types import ByteArray, FloatArray, GroundPlane

CAMERA = lens()
POSE = look(CAMERA, 0.0, 0.0, 1.1)
VIEW = View(CAMERA, POSE, GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0])))
EYES = StereoView(VIEW, (1.0, 1.0), CAMERA.focal_px * 0.12)
POSTS = ((2.0, 0.5, 0.15, 0.4), (2.6, -0.7, 0.2, 0.5), (3.2, 0.2, 0.2, 0.6))  # x, y, radius, height
NOTHING = np.zeros((240, 320), np.int32)
SEEN = np.zeros((240, 320), bool)


def pair_depth(posts: tuple[tuple[float, float, float, float], ...], roll: float = 0.0) -> tuple[ByteArray, FloatArray]:
    """Left picture, and depth by a rendered pair over ground that rolls by ``roll`` metres."""
    ground = field(20.0, 0.1, lambda x, y: roll * np.sin(2.0 * x) * np.cos(1.5 * y))
    renderer = make_renderer(world(ground, cylinders=posts))
    left, right = (renderer.render(CAMERA, to_the_right(POSE, off)).image for off in (0.0, 0.12))
    return left, depth_picture(left, right, CAMERA, (1.0, 1.0), 0.12)


@pytest.mark.parametrize("roll", [0.0, 0.05])
def test_posts_that_no_texture_told_of_are_found_by_depth(roll: float) -> None:
    _, depth = pair_depth(POSTS, roll)
    blobs, height = standing_blobs(depth, NOTHING, SEEN, EYES)
    found = placed_blobs(blobs, outlines(blobs, 1.25), depth, height, EYES)
    assert len(found) == len(POSTS)
    for x, y, radius, tall in POSTS:
        rock = min(found, key=lambda rock: float(np.hypot(rock.position_w[0] - x, rock.position_w[1] - y)))
        assert np.hypot(rock.position_w[0] - x, rock.position_w[1] - y) < 2.0 * rock.position_sd_m + roll
        assert rock.length_m == pytest.approx(2.0 * radius, rel=0.3)
        assert abs(rock.height_m - tall) < 0.15 * tall + roll + 0.03
        assert 0.5 <= rock.certainty <= 0.95
        assert rock.range_m == pytest.approx(np.hypot(*rock.position_w[:2]), abs=0.02)


@pytest.mark.parametrize("roll", [0.0, 0.05])
def test_nothing_stands_out_of_bare_ground(roll: float) -> None:
    _, depth = pair_depth((), roll)
    assert len(standing_blobs(depth, NOTHING, SEEN, EYES)[0]) == 0


def test_what_texture_told_of_or_nobody_matched_is_not_told_again() -> None:
    _, depth = pair_depth(POSTS)
    blobs, _ = standing_blobs(depth, NOTHING, SEEN, EYES)
    first = np.where(blobs.labels == 1, 1, 0).astype(np.int32)
    assert len(standing_blobs(depth, first, SEEN, EYES)[0]) == len(POSTS) - 1
    assert len(standing_blobs(depth, NOTHING, ~SEEN, EYES)[0]) == 0
    assert len(standing_blobs(np.full((240, 320), np.nan), NOTHING, SEEN, EYES)[0]) == 0


def test_they_join_the_rocks_of_the_picture() -> None:
    picture, depth = pair_depth(POSTS)
    knowledge = load_knowledge("rendered")
    seen = on_ground(examine(picture, knowledge, VIEW), VIEW, 0.0, knowledge)
    blind = replace(
        seen,
        rocks=(),
        labels=NOTHING,
        mask=SEEN,
        outlines=outlines(standing_blobs(depth, NOTHING, ~SEEN, EYES)[0], 1.25),
    )
    found = with_standing(blind, depth, EYES, knowledge)
    assert [rock.id for rock in found.rocks] == [1, 2, 3]
    assert found.observation is not None
    assert found.observation.rocks == tuple(rock.placed for rock in found.rocks)
    assert len(found.outlines.area_px) == 3
    for rock in found.rocks:
        assert (found.labels == rock.id).sum() == rock.area_px
    again = with_standing(found, depth, EYES, knowledge)
    assert again.rocks == found.rocks
