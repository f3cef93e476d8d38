"""Terrain Traversability Assessment Measure: equation 5 of the 2004 paper."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Section 5 of the paper; "Rocky Terrain" 1.5 is read as class B. The paper prints no weight for U.
WEIGHTS = {"S": 1.0, "V": 1.0, "m": 1.2, "M": 1.3, "B": 1.5}


def ttam(true: NDArray[np.str_], found: NDArray[np.str_], u_weight: float | None = 1.0) -> float:
    """Weighted share of windows classified correctly, in percent: 100 sum(w M) / sum(w), w by the true class.

    ``u_weight`` is the weight of windows that are truly U; None leaves them out. NaN when no window is left.
    Raises ValueError when the grids differ in shape or a true letter is not of the six.
    """
    if true.shape != found.shape:
        raise ValueError(f"grids differ: true {true.shape}, found {found.shape}")
    table = {**WEIGHTS, "U": 0.0 if u_weight is None else u_weight}
    unknown = sorted(set(true.ravel().tolist()) - set(table))
    if unknown:
        raise ValueError(f"true class {unknown[0]!r}; allowed are {', '.join(table)}")
    weight = np.vectorize(table.__getitem__, otypes=[float])(true)
    total = float(weight.sum())
    return float(100.0 * (weight * (true == found)).sum() / total) if total > 0 else float("nan")


def confusion(true: NDArray[np.str_], found: NDArray[np.str_]) -> NDArray[np.int64]:
    """How many windows of each class (row) were taken for each (column), (6, 6) in the order S V m M B U."""
    places = {letter: place for place, letter in enumerate((*WEIGHTS, "U"))}
    rows, columns = (
        np.array([places[letter] for letter in grid.ravel().tolist()], dtype=np.int64) for grid in (true, found)
    )
    return np.bincount(rows * len(places) + columns, minlength=len(places) ** 2).reshape(len(places), len(places))
