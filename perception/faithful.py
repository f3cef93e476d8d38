"""Rocks by the 2004 paper's own means, to be scored beside ours: grey levels, an optimum threshold per window, texture.

Section 4 and table 1, steps 1 to 6: low-pass, Canny edges, each 20x20 window binarised at its optimum threshold (dark
is obstacle), blobs above a size, and a fuzzy certainty from contrast, energy, variance and area. Which optimum the
paper takes is not said; here it is that of Otsu, interpolated between windows as in `perception.binarize`.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import cv2
import numpy as np

from perception.binarize import SingleArray, clean, close_edges, window_thresholds
from perception.blobs import find_blobs, select
from perception.knowledge_base import Binarization, Knowledge
from perception.pipeline import grey_levels, hidden_mask, smoothed, working_picture
from perception.rock_classifier import blob_features, rock_certainty
from worlds.fuzzy import RuleBase, rule_base
from worlds.strict_toml import read_table
from worlds.types import ByteArray, IntArray

HOW = Binarization(blur_px=1.2, edge_score=0.0)
_WINDOW_PX = 20
_LEAST_CERTAINTY = 0.4
_LEAST_SPREAD = 8 / 255  # a window whose grey levels deviate by less has no two classes


def paper_rocks(image: ByteArray, know: Knowledge) -> IntArray:
    """Rock ids (240, 320), 0 = none, of a picture of any size; only the sky comes from ``know``."""
    picture = working_picture(image)
    grey = picture if picture.ndim == 2 else np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    lab, colour = smoothed(picture, HOW.blur_px)
    soft = grey_levels(colour)
    hidden = hidden_mask(grey, lab, None, know)
    level = soft.astype(np.float32) * np.float32(1.0 / 255.0)
    dark = (level < grey_thresholds(level)) & ~hidden
    blobs = find_blobs(clean(close_edges(dark, level, soft, HOW), HOW), HOW.min_area_px)
    certainty = rock_certainty(blob_features(grey, level, blobs), paper_rules())
    return select(blobs, certainty >= _LEAST_CERTAINTY).labels


def grey_thresholds(level: SingleArray) -> SingleArray:
    """Threshold (H, W) of grey ``level`` (H, W) in 0..1, interpolated between windows.

    Windows without two classes take the mean of those around; far from any that has two it is 0: nothing is darker.
    """
    grid = window_thresholds(level, _WINDOW_PX, 0.0, 0.0, 1.0, _LEAST_SPREAD)
    known = (grid > 0.0).astype(np.float32)
    weight = cv2.blur(known, (3, 3), borderType=cv2.BORDER_CONSTANT)
    around = cv2.blur(grid, (3, 3), borderType=cv2.BORDER_CONSTANT) / np.maximum(weight, np.float32(1e-6))
    filled = np.where(known > 0.0, grid, around).astype(np.float32)
    return np.asarray(cv2.resize(filled, (level.shape[1], level.shape[0]), interpolation=cv2.INTER_LINEAR))


@cache
def paper_rules() -> RuleBase:
    """The rule base over the paper's four inputs."""
    path = Path(__file__).parent / "knowledge" / "paper" / "rock_rules.toml"
    return rule_base(read_table(path), str(path))
