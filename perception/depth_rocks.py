"""What stands out of the measured ground by depth alone: rocks and posts that look like the soil.

Whatever rises over the ground around it by more than `LEAST_M` and two sigma of its depth, and is no rock by its
texture, is a blob of its own. The ground is averaged over a broad part of the picture, and once more without what
stands out of it. Low rocks stay below the noise of the depths: this finds what would stop or tip the rover. What stands
out less, but beside a rock that is known, may be more of that rock.
"""

from __future__ import annotations

import cv2
import numpy as np

from perception.blobs import Blobs, find_blobs, select
from perception.camera import grid_rays_c
from perception.rock_geometry import RockOutlines
from perception.stereo import FORM_SD_M, StereoView, disparity_sd_m, point_heights, window_mean
from worlds.geometry import rotation_from_quaternion
from worlds.types import BoolArray, FloatArray, IntArray, PerceivedRock

LEAST_M = 0.1
_FACE_M, _FACE_REACH_M = 0.02, 3.0  # of what continues a rock, and how far off its depths tell
_SIGMAS = 2.0
_BROAD_PX, _FINE_PX, _LEAST_GROUND_PX = (91, 25), (61, 17), 60
_UNEVEN_M = 0.06  # that ground may differ within the broad window
_REACH_M = 5.0
_LEAST_PX, _LEAST_SIDE_PX = 25, 4
_KNOWN_SHARE = 0.2  # of a blob in rocks known by texture, from which on it is theirs
_NEAR_QUANTILE, _TOP_QUANTILE = 0.25, 0.98
_CERTAINTY = (0.5, 0.95)  # just above the least height, and from another sigma on


def filled_out(labels: IntArray, depth_m: FloatArray, hidden: BoolArray, eyes: StereoView) -> IntArray:
    """The labels (H, W) of rocks, and further ones of what stands out by depth beside them: faces that look like soil.

    A rock's face in the sun may have the colour of the sand. Which rock it belongs to is left open.
    """
    height, sd, rocks = _over_ground(depth_m, labels, hidden, eyes)
    stands = np.isfinite(height) & ~hidden & (height > _FACE_M + sd) & (depth_m < _FACE_REACH_M)
    faces = find_blobs(np.asarray(stands & (labels == 0)), _LEAST_PX)
    near = np.bincount(faces.labels[rocks], minlength=len(faces) + 1)[1:] > 0
    faces = select(faces, near)
    return np.where(faces.labels > 0, faces.labels + labels.max(), labels).astype(np.int32)


def _over_ground(
    depth_m: FloatArray, labels: IntArray, hidden: BoolArray, eyes: StereoView
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Heights (H, W) of all points over the ground, one sigma of each, and the rocks with their rim."""
    over, sd = point_heights(depth_m, eyes), disparity_sd_m(depth_m, eyes)
    rocks = cv2.dilate((labels > 0).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    ground = np.isfinite(over) & ~hidden & ~rocks
    broad, _ = window_mean(over, ground, _BROAD_PX)
    level, count = window_mean(over, ground & (np.abs(over - broad) < _UNEVEN_M + _SIGMAS * sd), _FINE_PX)
    return over - np.where(count >= _LEAST_GROUND_PX, level, broad), sd, rocks


def standing_blobs(
    depth_m: FloatArray, labels: IntArray, hidden: BoolArray, eyes: StereoView
) -> tuple[Blobs, FloatArray]:
    """Blobs that stand out by depth and are no labelled rock, and heights (H, W) of all points over the ground."""
    height, sd, rocks = _over_ground(depth_m, labels, hidden, eyes)
    stands = np.isfinite(height) & ~hidden & (height > LEAST_M + _SIGMAS * sd) & (depth_m < _REACH_M)
    whole = find_blobs(np.asarray(stands))
    # What stands out around a rock is the rock itself and the rim that its depths spill over.
    known = np.bincount(whole.labels[rocks], minlength=len(whole) + 1)[1:]
    fresh = select(whole, known < _KNOWN_SHARE * whole.area_px).labels > 0
    blobs = find_blobs(fresh & ~rocks, _LEAST_PX)
    return select(blobs, blobs.box_px[:, 2:].min(axis=1, initial=_LEAST_PX) >= _LEAST_SIDE_PX), np.asarray(height)


def placed_blobs(
    blobs: Blobs, shape: RockOutlines, depth_m: FloatArray, height_m: FloatArray, eyes: StereoView
) -> list[PerceivedRock]:
    """Each blob as a round rock or post behind its nearest points; ``height_m`` (H, W) as `standing_blobs` gives it."""
    view = eyes.view
    rays_c = grid_rays_c(view.camera, (depth_m.shape[0], depth_m.shape[1]))
    rays_w = (rays_c / rays_c[..., 2:]) @ rotation_from_quaternion(view.pose.quaternion_w).T
    over = point_heights(depth_m, eyes)
    placed = []
    for blob in range(len(blobs)):
        shown = blobs.labels == blob + 1
        points = depth_m[shown][:, None] * rays_w[shown]
        level = points - (points @ view.plane.normal_w)[:, None] * view.plane.normal_w
        near = float(np.quantile(np.linalg.norm(level, axis=1), _NEAR_QUANTILE))
        ahead = level.mean(axis=0) / np.linalg.norm(level.mean(axis=0))
        deep = float(np.median(depth_m[shown]))
        breadth = float(blobs.box_px[blob, 2]) * eyes.scale[0] / view.camera.focal_px * deep
        top = float(np.quantile(height_m[shown], _TOP_QUANTILE))
        ground = float(np.median((over - height_m)[shown]))
        centre = view.pose.position_w + (near + breadth / 2.0) * ahead + (ground - view.height_m) * view.plane.normal_w
        sd = float(disparity_sd_m(np.array(deep), eyes))
        sure = np.clip((top - LEAST_M) / sd - _SIGMAS, 0.0, 1.0)
        placed.append(
            PerceivedRock(
                position_w=(float(centre[0]), float(centre[1]), float(centre[2])),
                length_m=breadth,
                width_m=breadth,
                height_m=top,
                yaw_rad=0.0,
                certainty=float(_CERTAINTY[0] + sure * (_CERTAINTY[1] - _CERTAINTY[0])),
                formation=int(shape.formation[blob]),
                range_m=near + breadth / 2.0,
                position_sd_m=float(np.hypot(eyes.place_sd(deep), FORM_SD_M)),
                cut=bool(blobs.border[blob].any()),
                height_sd_m=sd,
            )
        )
    return placed
