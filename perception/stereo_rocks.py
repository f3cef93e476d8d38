"""Places and heights of rocks by two cameras: what one picture knows but for its scale, with the depths of both."""

from __future__ import annotations

import numpy as np
from msgspec import structs

from perception.camera import project
from perception.ground import ground_points, range_sd
from perception.knowledge_base import GroundKnowledge
from perception.stereo import FORM_SD_M, LEVEL_SD_M, MeasuredGround, StereoView, height_a_px
from worlds.types import FloatArray, IntArray, PerceivedRock

_FOOT_SHARE, _LEAST_PX = 0.35, 6  # of the rock's rows, from the bottom, that show its near face
_TOP_QUANTILE, _TOP_SD = 0.95, 0.03  # of a rock's points, its top; one sigma of what they miss, as a share
_TOP_SD_PX = 0.15  # and of their disparity
_PIECE_REACH_M = 3.5  # beyond it points that rise so are mostly mismatched
_PIECE_SIGMAS = 2.0  # of the points' error, that they rise over the outline's height: it may be that of a piece


def refined(
    rock: PerceivedRock,
    depth_m: FloatArray,
    shown: tuple[IntArray, IntArray],
    ground: MeasuredGround,
    eyes: StereoView,
    know: GroundKnowledge,
) -> PerceivedRock:
    """A placed rock moved along its line of sight, and of the height, that all that is known of it makes likeliest.

    ``depth_m`` (H, W) and ``shown``, the rock's rows and columns (N,), are of the working picture. One picture knows a
    rock but for its scale: at k times the distance everything about it is k times as large. The believed plane says
    k = 1, the measured ground beside the rock and the depth of its own foot say others; they are averaged by their
    variances, as is the height of its top over the ground with that of its outline.
    """
    rows, columns = shown
    row, column = int(rows.max()), int(columns[rows >= rows.max() - 1].mean())
    angle_sd = float(np.hypot(know.pixel_sd / eyes.view.camera.focal_px, np.deg2rad(know.attitude_sd_deg)))
    plane_sd = range_sd(np.array(rock.range_m), eyes.view.height_m, angle_sd, LEVEL_SD_M, ground.slope_sd)
    told = [(1.0, min(rock.position_sd_m, float(plane_sd)) / rock.range_m)]
    beside, beside_sd = float(ground.height_m[row, column]), float(ground.sd_m[row, column])
    if np.isfinite(beside):
        told.append((1.0 - beside / eyes.view.height_m, beside_sd / eyes.view.height_m))
    told += _by_foot(rock, depth_m, rows, columns, eyes)
    weight = np.array([sd**-2.0 for _, sd in told])
    scale = float(np.array([k for k, _ in told]) @ weight / weight.sum())
    sd = float(np.hypot(rock.range_m / np.sqrt(weight.sum()), FORM_SD_M))  # of base line and half depth they share it
    moved = _scaled(rock, scale, eyes.view.pose.position_w, sd)
    level = ground.planes.height_m(np.array(moved.position_w[:2]))
    if not np.isfinite(level):
        level = beside if np.isfinite(beside) else (1.0 - scale) * eyes.view.height_m
    return _topped(moved, ground.over_m[shown] - level, depth_m[shown], eyes)


def _by_foot(
    rock: PerceivedRock, depth_m: FloatArray, rows: IntArray, columns: IntArray, eyes: StereoView
) -> list[tuple[float, float]]:
    """Scale, and one sigma, by the depth of a rock's foot; none where too little of it was matched."""
    foot = rows >= rows.max() - _FOOT_SHARE * (rows.max() - rows.min() + 1)
    depths = depth_m[rows[foot], columns[foot]]
    depths = depths[np.isfinite(depths)]
    believed = _ground_depth(eyes, float(columns[foot].mean()) + 0.5, float(rows.max()) + 1.0)
    if len(depths) < _LEAST_PX or not believed > 0.0:
        return []
    seen = float(np.median(depths))
    return [(seen / believed, eyes.place_sd(seen) / rock.range_m)]


def _topped(rock: PerceivedRock, over_m: FloatArray, depth_m: FloatArray, eyes: StereoView) -> PerceivedRock:
    """The rock with its height averaged by variance with what its points (N,) rise over the ground.

    Points that rise clearly over what the outline tells count for more: the outline may be that of a piece, whose
    breadth, and so height, is too small.
    """
    seen = np.isfinite(over_m)
    if rock.cut or seen.sum() < _LEAST_PX or rock.height_sd_m <= 0.0:
        return rock
    top = float(np.quantile(over_m[seen], _TOP_QUANTILE))
    depth, more = np.asarray(np.median(depth_m[seen])), top - rock.height_m
    sd = np.hypot(_TOP_SD_PX * height_a_px(depth, eyes), _TOP_SD * top)
    piece = max(more - _PIECE_SIGMAS * float(sd), 0.0) if depth < _PIECE_REACH_M else 0.0
    told_sd = np.hypot(rock.height_sd_m, piece)
    trust = told_sd**2 / (told_sd**2 + sd**2)
    height = rock.height_m + trust * more
    return structs.replace(rock, height_m=float(height), height_sd_m=float(np.sqrt(trust) * sd))


def _ground_depth(eyes: StereoView, column: float, row: float) -> float:
    """Depth at which the ray of a working pixel meets the believed ground; NaN over the horizon."""
    view = eyes.view
    pixel = np.array([column * eyes.scale[0], row * eyes.scale[1]])
    point = ground_points(view.camera, view.pose, view.plane, pixel)
    return float(project(view.camera, view.pose, point)[1])


def _scaled(rock: PerceivedRock, scale: float, eye_w: FloatArray, sd_m: float) -> PerceivedRock:
    x, y, z = (eye_w + scale * (np.array(rock.position_w) - eye_w)).tolist()
    return structs.replace(
        rock,
        position_w=(x, y, z),
        length_m=rock.length_m * scale,
        width_m=rock.width_m * scale,
        height_m=rock.height_m * scale,
        height_sd_m=rock.height_sd_m * scale,
        range_m=rock.range_m * scale,
        position_sd_m=sd_m,
    )
