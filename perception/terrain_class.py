"""Six terrain classes of the picture's windows by fuzzy rules (the 2004 paper, sections 3 and 5).

Rules whose evidence adds up (``aggregation = "sum"``) speak in natural logarithms of odds, so that the logistic
function of the sums is the certainty; of other rules the strongest speaks, and its strength is the certainty. A window
without a picture, or of which the rules are less certain than the knowledge asks for, is uncertain.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from worlds.fuzzy import RuleBase, term_strengths
from worlds.types import FloatArray, TerrainClass

NO_CERTAINTY = 1e-6  # no rule has fired


def classify(features: dict[str, FloatArray], rules: RuleBase, min_certainty: float) -> NDArray[np.str_]:
    """Class letters (rows, columns) of windows with the given features, ``blank`` and all inputs among them."""
    shape = features["blank"].shape
    strengths = term_strengths(rules, {name: values.ravel() for name, values in features.items()})
    letters = np.array(rules.output.term_names, dtype="<U1")[np.argmax(strengths, axis=1)]
    unsure = certainty(strengths, rules) < max(min_certainty, NO_CERTAINTY)
    letters[unsure | (features["blank"].ravel() > 0)] = TerrainClass.UNCERTAIN.value
    return np.asarray(letters.reshape(shape))


def certainty(strengths: FloatArray, rules: RuleBase) -> FloatArray:
    """Certainty (N,) in 0..1 of the strongest class, from the strengths (N, classes) of all."""
    if rules.aggregation == "maximum":
        return np.asarray(strengths.max(axis=1))
    return np.asarray(1.0 / np.exp(strengths - strengths.max(axis=1, keepdims=True)).sum(axis=1))
