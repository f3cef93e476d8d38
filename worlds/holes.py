"""Heights that an elevation file does not have, filled with the smoothest surface."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, vstack
from scipy.sparse.linalg import splu

from worlds.types import BoolArray, FloatArray, IntArray


def fill_holes(heights_m: FloatArray, holes: BoolArray) -> FloatArray:
    """The heights (ny, nx) with those where ``holes`` (ny, nx) holds replaced; all others stay as they are.

    Filled with the surface of least bending, the integral of h_xx^2 + 2 h_xy^2 + h_yy^2 by finite differences: it goes
    on with the height and the slope around a hole, and repeats a plane exactly. Source: Duchon, "Splines minimizing
    rotation-invariant semi-norms in Sobolev spaces" (1977).
    """
    flat = np.where(holes, 0.0, heights_m).ravel()
    unknown = np.flatnonzero(holes.ravel())
    bending = _bending(holes)
    inside = bending[:, unknown]
    lu = splu(  # symmetric and positive definite, so no pivoting is needed
        (inside.T @ inside).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    flat[unknown] = lu.solve(-(inside.T @ (bending @ flat)))
    return flat.reshape(heights_m.shape)


def _bending(holes: BoolArray) -> csr_array:
    """Second differences that touch a hole, one a row, as a matrix on the flattened heights."""
    index = np.arange(holes.size, dtype=np.int32).reshape(holes.shape)
    twist = np.sqrt(2.0)
    stencils = (
        ((index[:, :-2], index[:, 1:-1], index[:, 2:]), (1.0, -2.0, 1.0)),
        ((index[:-2], index[1:-1], index[2:]), (1.0, -2.0, 1.0)),
        ((index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]), (twist, -twist, -twist, twist)),
    )
    return vstack([_rows(places, weights, holes.ravel()) for places, weights in stencils]).tocsc()


def _rows(places: tuple[IntArray, ...], weights: tuple[float, ...], holes: BoolArray) -> csr_array:
    columns = np.stack([place.ravel() for place in places], axis=1)
    columns = columns[holes[columns].any(axis=1)]
    count = len(columns)
    ends = len(weights) * np.arange(count + 1)
    return csr_array((np.tile(weights, count), columns.ravel(), ends), shape=(count, holes.size))
