"""Ranges from two cameras side by side: what one camera has to take from the ground plane, two measure.

The cameras are equal pinholes with parallel axes, the second one ``baseline`` to the right, so a point at depth Z lies
f B / Z pixels farther left in the second picture (its disparity). Matching is OpenCV's semi-global one (Hirschmueller,
IEEE Trans. PAMI 30(2), 2008).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from perception.camera import project
from perception.ground import ground_points
from perception.rock_placement import View
from worlds.types import BoolArray, ByteArray, FloatArray, PerceivedRock

DISPARITY_SD_PX = 0.35
FORM_SD_M = 0.05  # of a rock's centre against its near face
_DISPARITIES = 64  # of the working picture; nearer than f B / 64 nothing is measured
_BLOCK_PX = 5
_STEPS = 16.0  # of OpenCV's fixed point
_FOOT_SHARE, _LEAST_PX = 0.35, 6  # of the rock's rows, from the bottom, that show its near face


@dataclass(frozen=True, eq=False)
class StereoView:
    """The left camera's view, input pixels per working pixel, and focal length times baseline in working px m."""

    view: View
    scale: tuple[float, float]
    focal_baseline: float

    def place_sd(self, depth_m: float) -> float:
        """One sigma in metres of the place of a rock whose near face has a depth."""
        return float(np.hypot(FORM_SD_M, DISPARITY_SD_PX * depth_m**2 / self.focal_baseline))


def depth_picture(left: ByteArray, right: ByteArray, focal_px: float, baseline_m: float) -> FloatArray:
    """Depth (H, W) in metres along the left camera's axis; NaN where nothing could be matched."""
    grey = [
        p if p.ndim == 2 else np.asarray(cv2.cvtColor(p, cv2.COLOR_RGB2GRAY), dtype=np.uint8) for p in (left, right)
    ]
    # The matcher leaves out the columns whose partner might lie outside: give it room there.
    wide = [cv2.copyMakeBorder(p, 0, 0, _DISPARITIES, 0, cv2.BORDER_REPLICATE) for p in grey]
    matcher = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=_DISPARITIES,
        blockSize=_BLOCK_PX,
        P1=8 * _BLOCK_PX**2,
        P2=32 * _BLOCK_PX**2,
        disp12MaxDiff=1,
        uniquenessRatio=10,
        speckleWindowSize=50,
        speckleRange=2,
    )
    disparity = matcher.compute(wide[0], wide[1])[:, _DISPARITIES:] / _STEPS
    return np.asarray(focal_px * baseline_m / np.where(disparity > 0, disparity, np.nan))


def refined(rock: PerceivedRock, depth_m: FloatArray, shown: BoolArray, eyes: StereoView) -> PerceivedRock:
    """A placed rock moved along its line of sight to where its near face is seen, as far as both can be trusted.

    ``depth_m`` and ``shown`` (H, W) are of the working picture. One picture knows a rock but for its scale: at k times
    the distance everything about it is k times as large. k from the depth of its foot and 1 from the ground plane are
    averaged by their variances. A rock without enough depths stays where it was.
    """
    rows, columns = np.nonzero(shown)
    foot = rows >= rows.max() - _FOOT_SHARE * (rows.max() - rows.min() + 1)
    depths = depth_m[rows[foot], columns[foot]]
    depths = depths[np.isfinite(depths)]
    if len(depths) < _LEAST_PX:
        return rock
    seen = float(np.median(depths))
    believed = _ground_depth(eyes, float(columns[foot].mean()) + 0.5, float(rows.max()) + 1.0)
    if not believed > 0.0:
        return rock
    sd = eyes.place_sd(seen)
    trust = rock.position_sd_m**2 / (rock.position_sd_m**2 + sd**2)
    scale = 1.0 + trust * (seen / believed - 1.0)
    return _scaled(rock, scale, eyes.view.pose.position_w, float(np.sqrt(trust) * sd))


def _ground_depth(eyes: StereoView, column: float, row: float) -> float:
    """Depth at which the ray of a working pixel meets the believed ground; NaN over the horizon."""
    view = eyes.view
    pixel = np.array([column * eyes.scale[0], row * eyes.scale[1]])
    point = ground_points(view.camera, view.pose, view.plane, pixel)
    return float(project(view.camera, view.pose, point)[1])


def _scaled(rock: PerceivedRock, scale: float, eye_w: FloatArray, sd_m: float) -> PerceivedRock:
    x, y, z = (eye_w + scale * (np.array(rock.position_w) - eye_w)).tolist()
    return replace(
        rock,
        position_w=(x, y, z),
        length_m=rock.length_m * scale,
        width_m=rock.width_m * scale,
        height_m=rock.height_m * scale,
        height_sd_m=rock.height_sd_m * scale,
        range_m=rock.range_m * scale,
        position_sd_m=sd_m,
    )
