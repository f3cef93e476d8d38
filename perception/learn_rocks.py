"""Evidence for rock, learned from pictures whose rock pixels people have outlined.

Learned are: which smooth pixels count as soil, evidence of the first and the second look, evidence for pictures
without colour, the threshold, how narrow a neck parts two rocks, and how certain a blob must be to count. All else
comes from the knowledge to begin with.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from perception.additive_fit import fit_additive, quantile_knots
from perception.binarize import Binarized, evidence_score, rock_mask
from perception.cues import SingleArray, colour_likeness, cue_planes
from perception.evidence import Planes
from perception.knowledge_base import Cue, CueSet, Knowledge, RockCues, SoilKnowledge, cue_lines
from perception.pipeline import classify_blobs, grey_levels, hidden_mask, smoothed
from perception.rock_score import RockCounts, count_rocks
from perception.soil_reference import SoilReference, even_light, soil_reference
from worlds.strict_toml import dump_toml
from worlds.types import BoolArray, ByteArray, FloatArray

FIRST_CUES = ("lightness", "green_red", "blue_yellow", "roughness")
SECOND_CUES = (*FIRST_CUES, "likeness")
GREY_CUES = ("lightness", "roughness")
QUANTILES = (0.01, 0.1, 0.25, 0.5, 0.75, 0.9, 0.99)  # of a cue's values, where its knots are
STIFFNESS = 1e-3
SOIL_CHOICES = tuple(product((9, 15), (10.0, 15.0, 20.0, 30.0)))  # window_px, smooth_percentile
THRESHOLDS = (0.35, 0.4, 0.45, 0.5)
SPAN = 0.15  # on either side of the threshold, for the optimum of a window
NECK_RATIOS = (0.0, 0.4, 0.5, 0.6)
CERTAINTIES = (0.4, 0.5, 0.6, 0.65, 0.7)
_STRIDE = 4  # every fourth pixel across and down: neighbours tell the same
_CHOICE_STRIDE = 8  # while the soil is chosen


@dataclass(frozen=True, eq=False)
class Example:
    """A picture, grey (240, 320) or RGB (240, 320, 3), and its rock pixels (240, 320)."""

    picture: ByteArray
    rock: BoolArray


@dataclass(frozen=True, eq=False)
class _Smoothed:
    """An example with its picture after the low-pass."""

    lab: SingleArray
    grey: ByteArray
    soft: ByteArray  # grey, after the low-pass
    hidden: BoolArray
    rock: BoolArray


@dataclass(frozen=True, eq=False)
class _Prepared:
    """An example with its soil and its cues."""

    lab: SingleArray  # evenly lit
    grey: ByteArray
    soft: ByteArray
    hidden: BoolArray
    rock: BoolArray
    soil: SoilReference
    planes: Planes


def learn_rocks(examples: Sequence[Example], know: Knowledge) -> Knowledge:
    """``know`` with soil, cues, second cues and grey cues that fit ``examples``."""
    smooth = [_smooth(one, know) for one in examples]
    know = replace(know, soil=choose_soil(smooth, know))
    ready = [_prepare(one, know) for one in smooth]
    first = fit_cues(ready, FIRST_CUES)
    shade = know.cues.shade_compensation
    know = replace(know, cues=RockCues(bias=first.bias, shade_compensation=shade, **dict(first.named())))
    for one in ready:
        one.planes["likeness"] = colour_likeness(one.lab, evidence_score(one.planes, first), one.soil, one.hidden)
    grey = [_prepare(_smooth(Example(to_grey(one.picture), one.rock), know), know) for one in examples]
    know = replace(know, second_cues=fit_cues(ready, SECOND_CUES), grey_cues=fit_cues(grey, GREY_CUES))
    return choose_cuts(ready, know)


def choose_soil(examples: Sequence[_Smoothed], know: Knowledge) -> SoilKnowledge:
    """The soil of `SOIL_CHOICES` with which a first look fits ``examples`` best, by IoU of the sampled pixels."""
    best, chosen = -1.0, know.soil
    for window, percentile in SOIL_CHOICES:
        soil = msgspec.structs.replace(know.soil, window_px=window, smooth_percentile=percentile)
        ready = [_prepare(one, replace(know, soil=soil)) for one in examples]
        fitted = _iou(ready, fit_cues(ready, FIRST_CUES, _CHOICE_STRIDE), know.binarization.threshold)
        if fitted > best:
            best, chosen = fitted, soil
    return chosen


def choose_cuts(ready: Sequence[_Prepared], know: Knowledge) -> Knowledge:
    """The threshold that fits rock pixels best (IoU); then neck ratio and least certainty, by rock objects (F1)."""
    scores = [evidence_score(one.planes, know.second_cues or know.cues, one.hidden) for one in ready]

    def counts(know: Knowledge) -> RockCounts:
        total = RockCounts()
        for one, score in zip(ready, scores, strict=True):
            found = Binarized(score, rock_mask(score, one.soft, know.binarization))
            total += count_rocks(classify_blobs(one.grey, one.lab, found, one.hidden, know)[0].labels, one.rock)
        return total

    know = max((_with_cut(know, threshold=t) for t in THRESHOLDS), key=lambda k: counts(k).iou)
    know = max((_with_cut(know, neck_ratio=n) for n in NECK_RATIOS), key=lambda k: counts(k).object_f1)
    return max((_with_certainty(know, c) for c in CERTAINTIES), key=lambda k: counts(k).object_f1)


def _with_cut(know: Knowledge, **cut: float) -> Knowledge:
    how = msgspec.structs.replace(know.binarization, **cut)
    span = (round(how.threshold - SPAN, 3), round(how.threshold + SPAN, 3))
    return replace(know, binarization=msgspec.structs.replace(how, threshold_span=span))


def _with_certainty(know: Knowledge, least: float) -> Knowledge:
    return replace(know, rock=msgspec.structs.replace(know.rock, min_certainty=least))


def fit_cues(ready: Sequence[_Prepared], names: Sequence[str], stride: int = _STRIDE) -> CueSet:
    """Evidence of the cues ``names`` that fits the sampled pixels."""
    values = [
        np.concatenate([_sampled(one, one.planes[name], stride) for one in ready]).astype(float) for name in names
    ]
    rock = np.concatenate([_sampled(one, one.rock, stride) for one in ready])
    fit = fit_additive(values, rock, [quantile_knots(row, QUANTILES) for row in values], STIFFNESS)
    cues = {
        name: Cue(value=_rounded(knots), evidence=_rounded(evidence))
        for name, knots, evidence in zip(names, fit.knots, fit.evidence, strict=True)
    }
    return CueSet(bias=_rounded(np.array([fit.bias]))[0], **cues)


def to_grey(picture: ByteArray) -> ByteArray:
    """``picture`` without its colour, (H, W)."""
    return picture if picture.ndim == 2 else np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), dtype=np.uint8)


def learned_tables(know: Knowledge) -> dict[str, str]:
    """The learned tables of a knowledge file, as TOML by name."""
    tables = {name: f"[{name}]\n" + dump_toml(getattr(know, name)) for name in ("soil", "binarization", "rock")}
    tables["cues"] = cues_toml("cues", know.cues)
    for name in ("second_cues", "grey_cues"):
        cues: CueSet | None = getattr(know, name)
        if cues is not None:
            tables[name] = cues_toml(name, cues)
    return tables


def cues_toml(table: str, cues: CueSet) -> str:
    """The TOML table of ``cues``."""
    lines = [f"[{table}]", f"bias = {cues.bias}"]
    if isinstance(cues, RockCues):
        lines.append(f"shade_compensation = {cues.shade_compensation}")
    lines += cue_lines(cues.named())
    return "\n".join(lines) + "\n"


def _smooth(example: Example, know: Knowledge) -> _Smoothed:
    grey = to_grey(example.picture)
    lab, soft = smoothed(example.picture, know.binarization.blur_px)
    return _Smoothed(lab, grey, grey_levels(soft), hidden_mask(grey, lab, None, know), example.rock)


def _prepare(one: _Smoothed, know: Knowledge) -> _Prepared:
    soil = soil_reference(one.lab, one.hidden, know.soil)
    even = even_light(one.lab, soil)
    window, shade = know.binarization.roughness_window_px, know.cues.shade_compensation
    return _Prepared(
        even, one.grey, one.soft, one.hidden, one.rock, soil, cue_planes(even, soil, FIRST_CUES, shade, window)
    )


def _sampled(one: _Prepared, plane: NDArray[Any], stride: int) -> NDArray[Any]:
    """Seen pixels (N,) of ``plane`` (H, W) on a coarse grid."""
    some = (slice(stride // 2, None, stride),) * 2
    return np.asarray(plane[some][~one.hidden[some]])


def _iou(ready: Sequence[_Prepared], cues: CueSet, threshold: float) -> float:
    """Overlap of what scores over ``threshold`` with rock, over the sampled pixels of all pictures."""
    both = either = 0
    for one in ready:
        planes = {name: _sampled(one, plane, _CHOICE_STRIDE)[None] for name, plane in one.planes.items()}
        found, rock = evidence_score(planes, cues)[0] > threshold, _sampled(one, one.rock, _CHOICE_STRIDE)
        both += int((found & rock).sum())
        either += int((found | rock).sum())
    return both / max(either, 1)


def _rounded(values: FloatArray) -> tuple[float, ...]:
    return tuple(float(f"{value:.4g}") for value in values)
