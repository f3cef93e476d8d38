"""Heights of rendered rocks with and without the direction of the sun, against the renderer's truth.

    uv run python benchmarks/shadow_heights.py [--seeds 300 306] [--pictures 4]

The rocks are those that `benchmarks/rendered_rocks.py` counts and that were found; each world has a sun of the
elevation at an azimuth of its own. ``shown`` are rocks whose height the sun changes: a clear shadow is in sight.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from perception.knowledge_base import load_knowledge
from perception.pipeline import Perception, perceive
from rover_sim.learning.rendered_views import RenderedView, counted, make_world, matches, rendered_views
from worlds.types import FloatArray

SUNS_DEG = (15.0, 30.0, 50.0)


def heights(view: RenderedView, found: Perception) -> dict[int, tuple[float, float]]:
    """Perceived and true height of each counted rock that was found, by its true id."""
    rows = {int(identity): row for row, identity in enumerate(view.rocks.ids) if counted(view.rocks)[row]}
    mates = matches(found.labels, view.truth.ids)
    pairs = {mates[rock.id]: rock.placed for rock in found.rocks if rock.placed is not None and rock.id in mates}
    return {i: (rock.height_m, float(view.rocks.height_m[rows[i]])) for i, rock in pairs.items() if i in rows}


def line(name: str, ratio: FloatArray) -> str:
    """Median error and bias of heights, as shares of the true ones."""
    return (
        f"{name} {len(ratio):4d} rocks, error {np.median(np.abs(ratio - 1.0)):.3f}, bias {np.median(ratio) - 1.0:+.3f}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Heights of rendered rocks with and without the sun.")
    parser.add_argument("--seeds", type=int, nargs=2, default=(300, 306), metavar=("FIRST", "END"))
    parser.add_argument("--pictures", type=int, default=4, help="of each seed and sun")
    parser.add_argument("--roughness", type=float, default=0.0, help="rms of rolling ground in metres")
    arguments = parser.parse_args()
    knowledge = load_knowledge("rendered")
    for elevation in SUNS_DEG:
        rows = []
        for seed in range(*arguments.seeds):
            azimuth = float(np.random.default_rng((seed, int(elevation))).uniform(-180.0, 180.0))
            world = make_world(seed, arguments.roughness, (azimuth, elevation))
            for view in rendered_views(world, arguments.pictures):
                dark = heights(view, perceive(replace(view.frame, to_sun_w=None), knowledge))
                lit = heights(view, perceive(view.frame, knowledge))
                rows += [(dark[i][0] / dark[i][1], lit[i][0] / lit[i][1]) for i in dark]
        without, with_sun = np.array(rows).T
        shown = without != with_sun
        print(f"sun at {elevation:.0f} deg")
        print(f"  {line('all:   without', without)}; {line('with', with_sun)}")
        print(f"  {line('shown: without', without[shown])}; {line('with', with_sun[shown])}")


if __name__ == "__main__":
    main()
