"""Rocks in rendered pictures against the renderer's truth: found, false, placed, measured, and TTAM.

    uv run python benchmarks/rendered_rocks.py [--seeds 200 212] [--pictures 4] [--roughness 0.06] [--plane-reach 0.5]

A rock counts if its diameter is at least 0.10 m, it lies within 5 m, no part of it is outside the picture, at least
half of it is seen (against its outline with nothing before it) and at least 12 pixels show it; the second line has no
such filter: every rock of that size and range with a pixel in the picture. A reported rock and a true one match when
more than half of each one's pixels belong to the other, so neither can have two partners. Whatever is reported within
5 m and matches no rock, not even an uncounted one, is false: also what joins two rocks or is a piece of one. Seeds
from 500 on are never looked at while anything is tuned.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field

import numpy as np

from perception.knowledge_base import load_knowledge
from perception.pipeline import Perception, perceive
from perception.ttam import ttam
from rover_sim.learning.rendered_views import (
    LEAST_M,
    WITHIN_M,
    RenderedView,
    counted,
    make_world,
    matches,
    rendered_views,
)
from rover_sim.scoring import true_classes
from worlds.types import BoolArray, FloatArray, PerceivedRock

RANGES_M = ((0.0, 2.0), (2.0, 3.0), (3.0, 4.0), (4.0, 5.0))
SIZES_PX = ((12, 20), (20, 40), (40, 100), (100, 100000))


@dataclass
class Score:
    """Counts and measures over all pictures."""

    pictures: int = 0
    reported: int = 0
    false_ground: int = 0  # mostly on ground
    false_rock: int = 0  # joins rocks, or is a piece of one
    ttams: list[float] = field(default_factory=list)
    sizes: list[tuple[bool, bool, int]] = field(default_factory=list)  # counted, found, pixels
    pairs: list[tuple[float, ...]] = field(default_factory=list)  # see `measured`


def measured(view: RenderedView, rock: PerceivedRock, row: int) -> tuple[float, ...]:
    """Range, error along and across the line of sight, their sigma, diameter and height with their true values."""
    assert view.frame.camera_pose is not None
    true, eye = view.rocks, view.frame.camera_pose.position_w[:2]
    sight = (true.position_w[row, :2] - eye) / true.range_m[row]
    off = np.array(rock.position_w[:2]) - true.position_w[row, :2]
    along, across = float(off @ sight), float(off @ [-sight[1], sight[0]])
    size = float(np.sqrt(rock.length_m * rock.width_m))
    return (
        float(true.range_m[row]), along, across, rock.position_sd_m,
        size, float(true.diameter_m[row]), rock.height_m, float(true.height_m[row]),
    )  # fmt: skip


def add(score: Score, view: RenderedView, found: Perception) -> None:
    """Count one picture."""
    true, ids = view.rocks, view.truth.ids
    which, mates = counted(true), matches(found.labels, ids)
    placed = {rock.id: rock.placed for rock in found.rocks if rock.placed is not None}
    hits = {mates[label]: label for label in placed if label in mates}
    score.pictures += 1
    score.ttams.append(ttam(true_classes(view.clasts, view.truth.depth_m), found.classes))
    for row, identity in enumerate(true.ids.tolist()):
        if true.diameter_m[row] >= LEAST_M and true.range_m[row] <= WITHIN_M and true.seen_px[row]:
            score.sizes.append((bool(which[row]), identity in hits, int(true.seen_px[row])))
        if which[row] and identity in hits:
            rock = placed[hits[identity]]
            score.pairs.append(measured(view, rock, row))
    for label, rock in placed.items():
        if rock.range_m <= WITHIN_M:
            score.reported += 1
            on_rock = bool((ids[found.labels == label] > 0).mean() > 0.5)
            score.false_rock += label not in mates and on_rock
            score.false_ground += label not in mates and not on_rock


def figures(score: Score) -> tuple[float, float]:
    """Recall and precision."""
    which, found, _ = np.array(score.sizes).T
    right = score.reported - score.false_ground - score.false_rock
    return float(found[which > 0].mean()), right / max(score.reported, 1)


def report(score: Score) -> list[str]:
    """The figures as lines."""
    which, found, pixels = np.array(score.sizes).T
    counts, hit = which.astype(bool), found.astype(bool)
    false = score.false_ground + score.false_rock
    by_size = (f"{a}-{b}: {_share(hit[counts & (pixels >= a) & (pixels < b)])}" for a, b in SIZES_PX)
    precision = _ratio(score.reported - false, score.reported)
    return [
        f"{score.pictures} pictures: recall {_share(hit[counts])}, precision {precision}",
        f"without filter: recall {_share(hit)}",
        f"false: {score.false_ground} on ground, {score.false_rock} joined or pieces; TTAM {np.mean(score.ttams):.1f}",
        f"recall by pixels: {', '.join(by_size)}",
        *_errors(np.array(score.pairs)),
    ]


def _errors(pairs: FloatArray) -> list[str]:
    lines = ["range m        n  position error m           within sigma   diameter          height"]
    lines += ["           median  90 %  along across sigma   1     2       error   bias      error  bias"]
    for low, high in (*RANGES_M, (0.0, WITHIN_M)):
        away, along, across, sigma, size, true_size, height, true_height = pairs[
            (pairs[:, 0] >= low) & (pairs[:, 0] <= high)
        ].T
        error, ratio, tall = np.hypot(along, across), size / true_size - 1.0, height / true_height - 1.0
        lines.append(
            f"{low:.0f}-{high:.0f} {len(away):10d} {np.median(error):7.3f} {np.quantile(error, 0.9):5.3f} "
            f"{np.median(along):+6.3f} {np.median(np.abs(across)):5.3f} {np.median(sigma):6.3f} "
            f"{np.mean(np.abs(along) <= sigma):5.2f} {np.mean(np.abs(along) <= 2 * sigma):5.2f} "
            f"{100 * np.median(np.abs(ratio)):8.1f} % {100 * np.median(ratio):+5.1f} % "
            f"{100 * np.median(np.abs(tall)):8.1f} % {100 * np.median(tall):+5.1f} %"
        )
    return lines


def _share(found: BoolArray) -> str:
    return _ratio(int(found.sum()), len(found))


def _ratio(part: int, whole: int) -> str:
    return f"{part}/{whole} = {part / max(whole, 1):.3f}"


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description="Rocks in rendered pictures against the renderer's truth.")
    parser.add_argument("--seeds", type=int, nargs=2, default=(200, 212), metavar=("FIRST", "END"))
    parser.add_argument("--pictures", type=int, default=4, help="of each seed")
    parser.add_argument("--roughness", type=float, default=0.0, help="rms of rolling ground in metres")
    parser.add_argument("--plane-reach", type=float, default=0.5, help="metres around the rover that it knows")
    parser.add_argument("--knowledge", default="rendered")
    arguments = parser.parse_args()
    knowledge, score = load_knowledge(arguments.knowledge), Score()
    for seed in range(*arguments.seeds):
        world = make_world(seed, arguments.roughness)
        for view in rendered_views(world, arguments.pictures, arguments.plane_reach):
            add(score, view, perceive(view.frame, knowledge))
    print("\n".join(report(score)))


if __name__ == "__main__":
    main()
