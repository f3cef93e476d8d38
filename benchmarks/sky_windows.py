"""Windows of sky and ridge that become U, and other windows that wrongly do, cross-validated by scene.

    uv run python benchmarks/sky_windows.py DATA/mars/terrain_all --down DATA/mars/rocks_all [--write mars.toml]

The first folder holds pictures and, beside each, ``NAME_sem.png`` with 6 = sky, 7 = ridge, 5 and 255 = unknown. The
pictures of ``--down`` look down: by eye none of them shows sky or ridge, so all of it teaches what is neither; beside
each lies ``NAME_mask.png`` with 255 = rock. Each picture is judged by evidence, bias and skyline prices learned from
all pictures of other scenes (sols more than three apart). A window is what most of its pixels are. ``--write`` puts
what all pictures together teach into a knowledge file.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from perception.knowledge_base import SKY_CUES, Knowledge, Sky, load_knowledge
from perception.learn_sky import (
    GREY_CUES,
    SkySamples,
    WindowCounts,
    compare_windows,
    learn_sky,
    sky_samples,
    sky_toml,
    window_truth,
)
from perception.pipeline import examine
from perception.scenes import scene_groups
from rover_sim.files import write_text
from rover_sim.learning.knowledge_text import knowledge_text, replace_tables
from rover_sim.parallel import over_cores
from worlds.types import BoolArray, ByteArray

SKY, NO_TRUTH = (6, 7), (5, 255)
# A share of others wrongly U against the same share of sky missed. The targets are 2 % and 10 %, a ratio of 5; the
# others of the pictures that look down count among them, hence 10. Without colour, ground must come before sky.
WRONG_WEIGHT = {"colour": 10.0, "grey": 30.0}


@dataclass(frozen=True, eq=False)
class Labelled:
    """One picture with what people say of it."""

    name: str
    picture: ByteArray  # RGB
    sky: BoolArray
    known: BoolArray
    rock: BoolArray
    labelled: bool = True  # people said where the sky is; else the picture looks down


def read_all(terrain: Path, down: Path | None) -> list[Labelled]:
    """All labelled pictures of both folders."""
    found = []
    for label_path in sorted(terrain.glob("*_sem.png")):
        label, picture = read(label_path, "_sem.png")
        found.append(
            Labelled(label_path.stem[:-4], picture, np.isin(label, SKY), ~np.isin(label, NO_TRUTH), label == 4)
        )
    for label_path in sorted(down.glob("*_mask.png")) if down else []:
        label, picture = read(label_path, "_mask.png")
        nothing = np.zeros(label.shape, dtype=bool)
        found.append(Labelled(label_path.stem[:-5], picture, nothing, ~nothing, label > 127, labelled=False))
    return found


def read(label_path: Path, ending: str) -> tuple[ByteArray, ByteArray]:
    """Label and RGB picture."""
    stem = label_path.name.removesuffix(ending)
    picture_path = next(
        p for p in (label_path.with_name(f"{stem}.png"), label_path.with_name(f"{stem}.jpg")) if p.is_file()
    )
    label, picture = cv2.imread(str(label_path), cv2.IMREAD_GRAYSCALE), cv2.imread(str(picture_path))
    if label is None or picture is None:
        raise SystemExit(f"{picture_path}: cannot be read")
    return np.asarray(label, dtype=np.uint8), np.asarray(picture[..., ::-1], dtype=np.uint8)


def samples_of(item: Labelled) -> tuple[SkySamples, SkySamples]:
    """Samples with and without colour."""
    with_colour, without = (sky_samples(item.picture, item.sky, item.known, coloured=c) for c in (True, False))
    return with_colour, without


def learned(samples: Sequence[tuple[SkySamples, SkySamples]]) -> Sky:
    """Evidence from all samples."""
    return Sky(
        colour=learn_sky([colour for colour, _ in samples], SKY_CUES, WRONG_WEIGHT["colour"]),
        grey=learn_sky([grey for _, grey in samples], GREY_CUES, WRONG_WEIGHT["grey"]),
    )


def fold(
    group: int,
    groups: Sequence[int],
    items: Sequence[Labelled],
    samples: Sequence[tuple[SkySamples, SkySamples]],
    know: Knowledge,
) -> list[tuple[int, list[WindowCounts], int]]:
    """Index, counts (colour, grey, windows of one kind only) and hidden rock pixels of the pictures left out."""
    rest = [s for s, g in zip(samples, groups, strict=True) if g != group]
    changed = replace(know, sky=learned(rest))
    return [(i, *judge(items[i], changed)) for i, g in enumerate(groups) if g == group]


def judge(item: Labelled, know: Knowledge) -> tuple[list[WindowCounts], int]:
    """Counts of one picture by the whole pipeline, and the rock pixels that it hides."""
    grey = np.asarray(cv2.cvtColor(item.picture, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    found = examine(item.picture, know)
    unknown = np.asarray(found.classes == "U")
    truth, _ = window_truth(item.sky, item.known)
    pure = item.known & (item.sky == truth.repeat(20, 0).repeat(20, 1))
    whole = pure.reshape(12, 20, 16, 20).all(axis=(1, 3)).repeat(20, 0).repeat(20, 1)
    counts = [
        compare_windows(unknown, item.sky, item.known),
        compare_windows(np.asarray(examine(grey, know).classes == "U"), item.sky, item.known),
        compare_windows(unknown, item.sky, item.known & whole),
    ]
    return counts, int((found.hidden & item.rock).sum())


def report(rows: Sequence[tuple[int, list[WindowCounts], int]], items: Sequence[Labelled]) -> None:
    """Print worst pictures and totals."""
    terrain = [row for row in rows if items[row[0]].labelled]
    for i, (count, _, _), _ in sorted(rows, key=lambda row: -row[1][0].missed - row[1][0].wrong)[:12]:
        missed, wrong = f"missed {count.missed:3d} of {count.sky:3d}", f"wrong {count.wrong:3d} of {count.other:3d}"
        print(f"{items[i].name[:32]:<34}{missed}, {wrong}")
    for text, column in (("as they are", 0), ("turned grey", 1), ("windows of one kind only", 2)):
        total = sum((counts[column] for _, counts, _ in terrain), WindowCounts())
        print(f"{text}: {len(terrain)} pictures, {figures(total)}")
    rest = [row for row in rows if row not in terrain]
    if rest:
        for text, column in (("as they are", 0), ("turned grey", 1)):
            total = sum((counts[column] for _, counts, _ in rest), WindowCounts())
            print(f"pictures that look down, {text}: {total.wrong_share:.2%} of {total.other} windows wrongly U")
        rock = sum(int(items[i].rock.sum()) for i, _, _ in rest)
        print(f"rock pixels hidden in them: {sum(hidden for _, _, hidden in rest) / rock:.2%}")


def figures(total: WindowCounts) -> str:
    """Both shares in words."""
    return (
        f"{total.recall:.1%} of {total.sky} windows of sky and ridge U, {total.wrong_share:.2%} of {total.other} others"
    )


def main() -> None:
    """Print the cross-validated figures, and write what all pictures teach where asked to."""
    parser = argparse.ArgumentParser(description="Sky and ridge windows.")
    parser.add_argument("terrain", type=Path)
    parser.add_argument("--down", type=Path, help="pictures that show no sky, with rock masks")
    parser.add_argument("--knowledge", default="mars")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--write", type=Path, metavar="FILE.toml")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    items, know = read_all(arguments.terrain, arguments.down), load_knowledge(arguments.knowledge)
    samples = [samples_of(item) for item in items]
    groups = scene_groups([item.name for item in items]).tolist()
    work = partial(fold, groups=groups, items=items, samples=samples, know=know)
    rows = [row for part in over_cores(work, sorted(set(groups)), "scenes", arguments.workers) for row in part]
    print(f"{len(items)} pictures of {max(groups) + 1} scenes")
    report(rows, items)
    if arguments.write:
        text = replace_tables(knowledge_text(str(arguments.write)), {"sky": sky_toml(learned(samples))})
        write_text(arguments.write, text)


if __name__ == "__main__":
    main()
