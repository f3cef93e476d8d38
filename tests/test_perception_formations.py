from __future__ import annotations

import cv2
import numpy as np
import pytest

from perception.blobs import find_blobs
from perception.rock_geometry import RockOutlines, outlines
from worlds import rock_shape as shapes
from worlds.types import FloatArray


def from_above(formation: int, yaw_rad: float, profile: FloatArray) -> RockOutlines:
    """What is measured in the outline of a rock of 66 pixels, seen from above."""
    length, width = shapes.base_extents(formation, 66.0)
    base = shapes.outlines(profile[None], *(np.array([v]) for v in (length, width, yaw_rad)))[0]
    picture = np.zeros((140, 140), dtype=np.uint8)
    corners = np.column_stack([70.0 + base[:, 0], 70.0 - base[:, 1]])
    cv2.fillPoly(picture, [np.rint(corners - 0.5).astype(np.int32)], (1,))
    return outlines(find_blobs(picture > 0), 1.25)


@pytest.mark.parametrize("formation", range(1, 10))
def test_each_formation_is_told_and_its_nine_diameters_come_back(formation: int) -> None:
    yaw, profile = (formation - 0.5) * shapes.SECTOR_RAD, shapes.PROFILES[formation]
    shape = from_above(formation, yaw, profile)
    length, width = shapes.base_extents(formation, 66.0)
    assert shape.formation[0] == formation
    assert shape.length_px[0] == pytest.approx(length, abs=4.0)
    # The tips close within half a pixel, where a probe and a profile differ most.
    assert shape.sections_px[0, 1:8] / width == pytest.approx(profile[1:8], abs=0.12)


def test_a_hemisphere_is_round_whichever_way_it_is_turned() -> None:
    shape = from_above(0, 0.3, shapes.PROFILES[0])
    assert shape.formation[0] == 0
    assert shape.area_px[0] == pytest.approx(np.pi / 4 * 66.0**2, rel=0.05)
    assert shape.sections_px[0, 4] == pytest.approx(66.0, abs=2.0)
