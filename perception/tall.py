"""Things taller than the camera, whose feet tell where they stand: the camera as a coarse range scanner.

What sticks out over the horizon of the believed ground is as high as the camera wherever it stands, and its foot is
where, going down its column, the picture takes on the hue of the ground again. Hue (red less blue over the sum) is the
same in light and shade, so cast shadows are ground. Lower things do not reach the horizon: those are for the rock
pipeline.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera import grid_rays_c
from perception.ground import falling, ground_points, ground_range, range_sd
from worlds.geometry import quaternion_from_euler, rotation_from_quaternion
from worlds.types import BoolArray, ByteArray, FloatArray, Frame, IntArray, Pose, RangeScan

SingleArray = NDArray[np.float32]
REACH_M = 5.0  # farther feet are too few pixels below the horizon
ANGLE_SD_RAD = 0.006  # about a pixel and a quarter
GROUND_SD_M, SLOPE_SD = 0.01, 0.005
_BLUR_REACH_PX = 8  # rows beyond a strip that its softened pixels still feel


@dataclass(frozen=True)
class TallModel:
    """What counts as ground and as sky."""

    hue_tolerance: float = 0.045  # less than the ground's hue by more: not ground
    sky_lightness: float = 54.0  # L*; the sky is lighter ...
    sky_hue: float = 0.09  # ... and has at least this hue
    band_px: tuple[int, int] = (4, 4)  # above and below the horizon that a tall thing fills
    shadow_share: float = 0.65  # of the L* of lit ground: darker ground lies in a shadow
    gap_px: int = 3  # so much ground ends it
    blur_px: float = 0.8
    bottom_share: float = 0.3  # of the picture, taken for ground in the first one


@dataclass(frozen=True, eq=False)
class TallThings:
    """Where they and their shadows cover the picture, and how far away they stand."""

    covered: BoolArray  # (H, W)
    columns: BoolArray  # (W,) that hold one
    foot_px: FloatArray  # (W,) first row under the foot, -1 where there is none
    frame: Frame  # that shows them

    @cached_property
    def scan(self) -> RangeScan:
        """A beam a column: as far as the foot, or free."""
        return _scan(self.frame, self.foot_px)


def ground_hue(frame: Frame, model: TallModel | None = None) -> float:
    """Hue of the ground at the foot of a picture; the rover is set down where it has free ground before it."""
    model = model or TallModel()
    hue, _ = _hue_and_lightness(frame.image, model)
    return float(np.median(hue[round((1.0 - model.bottom_share) * len(hue)) :]))


def tall_things(frame: Frame, hue: float, model: TallModel | None = None) -> TallThings | None:
    """Tall things in a picture of known pose over ground of that hue; None where the horizon is out of the picture."""
    model = model or TallModel()
    if frame.camera_pose is None or frame.ground is None:
        raise ValueError("a frame without pose or ground has no horizon")
    height, width = frame.image.shape[:2]
    normal_c = rotation_from_quaternion(frame.camera_pose.quaternion_w).T @ frame.ground.normal_w
    above = falling(grid_rays_c(frame.camera, (height, width)), -normal_c, 0.0)
    horizon = above.sum(axis=0)
    up, down = model.band_px
    if horizon.min() < up or horizon.max() > height - down:
        return None
    band = slice(int(horizon.min()) - up, int(horizon.max()) + down)
    tall = _fill_the_band(frame, band, above, horizon, hue, model)
    if not tall.any():
        return TallThings(np.zeros_like(above), tall, np.full(width, -1.0), frame)
    found, lightness = _hue_and_lightness(frame.image, model)
    rows = np.arange(height)
    thing = _things(found, lightness, above, hue, model)
    foot = _feet(thing, rows[:, None] >= horizon, model.gap_px)
    covered = (rows[:, None] + 0.5 < foot) & tall
    covered |= _shadows(found, lightness, above | covered, hue, model)
    return TallThings(np.asarray(covered), tall, np.where(tall, foot, -1.0), frame)


def _fill_the_band(
    frame: Frame, band: slice, above: BoolArray, horizon: IntArray, hue: float, model: TallModel
) -> BoolArray:
    """Columns (W,) that something fills from above the horizon to below it; only those rows are looked at."""
    first = max(band.start - _BLUR_REACH_PX, 0)
    soft = _softened(frame.image[first : band.stop + _BLUR_REACH_PX], model)[band.start - first :][: len(above[band])]
    offset = np.arange(band.start, band.stop)[:, None] - horizon
    beside = (offset < -model.band_px[0]) | (offset >= model.band_px[1])
    found = _hue(soft)
    filled = np.asarray(((found < hue - model.hue_tolerance) | beside).all(axis=0))
    if not filled.any():  # mostly: and then nobody asks how light it is
        return filled
    return np.asarray((_things(found, _lightness(soft), above[band], hue, model) | beside).all(axis=0))


def _things(found: FloatArray, lightness: FloatArray, above: BoolArray, hue: float, model: TallModel) -> BoolArray:
    """Pixels that are neither ground nor sky."""
    sky = above & (lightness > model.sky_lightness) & (found > model.sky_hue)
    return np.asarray((found < hue - model.hue_tolerance) & ~sky)


def _hue_and_lightness(image: ByteArray, model: TallModel) -> tuple[FloatArray, FloatArray]:
    """Hue and L* (H, W) of the softened picture; a grey one has no hue."""
    soft = _softened(image, model)
    return _hue(soft), _lightness(soft)


def _softened(image: ByteArray, model: TallModel) -> SingleArray:
    """RGB (H, W, 3) in 0..1 of the softened picture."""
    colour = image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2RGB)
    return np.asarray(cv2.GaussianBlur(colour.astype(np.float32) / 255.0, (0, 0), model.blur_px), dtype=np.float32)


def _hue(soft: SingleArray) -> FloatArray:
    """Hue (H, W) of RGB (H, W, 3) in 0..1."""
    red, green, blue = soft[..., 0], soft[..., 1], soft[..., 2]
    return np.asarray((red - blue) / (red + green + blue + np.float32(1e-3)), dtype=np.float64)


def _lightness(soft: SingleArray) -> FloatArray:
    """L* (H, W) of RGB (H, W, 3) in 0..1."""
    return np.asarray(cv2.cvtColor(soft, cv2.COLOR_RGB2LAB)[..., 0], dtype=np.float64)


def _shadows(found: FloatArray, lightness: FloatArray, other: BoolArray, hue: float, model: TallModel) -> BoolArray:
    """Pixels (H, W) of dark ground: its hue at little of its light, with their soft edges."""
    ground = ~other & (found > hue - model.hue_tolerance)
    if not ground.any():
        return np.zeros_like(other)
    lit = float(np.percentile(lightness[ground], 90))
    dark = (ground & (lightness < model.shadow_share * lit)).astype(np.uint8)
    return np.asarray(cv2.dilate(dark, np.ones((5, 5), dtype=np.uint8)) > 0)


def _feet(thing: BoolArray, below: BoolArray, gap_px: int) -> FloatArray:
    """First row (W,) under the horizon from which on ``gap_px`` rows are ground; the picture's height if none is."""
    ground: BoolArray = below & ~thing
    ends = ground.copy()
    for shift in range(1, gap_px):
        ends[:-shift] = ends[:-shift] & ground[shift:]
        ends[-shift:] = False
    return np.asarray(np.where(ends.any(axis=0), ends.argmax(axis=0), thing.shape[0]), dtype=np.float64)


def _scan(frame: Frame, foot: FloatArray) -> RangeScan:
    """A beam a column (W,): as far as the foot, or free; what lies before the picture's lower edge stays unknown."""
    assert frame.camera_pose is not None
    assert frame.ground is not None
    camera, pose, plane = frame.camera, frame.camera_pose, frame.ground
    columns = np.arange(len(foot)) + 0.5
    lowest = ground_points(camera, pose, plane, np.column_stack([columns, np.full(len(foot), camera.height_px - 0.5)]))
    feet = ground_points(camera, pose, plane, np.column_stack([columns, np.minimum(foot, camera.height_px - 0.5)]))
    least, ranges = ground_range(pose, plane, lowest), ground_range(pose, plane, feet)
    ranges = np.where((foot >= 0) & (ranges < REACH_M), ranges, np.inf)
    forward = rotation_from_quaternion(pose.quaternion_w)[:, 2]
    yaw = float(np.arctan2(forward[1], forward[0]))
    bearing = np.arctan2(lowest[:, 1] - pose.position_w[1], lowest[:, 0] - pose.position_w[0]) - yaw
    height = float((pose.position_w - plane.point_w) @ plane.normal_w)
    sd = range_sd(np.where(np.isfinite(ranges), ranges, REACH_M), height, ANGLE_SD_RAD, GROUND_SD_M, SLOPE_SD)
    return RangeScan(
        frame.time_s,
        np.asarray((bearing + np.pi) % (2 * np.pi) - np.pi),
        ranges,
        np.minimum(sd, 1.0),
        np.asarray(np.minimum(least, ranges)),
        REACH_M,
        Pose(pose.position_w, quaternion_from_euler(0.0, 0.0, yaw)),
        plane,
    )
