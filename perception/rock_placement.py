"""From rock outlines in the picture to rocks on the ground that the rover believes in.

The base line of a blob is the near edge of the rock, where the ray meets the ground; its breadth comes from the
columns it spans. How large its base is follows from the area of its silhouette: half an ellipsoid of base diameter D
and height e D, seen at a depression d, covers pi / 8 D^2 (sqrt(4 e^2 cos^2 d + sin^2 d) + sin d) of a plane across the
ray (upper half of a tilted ellipsoid, and the near half of its base). Breadth times depth is then D^2.

Height comes from the upper outline: the ray that grazes the top from a camera at height H satisfies
b^2 = q^2 - 2 q a s, with a the half depth, b the height, s the tangent of the ray's depression and q its height over
the near edge (from the tangent condition q - a s = sqrt(b^2 + a^2 s^2)). Base line and top are known to a pixel only
and a by the silhouette alone, so e is the mean of that and of the usual proportion by their variances, and D follows
from it in a few rounds, unless a thing is too tall for any rock.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from perception.camera import project, rays_c, rays_w
from perception.ground import ground_points, ground_range, height_over, range_sd
from perception.knowledge_base import GroundKnowledge
from perception.rock_geometry import RockOutlines
from worlds.geometry import rotation_from_quaternion
from worlds.types import BoolArray, CameraModel, FloatArray, GroundPlane, PerceivedRock, Pose, Vector3

HEIGHT_SHARE, HEIGHT_SHARE_SD = 0.38, 0.07  # of the diameter, and one sigma: rocks are 0.25 to 0.5 of it high
_SHARE_LIMITS = (0.15, 0.65)  # that a measured one can stand for
_ROWS_SD_PX = 1.2  # between base line and top
_DEPTH_SD = 0.4  # of half the depth, as a share of it
_ROUNDS = 3
_DEPTH_OVER_BREADTH = (0.4, 2.0)


@dataclass(frozen=True, eq=False)
class View:
    """A camera, its pose, the ground under it and the sun over it."""

    camera: CameraModel
    pose: Pose
    plane: GroundPlane
    to_sun_w: Vector3 | None = None  # unit vector; None: not known

    @property
    def height_m(self) -> float:
        """Height of the camera over the plane."""
        return float(height_over(self.plane, self.pose.position_w))


def place_rocks(
    view: View,
    shape: RockOutlines,
    certainty: FloatArray,
    cut: BoolArray,
    scale: tuple[float, float],
    know: GroundKnowledge,
) -> list[PerceivedRock | None]:
    """Ground rocks, one a blob, None beyond the range.

    ``cut`` (R,) marks blobs that leave the picture; ``scale`` turns outline pixels into the camera's.
    """
    left, right = shape.left_px * scale[0], shape.right_px * scale[0]
    middle = (left + right) / 2.0
    base = shape.base_px * scale[1]
    near_w = ground_points(view.camera, view.pose, view.plane, np.column_stack([middle, base]))
    near_range = ground_range(view.pose, view.plane, near_w)
    foot = view.pose.position_w - view.height_m * view.plane.normal_w
    ahead = (near_w - foot) / near_range[:, None]
    ends = [rays_c(view.camera, np.column_stack([column, base]))[:, 0] for column in (left, right)]
    # Off the axis a pixel is a smaller part of the view, by the cube of the cosine.
    aslant = np.linalg.norm(rays_c(view.camera, np.column_stack([middle, base])), axis=-1)
    spread = np.sqrt(shape.area_px * scale[0] * scale[1] / aslant**3) / view.camera.focal_px
    top = rays_w(view.camera, view.pose, np.column_stack([middle, shape.top_px * scale[1]]))
    row_m = _ROWS_SD_PX * scale[1] / view.camera.focal_px * np.hypot(near_range, view.height_m)
    across = _breadth(view, near_w, ahead, ends[1] - ends[0])
    breadth, depth, height, height_sd = extents(
        view.height_m, near_range, spread, across, _fall(top, view.plane), row_m
    )
    half_depth, size = depth / 2.0, np.sqrt(breadth * depth)
    centre_w = near_w + half_depth[:, None] * ahead
    reach = near_range + half_depth
    angle_sd = float(np.hypot(know.pixel_sd / view.camera.focal_px, np.deg2rad(know.attitude_sd_deg)))
    sigma = range_sd(reach, view.height_m, angle_sd, know.ground_sd_m, know.slope_sd)
    yaw = np.arctan2(ahead[:, 1], ahead[:, 0])
    yaw = np.where(depth > breadth, yaw, (yaw + np.pi / 2.0 + np.pi) % (2.0 * np.pi) - np.pi)
    lengths = np.maximum(breadth, depth), np.minimum(breadth, depth), height
    columns = (*lengths, yaw, certainty, shape.formation, reach, sigma, cut, height_sd)
    rows = zip(centre_w.tolist(), *(column.tolist() for column in columns), strict=True)
    kept = (reach <= know.max_range_m) & (size >= know.min_diameter_m)
    return [PerceivedRock(tuple(c), *rest) if keep else None for keep, (c, *rest) in zip(kept, rows, strict=True)]


def extents(
    camera_height_m: float,
    near_range_m: FloatArray,
    spread: FloatArray,
    across_m: FloatArray,
    top_fall: FloatArray,
    row_m: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Breadth, depth and height (R,) in metres, and one sigma of the height.

    ``spread`` and ``top_fall`` as in `base_diameter` and `grazed_height`; ``across_m`` is the breadth by the columns,
    ``row_m`` one sigma of what the outline's rows span at the rock.
    """
    share = np.full(len(spread), HEIGHT_SHARE)
    for _ in range(_ROUNDS):
        diameter = base_diameter(camera_height_m, near_range_m, spread, share)
        breadth, depth = breadth_and_depth(across_m, diameter)
        size = np.sqrt(breadth * depth)
        grazing = grazed_height(camera_height_m, near_range_m, depth / 2.0, top_fall)
        measured = np.clip(grazing / size, *_SHARE_LIMITS)
        share_sd = grazed_sd(camera_height_m, near_range_m, depth / 2.0, top_fall, measured * size, row_m) / size
        trust = HEIGHT_SHARE_SD**2 / (HEIGHT_SHARE_SD**2 + share_sd**2)
        share = HEIGHT_SHARE + trust * (measured - HEIGHT_SHARE)
    # Where the silhouette asks for a larger base than its breadth allows it is a post, and what was measured counts.
    height = np.where(diameter > 1.01 * size, np.maximum(grazing, share * size), share * size)
    return breadth, depth, height, np.sqrt(trust) * share_sd * size


def base_diameter(
    camera_height_m: float, near_range_m: FloatArray, spread: FloatArray, height_share: FloatArray
) -> FloatArray:
    """Diameter (R,) in metres of the circle of equal base of rocks as high as ``height_share`` of it.

    ``spread`` is the root of their silhouette's solid angle.
    """
    diameter = np.zeros(len(spread))
    for _ in range(_ROUNDS):
        reach = near_range_m + diameter / 2.0
        distance = np.hypot(reach, camera_height_m)
        sine = camera_height_m / distance
        upper = np.hypot(2.0 * height_share * reach / distance, sine)
        diameter = spread * distance / np.sqrt(np.pi / 8.0 * (upper + sine))
    return diameter


def breadth_and_depth(breadth_m: FloatArray, diameter_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Breadth and depth (R,) whose product is ``diameter_m`` squared, within the proportions of rocks.

    Something taller than any rock of its breadth, such as a post, keeps its breadth.
    """
    ratio = np.clip((diameter_m / breadth_m) ** 2, *_DEPTH_OVER_BREADTH)
    kept = np.minimum(diameter_m / np.sqrt(ratio), breadth_m)
    return kept, kept * ratio


def grazed_height(
    camera_height_m: float, near_range_m: FloatArray, half_depth_m: FloatArray, top_fall: FloatArray
) -> FloatArray:
    """Height (R,) in metres of half ellipsoids whose top outline falls with slope ``top_fall``; 0 for none."""
    q = np.maximum(camera_height_m - near_range_m * top_fall, 0.0)
    return np.sqrt(np.maximum(q * q - 2.0 * q * half_depth_m * top_fall, 0.0))


def grazed_sd(
    camera_height_m: float,
    near_range_m: FloatArray,
    half_depth_m: FloatArray,
    top_fall: FloatArray,
    height_m: FloatArray,
    row_m: FloatArray,
) -> FloatArray:
    """One sigma (R,) in metres of `grazed_height` near ``height_m``: its derivatives by q and a times their errors."""
    q = np.maximum(camera_height_m - near_range_m * top_fall, 0.0)
    by_row = np.abs(q - half_depth_m * top_fall) * np.sqrt(1.0 + top_fall**2) * row_m
    return np.asarray(np.hypot(by_row, q * top_fall * half_depth_m * _DEPTH_SD) / height_m)


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
