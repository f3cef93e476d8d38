"""Additive evidence from labelled samples: piecewise-linear logistic regression.

Each cue gets knots at fixed quantiles of its own values; the evidence at the knots is the maximum of the penalised
likelihood, found by Newton's method (iteratively reweighted least squares). The penalty is on the second differences of
neighbouring knots, so that evidence bends no more than the samples ask for, and weakly on its size.
Source of the model: Hastie and Tibshirani, Generalized Additive Models, Statistical Science 1(3), 1986.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.sparse import csr_matrix

from worlds.types import BoolArray, FloatArray

_ROUNDS = 25
_STOP = 1e-6
_LARGEST = 40.0  # logarithm of odds
_SIZE_PENALTY = 1e-4  # a sample; only settles what the samples leave open


@dataclass(frozen=True, eq=False)
class AdditiveFit:
    """Bias and, for each cue, knots and the evidence at them."""

    bias: float
    knots: tuple[FloatArray, ...]
    evidence: tuple[FloatArray, ...]


def quantile_knots(values: FloatArray, quantiles: Sequence[float]) -> FloatArray:
    """Rising knots at ``quantiles`` (0..1) of ``values`` (N,), rounded to four digits; equal ones are merged."""
    knots = np.unique([float(f"{value:.4g}") for value in np.quantile(values, quantiles)])
    return knots if len(knots) > 1 else np.array([knots[0], knots[0] + 1.0])


def hat_weights(values: FloatArray, knots: FloatArray) -> csr_matrix:
    """Weights (N, knots) of the knots at ``values`` (N,): linear between neighbours, flat outside; rows sum to 1."""
    clipped = np.clip(values, knots[0], knots[-1])
    left = np.clip(np.searchsorted(knots, clipped, side="right") - 1, 0, len(knots) - 2)
    share = (clipped - knots[left]) / (knots[left + 1] - knots[left])
    rows = np.arange(len(values))
    data = np.concatenate([1.0 - share, share])
    place = np.concatenate([rows, rows]), np.concatenate([left, left + 1])
    return csr_matrix((data, place), shape=(len(values), len(knots)))


def fit_additive(
    cues: Sequence[FloatArray], rock: BoolArray, knots: Sequence[FloatArray], stiffness: float
) -> AdditiveFit:
    """Evidence of ``cues`` (each (N,)) for ``rock`` (N,) at given ``knots``; ``stiffness`` of the bends, a sample."""
    design = _design(cues, knots)
    penalty = len(rock) * _penalty([len(k) for k in knots], stiffness)
    return _parts(_newton(design, rock.astype(float), penalty), knots)


def fit_choice(
    cues: Sequence[FloatArray],
    right: BoolArray,
    group: NDArray[np.signedinteger[Any]],
    weight: FloatArray,
    knots: Sequence[FloatArray],
    stiffness: float,
) -> AdditiveFit:
    """Evidence of ``cues`` (each (N,)) for one of the choices of each group, or none of them.

    A choice is taken with the odds of its evidence against 1 for none and the odds of all others of its ``group``
    (N,), which counts up from 0 without gaps. What should be taken is any that is ``right`` (N,), none where none is;
    groups count by ``weight`` (groups,). Conditional logit: McFadden, in Frontiers in Econometrics, 1974.
    """
    design = _design(cues, knots)
    penalty = weight.sum() * _penalty([len(k) for k in knots], stiffness)
    first = np.flatnonzero(np.diff(group, prepend=-1))
    some = np.logical_or.reduceat(right, first)

    def loss(weights: FloatArray) -> tuple[float, FloatArray]:
        odds = np.exp(np.clip(design @ weights, -_LARGEST, _LARGEST))
        total, good = 1.0 + np.add.reduceat(odds, first), np.add.reduceat(odds * right, first)
        good[~some] = 1.0
        pull = penalty @ weights
        slope = odds * ((weight / total)[group] - right * (weight / good)[group])
        missed = float(weight @ (np.log(total) - np.log(good)))
        return missed + 0.5 * float(weights @ pull), design.T @ slope + pull

    found = minimize(loss, np.zeros(design.shape[1]), jac=True, method="L-BFGS-B", options={"maxiter": 400})
    return _parts(np.asarray(found.x), knots)


def _design(cues: Sequence[FloatArray], knots: Sequence[FloatArray]) -> csr_matrix:
    """Ones for the bias, and the weights of the knots of all cues."""
    from scipy.sparse import hstack

    hats = [hat_weights(values, places) for values, places in zip(cues, knots, strict=True)]
    return hstack([csr_matrix(np.ones((len(cues[0]), 1))), *hats]).tocsr()


def _parts(weights: FloatArray, knots: Sequence[FloatArray]) -> AdditiveFit:
    """Bias and evidence from the fitted weights of a design."""
    parts = np.split(weights[1:], np.cumsum([len(k) for k in knots])[:-1])
    # Rows of hats sum to one: what all knots of a cue share belongs to the bias.
    return AdditiveFit(
        float(weights[0] + sum(p.mean() for p in parts)), tuple(knots), tuple(p - p.mean() for p in parts)
    )


def _penalty(sizes: Sequence[int], stiffness: float) -> FloatArray:
    penalty = np.zeros((1 + sum(sizes), 1 + sum(sizes)))
    start = 1
    for size in sizes:
        bends = np.diff(np.eye(size), 2, axis=0) if size > 2 else np.zeros((0, size))
        block = slice(start, start + size)
        penalty[block, block] = stiffness * bends.T @ bends + _SIZE_PENALTY * np.eye(size)
        start += size
    return penalty


def _newton(design: csr_matrix, target: FloatArray, penalty: FloatArray) -> FloatArray:
    weights = np.zeros(design.shape[1])
    for _ in range(_ROUNDS):
        chance = 1.0 / (1.0 + np.exp(-np.clip(design @ weights, -30.0, 30.0)))
        slope = design.T @ (target - chance) - penalty @ weights
        curve = (design.T @ design.multiply((chance * (1.0 - chance))[:, None])).toarray() + penalty
        step = np.linalg.solve(curve, slope)
        weights += step
        if np.abs(step).max() < _STOP:
            break
    return weights
