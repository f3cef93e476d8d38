"""Six terrain classes of the picture's windows by fuzzy rules (the 2004 paper, sections 3 and 5).

Each class has rules over five measures of a window: fine and coarse band-pass texture, rock cover, cover by big rock
and the share that shows no ground. The class whose strongest rule fires most wins; where none fires at all the window
is uncertain.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.texture import band_texture, window_reduce
from worlds.fuzzy import RuleBase, term_strengths
from worlds.types import BoolArray, ByteArray, FloatArray, TerrainClass

WINDOW_PX = 20  # the paper's sub-window


def window_features(grey: ByteArray, rock: BoolArray, big_rock: BoolArray, hidden: BoolArray) -> dict[str, FloatArray]:
    """Inputs of the rules, each (rows, columns), of the whole 20x20 windows of ``grey`` (H, W).

    A window without any variation at all carries no picture: it counts as unseen.
    """
    bands = band_texture(grey, WINDOW_PX)
    blank = window_reduce(np.maximum, grey, WINDOW_PX) == window_reduce(np.minimum, grey, WINDOW_PX)
    return {
        "fine": np.log10(np.maximum(bands.fine, 0.1)),
        "coarse": np.log10(np.maximum(bands.coarse, 0.1)),
        "cover": window_share(rock),
        "big": window_share(big_rock),
        "unseen": np.where(blank, 1.0, window_share(hidden)),
    }


def window_share(mask: BoolArray) -> FloatArray:
    """Share (rows, columns) of set pixels of ``mask`` (H, W) in each whole window."""
    rows, columns = mask.shape[0] // WINDOW_PX, mask.shape[1] // WINDOW_PX
    whole = mask[: rows * WINDOW_PX, : columns * WINDOW_PX].astype(np.float32)
    return np.asarray(cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA), dtype=np.float64)


def classify(features: dict[str, FloatArray], rules: RuleBase) -> NDArray[np.str_]:
    """Class letters (rows, columns) of windows with the given features."""
    shape = features["unseen"].shape
    strengths = term_strengths(rules, {name: values.ravel() for name, values in features.items()})
    letters = np.array(rules.output.term_names, dtype="<U1")[np.argmax(strengths, axis=1)]
    letters[strengths.max(axis=1) <= 0.0] = TerrainClass.UNCERTAIN.value
    return np.asarray(letters.reshape(shape))
