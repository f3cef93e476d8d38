"""Where the rover believed to be, beside where it was: the track and ellipses of what it claimed to know."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.patches import Ellipse
from numpy.typing import NDArray

from worlds.types import FloatArray

EVERY_M = 5.0
SIGMAS = 2.0
WORTH_M = 0.08  # where the rover never claims less, the two tracks are one line


def draw_believed_track(axes: Axes, trace: Mapping[str, NDArray[np.float64]]) -> None:
    """The believed track and its ellipses; nothing where satellites tell the place."""
    covariance = trace["estimate_covariance_m2"].reshape(-1, 2, 2)
    if np.sqrt(np.trace(covariance, axis1=1, axis2=2)).max() < WORTH_M:
        return
    place = trace["estimate_position_w"][:, :2]
    axes.plot(*place.T, color="lime", linewidth=1.2, linestyle="--", zorder=7, label="track believed, 2 sigma ellipses")
    chosen = marks(place)
    patches = [Ellipse((x, y), *size, angle=angle) for (x, y), (size, angle) in zip(
        place[chosen], map(ellipse, covariance[chosen]), strict=True)]  # fmt: skip
    axes.add_collection(PatchCollection(patches, facecolor="none", edgecolor="lime", linewidths=0.9, zorder=7))


def marks(place_w: FloatArray) -> NDArray[np.intp]:
    """Rows (K,) of a track (N, 2) after every few metres, and the last."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(place_w, axis=0).T))])
    rows = np.searchsorted(way, np.arange(EVERY_M, way[-1], EVERY_M))
    return np.unique([*rows, len(way) - 1]).astype(np.intp)


def ellipse(covariance: FloatArray) -> tuple[tuple[float, float], float]:
    """Width and height (m) and turn (degrees) of the ellipse of a covariance (2, 2)."""
    values, axes = np.linalg.eigh(covariance)
    width, height = (2.0 * SIGMAS * np.sqrt(np.maximum(values[::-1], 0.0))).tolist()
    return (width, height), float(np.degrees(np.arctan2(axes[1, 1], axes[0, 1])))
