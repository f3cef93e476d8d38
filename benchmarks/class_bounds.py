"""What limits the six classes on rendered worlds: parts of the truth put in place of what was found, and label noise.

    OMP_NUM_THREADS=1 uv run python benchmarks/class_bounds.py [--worlds 18]

The worlds are those that served to develop the classes (seeds from 5001), judged by the shipped knowledge. First the
chance of clasts is put right in part, and the windows are judged again by the rules and by the definition alone (cut
0.4, U known). Then the windows of the truth are moved, which no picture can tell: how far do the letters agree with
themselves? Last, how many pixels of clasts a window is from another letter, and how the rules do farther from there.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace

import cv2
import numpy as np

from benchmarks.rendered_classes import TEXTURES, Labelled, gather
from perception.class_definition import (
    BIG_COVER,
    RESOLVED_PX,
    ROUGH_COVER,
    SPECK_PX,
    STAGES,
    VERY_ROUGH_COVER,
    VERY_SMALL_PX,
    WINDOW_PX,
    window_stages,
)
from perception.clasts import clast_stages
from perception.knowledge_base import Knowledge, load_knowledge
from perception.terrain_class import classify
from perception.ttam import ttam
from perception.window_features import SingleArray, window_features
from rover_sim.learning.grid import Letters
from rover_sim.scoring import resolved, rock_extents_px
from worlds.types import IntArray

FIRST_SEED = 5001
CUT = 0.4
MARGINS_PX = (0, 1, 2, 4, 8, 16)
SHIFTS_PX = ((1, 0), (0, 1), (2, 0), (0, 2))
Chance = Callable[[Labelled], SingleArray]


def areas_px(view: Labelled) -> IntArray:
    """Pixels of the clast that each pixel (H, W) shows; 0 where there is none."""
    ids = np.maximum(view.clasts, 0)
    return np.asarray(np.where(ids > 0, np.bincount(ids.ravel())[ids], 0), dtype=np.int32)


def found(view: Labelled) -> SingleArray:
    """The chance of clasts as it is."""
    assert view.windows.chance is not None
    return view.windows.chance


def sizes_right(low: int, high: int) -> Chance:
    """The chance with the clasts of ``low`` to under ``high`` pixels put right."""
    return lambda view: np.where((areas_px(view) >= low) & (areas_px(view) < high), np.float32(1.0), found(view))


def nothing_false(view: Labelled) -> SingleArray:
    """The chance, none where no clast is."""
    return np.where(resolved(view.clasts), found(view), np.float32(0.0))


def no_false_clasts(view: Labelled) -> SingleArray:
    """The chance, none farther than a pixel from a clast."""
    beside = cv2.dilate(resolved(view.clasts).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return np.where(beside, found(view), np.float32(0.0))


def half_found_whole(view: Labelled) -> SingleArray:
    """Every clast of which more than half is found, whole, and nothing else."""
    ids = np.maximum(view.clasts, 0)
    share = np.bincount(ids.ravel(), weights=(found(view) > CUT).ravel()) / np.maximum(np.bincount(ids.ravel()), 1)
    return np.asarray((share[ids] > 0.5) & resolved(view.clasts), dtype=np.float32)


def truth(view: Labelled) -> SingleArray:
    """1 where a clast is."""
    return resolved(view.clasts).astype(np.float32)


PARTS: dict[str, Chance] = {
    "as found": found,
    "clasts of 4 and 5 px right": sizes_right(RESOLVED_PX, 6),
    "clasts of 6 to 11 px right": sizes_right(6, 12),
    "clasts from 12 px right": sizes_right(12, 1 << 30),
    "no false pixels": nothing_false,
    "none but within 1 px of a clast": no_false_clasts,
    "what is half found whole, no others": half_found_whole,
    "all right": truth,
}


def by_rules(view: Labelled, chance: SingleArray, know: Knowledge) -> Letters:
    """Letters (192,) of a picture with another chance of clasts."""
    features = window_features(replace(view.windows, chance=chance), know.terrain_rules.input_names)
    return classify(features, know.terrain_rules, know.terrain.min_certainty).ravel()


def lettered(view: Labelled, stages: np.ndarray) -> Letters:
    """Letters (192,) of stages, U where that is true."""
    return np.where(view.letters == "U", "U", np.array(STAGES)[stages.astype(np.intp).ravel()])


def moved(view: Labelled, across: int, down: int) -> Letters:
    """True letters of windows that lie elsewhere by some pixels."""
    ids = np.roll(view.clasts, (-down, -across), (0, 1))
    area = np.bincount(np.maximum(view.clasts, 0).ravel()).astype(np.int32)
    return lettered(view, window_stages(ids, area, rock_extents_px(view.clasts)))


def margin_px(inside: IntArray, letter: str) -> int:
    """Pixels of clasts, ``inside`` of each (N,), that at least must come or go until a window's letter changes."""
    cover, largest, size = int(inside.sum()), int(inside.max(initial=0)), WINDOW_PX**2
    rough, very_rough = ROUGH_COVER * size, VERY_ROUGH_COVER * size
    if letter == "S":
        return RESOLVED_PX if len(inside) == 0 else SPECK_PX + 1 - largest
    if letter == "V":
        alone = {1: largest - SPECK_PX, 2: int(inside.min())}.get(len(inside), size)
        return min(int(np.ceil(rough - cover)), VERY_SMALL_PX + 1 - largest, alone)
    if letter == "m":
        up = int(very_rough) + 1 - cover
        return min(up, max(cover - int(np.ceil(rough)) + 1, largest - VERY_SMALL_PX))
    return cover - int(very_rough) if letter == "M" else largest - int(BIG_COVER * size) + 1


def margins_px(view: Labelled) -> IntArray:
    """`margin_px` (192,) of all windows; of U as many as a window has."""
    area = np.bincount(np.maximum(view.clasts, 0).ravel())
    margins = np.full(len(view.letters), WINDOW_PX**2, dtype=np.int32)
    columns = view.clasts.shape[1] // WINDOW_PX
    for place in np.flatnonzero(view.letters != "U"):
        row, column = divmod(int(place), columns)
        window = view.clasts[row * WINDOW_PX : (row + 1) * WINDOW_PX, column * WINDOW_PX : (column + 1) * WINDOW_PX]
        ids, inside = np.unique(window[window > 0], return_counts=True)
        margins[place] = margin_px(inside[area[ids] >= RESOLVED_PX].astype(np.int32), str(view.letters[place]))
    return margins


def show(views: Sequence[Labelled], know: Knowledge) -> None:
    """Print the tables."""
    true = np.concatenate([v.letters for v in views])
    for name, chance in PARTS.items():
        rules = np.concatenate([by_rules(v, chance(v), know) for v in views])
        alone = np.concatenate([lettered(v, clast_stages(chance(v), CUT)) for v in views])
        print(f"{name}: TTAM {ttam(true, rules):.1f} by rules, {ttam(true, alone):.1f} by the definition")
    for shift in SHIFTS_PX:
        print(f"true windows moved by {shift} px: {ttam(true, np.concatenate([moved(v, *shift) for v in views])):.1f}")
    judged = np.concatenate([by_rules(v, found(v), know) for v in views])
    margin, wrong = np.concatenate([margins_px(v) for v in views]), judged != true
    for least in MARGINS_PX:
        far = margin > least
        print(
            f"more than {least} px from another letter: {far.mean():.2f} of the windows, TTAM "
            f"{ttam(true[far], judged[far]):.1f}; nearer {wrong[~far].sum() / wrong.sum():.2f} of all errors"
        )
    texture = np.repeat([v.texture for v in views], len(views[0].letters))
    for name in TEXTURES:
        print(f"{name}: TTAM {ttam(true[texture == name], judged[texture == name]):.1f}")


def main() -> None:
    """Print what limits the classes."""
    parser = argparse.ArgumentParser(description="What limits the six classes on rendered worlds.")
    parser.add_argument("--worlds", type=int, default=18)
    know = load_knowledge("rendered")
    show(gather(FIRST_SEED, parser.parse_args().worlds, know), know)


if __name__ == "__main__":
    main()
