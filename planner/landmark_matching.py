"""Which seen rock is which landmark: pairs that are compatible all together, and that nothing else could be.

Each pair must lie inside its own gate, and inside the gate that is left once all pairs taken before are granted: the
sum of these conditional distances is the joint Mahalanobis distance (joint compatibility: Neira and Tardos, IEEE Trans.
Robotics and Automation 17(5), 2001). Pairs are taken greedily, the likeliest first, from several first pairs; the
set with most pairs is taken (after Paz, Guivant, Tardos and Neira, RSS 2007). A rock that two landmarks could be is
left out, as is the reverse.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from worlds.types import BoolArray, FloatArray

Index = NDArray[np.intp]


@dataclass(frozen=True)
class MatchModel:
    """How strictly pairs are judged."""

    confidence: float = 0.99
    apart: float = 6.0  # in squared Mahalanobis distance, that a rival must be worse to be out of the question
    seeds: int = 4  # first pairs that are tried


@dataclass(frozen=True, eq=False)
class Pairs:
    """P possible pairs, their joint innovation, and what the sizes say."""

    landmark: Index  # (P,)
    view: Index  # (P,)
    innovation: FloatArray  # (P, C) C coordinates a pair
    spread: FloatArray  # (P C, P C) joint covariance of the innovations
    beside: FloatArray  # (P,) squared distance of what is independent of the pose, the size


def individually(innovation: FloatArray, spread: FloatArray) -> FloatArray:
    """Squared Mahalanobis distances (...,) of innovations (..., C) with covariances (..., C, C)."""
    return np.asarray(np.einsum("...i,...i->...", innovation, np.linalg.solve(spread, innovation[..., None])[..., 0]))


@lru_cache
def gate(coordinates: int, confidence: float) -> float:
    """Squared distance that a pair of so many coordinates, the size beside them, stays within."""
    return float(chi2.ppf(confidence, coordinates + 1))


def compatible(pairs: Pairs, model: MatchModel) -> Index:
    """The pairs taken, as indices (Q,)."""
    if len(pairs.landmark) == 0:
        return np.zeros(0, dtype=np.intp)
    count, coordinates = pairs.innovation.shape
    blocks = np.arange(count * coordinates).reshape(count, coordinates)
    alone = _distances(pairs, pairs.innovation.ravel(), pairs.spread, blocks)
    first = np.argsort(alone, kind="stable")
    clear = [pair for pair in first if _unrivalled(pairs, alone, np.ones(count, dtype=bool), int(pair), model)]
    sets = [_grown(pairs, int(seed), blocks, model) for seed in (clear or list(first))[: model.seeds]]
    taken, _ = max(sets, key=lambda found: (len(found[0]), -found[1]))
    return taken


def _grown(pairs: Pairs, seed: int, blocks: Index, model: MatchModel) -> tuple[Index, float]:
    """Pairs that go with the pair ``seed``, and their joint squared distance; none if it has rivals itself."""
    innovation, spread = pairs.innovation.ravel().copy(), pairs.spread.copy()
    free, limit = np.ones(len(blocks), dtype=bool), gate(blocks.shape[1], model.confidence)
    taken: list[int] = []
    total = 0.0
    while free.any():
        distance = np.where(free, _distances(pairs, innovation, spread, blocks), np.inf)
        near = np.flatnonzero(distance < limit)
        near = near[np.argsort(distance[near], kind="stable")]
        if not taken:
            near = near[near == seed]
        pair = next((int(p) for p in near if _unrivalled(pairs, distance, free, int(p), model)), None)
        if pair is None:
            break
        taken.append(pair)
        total += float(distance[pair])
        rows = blocks[pair]
        gain = np.linalg.solve(spread[np.ix_(rows, rows)], spread[rows]).T
        innovation -= gain @ innovation[rows]
        spread -= gain @ spread[rows]
        free &= (pairs.landmark != pairs.landmark[pair]) & (pairs.view != pairs.view[pair])
    return np.array(taken, dtype=np.intp), total


def _distances(pairs: Pairs, innovation: FloatArray, spread: FloatArray, blocks: Index) -> FloatArray:
    own = spread[blocks[:, :, None], blocks[:, None, :]]
    # What is granted already has no spread left.
    own = own + 1e-12 * np.eye(blocks.shape[1])
    return individually(innovation[blocks], own) + pairs.beside


def _unrivalled(pairs: Pairs, distance: FloatArray, free: BoolArray, pair: int, model: MatchModel) -> bool:
    """Whether no other free pair of the same landmark or view is nearly as likely."""
    same = (pairs.landmark == pairs.landmark[pair]) | (pairs.view == pairs.view[pair])
    same[pair] = False
    return not bool((distance[same & free] < distance[pair] + model.apart).any())
