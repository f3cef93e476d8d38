"""Evidence of cues that adds up at each pixel, in log odds, and the chance that it makes: compiled, for all looks."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from perception.knowledge_base import Cue
from worlds.types import BoolArray, IntArray

SingleArray = NDArray[np.float32]
Planes = dict[str, SingleArray]
_STEPS = 2048  # of sampled evidence: the largest error is about 0.02 where the steepest cue bends
_REACH = 8.0  # of the logistic curve's table; beyond it a chance is 0.0003 or 0.9997
_LOGISTIC = (1 / (1 + np.exp(-np.linspace(-_REACH, _REACH, _STEPS + 1)))).astype(np.float32)


def chance_of(
    planes: Planes,
    bias: float,
    named: Iterable[tuple[str, Cue]],
    skipped: BoolArray | None = None,
    otherwise: SingleArray | None = None,
) -> SingleArray:
    """Logistic curve (H, W) of the evidence of the ``named`` cues; where ``skipped``, what ``otherwise`` says, or 0."""
    named = tuple(named)
    shape = planes[named[0][0]].shape if named else next(iter(planes.values())).shape
    chance = np.zeros(shape, dtype=np.float32) if otherwise is None else otherwise.copy()
    left_out = np.zeros(shape, dtype=bool) if skipped is None else skipped
    _add_up(tuple(planes[name] for name, _ in named), _tables(named), bias, left_out, chance)
    return chance


@lru_cache(maxsize=32)
def _tables(named: tuple[tuple[str, Cue], ...]) -> SingleArray:
    """Tables (cues, 2 + samples) of all cues."""
    return np.stack([evidence_table(cue.value, cue.evidence) for _, cue in named])


@lru_cache(maxsize=128)
def evidence_table(knots: tuple[float, ...], evidence: tuple[float, ...]) -> SingleArray:
    """Evidence sampled between the first and the last of the ``knots``, for the compiled kernel.

    (2 + samples): the first knot, steps a unit, and the samples.
    """
    values = np.interp(np.linspace(knots[0], knots[-1], _STEPS + 1), knots, evidence)
    return np.concatenate([[knots[0], _STEPS / (knots[-1] - knots[0])], values]).astype(np.float32)


@njit(cache=True, nogil=True, fastmath=True)
def _add_up(
    planes: tuple[SingleArray, ...], tables: SingleArray, bias: float, skipped: BoolArray, out: SingleArray
) -> None:
    """Write the logistic curve of all evidence into ``out`` (H, W) where not ``skipped``."""
    width = out.shape[1]
    columns = np.empty(width, dtype=np.uint32)  # of a row's pixels that are not skipped
    total, values = np.empty(width, dtype=np.float32), np.empty(width, dtype=np.float32)
    places = np.empty(width, dtype=np.int32)
    reach, per = np.float32(_REACH), np.float32(_STEPS / (2 * _REACH))
    for y in range(out.shape[0]):
        number = 0
        for x in range(width):
            columns[number] = x
            number += not skipped[y, x]
        total[:number] = bias
        for cue in range(len(planes)):
            row, table = planes[cue][y], tables[cue]
            if number == width:  # a whole row needs no list of its pixels
                _samples(row, table[0], table[1], places)
            else:
                for i in range(number):
                    values[i] = row[columns[i]]
                _samples(values[:number], table[0], table[1], places)
            for i in range(number):
                total[i] += table[np.uint32(places[i]) + np.uint32(2)]
        _samples(total[:number], -reach, per, places)
        for i in range(number):
            out[y, columns[i]] = _LOGISTIC[np.uint32(places[i])]


@njit(cache=True, nogil=True, fastmath=True)
def _samples(values: SingleArray, first: np.float32, step: np.float32, places: IntArray) -> None:
    """Write the nearest sample of each of the ``values`` (N,): apart from looking it up, many take a single step."""
    zero, half, last = np.float32(0.0), np.float32(0.5), np.float32(_STEPS)
    for i in range(len(values)):
        places[i] = np.int32(min(max((values[i] - first) * step, zero), last) + half)
