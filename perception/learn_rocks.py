"""Evidence for rock, learned from pictures whose rock pixels people have outlined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from perception.additive_fit import fit_additive, quantile_knots
from perception.cues import SingleArray, cue_planes, used_cues
from perception.knowledge_base import Cue, Knowledge, RockCues
from perception.pipeline import hidden_mask, smoothed, working_picture
from perception.soil_reference import even_light, soil_reference
from worlds.types import BoolArray, ByteArray, FloatArray

QUANTILES = (0.01, 0.1, 0.25, 0.5, 0.75, 0.9, 0.99)
STIFFNESS = 1e-3
_STRIDE = 4  # every fourth pixel across and down: neighbours tell the same


@dataclass(frozen=True, eq=False)
class RockSamples:
    """Cues (K, N) and labels (N,) of sampled pixels of one picture."""

    cues: SingleArray
    rock: BoolArray


def rock_samples(image: ByteArray, truth: BoolArray, know: Knowledge) -> RockSamples:
    """Samples of a picture of any size with ``truth`` (240, 320), rock at the working size."""
    import cv2

    picture = working_picture(image)
    lab, _ = smoothed(picture, know.binarization.blur_px)
    grey = picture if picture.ndim == 2 else np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    hidden = hidden_mask(grey, lab, None, know)
    soil = soil_reference(lab, hidden, know.soil)
    names = used_cues(know.cues, coloured=True)
    window = know.binarization.roughness_window_px
    planes = cue_planes(even_light(lab, soil), soil, names, know.cues.shade_compensation, window)
    some = (slice(_STRIDE // 2, None, _STRIDE),) * 2
    seen = ~hidden[some]
    return RockSamples(planes[(slice(None), *some)][:, seen], truth[some][seen])


def learn_cues(samples: Sequence[RockSamples], know: Knowledge) -> Knowledge:
    """``know`` with evidence that fits ``samples``; nothing else of it changes."""
    values = np.concatenate([s.cues for s in samples], axis=1).astype(np.float64)
    rock = np.concatenate([s.rock for s in samples])
    knots = [quantile_knots(row, QUANTILES) for row in values]
    fit = fit_additive(list(values), rock, knots, STIFFNESS)
    cues = {
        name: Cue(value=_rounded(k, 4), evidence=_rounded(e, 3))
        for name, k, e in zip(used_cues(know.cues, coloured=True), fit.knots, fit.evidence, strict=True)
    }
    learned = RockCues(bias=round(fit.bias, 3), shade_compensation=know.cues.shade_compensation, **cues)
    return replace(know, cues=learned)


def cues_toml(cues: RockCues) -> str:
    """The table ``[cues]`` of a knowledge file."""
    lines = ["[cues]", f"bias = {cues.bias}", f"shade_compensation = {cues.shade_compensation}"]
    for name, cue in cues.named():
        lines.append(f"{name} = {{ value = {list(cue.value)}, evidence = {list(cue.evidence)} }}")
    return "\n".join(lines) + "\n"


def _rounded(values: FloatArray, digits: int) -> tuple[float, ...]:
    return tuple(float(f"{value:.{digits}g}") for value in values)
