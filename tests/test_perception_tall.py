"""Things taller than the camera, in pictures painted by hand."""

from __future__ import annotations

from math import radians, tan

import numpy as np
import pytest

from perception.tall import ground_hue, tall_things
from worlds.geometry import camera_pose
from worlds.types import ByteArray, CameraModel, Frame, GroundPlane, Pose

HEIGHT_M = 0.8
CAMERA = CameraModel(320, 240, 207.8, (0.0, 0.0, HEIGHT_M), radians(25.0))
LEVEL = GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0]))
SAND, SKY, BASALT = (200, 160, 115), (200, 180, 150), (45, 45, 47)
HORIZON = round(120 - 207.8 * tan(radians(25.0)))  # row


def _picture() -> ByteArray:
    image = np.zeros((240, 320, 3), dtype=np.uint8)
    image[:HORIZON], image[HORIZON:] = SKY, SAND
    return image


def _row(range_m: float) -> int:
    """Row in which ground straight ahead at a range lies."""
    depression = np.arctan2(HEIGHT_M, range_m)
    return round(120 + 207.8 * tan(depression - radians(25.0)))


def _frame(image: ByteArray, pitch: float = 0.0) -> Frame:
    body = Pose(np.zeros(3), np.array([0.0, np.sin(pitch / 2), 0.0, np.cos(pitch / 2)]))
    return Frame(0.0, image, CAMERA, camera_pose(body, CAMERA), LEVEL)


HUE = ground_hue(_frame(_picture()))


def test_the_hue_is_that_of_the_ground_in_light_and_shade() -> None:
    assert pytest.approx((200 - 115) / (200 + 160 + 115), abs=0.01) == HUE
    dim = (_picture() * 0.4).astype(np.uint8)
    assert ground_hue(_frame(dim)) == pytest.approx(HUE, abs=0.01)


def test_bare_ground_under_a_sky_has_nothing_tall() -> None:
    found = tall_things(_frame(_picture()), HUE)
    assert found is not None
    assert not found.columns.any()
    assert not found.covered.any()
    assert np.isinf(found.scan.ranges_m).all()


@pytest.mark.parametrize("range_m", [1.0, 2.0, 4.0])
def test_a_pillar_stands_where_its_foot_is(range_m: float) -> None:
    image = _picture()
    image[: _row(range_m), 140:180] = BASALT
    found = tall_things(_frame(image), HUE)
    assert found is not None
    assert np.array_equal(np.flatnonzero(found.columns), np.arange(140, 180))
    middle = found.scan.ranges_m[160]
    assert middle == pytest.approx(range_m, abs=3 * found.scan.range_sd_m[160])
    assert found.scan.range_sd_m[160] < 0.1 * range_m
    assert found.scan.angles_rad[160] == pytest.approx(0.0, abs=0.01)
    assert found.scan.angles_rad[140] > found.scan.angles_rad[179]  # the left one is farther counter-clockwise
    assert found.covered[100 : _row(range_m) - 2, 145:175].all() or range_m > 2.0
    assert not found.covered[:, :130].any()


def test_a_rock_below_the_horizon_is_left_to_the_rock_pipeline() -> None:
    image = _picture()
    image[_row(3.0) : _row(1.5), 140:180] = BASALT
    found = tall_things(_frame(image), HUE)
    assert found is not None
    assert not found.columns.any()
    assert not found.covered.any()


def test_a_cast_shadow_is_covered_but_no_obstacle() -> None:
    image = _picture()
    image[: _row(2.0), 140:180] = BASALT
    image[_row(2.0) : _row(1.2), 150:220] = tuple(int(0.3 * value) for value in SAND)
    found = tall_things(_frame(image), HUE)
    assert found is not None
    assert found.scan.ranges_m[165] == pytest.approx(2.0, abs=0.2)
    assert np.isinf(found.scan.ranges_m[200])
    assert found.covered[_row(1.6), 160:215].all()


def test_a_wall_that_fills_the_picture_is_as_near_as_the_picture_shows() -> None:
    image = np.zeros((240, 320, 3), dtype=np.uint8)
    image[:] = BASALT
    found = tall_things(_frame(image), HUE)
    assert found is not None
    assert found.columns.all()
    nearest = HEIGHT_M / tan(radians(25.0) + np.arctan2(119.5, 207.8))
    assert found.scan.ranges_m[160] == pytest.approx(nearest, abs=0.02)
    assert found.scan.least_m[160] == found.scan.ranges_m[160]  # nothing nearer is called free


def test_without_a_horizon_in_the_picture_nothing_is_said() -> None:
    assert tall_things(_frame(_picture(), pitch=radians(20.0)), HUE) is None
    with pytest.raises(ValueError, match="without pose"):
        tall_things(Frame(0.0, _picture(), CAMERA), HUE)
