"""Whether a path verified in the virtual terrain of a picture is safe in the world that the picture was taken of.

    uv run python benchmarks/verify_agreement.py [--seeds 300 340] [--roughness 0.03] [--out FILE.csv]

Each seed is a world with a sun and a rock cover of its own; the rover stands at its start and takes one rendered
picture. Driven are the planner's candidates and, so that there are ways that fail, three straight ones that no planner
made, each twice: in the virtual terrain that `rover-sim perceive --verify` builds, and in the true world. The knowledge
was fitted on seeds 100 to 117.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np
from msgspec import structs

from perception.knowledge_base import Knowledge, load_knowledge
from perception.pipeline import Perception, View, perceive
from rover_sim.given_way import Way
from rover_sim.picture_paths import picture_paths
from rover_sim.sim.renderer import add_noise, make_renderer
from rover_sim.sim.rover import RoverModel, load_rover
from rover_sim.verdict import Verdict
from rover_sim.verify import Check, drive_way
from rover_sim.virtual_terrain import GOAL_RADIUS_M, unseen_m, virtual_scenario
from worlds.build import build_world
from worlds.errors import ScenarioError
from worlds.geometry import camera_pose, quaternion_from_rotation
from worlds.heightfield import height_at
from worlds.scenario import Camera, Goal, Rocks, Scenario, SoilChoice, Sun, Terrain
from worlds.types import FloatArray, Frame, GroundPlane, HeightField, Pose, World

SUNS_DEG = ((120, 40), (30, 25), (250, 60), (180, 15), (320, 35), (75, 50))
COVERS = (0.03, 0.06, 0.10)
STRAIGHT_DEG = (-18.0, 0.0, 18.0)
STRAIGHT_M = 6.0


@dataclass(frozen=True)
class Row:
    """One way, driven twice."""

    seed: int
    planned: bool
    virtual: str
    virtual_fault: str
    virtual_safe: bool  # by the physics alone
    unseen_m: float
    true_safe: bool
    true_reason: str
    virtual_clearance_m: float | None
    true_clearance_m: float | None


def make_world(seed: int, roughness_m: float) -> World:
    """World of a seed: rocks, sun and cover change with it."""
    azimuth, elevation = SUNS_DEG[seed % len(SUNS_DEG)]
    scenario = Scenario(
        name="agreement",
        terrain=Terrain(kind="fractal", size_m=(30.0, 30.0), roughness_m=roughness_m),
        rocks=Rocks(cfa=COVERS[seed % len(COVERS)], clear_radius_m=1.2),
        soil=SoilChoice(preset="mars_sand"),
        goal=Goal(position_m=(8.0, 0.0), radius_m=GOAL_RADIUS_M, time_limit_s=120.0),
        sun=Sun(azimuth_deg=azimuth, elevation_deg=elevation),
    )
    return build_world(scenario, seed)


def plane_under(ground: HeightField) -> GroundPlane:
    """Plane through the ground within half a metre of the start."""
    dx, dy = np.meshgrid(np.linspace(-0.5, 0.5, 5), np.linspace(-0.5, 0.5, 5))
    z = height_at(ground, dx, dy)
    a, b, c = np.linalg.lstsq(np.column_stack([dx.ravel(), dy.ravel(), np.ones(dx.size)]), z.ravel(), rcond=None)[0]
    normal = np.array([-a, -b, 1.0])
    return GroundPlane(np.array([0.0, 0.0, c]), normal / np.linalg.norm(normal))


def look(world: World, rover: RoverModel, knowledge: Knowledge) -> tuple[Perception, View]:
    """What one picture from the start shows."""
    camera, plane = rover.camera(Camera()), plane_under(world.ground)
    forward = np.array([1.0, 0.0, 0.0])
    forward -= (forward @ plane.normal_w) * plane.normal_w
    forward /= np.linalg.norm(forward)
    axes = np.column_stack([forward, np.cross(plane.normal_w, forward), plane.normal_w])
    hub = plane.point_w + rover.wheel.radius_m * plane.normal_w
    pose = camera_pose(Pose(hub, quaternion_from_rotation(axes)), camera)
    truth = make_renderer(world).render(camera, pose)
    image = add_noise(truth.image, Camera().noise, np.random.default_rng(world.seed))
    return perceive(Frame(0.0, image, camera, pose, plane), knowledge), View(camera, pose, plane)


def ways(found: Perception, view: View, rover: RoverModel) -> Iterator[tuple[bool, FloatArray, float]]:
    """Whether it was planned, points and traversability of each way."""
    assert found.observation is not None
    for path in picture_paths(found.observation, view, rover.footprint()):
        yield True, path.whole_w, path.traversability
    for angle in np.radians(STRAIGHT_DEG):
        ahead = np.array([np.cos(angle), np.sin(angle)])
        yield False, np.linspace(0.0, STRAIGHT_M, 5)[:, None] * ahead, 1.0


def compare(seed: int, roughness_m: float, rover: RoverModel, knowledge: Knowledge) -> Iterator[Row]:
    """All ways of one seed."""
    world = make_world(seed, roughness_m)
    found, view = look(world, rover, knowledge)
    reach = knowledge.ground.max_range_m
    for planned, points, traversability in ways(found, view, rover):
        way = Way(tuple((float(x), float(y)) for x, y in points), traversability)
        try:
            scenario, _ = virtual_scenario("virtual", found, view, "husky", rover.footprint(), points, reach)
            virtual = drive_way(build_world(scenario, 0), rover, way)
            true = drive_way(with_goal(world, way.points_w[-1]), rover, way)
        except ScenarioError:  # the end of a straight way lies inside a rock
            continue
        check = Check(virtual, unseen_m(found, view, virtual.track_w, reach))
        yield Row(
            seed,
            planned,
            check.verdict.value,
            check.fault,
            virtual.safe,
            round(check.unseen_m, 3),
            true.safe,
            true.figures["reason"],
            virtual.figures["clearance_m"],
            true.figures["clearance_m"],
        )


def with_goal(world: World, goal_w: tuple[float, float]) -> World:
    """The same world with another goal."""
    goal = structs.replace(world.scenario.goal, position_m=goal_w)
    height = float(height_at(world.ground, *goal_w))
    return replace(world, scenario=structs.replace(world.scenario, goal=goal), goal_w=(*goal_w, height))


def told(rows: Sequence[Row], name: str) -> str:
    """Counts of one kind of way."""
    if not rows:
        return f"{name}: none"
    agree = sum(row.virtual_safe == row.true_safe for row in rows)
    safe = sum(row.true_safe for row in rows)
    lines = [f"{name}: {len(rows)} ways, safe in truth {safe}; agreement of both drives {agree / len(rows):.3f}"]
    for verdict in Verdict:
        those = [row.true_safe for row in rows if row.virtual == verdict]
        lines.append(f"  {verdict.value} {len(those)}: {those.count(True)} safe in truth, {those.count(False)} not")
    return "\n".join(lines)


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description="Virtual terrain against the true world.")
    parser.add_argument("--seeds", type=int, nargs=2, default=(300, 340), metavar=("FIRST", "END"))
    parser.add_argument("--roughness", type=float, default=0.03)
    parser.add_argument("--out", type=Path, help="CSV with a row a way")
    arguments = parser.parse_args()
    rover, knowledge = load_rover("husky"), load_knowledge("rendered")
    rows: list[Row] = []
    for seed in range(*arguments.seeds):
        rows.extend(compare(seed, arguments.roughness, rover, knowledge))
    print(told([row for row in rows if row.planned], "planned"))
    print(told([row for row in rows if not row.planned], "straight"))
    print(told(rows, "all"))
    if arguments.out:
        with arguments.out.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, [field.name for field in fields(Row)])
            writer.writeheader()
            writer.writerows(asdict(row) for row in rows)


if __name__ == "__main__":
    main()
