"""Perception against the renderer's truth: recall, false rocks, position error by range, TTAM.

    uv run python benchmarks/rendered_rocks.py [--seeds 200 212] [--pictures 4] [--roughness 0.06]

Each seed is a world with a sun and a rock cover of its own; the rover stands at random free places, its camera and
its believed ground tilted like the plane through the ground under it. The shipped knowledge was fitted on seeds 100
to 117: use others to score. Recall counts rocks of at least 0.2 m within 6 m of which 40 pixels are seen, found if
half of them are in the mask; a placed rock within 6 m is false if less than a fifth of it is rock.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from perception.ground import ground_range
from perception.knowledge_base import Knowledge, load_knowledge
from perception.pipeline import perceive
from perception.ttam import ttam
from rover_sim.scoring import true_classes
from rover_sim.sim.renderer import RenderedImage, add_noise, make_renderer
from rover_sim.sim.rover import load_rover
from worlds.build import build_world
from worlds.geometry import camera_pose, quaternion_from_rotation
from worlds.heightfield import height_at
from worlds.scenario import Camera, Goal, Rocks, Scenario, Sun, Terrain
from worlds.types import Frame, GroundPlane, HeightField, Pose, World

SUNS_DEG = ((120, 40), (30, 25), (250, 60), (180, 15), (320, 35), (75, 50))
COVERS = (0.05, 0.03, 0.08)
NEAR_M, LEAST_M, LEAST_PX = 6.0, 0.2, 40


@dataclass
class Score:
    """Counts over all pictures."""

    pictures: int = 0
    rocks: int = 0
    found: int = 0
    false: int = 0
    errors: list[tuple[float, float]] = field(default_factory=list)  # true range, distance of the place
    ttams: list[float] = field(default_factory=list)


def make_world(seed: int, roughness_m: float) -> World:
    """World of a seed: rocks, sun and cover change with it."""
    azimuth, elevation = SUNS_DEG[seed % len(SUNS_DEG)]
    scenario = Scenario(
        name="perception",
        terrain=Terrain(kind="fractal", size_m=(30.0, 30.0), roughness_m=roughness_m),
        rocks=Rocks(cfa=COVERS[seed % len(COVERS)]),
        goal=Goal(position_m=(12.0, 0.0)),
        sun=Sun(azimuth_deg=azimuth, elevation_deg=elevation),
    )
    return build_world(scenario, seed)


def plane_under(ground: HeightField, x: float, y: float) -> GroundPlane:
    """Plane through the ground within half a metre."""
    dx, dy = np.meshgrid(np.linspace(-0.5, 0.5, 5), np.linspace(-0.5, 0.5, 5))
    z = height_at(ground, x + dx, y + dy)
    a, b, c = np.linalg.lstsq(np.column_stack([dx.ravel(), dy.ravel(), np.ones(dx.size)]), z.ravel(), rcond=None)[0]
    normal = np.array([-a, -b, 1.0])
    return GroundPlane(np.array([x, y, c]), normal / np.linalg.norm(normal))


def pictures(world: World, count: int, rng: np.random.Generator) -> Iterator[tuple[Frame, RenderedImage]]:
    """Frames from random places that no rock is on."""
    renderer, camera = make_renderer(world), load_rover("husky").camera(Camera())
    (x0, x1), (y0, y1) = world.ground.x_limits_m, world.ground.y_limits_m
    while count:
        x, y, yaw = rng.uniform(x0 + 3, x1 - 3), rng.uniform(y0 + 3, y1 - 3), rng.uniform(-np.pi, np.pi)
        if any(np.hypot(r.position_w[0] - x, r.position_w[1] - y) < r.length_m / 2 + 0.5 for r in world.rocks):
            continue
        plane = plane_under(world.ground, x, y)
        forward = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        forward -= (forward @ plane.normal_w) * plane.normal_w
        forward /= np.linalg.norm(forward)
        axes = np.column_stack([forward, np.cross(plane.normal_w, forward), plane.normal_w])
        hub = plane.point_w + load_rover("husky").wheel.radius_m * plane.normal_w
        pose = camera_pose(Pose(hub, quaternion_from_rotation(axes)), camera)
        truth = renderer.render(camera, pose)
        yield Frame(0.0, add_noise(truth.image, Camera().noise, rng), camera, pose, plane), truth
        count -= 1


def add(score: Score, world: World, frame: Frame, truth: RenderedImage, knowledge: Knowledge) -> None:
    """Count one picture."""
    assert frame.camera_pose is not None
    assert frame.ground is not None
    found = perceive(frame, knowledge)
    by_id = {rock.id: rock for rock in world.rocks}
    seen = np.bincount(truth.ids[truth.ids > 0], minlength=len(by_id) + 1)
    score.pictures += 1
    score.ttams.append(ttam(true_classes(truth.ids, truth.depth_m), found.classes))
    for identity in np.flatnonzero(seen >= LEAST_PX).tolist():
        rock = by_id[identity]
        away = float(ground_range(frame.camera_pose, frame.ground, np.array(rock.position_w)))
        if rock.diameter_m >= LEAST_M and away <= NEAR_M:
            score.rocks += 1
            score.found += bool(found.mask[truth.ids == identity].mean() >= 0.5)
    for blob in found.rocks:
        if blob.placed is None or blob.placed.range_m > NEAR_M:
            continue
        under = truth.ids[found.labels == blob.id]
        if (under > 0).mean() < 0.2:
            score.false += 1
            continue
        main = int(np.bincount(under[under > 0]).argmax())
        both, either = (under == main).sum(), ((found.labels == blob.id) | (truth.ids == main)).sum()
        if both / either > 0.5 and by_id[main].diameter_m >= LEAST_M and not blob.touches_border:
            place = np.array(by_id[main].position_w)
            away = float(ground_range(frame.camera_pose, frame.ground, place))
            score.errors.append((away, float(np.hypot(*(np.array(blob.placed.position_w) - place)[:2]))))


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description="Perception against the renderer's truth.")
    parser.add_argument("--seeds", type=int, nargs=2, default=(200, 212), metavar=("FIRST", "END"))
    parser.add_argument("--pictures", type=int, default=4)
    parser.add_argument("--roughness", type=float, default=0.06)
    parser.add_argument("--knowledge", default="rendered")
    arguments = parser.parse_args()
    knowledge, score = load_knowledge(arguments.knowledge), Score()
    for seed in range(*arguments.seeds):
        world = make_world(seed, arguments.roughness)
        for frame, truth in pictures(world, arguments.pictures, np.random.default_rng(seed)):
            add(score, world, frame, truth, knowledge)
    print(f"{score.pictures} pictures: recall {score.found}/{score.rocks} = {score.found / score.rocks:.3f}")
    print(f"false rocks {score.false} ({score.false / score.pictures:.2f} a picture), TTAM {np.mean(score.ttams):.1f}")
    away, error = np.array(score.errors).T
    for low, high in ((1.0, 2.0), (2.0, 3.0), (3.0, 4.0), (4.0, 6.0)):
        part = error[(away >= low) & (away < high)]
        print(f"{low:.0f}-{high:.0f} m: {len(part)} rocks, position error median {np.median(part):.3f} m")


if __name__ == "__main__":
    main()
