"""Where rocks are placed by one camera and by two, on rolling ground, against the renderer's truth.

uv run python benchmarks/stereo_ranges.py [--seeds 500 506] [--pictures 4] [--roughness 0.06]
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from perception.knowledge_base import load_knowledge
from perception.pipeline import Perception, perceive
from perception.stereo import depth_picture
from rover_sim.learning.rendered_views import RenderedView, make_world, rendered_views
from rover_sim.sim.renderer import add_noise, make_renderer
from rover_sim.traverse import STEREO_BASELINE_M
from worlds.geometry import to_the_right
from worlds.scenario import Camera
from worlds.types import FloatArray

RANGES_M = ((1.0, 2.0), (2.0, 3.0), (3.0, 4.0), (4.0, 6.0))


def errors(view: RenderedView, found: Perception) -> list[tuple[float, float, float]]:
    """True range, error and sigma of each placed rock that mostly shows one true rock of 12 cm or more."""
    rows = []
    for rock in found.rocks:
        owners = view.truth.ids[found.labels == rock.id]
        owners = owners[owners > 0]
        if rock.placed is None or not len(owners):
            continue
        where = np.flatnonzero(view.rocks.ids == np.bincount(owners).argmax())
        if len(where) and view.rocks.diameter_m[where[0]] >= 0.12 and not view.rocks.cut[where[0]]:
            off = np.array(rock.placed.position_w)[:2] - view.rocks.position_w[where[0], :2]
            rows.append((float(view.rocks.range_m[where[0]]), float(np.hypot(*off)), rock.placed.position_sd_m))
    return rows


def line(name: str, rows: FloatArray) -> str:
    """Median error by range, and how often it lies within sigma."""
    parts = []
    for low, high in RANGES_M:
        part = rows[(rows[:, 0] >= low) & (rows[:, 0] < high)]
        within = np.mean(part[:, 1] <= part[:, 2]) if len(part) else np.nan
        median = np.median(part[:, 1]) if len(part) else np.nan
        parts.append(f"{low:.0f}-{high:.0f} m {median:.3f} (n {len(part)}, within sigma {within:.2f})")
    return f"{name:6} median error: " + ", ".join(parts)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Rock places by one camera and by two.")
    parser.add_argument("--seeds", type=int, nargs=2, default=(500, 506), metavar=("FIRST", "END"))
    parser.add_argument("--pictures", type=int, default=4)
    parser.add_argument("--roughness", type=float, default=0.06)
    parser.add_argument("--plane-reach", type=float, default=0.5)
    arguments = parser.parse_args()
    knowledge, rng = load_knowledge("rendered"), np.random.default_rng(0)
    one: list[tuple[float, float, float]] = []
    two: list[tuple[float, float, float]] = []
    depth_off, matched, spent = [], [], []
    for seed in range(*arguments.seeds):
        world = make_world(seed, arguments.roughness)
        renderer = make_renderer(world)
        for view in rendered_views(world, arguments.pictures, arguments.plane_reach):
            frame = view.frame
            assert frame.camera_pose is not None
            right = renderer.render(frame.camera, to_the_right(frame.camera_pose, STEREO_BASELINE_M)).image
            right = add_noise(right, Camera().noise, rng)
            one += errors(view, perceive(frame, knowledge))
            two += errors(view, perceive(replace(frame, right=right, baseline_m=STEREO_BASELINE_M), knowledge))
            start = time.process_time()
            depth = depth_picture(frame.image, right, frame.camera, (1.0, 1.0), STEREO_BASELINE_M)
            spent.append(time.process_time() - start)
            near = view.truth.depth_m < 6.0
            matched.append(np.isfinite(depth[near]).mean())
            disparity = frame.camera.focal_px * STEREO_BASELINE_M * (1.0 / depth - 1.0 / view.truth.depth_m)
            depth_off.append(np.nanmedian(np.abs(disparity[near])))
    print(line("one", np.array(one)))
    print(line("two", np.array(two)))
    share, off = np.mean(matched), np.mean(depth_off)
    print(f"depths within 6 m: {share:.1%} of the pixels, median error {off:.2f} px of disparity")
    print(f"matching: {1e3 * np.median(spent):.1f} ms of processor time a pair")


if __name__ == "__main__":
    main()
