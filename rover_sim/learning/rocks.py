"""Rock outlines as labels: ``STEM_mask.png`` (or ``STEM.png`` in a folder of its own), white = rock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from perception.faithful import paper_rocks
from perception.knowledge_base import Knowledge, load_knowledge
from perception.learn_rocks import Example, learn_rocks, learned_tables, to_grey
from perception.pipeline import examine, working_picture
from perception.rock_score import RockCounts, count_rocks
from perception.scenes import scene_groups
from rover_sim.errors import InputError
from rover_sim.files import output_folder, write_json, write_text
from rover_sim.learning.knowledge_text import knowledge_text, replace_tables
from rover_sim.parallel import over_cores
from rover_sim.pictures import read_picture
from rover_sim.report.rock_scores import save_rock_scores
from worlds.types import BoolArray, ByteArray

Pair = tuple[Path, Path]
METHODS = {
    "colour": "pictures as they are",
    "grey": "the same turned grey",
    "paper": "by the paper's own means",
}


@dataclass(frozen=True)
class PictureScore:
    """Counts of one picture by method."""

    name: str
    counts: dict[str, RockCounts]


def label_of(image: Path, folder: Path) -> Path:
    """The label of ``image`` in ``folder``: ``STEM_mask.png``, or ``STEM.png`` where there is no such file."""
    mask = folder / f"{image.stem}_mask.png"
    return mask if mask.is_file() else folder / f"{image.stem}.png"


def read_labelled(pair: Pair) -> tuple[ByteArray, BoolArray]:
    """Picture and rock pixels, both at the working size; a label of another shape is an InputError."""
    image, label = read_picture(pair[0]), read_picture(pair[1])
    if image.shape[:2] != label.shape[:2]:
        sizes = " and ".join(f"{s[1]} x {s[0]}" for s in (label.shape, image.shape))
        raise InputError(f"{pair[1]}: {sizes} px; a label must be as large as its picture")
    rock = label if label.ndim == 2 else label.max(axis=2)
    return working_picture(image), np.asarray(working_picture(rock) > 127)


def score_picture(pair: Pair, knowledge: Knowledge) -> PictureScore:
    """Counts of one picture."""
    picture, truth = read_labelled(pair)
    found = {
        "colour": examine(picture, knowledge).labels,
        "grey": examine(to_grey(picture), knowledge).labels,
        "paper": paper_rocks(picture, knowledge),
    }
    return PictureScore(pair[0].stem, {method: count_rocks(labels, truth) for method, labels in found.items()})


def score(pairs: Sequence[Pair], knowledge: str, folder: Path, workers: int) -> list[str]:
    """Score ``knowledge`` on labelled pictures: ``score.json`` and ``score.png`` in ``folder``."""
    output_folder(folder)
    know = load_knowledge(knowledge)
    rows = over_cores(partial(score_picture, knowledge=know), pairs, "scoring", workers)
    _write_report(folder / "score", rows, {"kind": "rocks", "knowledge": knowledge})
    return score_lines(rows)


def learn(pairs: Sequence[Pair], base: str, out: Path, workers: int) -> list[str]:
    """Learn from labelled pictures: ``out`` (TOML) from all, its report from knowledge of the other scenes only."""
    output_folder(out.parent)
    know, text = load_knowledge(base), knowledge_text(base)
    groups = scene_groups([image.stem for image, _ in pairs])
    if groups.max(initial=0) < 1:
        raise InputError(f"--images {pairs[0][0].parent}: all pictures are of one scene; two or more are needed")
    # A fold a scene, and one that leaves none out: its knowledge is what ships.
    folds = [Fold(tuple(pairs), tuple(groups != group), know) for group in range(groups.max() + 2)]
    *parts, (learned, _) = over_cores(learn_fold, folds, "learning without one scene at a time", workers)
    rows = sorted(chain.from_iterable(rows for _, rows in parts), key=lambda row: row.name)
    write_text(out, replace_tables(text, learned_tables(learned)))
    load_knowledge(out)
    _write_report(
        out.with_suffix(""), rows, {"kind": "rocks", "base": base, "cross_validated": True, "scenes": len(parts)}
    )
    return score_lines(rows)


@dataclass(frozen=True)
class Fold:
    """Which of the pictures teach; the others are scored."""

    pairs: tuple[Pair, ...]
    teaches: tuple[bool, ...]
    base: Knowledge


def learn_fold(fold: Fold) -> tuple[Knowledge, list[PictureScore]]:
    """Knowledge from the pictures that teach, and how well it does on the others."""
    chosen = list(zip(fold.pairs, fold.teaches, strict=True))
    learned = learn_rocks([Example(*read_labelled(pair)) for pair, teaches in chosen if teaches], fold.base)
    return learned, [score_picture(pair, learned) for pair, teaches in chosen if not teaches]


def summary(counts: Sequence[RockCounts]) -> dict[str, float]:
    """The figures of several pictures."""
    total = sum(counts, RockCounts())
    names = ("iou", "precision", "recall", "object_precision", "object_recall", "object_f1")
    mean = float(np.mean([c.iou for c in counts]))
    return {**{name: round(float(getattr(total, name)), 4) for name in names}, "mean_iou": round(mean, 4)}


def score_lines(rows: Sequence[PictureScore]) -> list[str]:
    """A line a method."""
    lines = []
    for method, text in METHODS.items():
        s = summary([row.counts[method] for row in rows])
        lines.append(
            f"{text}: IoU {s['iou']:.3f} pooled, {s['mean_iou']:.3f} mean of {len(rows)} pictures, "
            f"precision {s['precision']:.3f}, recall {s['recall']:.3f}; objects from 150 px: F1 {s['object_f1']:.3f}, "
            f"precision {s['object_precision']:.3f}, recall {s['object_recall']:.3f}"
        )
    return lines


def _write_report(stem: Path, rows: Sequence[PictureScore], about: dict[str, Any]) -> None:
    methods = {method: summary([row.counts[method] for row in rows]) for method in METHODS}
    pictures = [
        {"name": row.name, **{m: {**asdict(c), "iou": round(c.iou, 4)} for m, c in row.counts.items()}} for row in rows
    ]
    write_json(stem.with_name(f"{stem.name}.json"), {**about, "methods": methods, "pictures": pictures})
    ious = {METHODS[m]: [row.counts[m].iou for row in rows] for m in METHODS}
    save_rock_scores(stem.with_name(f"{stem.name}.png"), ious, {METHODS[m]: v for m, v in methods.items()})
