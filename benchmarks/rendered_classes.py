"""Six classes on rendered worlds, by rules learned on others: three suns, three ground textures, true labels.

    OMP_NUM_THREADS=1 uv run python benchmarks/rendered_classes.py [--learn 36] [--score 18] [--out FILE.toml]

Worlds of the learning and of the scored set take the nine pairs of sun and texture in turn, with seeds of their own;
three pictures each. Scored: rules from all learning worlds; and, for each sun and each texture, rules from the
learning worlds without it on the scored worlds with it. ``--out`` writes the rules from the learning worlds into the
shipped ``rendered`` knowledge. The rock evidence behind the features is the shipped one; it was taught on sand under
other suns. "rocks only" is the score against labels that take pebbles for soil.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

import numpy as np

from perception.knowledge_base import Knowledge, load_knowledge
from perception.pipeline import View, examine
from perception.ttam import ttam
from rover_sim.learning.grid import (
    EMPHASIS,
    GridSample,
    Letters,
    grid_sample,
    judge,
    learn_rules,
    summary,
    with_rules,
    write_rules,
)
from rover_sim.learning.knowledge_text import knowledge_text
from rover_sim.learning.rendered_views import make_world, rendered_views
from rover_sim.scoring import true_classes
from worlds.scenario import GroundTexture

SUNS_DEG = {"high": (60.0, 55.0), "middle": (200.0, 32.0), "low": (310.0, 18.0)}
TEXTURES: tuple[GroundTexture, ...] = get_args(GroundTexture)
FIRST_LEARNED, FIRST_SCORED = 3001, 7001  # 5001 to 5027 served to develop this
PICTURES, ROUGHNESS_M = 3, 0.06
PENALTY = 0.03  # there are a dozen times the windows of the hand labels


@dataclass(frozen=True, eq=False)
class Labelled:
    """Windows of one picture, its sun and texture, and the letters with pebbles taken for soil."""

    sun: str
    texture: str
    sample: GridSample
    rocks_only: Letters


def gather(first_seed: int, worlds: int, know: Knowledge) -> list[Labelled]:
    """Pictures of ``worlds`` worlds."""
    pairs = [(sun, texture) for texture in TEXTURES for sun in SUNS_DEG]
    found = []
    for index in range(worlds):
        sun, texture = pairs[index % len(pairs)]
        world = make_world(first_seed + index, ROUGHNESS_M, SUNS_DEG[sun], texture)
        for view in rendered_views(world, PICTURES):
            frame = view.frame
            assert frame.camera_pose is not None
            assert frame.ground is not None
            windows = examine(frame.image, know, View(frame.camera, frame.camera_pose, frame.ground)).windows
            letters = true_classes(view.clasts, view.truth.depth_m)
            sample = grid_sample(f"{first_seed + index}", windows, letters, know)
            found.append(Labelled(sun, texture, sample, true_classes(view.truth.ids, view.truth.depth_m).ravel()))
    return found


def rules_from(views: Sequence[Labelled], know: Knowledge, *, rocks_only: bool = False) -> Knowledge:
    """``know`` with rules from these pictures."""
    samples = [replace(v.sample, letters=v.rocks_only) if rocks_only else v.sample for v in views]
    return with_rules(know, learn_rules(samples, know, EMPHASIS, PENALTY))


def show(title: str, views: Sequence[Labelled], know: Knowledge) -> None:
    """Print TTAM of both methods."""
    rows = [judge(v.sample, know) for v in views]
    best, faithful = (summary(rows, method) for method in ("best", "faithful"))
    recall = " ".join(f"{letter} {value:.2f}" for letter, value in best["recall"].items())
    print(
        f"{title}: TTAM {best['ttam']:.1f} ({best['ttam_without_u']:.1f} without U), faithful {faithful['ttam']:.1f} "
        f"({faithful['ttam_without_u']:.1f}); recall {recall}",
        flush=True,
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Six classes on rendered worlds.")
    parser.add_argument("--learn", type=int, default=36, metavar="WORLDS")
    parser.add_argument("--score", type=int, default=18, metavar="WORLDS")
    parser.add_argument("--out", type=Path, metavar="FILE.toml")
    arguments = parser.parse_args()
    know = load_knowledge("rendered")
    learned, scored = gather(FIRST_LEARNED, arguments.learn, know), gather(FIRST_SCORED, arguments.score, know)
    rules = rules_from(learned, know)
    if arguments.out is not None:
        tables = learn_rules([v.sample for v in learned], know, EMPHASIS, PENALTY)
        write_rules(arguments.out, knowledge_text("rendered"), tables)
    show("all suns and textures learned", scored, rules)
    print(np.array(summary([judge(v.sample, rules) for v in scored], "best")["confusion"]))
    by_rocks = rules_from(learned, know, rocks_only=True)
    found = np.concatenate([judge(v.sample, by_rocks).found["best"] for v in scored])
    true = np.concatenate([v.rocks_only for v in scored])
    print(f"rocks only, learned so: TTAM {ttam(true, found):.1f} ({ttam(true, found, None):.1f} without U)", flush=True)
    for name in SUNS_DEG:
        without = rules_from([v for v in learned if v.sun != name], know)
        show(f"sun {name} never learned", [v for v in scored if v.sun == name], without)
    for texture in TEXTURES:
        without = rules_from([v for v in learned if v.texture != texture], know)
        show(f"texture {texture} never learned", [v for v in scored if v.texture == texture], without)


if __name__ == "__main__":
    main()
