from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.camera import project, rays_c
from perception.ground import ground_points, ground_range
from perception.knowledge_base import GroundKnowledge
from perception.rock_geometry import RockOutlines
from perception.rock_placement import (
    View,
    base_diameter,
    breadth_and_depth,
    extents,
    grazed_height,
    grazed_sd,
    place_rocks,
)
from worlds.geometry import camera_pose, quaternion_from_euler
from worlds.types import CameraModel, FloatArray, GroundPlane, PerceivedRock, Pose

CAMERA = CameraModel(320, 240, 207.8, (0.0, 0.0, 1.1), float(np.deg2rad(25.0)))
LEVEL = GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0]))


def view(yaw: float = 0.0) -> View:
    return View(CAMERA, camera_pose(Pose(np.zeros(3), quaternion_from_euler(0.0, 0.0, yaw)), CAMERA), LEVEL)


def dome_outline(seen: View, x: float, y: float, radius: float, height: float) -> RockOutlines:
    """Outline of half an ellipsoid of revolution, from its projected surface."""
    around, up = np.meshgrid(np.linspace(0, 2 * np.pi, 121), np.linspace(0, np.pi / 2, 61))
    surface: FloatArray = np.stack(
        [
            x + radius * np.cos(up) * np.cos(around),
            y + radius * np.cos(up) * np.sin(around),
            height * np.sin(up),
        ],
        axis=-1,
    ).reshape(-1, 3)
    pixels, _ = project(seen.camera, seen.pose, surface)
    area = cv2.contourArea(cv2.convexHull(pixels.astype(np.float32)))
    (left, top), (right, base) = pixels.min(axis=0), pixels.max(axis=0)
    return RockOutlines(
        np.zeros(1, np.int32), np.zeros(1), np.zeros((1, 9)), *(np.array([v]) for v in (left, right, top, base, area))
    )


def place(seen: View, shape: RockOutlines, know: GroundKnowledge | None = None) -> PerceivedRock | None:
    return place_rocks(seen, shape, np.array([0.9]), np.array([False]), (1.0, 1.0), know or GroundKnowledge())[0]


@given(st.floats(1.5, 6.0), st.floats(-0.35, 0.35), st.floats(0.1, 0.35), st.floats(0.6, 1.0), st.floats(-3.0, 3.0))
def test_a_dome_is_found_where_it_stands(away: float, bearing: float, radius: float, flat: float, yaw: float) -> None:
    seen = view(yaw)
    x, y = away * np.cos(yaw + bearing), away * np.sin(yaw + bearing)
    rock = place(seen, dome_outline(seen, x, y, radius, flat * radius))
    assert rock is not None
    assert np.hypot(rock.position_w[0] - x, rock.position_w[1] - y) < 0.03 + 0.25 * radius
    assert rock.position_w[2] == pytest.approx(0.0, abs=1e-9)
    assert np.sqrt(rock.length_m * rock.width_m) == pytest.approx(2 * radius, rel=0.12)
    assert rock.height_m == pytest.approx(flat * radius, abs=0.25 * radius)
    assert rock.range_m == pytest.approx(np.hypot(rock.position_w[0], rock.position_w[1]))
    assert rock.position_sd_m > 0


def test_the_tangent_formula_worked_by_hand() -> None:
    # Camera 1 m up, near edge at 2 m, half depth 0.5, height 0.4: the grazing ray falls with slope s where
    # (1 - 2.5 s)^2 = 0.16 + 0.25 s^2, so 6 s^2 - 5 s + 0.84 = 0 and s = 0.2333.
    slope = (5 - np.sqrt(25 - 4 * 6 * 0.84)) / 12
    height = grazed_height(1.0, np.array([2.0]), np.array([0.5]), np.array([slope]))
    assert height[0] == pytest.approx(0.4)


def test_the_silhouette_of_a_dome_worked_by_hand() -> None:
    # From right above, the near edge half a metre behind, a dome of diameter 1 covers its base: at 10 m a tenth of the
    # root of pi / 4.
    spread = np.sqrt(np.pi / 4) / 10.0
    assert base_diameter(10.0, np.array([-0.5]), np.array([spread]), np.array([0.38]))[0] == pytest.approx(
        1.0, abs=1e-3
    )
    # From the side of level ground it is half an ellipse of 1 by 0.38 m; its middle is 10.5 m away.
    for share in (0.38, 0.5):
        spread = np.sqrt(np.pi / 4 * share) / 10.5
        diameter = base_diameter(1e-9, np.array([10.0]), np.array([spread]), np.array([share]))
        assert diameter[0] == pytest.approx(1.0, abs=1e-3)


@given(st.floats(1.5, 6.0), st.floats(0.05, 0.35), st.floats(0.25, 0.5))
def test_a_known_form_has_its_diameter_without_bias(away: float, radius: float, share: float) -> None:
    seen = view()
    shape = dome_outline(seen, away, 0.0, radius, 2.0 * share * radius)
    centre = float(shape.left_px[0] + shape.right_px[0]) / 2.0
    near = ground_points(seen.camera, seen.pose, seen.plane, np.array([[centre, shape.base_px[0]]]))
    aslant = np.linalg.norm(rays_c(seen.camera, np.array([centre, float(shape.base_px[0])])))
    spread = np.sqrt(shape.area_px / aslant**3) / seen.camera.focal_px
    diameter = base_diameter(seen.height_m, ground_range(seen.pose, seen.plane, near), spread, np.array([share]))
    assert diameter[0] == pytest.approx(2.0 * radius, rel=0.04)


def test_breadth_and_depth_share_the_area_of_the_base() -> None:
    breadth, depth = breadth_and_depth(np.array([0.4, 1.0, 0.1]), np.array([0.4, 0.8, 0.5]))
    assert breadth == pytest.approx([0.4, 1.0, 0.1])
    assert depth == pytest.approx([0.4, 0.64, 0.2])  # the post is taken as twice as deep as broad at most


def test_the_error_of_a_grazed_height_is_that_of_its_rows_and_its_depth() -> None:
    one = np.ones(1)
    away, depth, fall = 2.0 * one, 0.2 * one, 0.4 * one
    height = grazed_height(1.1, away, depth, fall)
    by_row = (grazed_height(1.1, away - 0.0005, depth, fall) - grazed_height(1.1, away + 0.0005, depth, fall)) / 0.0004
    by_depth = (grazed_height(1.1, away, depth - 0.001, fall) - grazed_height(1.1, away, depth + 0.001, fall)) / 0.002
    rows_only = grazed_sd(1.1, away, depth, fall, height, 0.01 * one)
    both = np.hypot(by_row * np.sqrt(1.0 + 0.4**2) * 0.01, by_depth * 0.4 * 0.2)
    assert rows_only == pytest.approx(both, rel=1e-3)


def seen_from_above_a_post(height: float, row_m: float) -> tuple[float, float]:
    """Height, and its sigma, of something 0.4 m broad whose top is seen over ``height`` at 3 m."""
    one = np.ones(1)
    fall = (1.1 - height) / 3.2 * one
    spread = np.sqrt(np.pi / 8 * 0.4**2 * (np.hypot(2 * height / 0.4 * 0.94, 0.34) + 0.34)) / 3.4
    _, _, found, sd = extents(1.1, 3.0 * one, spread * one, 0.4 * one, fall, row_m * one)
    return float(found[0]), float(sd[0])


def test_a_height_lies_between_what_was_measured_and_what_is_usual_but_a_post_stays_a_post() -> None:
    sharp, blurred = seen_from_above_a_post(0.2, 0.001), seen_from_above_a_post(0.2, 1.0)
    assert sharp[1] < blurred[1] < 0.07 * 0.45
    assert abs(blurred[0] / 0.4 - 0.38) < 0.05
    assert sharp[0] > blurred[0]
    assert seen_from_above_a_post(0.9, 0.01)[0] > 0.75


def test_far_and_tiny_rocks_are_left_out() -> None:
    seen = view()
    assert place(seen, dome_outline(seen, 10.1, 0.0, 0.3, 0.2)) is None
    assert place(seen, dome_outline(seen, 3.0, 0.0, 0.05, 0.03)) is not None
    assert place(seen, dome_outline(seen, 3.0, 0.0, 0.05, 0.03), GroundKnowledge(min_diameter_m=0.15)) is None


def test_a_base_line_above_the_horizon_is_nowhere() -> None:
    one = np.ones(1)
    shape = RockOutlines(np.zeros(1, np.int32), one, np.ones((1, 9)), *(v * one for v in (100, 120, 2, 10, 150)))
    assert place(view(), shape) is None
