"""Class letters of windows as labels: ``STEM.csv``, a row of letters S V m M B U a row of windows, top row first.

Two rule bases are learned and scored side by side: the best one, over the inputs that the base knowledge names, and
the faithful one, over the 2004 paper's own features in the paper's form of rules.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perception.knowledge_base import PAPER_INPUTS, Knowledge, load_knowledge
from perception.learn_rocks import Example, learn_rocks
from perception.learn_terrain import LETTERS, learn_additive, learn_paper_rules, learned_base, rules_toml
from perception.pipeline import examine, working_picture
from perception.scenes import SOLS_APART, scene_groups, sol_of
from perception.terrain_class import classify
from perception.ttam import confusion, ttam
from perception.window_features import WindowSource, window_features
from rover_sim.errors import InputError
from rover_sim.files import output_folder, write_json, write_text
from rover_sim.learning.knowledge_text import knowledge_text, replace_tables
from rover_sim.learning.labels import label_pairs
from rover_sim.learning.rocks import label_of as mask_of
from rover_sim.learning.rocks import read_labelled
from rover_sim.parallel import over_cores
from rover_sim.pictures import read_picture
from rover_sim.report.class_scores import save_class_scores
from worlds.types import FloatArray

Pair = tuple[Path, Path]
Letters = NDArray[np.str_]
METHODS = {"best": "all inputs of the rules", "faithful": "the paper's own features and form of rules"}
GRID_SHAPE = (12, 16)
EMPHASIS = {"M": 2.0}  # few windows are M: without it hardly any is found


@dataclass(frozen=True, eq=False)
class GridSample:
    """Features (192,) each and true letters (192,) of the windows of one picture."""

    name: str
    features: dict[str, FloatArray]
    letters: Letters


@dataclass(frozen=True, eq=False)
class GridScore:
    """True and found letters of one picture, found ones by method."""

    name: str
    true: Letters
    found: dict[str, Letters]


def label_of(image: Path, folder: Path) -> Path:
    """The label of ``image`` in ``folder``."""
    return folder / f"{image.stem}.csv"


def read_letters(path: Path) -> Letters:
    """Letters (12, 16) of a label file; InputError for another shape or letter."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = [[cell.strip() for cell in row] for row in csv.reader(file) if row]
    if len(rows) != GRID_SHAPE[0] or any(len(row) != GRID_SHAPE[1] for row in rows):
        raise InputError(f"{path}: {len(rows)} rows; 12 rows of 16 letters are needed")
    wrong = sorted({letter for row in rows for letter in row} - set(LETTERS))
    if wrong:
        raise InputError(f"{path}: {wrong[0]!r}; allowed are {', '.join(LETTERS)}")
    return np.array(rows, dtype="<U1")


def sample(pair: Pair, know: Knowledge) -> GridSample:
    """Features and letters of one picture."""
    windows = examine(working_picture(read_picture(pair[0])), know).windows
    return grid_sample(pair[0].stem, windows, read_letters(pair[1]), know)


def grid_sample(name: str, windows: WindowSource, letters: Letters, know: Knowledge) -> GridSample:
    """Features that ``know`` and the faithful rules ask for, beside the true letters (12, 16)."""
    features = window_features(windows, (*know.terrain_rules.input_names, *PAPER_INPUTS))
    return GridSample(name, {k: v.ravel() for k, v in features.items()}, letters.ravel())


def learn_rules(
    samples: Sequence[GridSample], know: Knowledge, emphasis: Mapping[str, float], penalty: float = 1.0
) -> dict[str, dict[str, Any]]:
    """Tables of the rules of both methods."""
    letters = np.concatenate([s.letters for s in samples]).tolist()
    seen = {name: np.concatenate([s.features[name] for s in samples]) for name in samples[0].features}
    return {
        "best": learn_additive({n: seen[n] for n in know.terrain_rules.input_names}, letters, emphasis, penalty),
        "faithful": learn_paper_rules({name: seen[name] for name in PAPER_INPUTS}, letters),
    }


def judge(one: GridSample, know: Knowledge) -> GridScore:
    """Letters of a picture by the rules of ``know``."""
    rules = {"best": know.terrain_rules, "faithful": know.paper_rules}
    found = {m: classify(one.features, base, know.terrain.min_certainty) for m, base in rules.items()}
    return GridScore(one.name, one.letters, found)


def with_rules(know: Knowledge, tables: Mapping[str, Mapping[str, Any]]) -> Knowledge:
    """``know`` with the rules of learned tables."""
    return replace(know, terrain_rules=learned_base(tables["best"]), paper_rules=learned_base(tables["faithful"]))


def score(pairs: Sequence[Pair], knowledge: str, folder: Path, workers: int) -> list[str]:
    """Score ``knowledge`` on labelled pictures: ``score.json`` and ``score.png`` in ``folder``."""
    output_folder(folder)
    know = load_knowledge(knowledge)
    samples = over_cores(partial(sample, know=know), pairs, "scoring", workers)
    rows = [judge(one, know) for one in samples]
    write_report(folder / "score", rows, {"kind": "grid", "knowledge": knowledge})
    return score_lines(rows)


def learn(pairs: Sequence[Pair], base: str, out: Path, workers: int, outlines: Path | None = None) -> list[str]:
    """Learn from labelled pictures: ``out`` (TOML) from all, its report from rules of the other scenes only.

    The rock evidence behind the features is that of ``base``; for the report it is learned for each scene from the
    outlined pictures in ``outlines`` that are of other scenes, so that nothing in it has seen the picture judged.
    """
    output_folder(out.parent)
    know, text = load_knowledge(base), knowledge_text(base)
    groups = scene_groups([image.stem for image, _ in pairs])
    if groups.max(initial=0) < 1:
        raise InputError(f"--images {pairs[0][0].parent}: all pictures are of one scene; two or more are needed")
    evidence = _evidence(pairs, groups, know, outlines, workers)
    folds = [(pairs, groups == group, evidence[group]) for group in range(groups.max() + 1)]
    rows = sorted((r for part in over_cores(_fold, folds, "cross-validating", workers) for r in part), key=_name)
    samples = over_cores(partial(sample, know=know), pairs, "reading", workers)
    tables = learn_rules(samples, know, EMPHASIS)
    write_rules(out, text, tables)
    about = {"kind": "grid", "base": base, "cross_validated": True, "scenes": len(folds)}
    write_report(out.with_suffix(""), rows, {**about, "rock_evidence_of_other_scenes": outlines is not None})
    return score_lines(rows)


def write_rules(out: Path, text: str, tables: Mapping[str, Mapping[str, Any]]) -> None:
    """The knowledge file ``text`` with learned rules in place of its own, as ``out``; it loads, or InputError."""
    learned = {"terrain_rules": tables["best"], "paper_rules": tables["faithful"]}
    write_text(out, replace_tables(text, {name: rules_toml(name, table) for name, table in learned.items()}))
    load_knowledge(out)


def _name(row: GridScore) -> str:
    return row.name


def _evidence(
    pairs: Sequence[Pair], groups: NDArray[np.int32], know: Knowledge, outlines: Path | None, workers: int
) -> list[Knowledge]:
    """Knowledge for judging each scene, its rock evidence from other scenes where outlines are given."""
    count = int(groups.max()) + 1
    if outlines is None:
        return [know] * count
    outlined = label_pairs(outlines, outlines, mask_of)
    sols = np.array([sol_of(image.stem) for image, _ in outlined])
    teaching = []
    for group in range(count):
        own = [sol_of(pair[0].stem) for pair, g in zip(pairs, groups, strict=True) if g == group]
        apart = np.abs(sols[:, None] - np.array(own)).min(axis=1) > SOLS_APART
        teaching.append(tuple(pair for pair, other in zip(outlined, apart, strict=True) if other))
    distinct = list(dict.fromkeys(teaching))
    made = over_cores(partial(_rock_evidence, base=know), distinct, "learning rock evidence", workers)
    return [made[distinct.index(chosen)] for chosen in teaching]


def _rock_evidence(outlined: Sequence[Pair], base: Knowledge) -> Knowledge:
    return learn_rocks([Example(*read_labelled(pair)) for pair in outlined], base)


def _fold(fold: tuple[Sequence[Pair], NDArray[np.bool_], Knowledge]) -> list[GridScore]:
    """Scores of the pictures left out, by rules from all others."""
    pairs, left_out, know = fold
    samples = [sample(pair, know) for pair in pairs]
    learned = with_rules(
        know, learn_rules([s for s, out in zip(samples, left_out, strict=True) if not out], know, EMPHASIS)
    )
    return [judge(s, learned) for s, out in zip(samples, left_out, strict=True) if out]


def summary(rows: Sequence[GridScore], method: str) -> dict[str, Any]:
    """The figures of several pictures: TTAM in percent, recall of each class, confusion (rows: true; S V m M B U)."""
    true = np.concatenate([row.true for row in rows])
    found = np.concatenate([row.found[method] for row in rows])
    counts = confusion(true, found)
    held = counts.sum(axis=1)
    recall = {x: round(float(counts[i, i] / held[i]), 3) for i, x in enumerate(LETTERS) if held[i]}
    return {
        "ttam": round(ttam(true, found), 2),
        "ttam_without_u": round(ttam(true, found, None), 2),
        "accuracy": round(float((true == found).mean()), 4),
        "recall": recall,
        "confusion": counts.tolist(),
    }


def score_lines(rows: Sequence[GridScore]) -> list[str]:
    """A line a method."""
    lines = []
    for method, text in METHODS.items():
        s = summary(rows, method)
        recall = ", ".join(f"{letter} {value:.2f}" for letter, value in s["recall"].items())
        lines.append(
            f"{text}: TTAM {s['ttam_without_u']:.1f} without U, {s['ttam']:.1f} with U at weight 1, "
            f"of {len(rows)} pictures; recall {recall}"
        )
    return lines


def write_report(stem: Path, rows: Sequence[GridScore], about: Mapping[str, Any]) -> None:
    """``STEM.json`` and ``STEM.png``: figures and confusion by method, TTAM picture by picture."""
    methods = {method: summary(rows, method) for method in METHODS}
    names = ("ttam", "ttam_without_u")
    pictures = [
        {"name": row.name, **{m: {k: _number(summary([row], m)[k]) for k in names} for m in METHODS}} for row in rows
    ]
    write_json(stem.with_name(f"{stem.name}.json"), {**about, "methods": methods, "pictures": pictures})
    by_picture = {m: [float(ttam(row.true, row.found[m])) for row in rows] for m in METHODS}
    save_class_scores(stem.with_name(f"{stem.name}.png"), methods, by_picture, METHODS)


def _number(value: float) -> float | None:
    """JSON has no NaN: a picture whose windows are all U has no TTAM without them."""
    return value if np.isfinite(value) else None
