"""Compiled noise of pictures."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from worlds.types import ByteArray


@njit(cache=True, nogil=True)
def add_levels(image: ByteArray, draws: NDArray[np.uint16], levels: NDArray[np.int16], out: ByteArray) -> None:
    """Fill ``out`` (N,) with grey levels (N,) and ``levels`` at the places ``draws`` (N,), cut to 0..255."""
    for k in range(image.size):
        at = np.uintp(k)
        out[at] = np.uint8(min(max(int(image[at]) + int(levels[np.uintp(draws[at])]), 0), 255))
