"""From rock outlines in the picture to rocks on the ground that the rover believes in.

The base line of a blob is the near edge of the rock, where the ray meets the ground. Its breadth comes from the
columns it spans at its own distance. Depth and height share one measurement, the upper outline: for a half ellipsoid
of half depth a and height b standing on the plane, the ray that grazes its top from a camera at height H satisfies
b^2 = q^2 - 2 q a s, with s the tangent of the ray's depression and q its height over the near edge (derived from the
tangent condition q - a s = sqrt(b^2 + a^2 s^2)). Depth is taken as the breadth unless the height would leave the
proportions of rocks; then the height stays at the limit and the depth follows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from perception.camera import project, rays_c, rays_w
from perception.ground import ground_points, ground_range, height_over, range_sd
from perception.knowledge_base import GroundKnowledge
from perception.rock_geometry import RockOutlines
from worlds.geometry import rotation_from_quaternion
from worlds.types import CameraModel, FloatArray, GroundPlane, PerceivedRock, Pose

_HEIGHT_OVER_BREADTH = (0.2, 0.6)  # rocks are 0.25 to 0.5 of their diameter high; some room for what was measured
_DEPTH_OVER_BREADTH = (0.4, 2.0)


@dataclass(frozen=True, eq=False)
class View:
    """A camera, its pose and the ground under it."""

    camera: CameraModel
    pose: Pose
    plane: GroundPlane

    @property
    def height_m(self) -> float:
        """Height of the camera over the plane."""
        return float(height_over(self.plane, self.pose.position_w))


def place_rocks(
    view: View,
    shape: RockOutlines,
    certainty: FloatArray,
    scale: tuple[float, float],
    know: GroundKnowledge,
) -> list[PerceivedRock | None]:
    """Ground rocks, one a blob, None beyond the range; ``scale`` turns outline pixels into the camera's."""
    left, right = shape.left_px * scale[0], shape.right_px * scale[0]
    middle = (left + right) / 2.0
    base = shape.base_px * scale[1]
    near_w = ground_points(view.camera, view.pose, view.plane, np.column_stack([middle, base]))
    near_range = ground_range(view.pose, view.plane, near_w)
    foot = view.pose.position_w - view.height_m * view.plane.normal_w
    ahead = (near_w - foot) / near_range[:, None]
    ends = [rays_c(view.camera, np.column_stack([column, base]))[:, 0] for column in (left, right)]
    breadth = _breadth(view, near_w, ahead, ends[1] - ends[0])
    top = rays_w(view.camera, view.pose, np.column_stack([middle, shape.top_px * scale[1]]))
    half_depth, height = depth_and_height(view.height_m, near_range, breadth, _fall(top, view.plane))
    centre_w = near_w + half_depth[:, None] * ahead
    reach = near_range + half_depth
    angle_sd = float(np.hypot(know.pixel_sd / view.camera.focal_px, np.deg2rad(know.attitude_sd_deg)))
    spread = range_sd(reach, view.height_m, angle_sd, know.ground_sd_m, know.slope_sd)
    yaw = np.arctan2(ahead[:, 1], ahead[:, 0])
    size = np.sqrt(2.0 * half_depth * breadth)
    placed: list[PerceivedRock | None] = []
    for i in range(len(certainty)):
        if not (reach[i] <= know.max_range_m and size[i] >= know.min_diameter_m):
            placed.append(None)
            continue
        deep = 2.0 * half_depth[i] > breadth[i]
        placed.append(
            PerceivedRock(
                position_w=(float(centre_w[i, 0]), float(centre_w[i, 1]), float(centre_w[i, 2])),
                length_m=float(max(breadth[i], 2.0 * half_depth[i])),
                width_m=float(min(breadth[i], 2.0 * half_depth[i])),
                height_m=float(height[i]),
                yaw_rad=float(yaw[i] if deep else (yaw[i] + np.pi / 2.0 + np.pi) % (2.0 * np.pi) - np.pi),
                certainty=float(certainty[i]),
                formation=int(shape.formation[i]),
                range_m=float(reach[i]),
                position_sd_m=float(spread[i]),
            )
        )
    return placed


def depth_and_height(
    camera_height_m: float, near_range_m: FloatArray, breadth_m: FloatArray, top_fall: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Half depth and height (R,) in metres of half ellipsoids whose top outline falls with slope ``top_fall``."""
    q = np.maximum(camera_height_m - near_range_m * top_fall, 1e-3)
    shallow, deep = (0.5 * ratio * breadth_m for ratio in _DEPTH_OVER_BREADTH)
    half_depth = 0.5 * breadth_m
    squared = q * q - 2.0 * q * half_depth * top_fall
    low, high = ((ratio * breadth_m) ** 2 for ratio in _HEIGHT_OVER_BREADTH)
    wanted = np.clip(squared, low, high)
    # Near the horizon the top says nothing of the depth; elsewhere the limit of height decides it.
    slope = np.where(top_fall > 0.05, top_fall, np.nan)
    fitted = np.clip((q * q - wanted) / (2.0 * q * slope), shallow, deep)
    half_depth = np.where(np.isnan(fitted) | (wanted == squared), half_depth, fitted)
    height = np.sqrt(np.maximum(q * q - 2.0 * q * half_depth * top_fall, low))
    return half_depth, height


def _breadth(view: View, near_w: FloatArray, ahead: FloatArray, spread: FloatArray) -> FloatArray:
    """Breadth (R,) in metres of what spans ``spread`` at depth 1, at the depth of an equally deep rock's middle."""
    forward = rotation_from_quaternion(view.pose.quaternion_w)[:, 2]
    _, depth = project(view.camera, view.pose, near_w)
    # breadth = spread * (depth + breadth / 2 * cosine), solved for the breadth.
    return np.asarray(spread * depth / np.maximum(1.0 - 0.5 * spread * (ahead @ forward), 0.2))


def _fall(rays: FloatArray, plane: GroundPlane) -> FloatArray:
    """Tangent (R,) of the rays' depression under the plane's horizon."""
    down = -(rays @ plane.normal_w)
    level = np.linalg.norm(rays + down[:, None] * plane.normal_w, axis=-1)
    return np.asarray(down / level)
