"""Evidence for clasts of a few pixels, learned from pictures in which every clast is known: rendered ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perception.additive_fit import fit_additive, quantile_knots
from perception.clasts import GATE, add_second_planes, first_planes, redness
from perception.evidence import Planes, chance_of
from perception.knowledge_base import CLAST_CUES, ClastCues, ClastKnowledge, Cue, cue_lines
from perception.window_features import WindowSource
from worlds.types import BoolArray, FloatArray

FIRST_CUES = ("red_median", "red_over", "score", "light_range")  # few, as every pixel is asked for them
SECOND_CUES = tuple(CLAST_CUES)
QUANTILES = (0.005, 0.02, 0.06, 0.15, 0.35, 0.65, 0.85, 0.94, 0.98, 0.995)  # of a cue's values, where its knots are
CLAST_QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)  # of its values on clasts: these are few
STIFFNESS = 1e-3
ROCK_CUT = 0.25  # of 0.2 to 0.45 the best for rocks from 10 cm on worlds 330 to 359, with their sizes
_STRIDE = 6, 4  # of the pixels that the first and the second look learn from


@dataclass(frozen=True, eq=False)
class ClastExample:
    """A picture, and which of its pixels (H, W) show a clast and are to be learned from."""

    windows: WindowSource
    clast: BoolArray
    counts: BoolArray


def learn_clasts(examples: Sequence[ClastExample]) -> ClastKnowledge:
    """Evidence of both looks that fits ``examples``."""
    planes = [first_planes(redness(w.picture, w.hidden), w.grey, w.score) for w in (one.windows for one in examples)]
    counts = [one.counts & ~one.windows.hidden for one in examples]
    clast = [one.clast for one in examples]
    first = _fit(planes, clast, [_thinned(some, _STRIDE[0]) for some in counts], FIRST_CUES)
    for own, one in zip(planes, examples, strict=True):
        add_second_planes(own, chance_of(own, first.bias, first.named(), one.windows.hidden))
    near = [_thinned(some & (own["chance_most"] >= GATE), _STRIDE[1]) for some, own in zip(counts, planes, strict=True)]
    return ClastKnowledge(rock_cut=ROCK_CUT, first=first, second=_fit(planes, clast, near, SECOND_CUES))


def clasts_toml(know: ClastKnowledge) -> str:
    """The table ``[clasts]`` of a knowledge file."""
    lines = ["# How likely a pixel shows a clast, down to pebbles of a few pixels, by evidence that adds up."]
    lines += ["[clasts]", f"rock_cut = {know.rock_cut}"]
    for look, cues in (("first", know.first), ("second", know.second)):
        lines += [f"[clasts.{look}]", f"bias = {cues.bias}", *cue_lines(cues.named())]
    return "\n".join(lines) + "\n"


def _fit(
    planes: Sequence[Planes], clast: Sequence[BoolArray], chosen: Sequence[BoolArray], names: Sequence[str]
) -> ClastCues:
    true = _gathered(clast, chosen)
    values = [_gathered([own[name] for own in planes], chosen).astype(np.float64) for name in names]
    fit = fit_additive(values, true, [_knots(row, true) for row in values], STIFFNESS)
    cues = {
        name: Cue(value=tuple(knots.tolist()), evidence=tuple(round(float(v), 2) for v in evidence))
        for name, knots, evidence in zip(names, fit.knots, fit.evidence, strict=True)
    }
    return ClastCues(bias=round(fit.bias, 3), **cues)


def _knots(values: FloatArray, clast: BoolArray) -> FloatArray:
    return np.unique(
        np.concatenate([quantile_knots(values, QUANTILES), quantile_knots(values[clast], CLAST_QUANTILES)])
    )


def _gathered(planes: Sequence[NDArray[Any]], chosen: Sequence[BoolArray]) -> NDArray[Any]:
    return np.concatenate([own[some] for own, some in zip(planes, chosen, strict=True)])


def _thinned(chosen: BoolArray, stride: int) -> BoolArray:
    """``chosen`` (H, W) on a coarse grid: neighbours tell the same."""
    thin = np.zeros_like(chosen)
    thin[stride // 2 :: stride, stride // 2 :: stride] = chosen[stride // 2 :: stride, stride // 2 :: stride]
    return thin
