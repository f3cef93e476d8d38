"""Learns where to cut blobs that show several rocks, and what that brings on other rendered worlds.

    OMP_NUM_THREADS=1 uv run python benchmarks/rock_parting.py [--teach 100 148] [--check 300 330] [--out FILE.toml]

The evidence is learned from the worlds that teach. For each threshold the rocks found in the other worlds are counted
as `benchmarks/rendered_rocks.py` counts them; ``--out`` writes the shipped ``rendered`` knowledge with the evidence and
the threshold of the most rocks at a precision of ``LEAST_PRECISION``. Seeds from 500 on are for that benchmark alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.rendered_rocks import Score, add, figures
from perception.knowledge_base import Knowledge, load_knowledge
from perception.pipeline import perceive
from rover_sim.files import write_text
from rover_sim.learning.knowledge_text import knowledge_text, replace_tables
from rover_sim.learning.parting import cut_samples, learn_parting, parting_toml, with_parting
from rover_sim.learning.rendered_views import RenderedView, make_world, rendered_views

PICTURES = 4  # a world
THRESHOLDS = (-1.6, -1.3, -1.1, -0.9, -0.7, -0.5, -0.25, 0.0, 0.5)
LEAST_PRECISION = 0.98


def views(seeds: range) -> list[RenderedView]:
    """Pictures of flat worlds."""
    return [view for seed in seeds for view in rendered_views(make_world(seed, 0.0), PICTURES)]


def scored(seen: Sequence[RenderedView], know: Knowledge) -> tuple[float, float]:
    """Recall and precision."""
    score = Score()
    for view in seen:
        add(score, view, perceive(view.frame, know))
    return figures(score)


def main() -> None:
    """Learn, print the curve, write the table."""
    parser = argparse.ArgumentParser(description="Evidence for cuts between rocks of one blob.")
    parser.add_argument("--teach", type=int, nargs=2, default=(100, 148), metavar=("FIRST", "END"))
    parser.add_argument("--check", type=int, nargs=2, default=(300, 330), metavar=("FIRST", "END"))
    parser.add_argument("--out", type=Path, metavar="FILE.toml")
    arguments = parser.parse_args()
    know = replace(load_knowledge("rendered"), parting=None)
    parting = learn_parting([cut_samples(view, know) for view in views(range(*arguments.teach))], THRESHOLDS[0])
    seen = views(range(*arguments.check))
    print("without: recall {:.3f}, precision {:.3f}".format(*scored(seen, know)))
    results = {cut: scored(seen, with_parting(know, parting, cut)) for cut in THRESHOLDS}
    for cut, (recall, precision) in results.items():
        print(f"threshold {cut:+.2f}: recall {recall:.4f}, precision {precision:.4f}")
    precise = {cut: recall for cut, (recall, precision) in results.items() if precision >= LEAST_PRECISION}
    best = max(precise or dict.fromkeys(results, 0.0), key=lambda cut: (precise.get(cut, 0.0), cut))
    print(f"chosen: {best}")
    if arguments.out:
        chosen = with_parting(know, parting, best).parting
        assert chosen is not None
        write_text(arguments.out, replace_tables(knowledge_text("rendered"), {"parting": parting_toml(chosen)}))
        load_knowledge(arguments.out)


if __name__ == "__main__":
    main()
