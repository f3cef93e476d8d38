"""Six classes on rendered worlds, by rules learned on others: three suns, three ground textures, true labels.

    OMP_NUM_THREADS=1 uv run python benchmarks/rendered_classes.py [--learn 36] [--score 18] [--out FILE.toml]

Worlds of the learning and of the scored set take the nine pairs of sun and texture in turn, with seeds of their own;
three pictures each. Scored: clast evidence and rules from all learning worlds; and, for each sun and each texture,
both from the learning worlds without it on the scored worlds with it. ``--out`` writes what the learning worlds taught
into the shipped ``rendered`` knowledge. The rock evidence behind the features is the shipped one; it was taught on sand
under other suns. Last comes how many of the true clasts of each size have most of their pixels found.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import get_args

import numpy as np

from perception.clasts import clast_chance, redness
from perception.knowledge_base import PAPER_INPUTS, ClastKnowledge, Knowledge, load_knowledge
from perception.learn_clasts import ClastExample, clasts_toml, learn_clasts
from perception.pipeline import View, examine
from perception.window_features import STONE_CUTS, WindowSource, window_features
from rover_sim.learning.grid import (
    EMPHASIS,
    GridSample,
    Letters,
    judge,
    learn_rules,
    summary,
    with_rules,
    write_rules,
)
from rover_sim.learning.knowledge_text import knowledge_text, replace_tables
from rover_sim.learning.rendered_views import make_world, rendered_views
from rover_sim.scoring import FAR_M, resolved, true_classes
from worlds.scenario import GroundTexture
from worlds.types import BoolArray, Frame, IntArray

SUNS_DEG = {"high": (60.0, 55.0), "middle": (200.0, 32.0), "low": (310.0, 18.0)}
TEXTURES: tuple[GroundTexture, ...] = get_args(GroundTexture)
FIRST_LEARNED, FIRST_SCORED = 3001, 7001  # 5001 to 5027 served to develop this
PICTURES, ROUGHNESS_M = 3, 0.06
PENALTY = 0.03  # there are a dozen times the windows of the hand labels
SIZES_PX = (4, 5, 6, 8, 12, 16, 25, 50, 100_000)


@dataclass(frozen=True, eq=False)
class Labelled:
    """One picture: its sun and texture, what its windows are judged by, and the truth."""

    sun: str
    texture: str
    frame: Frame
    windows: WindowSource
    letters: Letters  # (192,)
    clasts: IntArray  # (H, W) ids of rocks and pebbles
    near: BoolArray  # (H, W)


def gather(first_seed: int, worlds: int, know: Knowledge) -> list[Labelled]:
    """Pictures of ``worlds`` worlds."""
    pairs = [(sun, texture) for texture in TEXTURES for sun in SUNS_DEG]
    found = []
    for index in range(worlds):
        sun, texture = pairs[index % len(pairs)]
        world = make_world(first_seed + index, ROUGHNESS_M, SUNS_DEG[sun], texture)
        for view in rendered_views(world, PICTURES):
            frame, truth = view.frame, view.truth
            windows = windows_of(frame, know)
            letters = true_classes(view.clasts, truth.depth_m).ravel()
            near = np.asarray(truth.depth_m <= FAR_M)
            found.append(Labelled(sun, texture, frame, windows, letters, view.clasts, near))
    return found


def clasts_from(views: Sequence[Labelled]) -> ClastKnowledge:
    """Clast evidence from these pictures."""
    return learn_clasts([ClastExample(v.windows, resolved(v.clasts), v.near) for v in views])


def sample(view: Labelled, clasts: ClastKnowledge, know: Knowledge) -> GridSample:
    """All features of a picture, its rocks and pebbles found by ``clasts``."""
    windows = windows_of(view.frame, replace(know, clasts=clasts))
    names = (*know.terrain_rules.input_names, *PAPER_INPUTS)
    features = {name: values.ravel() for name, values in window_features(windows, names).items()}
    return GridSample("", features, view.letters)


def windows_of(frame: Frame, know: Knowledge) -> WindowSource:
    """What the windows of a picture are judged by."""
    assert frame.camera_pose is not None
    assert frame.ground is not None
    return examine(frame.image, know, View(frame.camera, frame.camera_pose, frame.ground)).windows


def show(title: str, learned: Sequence[Labelled], scored: Sequence[Labelled], know: Knowledge) -> None:
    """Learn and print TTAM of both methods."""
    clasts = clasts_from(learned)
    rules = with_rules(know, learn_rules([sample(v, clasts, know) for v in learned], know, EMPHASIS, PENALTY))
    rows = [judge(sample(v, clasts, know), rules) for v in scored]
    best, faithful = (summary(rows, method) for method in ("best", "faithful"))
    recall = " ".join(f"{letter} {value:.2f}" for letter, value in best["recall"].items())
    textures = {v.texture: [r for r, own in zip(rows, scored, strict=True) if own.texture == v.texture] for v in scored}
    on = " ".join(f"{name} {summary(own, 'best')['ttam']:.1f}" for name, own in textures.items())
    print(
        f"{title}: TTAM {best['ttam']:.1f} ({best['ttam_without_u']:.1f} without U; {on}), faithful "
        f"{faithful['ttam']:.1f} ({faithful['ttam_without_u']:.1f}); recall {recall}",
        flush=True,
    )


def write(path: Path, learned: Sequence[Labelled], know: Knowledge) -> None:
    """The shipped knowledge with what these pictures taught."""
    clasts = clasts_from(learned)
    tables = learn_rules([sample(v, clasts, know) for v in learned], know, EMPHASIS, PENALTY)
    write_rules(path, replace_tables(knowledge_text("rendered"), {"clasts": clasts_toml(clasts)}), tables)


def show_clasts(learned: Sequence[Labelled], scored: Sequence[Labelled]) -> None:
    """Print how well pixels of clasts are found, and clasts by size."""
    know, cut = clasts_from(learned), STONE_CUTS["stones"]
    both = either = 0
    sizes, shares = list[int](), list[float]()
    for view in scored:
        w, true = view.windows, resolved(view.clasts) & view.near
        found = (clast_chance(redness(w.picture, w.hidden), w.grey, w.score, w.hidden, know) > cut) & view.near
        both, either = both + int((found & true).sum()), either + int((found | true).sum())
        ids, area = np.unique(view.clasts[true], return_counts=True)
        hit = np.bincount(view.clasts[true & found], minlength=int(ids.max(initial=0)) + 1)
        sizes += area.tolist()
        shares += (hit[ids] / area).tolist()
    print(f"pixels of clasts: IoU {both / either:.3f}")
    for low, high in pairwise(SIZES_PX):
        own = [share for size, share in zip(sizes, shares, strict=True) if low <= size < high]
        print(f"  {low:3d} px and more: {len(own):5d} clasts, {np.mean(np.array(own) > 0.5):.2f} found")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Six classes on rendered worlds.")
    parser.add_argument("--learn", type=int, default=36, metavar="WORLDS")
    parser.add_argument("--score", type=int, default=18, metavar="WORLDS")
    parser.add_argument("--out", type=Path, metavar="FILE.toml")
    arguments = parser.parse_args()
    know = load_knowledge("rendered")
    learned = gather(FIRST_LEARNED, arguments.learn, know)
    if arguments.out is not None:
        write(arguments.out, learned, know)
    scored = gather(FIRST_SCORED, arguments.score, know)
    show("all suns and textures learned", learned, scored, know)
    for name in SUNS_DEG:
        parts = [v for v in learned if v.sun != name], [v for v in scored if v.sun == name]
        show(f"sun {name} never learned", *parts, know)
    for texture in TEXTURES:
        parts = [v for v in learned if v.texture != texture], [v for v in scored if v.texture == texture]
        show(f"texture {texture} never learned", *parts, know)
    show_clasts(learned, scored)


if __name__ == "__main__":
    main()
