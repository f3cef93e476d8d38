"""Evidence for sky and far ridges, learned from pictures whose pixels people have named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import cv2
import msgspec
import numpy as np

from perception.additive_fit import fit_additive, quantile_knots
from perception.knowledge_base import Cue, Sky, SkyEvidence, cue_lines
from perception.pipeline import missing_data, smoothed, working_picture
from perception.sky import SingleArray, cell_evidence, over_line, sky_cues, wide_skyline
from perception.window_features import window_mean
from worlds.types import BoolArray, ByteArray, FloatArray

GREY_CUES = ("lightness", "texture", "texture_over", "texture_level", "row")
QUANTILES = (0.01, 0.05, 0.15, 0.3, 0.5, 0.7, 0.85, 0.95, 0.99)
STIFFNESS = 1e-3
_STRIDE = (2, 3)  # of the cells down and across that teach
_BLUR_PX = 1.0
# What the skyline is chosen from.
_OFFSETS, _STEP_COSTS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5), (3.0, 8.0)
_LEASTS, _WIDTHS = (0.0, 6.0), (0.0, 0.2, 0.4)


@dataclass(frozen=True, eq=False)
class SkySamples:
    """One picture at the working size: its cues, cells without data, and what people say that its pixels show."""

    cues: dict[str, SingleArray]  # each (rows, columns)
    missing: BoolArray  # (rows, columns)
    sky: BoolArray  # (H, W) sky or ridge
    known: BoolArray  # (H, W) either that or ground


@dataclass(frozen=True)
class WindowCounts:
    """Windows of sky or ridge and of anything else, and how many of each were found to be U or not."""

    sky: int = 0
    missed: int = 0
    other: int = 0
    wrong: int = 0

    def __add__(self, more: WindowCounts) -> WindowCounts:
        return WindowCounts(
            self.sky + more.sky, self.missed + more.missed, self.other + more.other, self.wrong + more.wrong
        )

    @property
    def recall(self) -> float:
        """Share of the sky windows that were found; 1 without any."""
        return 1.0 - self.missed / self.sky if self.sky else 1.0

    @property
    def wrong_share(self) -> float:
        """Share of the other windows taken for sky; 0 without any."""
        return self.wrong / self.other if self.other else 0.0


def sky_samples(image: ByteArray, sky: BoolArray, known: BoolArray, *, coloured: bool) -> SkySamples:
    """Samples of a picture of any size with its truth (240, 320) at the working size; its colour may be left out."""
    picture = working_picture(image)
    grey = picture if picture.ndim == 2 else np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    lab, _ = smoothed(picture if coloured else grey, _BLUR_PX)
    return SkySamples(*sky_cues(lab, missing_data(grey)), sky, known)


def learn_sky(samples: Sequence[SkySamples], names: tuple[str, ...], wrong_weight: float) -> SkyEvidence:
    """Evidence of the cues ``names`` that fits ``samples``, and the skyline's prices that serve them best.

    Best is the least sum of the share of missed windows of sky and ``wrong_weight`` times that of others taken for it.
    """
    picked = [_teaching(sample) for sample in samples]
    truth = np.concatenate([sky[pick] for sky, pick in picked])
    cues = [
        np.concatenate([s.cues[name][pick] for s, (_, pick) in zip(samples, picked, strict=True)]).astype(np.float64)
        for name in names
    ]
    fit = fit_additive(cues, truth, [quantile_knots(values, QUANTILES) for values in cues], STIFFNESS)
    named = {
        name: Cue(value=_rounded(knots, 4), evidence=_rounded(evidence, 3))
        for name, knots, evidence in zip(names, fit.knots, fit.evidence, strict=True)
    }
    start = SkyEvidence(bias=round(fit.bias, 3), step_cost=0.0, least=0.0, least_width=0.0, **named)
    return _priced(start, samples, wrong_weight)


def _teaching(sample: SkySamples) -> tuple[BoolArray, BoolArray]:
    """Which cells (rows, columns) are sky, and which of them teach."""
    size = sample.missing.shape[::-1]
    known = cv2.resize(sample.known.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    sky = cv2.resize(sample.sky.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    some = np.zeros(sample.missing.shape, dtype=bool)
    some[:: _STRIDE[0], :: _STRIDE[1]] = True
    return np.asarray(sky > 0.5 * known), np.asarray(some & (known > 0.5) & ~sample.missing)


def _priced(start: SkyEvidence, samples: Sequence[SkySamples], wrong_weight: float) -> SkyEvidence:
    """``start`` with the bias and the prices of least fault."""
    evidence = [cell_evidence(s.cues, s.missing, start) for s in samples]
    best, least_fault = start, float("inf")
    for offset, step, least, width in product(_OFFSETS, _STEP_COSTS, _LEASTS, _WIDTHS):
        prices = {"step_cost": step, "least": least, "least_width": width}
        tried = msgspec.structs.replace(start, bias=round(start.bias + offset, 3), **prices)
        total = WindowCounts()
        for values, sample in zip(evidence, samples, strict=True):
            moved = np.where(sample.missing, 0.0, values + offset)
            total += count_windows(found_sky(moved, tried, sample.sky.shape), sample)
        fault = 1.0 - total.recall + wrong_weight * total.wrong_share
        if fault < least_fault:
            best, least_fault = tried, fault
    return best


def found_sky(evidence: FloatArray, prices: SkyEvidence, shape: tuple[int, ...]) -> BoolArray:
    """Sky (H, W) over the best skyline through the evidence of cells."""
    return over_line(wide_skyline(evidence, prices), (shape[0], shape[1]))


def count_windows(found: BoolArray, sample: SkySamples) -> WindowCounts:
    """Windows of one picture; the found ones are at least half sky, the true ones mostly, see `window_truth`."""
    return compare_windows(window_mean(found) >= 0.5, sample.sky, sample.known)


def compare_windows(found: BoolArray, sky: BoolArray, known: BoolArray) -> WindowCounts:
    """Counts of windows ``found`` (rows, columns) to be U against pixels (H, W)."""
    truth, counted = window_truth(sky, known)
    return WindowCounts(
        int((truth & counted).sum()),
        int((truth & counted & ~found).sum()),
        int((~truth & counted).sum()),
        int((~truth & counted & found).sum()),
    )


def window_truth(sky: BoolArray, known: BoolArray) -> tuple[BoolArray, BoolArray]:
    """Which windows (rows, columns) are sky or ridge, and which count.

    A window is what most of its pixels are: sky or ridge, ground, or unknown; a draw goes to sky first, then to
    ground. Windows that are mostly unknown do not count.
    """
    above, seen = window_mean(sky & known), window_mean(known)
    ground = seen - above
    return np.asarray(above >= ground), np.asarray(np.maximum(above, ground) >= 1.0 - seen)


def sky_toml(sky: Sky) -> str:
    """The tables ``[sky.colour]`` and ``[sky.grey]`` of a knowledge file."""
    lines = []
    for name, table in (("colour", sky.colour), ("grey", sky.grey)):
        numbers = ("bias", "step_cost", "least", "least_width")
        lines += [f"[sky.{name}]", *(f"{key} = {getattr(table, key)}" for key in numbers)]
        lines += [*cue_lines(table.named()), ""]
    return "\n".join(lines)


def _rounded(values: FloatArray, digits: int) -> tuple[float, ...]:
    return tuple(float(f"{value:.{digits}g}") for value in values)
