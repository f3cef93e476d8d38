"""Learning where to cut blobs that show several rocks, from pictures whose rocks are known pixel by pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from perception.additive_fit import fit_choice, quantile_knots
from perception.binarize import SingleArray
from perception.blobs import Blobs, find_blobs
from perception.knowledge_base import PARTING_CUES, Cue, Knowledge, Parting, cue_lines
from perception.pipeline import View, prepare, rock_pixels, working_picture
from perception.rock_parting import Integers, all_cuts, cut, side_of
from rover_sim.learning.rendered_views import RenderedView
from worlds.types import BoolArray, FloatArray, IntArray

QUANTILES = (0.01, 0.1, 0.25, 0.5, 0.75, 0.9, 0.97, 0.995)  # of a cue's values, where its knots are
STIFFNESS = 1e-3
LEAST_PX = 10  # on either side of a cut
LEAST_ROCK_PX = 8  # a part that shows a smaller rock gains nothing
HARMLESS = 0.1  # weight of a blob that no cut makes better or worse


@dataclass(frozen=True, eq=False)
class CutSamples:
    """Lines through blobs and through what is left of them once cut rightly."""

    measures: FloatArray  # (N, 16)
    gain: IntArray  # (N,) rocks that have a blob of their own after the cut, minus before
    blob: IntArray  # (N,) counts up from 0


def cut_samples(view: RenderedView, know: Knowledge) -> CutSamples:
    """All lines through the blobs of one picture, found as `examine` finds them, and what each would gain."""
    blobs, even, score = blobs_before_parting(view, know)
    ids, seen = np.maximum(view.truth.ids, 0), view.rocks.seen_px >= LEAST_ROCK_PX
    true_px = np.bincount(ids.ravel())
    wanted = np.zeros(len(true_px), dtype=bool)
    wanted[view.rocks.ids[seen]] = True
    labels = blobs.labels.copy()
    measures, gains = [np.empty((0, len(PARTING_CUES)))], [np.empty(0, dtype=np.int32)]
    waiting, free = [(blob + 1, blobs.box_px[blob]) for blob in range(len(blobs))], len(blobs) + 1
    while waiting:
        label, box = waiting.pop()
        found, lines = all_cuts(labels, even, score, label, box, LEAST_PX)
        if not len(lines):
            continue
        here = (slice(box[1], box[1] + box[3]), slice(box[0], box[0] + box[2]))
        y, x = np.nonzero(labels[here] == label)
        of = ids[here][y, x]
        sides = [side_of(x, y, line, box) for line in lines]
        pairs = (_shows_one(of[far], true_px, wanted) + _shows_one(of[~far], true_px, wanted) for far in sides)
        gain = np.fromiter(pairs, np.int32, len(lines)) - _shows_one(of, true_px, wanted)
        measures.append(found)
        gains.append(gain)
        if gain.max() > 0:
            best = np.flatnonzero(gain == gain.max())
            cut(labels, label, box, lines[best[len(best) // 2]], free)
            waiting += [(label, box), (free, box)]
            free += 1
    counts = [len(gain) for gain in gains[1:]]
    return CutSamples(np.concatenate(measures), np.concatenate(gains), np.repeat(np.arange(len(counts)), counts))


def learn_parting(samples: Sequence[CutSamples], threshold: float) -> Parting:
    """Evidence for the line that gains a rock, of all lines through a blob, or for none."""
    measures = np.concatenate([s.measures for s in samples])
    gain = np.concatenate([s.gain for s in samples])
    before = np.cumsum([0, *(s.blob.max(initial=-1) + 1 for s in samples)])
    blob = np.concatenate([s.blob + start for s, start in zip(samples, before, strict=False)])
    weight = np.full(int(before[-1]), HARMLESS)
    weight[blob[gain != 0]] = 1.0
    knots = [quantile_knots(column, QUANTILES) for column in measures.T]
    fit = fit_choice(list(measures.T), gain > 0, blob, weight, knots, STIFFNESS)
    cues = {
        name: Cue(value=_rounded(places), evidence=_rounded(evidence))
        for name, places, evidence in zip(PARTING_CUES, fit.knots, fit.evidence, strict=True)
    }
    return Parting(bias=round(fit.bias, 3), threshold=threshold, least_px=LEAST_PX, **cues)


def with_parting(know: Knowledge, parting: Parting, threshold: float) -> Knowledge:
    """``know`` that parts blobs where the evidence is at least ``threshold``."""
    return replace(know, parting=msgspec.structs.replace(parting, threshold=threshold))


def parting_toml(parting: Parting) -> str:
    """The TOML table."""
    lines = ["[parting]", *(f"{name} = {getattr(parting, name)}" for name in ("bias", "threshold", "least_px"))]
    lines += cue_lines(parting.named())
    return "\n".join(lines) + "\n"


def blobs_before_parting(view: RenderedView, know: Knowledge) -> tuple[Blobs, SingleArray, SingleArray]:
    """Blobs of a picture parted at necks alone, its evenly lit CIE Lab, and its rock score."""
    frame = view.frame
    assert frame.camera_pose is not None
    assert frame.ground is not None
    ready = prepare(working_picture(frame.image), know, View(frame.camera, frame.camera_pose, frame.ground))
    _, _, found = rock_pixels(ready, know)
    how = know.binarization
    return find_blobs(found.mask, how.min_area_px, how.neck_ratio), ready.even, found.score


def _shows_one(of: Integers, true_px: Integers, wanted: BoolArray) -> int:
    """1 if more than half of the pixels ``of`` a part, and of a wanted rock, belong to each other."""
    if len(of) == 0:
        return 0
    counts = np.bincount(of, minlength=1)
    counts[0] = 0
    rock = int(counts.argmax())
    return int(wanted[rock] and 2 * counts[rock] > max(len(of), int(true_px[rock])))


def _rounded(values: FloatArray) -> tuple[float, ...]:
    return tuple(float(f"{value:.4g}") for value in values)
