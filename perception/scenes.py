"""Which pictures show the same scene: pictures of the same or neighbouring sols must not teach and test at once."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from worlds.errors import InputError
from worlds.types import IntArray

SOLS_APART = 3  # a rover that far apart in time may still stand before the same rocks


def sol_of(name: str) -> int:
    """Sol of a picture: the first whole number in its file name, as ``md_cr_2052_2052MR01`` has 2052.

    Raises InputError for a name without a number.
    """
    found = re.search(r"\d+", name)
    if found is None:
        raise InputError(f"{name}: no number in the file name; it must hold the sol, as in md_363_left.png")
    return int(found.group())


def scene_groups(names: Sequence[str]) -> IntArray:
    """Group (N,) 0..G-1 of each picture in the order of their sols; chains of at most `SOLS_APART` stay together."""
    sols = np.array([sol_of(name) for name in names], dtype=np.int64)
    rising, place = np.unique(sols, return_inverse=True)
    group = np.concatenate([[0], np.cumsum(np.diff(rising) > SOLS_APART)]) if len(rising) else rising
    return np.asarray(group[place], dtype=np.int32)
