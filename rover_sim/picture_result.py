"""What `perceive` reports of one picture, in the picture's own pixels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np

from perception.pipeline import ImageRock, Perception
from rover_sim import __version__
from rover_sim.camera_file import CameraFile, default_camera
from rover_sim.picture_paths import PicturePath
from rover_sim.verdict import Verdict
from rover_sim.verify import Check


def result_table(
    found: Perception, paths: Sequence[PicturePath], size: tuple[int, int], camera: CameraFile | None, knowledge: str
) -> dict[str, Any]:
    """The table of the JSON file; keys in metres only where the ``camera`` is known."""
    metric = camera is not None
    return {
        "size_px": list(size),
        "camera": msgspec.to_builtins(camera or default_camera(size)),
        "camera_assumed": not metric,
        "knowledge": knowledge,
        "version": __version__,
        "classes": ["".join(row) for row in found.classes.tolist()],
        "rocks": [_rock(rock, found.scale, metric=metric) for rock in found.rocks],
        "waypoints": [_path(path, metric=metric) for path in paths],
    }


def verification_table(rover: str, checks: Sequence[Check], left_out: Sequence[int], *, metric: bool) -> dict[str, Any]:
    """How each path was driven, in the order of ``waypoints``.

    Unlike the keys of rocks and waypoints these keep their metres without a camera file: they are lengths in the
    virtual terrain, whose scale is then that of the assumed camera, and ``scale`` says so.
    """
    verdicts = [check.verdict for check in checks]
    return {
        "scale": "camera" if metric else "assumed",
        "rover": rover,
        "rocks_left_out": list(left_out),  # the rover stands in them
        "best_verified_path": verdicts.index(Verdict.VERIFIED) if Verdict.VERIFIED in verdicts else None,
        "paths": [_check(index, check) for index, check in enumerate(checks)],
    }


def _check(index: int, check: Check) -> dict[str, Any]:
    return {
        "path": index,
        "verdict": check.verdict.value,
        "fault": check.fault,
        "unseen_m": round(check.unseen_m, 4),
        **check.drive.figures,
    }


def _rock(rock: ImageRock, scale: tuple[float, float], *, metric: bool) -> dict[str, Any]:
    across, down = scale
    x, y, width, height = rock.bbox_px
    cos, sin = np.cos(rock.axis_rad), np.sin(rock.axis_rad)
    # Pixels that are not square turn directions and stretch what is measured along them.
    axis = float(np.mod(np.arctan2(sin * down, cos * across), np.pi))
    stretch = float(np.hypot(sin * across, cos * down))
    table: dict[str, Any] = {
        "id": rock.id,
        "centroid_px": [_round(rock.centroid_px[0] * across), _round(rock.centroid_px[1] * down)],
        "bbox_px": [_round(x * across), _round(y * down), _round(width * across), _round(height * down)],
        "area_px": _round(rock.area_px * across * down),
        "certainty": round(rock.certainty, 4),
        "formation": rock.formation,
        "axis_deg": _round(float(np.rad2deg(axis))),
        "sections_px": [_round(section * stretch) for section in rock.sections_px],
    }
    if metric and rock.placed is not None:
        table["position_m"] = [round(value, 4) for value in rock.placed.position_w]
        table["height_m"] = round(rock.placed.height_m, 4)
    return table


def _path(path: PicturePath, *, metric: bool) -> dict[str, Any]:
    table: dict[str, Any] = {
        "traversability": round(path.traversability, 4),
        "points_px": np.round(path.points_px, 2).tolist(),
    }
    if metric:
        table["points_m"] = np.round(path.points_w, 4).tolist()
    return table


def _round(value: float) -> float:
    return round(float(value), 2)
