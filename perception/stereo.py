"""Ranges from two cameras side by side: what one camera has to take from the ground plane, two measure.

The cameras are equal with parallel axes, the second one ``baseline`` to the right, so a point at depth Z lies f B / Z
pixels farther left in the second picture of a pinhole (its disparity). Matching is OpenCV's semi-global one
(Hirschmueller, IEEE Trans. PAMI 30(2), 2008) along all eight directions: without those from below, as in OpenCV's
default, ground that falls away from the camera comes out 0.2 pixels too far.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import cv2
import numpy as np

from perception.camera import grid_rays_c
from perception.fine_disparity import SingleArray, sharpened
from perception.ground_planes import GroundPlanes, ground_planes
from perception.lens import distort
from perception.rock_placement import View
from worlds.geometry import rotation_from_quaternion
from worlds.types import BoolArray, ByteArray, CameraModel, FloatArray, IntArray

DISPARITY_SD_PX, SHARED_SD_PX = 0.15, 0.08  # one sigma of a pixel alone, and of what all pixels share
FORM_SD_M = 0.05  # of a rock's centre against its near face
_DISPARITIES = 64  # of the working picture; nearer than f B / 64 nothing is measured
_BLOCK_PX = 5
_OUTSIDE_PX = _BLOCK_PX // 2 + 1  # so near the rim of the second picture a partner is not seen whole
_STEPS = 16.0  # of OpenCV's fixed point
_AROUND_PX = (31, 9)  # of the picture whose ground is averaged
_RIM_PX = 5  # about rocks: their depths spill over by half a block
_LEAST_GROUND_PX = 40
PLANES_M = 4.0  # farther ground is measured too badly for planes of its own
LEVEL_SD_M = 0.01  # between the ground beside a rock and under it


@dataclass(frozen=True, eq=False)
class StereoView:
    """The left camera's view, input pixels per working pixel, and focal length times baseline in working px m."""

    view: View
    scale: tuple[float, float]
    focal_baseline: float

    def place_sd(self, depth_m: float) -> float:
        """One sigma in metres of the place of a rock whose near face has a depth."""
        disparity_sd = np.hypot(DISPARITY_SD_PX, SHARED_SD_PX)
        return float(np.hypot(FORM_SD_M, disparity_sd * depth_m**2 / self.focal_baseline))


@dataclass(frozen=True, eq=False)
class MeasuredGround:
    """Ground around each pixel (H, W) over the believed plane, in metres, where no rock hides it."""

    height_m: FloatArray  # NaN where too little of it was matched
    sd_m: FloatArray
    over_m: FloatArray  # heights of the points of the pixels themselves, rocks and all
    planes: GroundPlanes  # what rocks stand on
    slope_sd: float  # how far it leaves the plane in this picture, one sigma as a share of the range


def depth_picture(
    left: ByteArray,
    right: ByteArray,
    camera: CameraModel,
    scale: tuple[float, float],
    baseline_m: float,
    labels: IntArray | None = None,
) -> FloatArray:
    """Depth (H, W) in metres along the left camera's axis; NaN where nothing could be matched.

    ``scale`` makes pixels of the ``camera`` of the pictures'. Pictures through a lens are matched as a pinhole of the
    same focal length would have taken them, and the depths brought back to the pixels that they belong to. ``labels``
    (H, W) of rocks, if known, keep the depths of rocks and ground apart (`perception.fine_disparity`).
    """
    grey = [
        p if p.ndim == 2 else np.asarray(cv2.cvtColor(p, cv2.COLOR_RGB2GRAY), dtype=np.uint8) for p in (left, right)
    ]
    focal_baseline = camera.focal_px / scale[0] * baseline_m
    if camera.lens is None:
        return focal_baseline / _disparity(grey[0], grey[1], labels)
    there, back = _rectifying(camera, (left.shape[0], left.shape[1]), scale)
    flat = [cv2.remap(p, there[0], there[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for p in grey]
    if labels is not None:
        labels = np.asarray(cv2.remap(labels.astype(np.int16), there[0], there[1], cv2.INTER_NEAREST), np.int32)
    depth = focal_baseline / _disparity(np.asarray(flat[0], np.uint8), np.asarray(flat[1], np.uint8), labels)
    depth[np.isnan(there[0])] = np.nan
    return np.asarray(
        cv2.remap(depth, back[0], back[1], cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=np.nan)
    )


def _disparity(left: ByteArray, right: ByteArray, labels: IntArray | None) -> FloatArray:
    found = _matched(left, right)
    return np.asarray(found if labels is None else sharpened(found, left, right, labels), dtype=np.float64)


def _matched(left: ByteArray, right: ByteArray) -> SingleArray:
    # The matcher leaves out the columns whose partner might lie outside: give it room there.
    wide = [cv2.copyMakeBorder(p, 0, 0, _DISPARITIES, 0, cv2.BORDER_REPLICATE) for p in (left, right)]
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
        mode=cv2.STEREO_SGBM_MODE_HH,
    )
    disparity = matcher.compute(wide[0], wide[1])[:, _DISPARITIES:] / _STEPS
    # What the second eye does not see is matched to the room given, and towers over the ground.
    seen = disparity <= np.arange(disparity.shape[1]) - _OUTSIDE_PX
    return np.where((disparity > 0) & seen, disparity, np.nan).astype(np.float32)


@lru_cache(maxsize=4)
def _rectifying(
    camera: CameraModel, shape: tuple[int, int], scale: tuple[float, float]
) -> tuple[SingleArray, SingleArray]:
    """Maps (2, H, W) for `cv2.remap`: from the picture to that of the pinhole, and back."""
    assert camera.lens is not None
    middle = np.array([camera.width_px, camera.height_px]) / 2.0
    columns, rows = (np.arange(n) + 0.5 for n in shape[::-1])
    ideal = (np.stack(np.meshgrid(columns, rows), axis=-1) * scale - middle) / camera.focal_px
    seen = distort(camera.lens, ideal) * camera.focal_px * [1.0, camera.lens.aspect] + camera.lens.centre_px
    rays = grid_rays_c(camera, shape)
    pinhole = rays[..., :2] / rays[..., 2:] * camera.focal_px + middle
    there, back = (np.moveaxis(p / scale - 0.5, -1, 0).astype(np.float32) for p in (seen, pinhole))
    return np.asarray(there, np.float32), np.asarray(back, np.float32)


def measured_ground(depth_m: FloatArray, labels: IntArray, hidden: BoolArray, eyes: StereoView) -> MeasuredGround:
    """The ground beside rocks, averaged over a small part of the picture around each pixel (H, W)."""
    over, high = point_heights(depth_m, eyes), eyes.view.height_m
    rocks = cv2.dilate((labels > 0).astype(np.uint8), np.ones((_RIM_PX, _RIM_PX), np.uint8)) > 0
    ground = np.isfinite(over) & ~rocks & ~hidden
    height, count = window_mean(over, ground, _AROUND_PX)
    height = np.where(count >= _LEAST_GROUND_PX, height, np.nan)
    disparity_sd = np.hypot(SHARED_SD_PX, DISPARITY_SD_PX / np.sqrt(np.maximum(count / _BLOCK_PX**2, 1.0)))
    believed = high / np.maximum(_fall(depth_m, eyes), 1e-3)
    sd = np.hypot(LEVEL_SD_M, disparity_sd * believed * high / eyes.focal_baseline)
    known = ground & np.isfinite(height)
    excess = (height[known] ** 2 - sd[known] ** 2) / (believed[known] ** 2 + high**2)
    slope = float(np.sqrt(max(float(excess.mean()), 0.0))) if len(excess) else np.inf
    return MeasuredGround(height, sd, over, _planes(depth_m, ground, over, eyes), slope)


def _planes(depth_m: FloatArray, ground: BoolArray, over_m: FloatArray, eyes: StereoView) -> GroundPlanes:
    pose, rays = eyes.view.pose, grid_rays_c(eyes.view.camera, (depth_m.shape[0], depth_m.shape[1]))
    near = ground & (depth_m < PLANES_M)
    eye_w = np.asarray(pose.position_w[:2])
    across = (
        rays[near] * (depth_m[near] / rays[near][:, 2])[:, None] @ rotation_from_quaternion(pose.quaternion_w)[:2].T
    )
    return ground_planes(eye_w + across, over_m[near], eye_w)


def on_measured(centre_w: FloatArray, ground: MeasuredGround, eyes: StereoView) -> FloatArray:
    """Places (rows, columns, 2) of the centres of the picture's windows, moved from the plane to the measured ground.

    A height counts as far as ground that rolls like this picture's explains it better than the error of its depths.
    """
    if not np.isfinite(ground.slope_sd):
        return centre_w
    shape = ground.height_m.shape
    rows, columns = (
        ((np.arange(n) + 0.5) * size / n).astype(int) for n, size in zip(centre_w.shape, shape, strict=False)
    )
    height, sd = (layer[np.ix_(rows, columns)] for layer in (ground.height_m, ground.sd_m))
    sight = centre_w - eyes.view.pose.position_w[:2]
    rolls = (ground.slope_sd * np.linalg.norm(sight, axis=-1)) ** 2
    lift = np.where(np.isfinite(height), height * rolls / (rolls + sd**2), 0.0)
    return np.asarray(eyes.view.pose.position_w[:2] + sight * (1.0 - lift / eyes.view.height_m)[..., None])


def point_heights(depth_m: FloatArray, eyes: StereoView) -> FloatArray:
    """Heights (H, W) of the points of a depth map over the believed plane, in metres."""
    return np.asarray(eyes.view.height_m - depth_m * _fall(depth_m, eyes))


def disparity_sd_m(depth_m: FloatArray, eyes: StereoView) -> FloatArray:
    """One sigma (...,) in metres of the height of single points over the ground at depths (...,)."""
    return np.asarray(np.hypot(SHARED_SD_PX, DISPARITY_SD_PX) * height_a_px(depth_m, eyes))


def height_a_px(depth_m: FloatArray, eyes: StereoView) -> FloatArray:
    """Metres of height over the ground (...,) for a pixel of disparity at depths (...,)."""
    return np.asarray(depth_m * eyes.view.height_m / eyes.focal_baseline)


def window_mean(values: FloatArray, which: BoolArray, size_px: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """Mean (H, W) of the ``values`` where ``which`` holds in a window around each pixel, and how many there are."""
    count = cv2.boxFilter(which.astype(np.float64), -1, size_px, normalize=False)
    total = cv2.boxFilter(np.where(which, values, 0.0), -1, size_px, normalize=False)
    return np.asarray(total / np.maximum(count, 1.0)), np.asarray(count)


def _fall(depth_m: FloatArray, eyes: StereoView) -> FloatArray:
    """How far the rays of the pixels (H, W) of a depth map fall under the camera a metre of depth."""
    view = eyes.view
    rays = grid_rays_c(view.camera, (depth_m.shape[0], depth_m.shape[1]))
    normal_c = rotation_from_quaternion(view.pose.quaternion_w).T @ view.plane.normal_w
    return np.asarray(-(rays @ normal_c) / rays[..., 2])


def pixels_by_label(labels: IntArray, count: int) -> list[tuple[IntArray, IntArray]]:
    """Rows and columns of the pixels of the labels 1 to ``count`` of a picture (H, W), each in the picture's order."""
    places = np.flatnonzero(labels)
    found = labels.ravel()[places]
    order = np.argsort(found, kind="stable")
    bounds = np.searchsorted(found[order], np.arange(1, count + 2))
    rows, columns = (part[order].astype(np.int32) for part in np.divmod(places, labels.shape[1]))
    return [(rows[start:end], columns[start:end]) for start, end in pairwise(bounds.tolist())]
