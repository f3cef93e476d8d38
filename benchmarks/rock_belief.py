"""What the planner believes of tall rocks along a drive, against their true outlines.

    uv run python benchmarks/rock_belief.py [--seeds 600 606] [--cfa 0.10] [--sensors stereo]

The rover is carried along the oracle's way through the worlds of `rover-sim trials nav`, with a rendered picture every
quarter of a metre; what perception sees in it is remembered as in a run. Its pose is exact; the ground that it believes
in is the plane through 4 m around. Every metre each rock that is too tall for the belly, lies within 4 m and was seen
(20 pixels in some picture) is compared with the hard obstacles of the planner, without their berths: the share of its
outline that none covers, and how far it sticks out of them. Believed ground is what hard obstacles cover within 4 m;
it is false where there is no rock of 7 cm within 3 cm. Heights of seen rocks over the ground where wheels stand that
straddle them are compared with those of the remembered ones in their place. Seeds from 700 on are never looked at while
anything is tuned.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise

import cv2
import numpy as np

from perception.knowledge_base import load_knowledge
from perception.pipeline import perceive
from planner.obstacle_map import STEREO_DRIVE, DriveModel, belly_meets, distance_to, obstacles, too_high
from planner.terrain_map import STEREO_MEMORY, RockMemory, empty_memory, remember_rocks
from rover_sim.learning.rendered_views import body_pose, plane_around
from rover_sim.sim.renderer import add_noise, make_renderer
from rover_sim.sim.rover import load_rover
from rover_sim.traverse import STEREO_BASELINE_M
from rover_sim.trials.oracle import oracle_way
from rover_sim.trials.suites import Choices, trials_of
from worlds.build import build_world
from worlds.geometry import camera_pose, to_sun, to_the_right
from worlds.heightfield import height_at
from worlds.rock_shape import outlines
from worlds.scenario import Camera
from worlds.types import BoolArray, FloatArray, Footprint, Frame, GroundPlane, World

PICTURE_M, SCORED_EACH = 0.25, 4
REACH_M, SEEN_PX = 4.0, 20
CELL_M, FALSE_BELOW_M, NEAR_ROCK_M = 0.05, 0.07, 0.03
RANGES_M = ((0.0, 1.5), (1.5, 2.5), (2.5, 4.0))
KINDS = ("round", "aspect 1.3 to 1.75", "aspect 1.75 to 2.2", "two lobes")
TWO_LOBES = (6, 8)  # formations
NEAR_M = (0.0, 0.9, 1.4, 2.0, 3.5)
COMPARED_M = (0.08, 0.13)  # true heights around what the belly clears
HEIGHTS_M = (0.06, 0.08, 0.09, 0.10, 0.107, 0.115, 0.13, 0.20)
IN_PLACE = 0.3  # of a rock's mean diameter
STRADDLED_M = (0.3, 0.4, 0.5)  # from a rock's middle, where the wheels are when it is under the belly
BARE = replace(DriveModel(), sd_share=0.0)  # obstacles without berth


@dataclass
class Score:
    """Rows of figures over all worlds."""

    rocks: list[tuple[float, ...]] = field(default_factory=list)  # kind, range, share not covered, m sticking out
    believed: list[tuple[float, ...]] = field(default_factory=list)  # range, m^2 believed, false
    heights: list[tuple[float, ...]] = field(default_factory=list)  # range, true, believed, 1 if hard


@dataclass(frozen=True, eq=False)
class Moment:
    """What is believed at one place of the way."""

    place_w: FloatArray  # (2,)
    rocks: RockMemory
    seen: BoolArray  # (R,) rows of the world's rocks that were seen so far


def carried(world: World, way_w: FloatArray, *, stereo: bool = False) -> Iterator[Moment]:
    """The moments of a rover that is carried along a way (N, 2), one a picture, seen by one camera or by two."""
    rng, rover, renderer = np.random.default_rng(world.seed), load_rover("husky"), make_renderer(world)
    camera, knowledge, sun = rover.camera(Camera()), load_knowledge("rendered"), world.scenario.sun
    rocks, seen = empty_memory(way_w[0]).rocks, np.zeros(len(world.rocks), dtype=bool)
    for time_s, (place, heading) in enumerate(_places(way_w)):
        x, y = float(place[0]), float(place[1])
        stand = plane_around(world.ground, x, y, 0.5)
        pose = camera_pose(body_pose(stand, heading, rover.wheel.radius_m), camera)
        picture = renderer.render(camera, pose)
        believed = GroundPlane(stand.point_w, plane_around(world.ground, x, y, 4.0).normal_w)
        image = add_noise(picture.image, Camera().noise, rng)
        frame = Frame(float(time_s), image, camera, pose, believed, to_sun_w=to_sun(sun.azimuth_deg, sun.elevation_deg))
        if stereo:
            beside = renderer.render(camera, to_the_right(pose, STEREO_BASELINE_M)).image
            frame = replace(frame, right=add_noise(beside, Camera().noise, rng), baseline_m=STEREO_BASELINE_M)
        observation = perceive(frame, knowledge).observation
        assert observation is not None
        rocks = remember_rocks(rocks, observation, place, STEREO_MEMORY if stereo else None)
        shown = np.bincount(picture.ids[picture.ids > 0], minlength=int(world.rocks.ids.max(initial=0)) + 1)
        seen = seen | (shown[world.rocks.ids] >= SEEN_PX)
        yield Moment(place, rocks, seen)


def _places(way_w: FloatArray) -> Iterator[tuple[FloatArray, float]]:
    """Places at equal steps along a way, and the heading half a metre ahead."""
    arcs = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way_w, axis=0), axis=1))])
    for arc in np.arange(0.0, arcs[-1] - 0.5, PICTURE_M):
        here, ahead = (np.array([np.interp(at, arcs, way_w[:, k]) for k in (0, 1)]) for at in (arc, arc + 0.5))
        yield here, float(np.arctan2(*(ahead - here)[::-1]))


def add(score: Score, world: World, moment: Moment, body: Footprint, model: DriveModel) -> None:
    """Count one moment."""
    add_heights(score, world, moment, body, model)
    table = obstacles(moment.rocks, BARE, body.climb_height_m, place_w=moment.place_w)
    hard = table[table[:, 6] > 0.5]
    true = world.rocks
    away = np.hypot(*(true.position_w[:, :2] - moment.place_w).T)
    near = away < REACH_M + 1.0
    length, width, _ = true.extents_m[near].T
    shapes = outlines(true.section_ratio[near], length, width, true.yaw_rad[near])
    shapes = shapes + true.position_w[near, None, :2]
    tall = true.extents_m[near, 2] > BARE.belly_share * body.climb_height_m
    for row in np.flatnonzero(tall & moment.seen[near] & (away[near] < REACH_M)):
        rock = np.flatnonzero(near)[row]
        out = np.maximum(_outside(hard, _filled(shapes[row])), 0.0)
        score.rocks.append((_kind(world, int(rock)), float(away[rock]), float((out > 0.0).mean()), float(out.max())))
    steps = np.arange(-REACH_M, REACH_M, CELL_M)
    cells = moment.place_w + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    cells = cells[np.hypot(*(cells - moment.place_w).T) < REACH_M]
    cells = cells[_outside(hard, cells) < 0.0]
    rocky = shapes[true.extents_m[near, 2] > FALSE_BELOW_M]
    false = ~_on_rock(rocky, cells)
    range_m = np.hypot(*(cells - moment.place_w).T)
    for low, high in RANGES_M:
        inside = (range_m >= low) & (range_m < high)
        score.believed.append((low, CELL_M**2 * inside.sum(), CELL_M**2 * (false & inside).sum()))


def add_heights(score: Score, world: World, moment: Moment, body: Footprint, model: DriveModel) -> None:
    """Compare the heights of rocks that are remembered where they are."""
    rocks, true = moment.rocks, world.rocks
    if not len(rocks):
        return
    high = too_high(rocks, belly_meets(rocks, model, body.climb_height_m), model)
    away = np.hypot(*(true.position_w[:, :2] - moment.place_w).T)
    low, top = HEIGHTS_M[0], HEIGHTS_M[-1]
    for row in np.flatnonzero((away < NEAR_M[-1]) & moment.seen):
        tall = over_wheels(world, int(row))
        if not low < tall < top:
            continue
        apart = np.hypot(*(rocks.centre_w - true.position_w[row, :2]).T)
        nearest = int(apart.argmin())
        if apart[nearest] < IN_PLACE * np.sqrt(np.prod(true.extents_m[row, :2])):
            found = float(rocks.height_m[nearest]), float(high[nearest])
            score.heights.append((float(away[row]), tall, *found))


def over_wheels(world: World, row: int) -> float:
    """Height of a rock's top over the ground around it that wheels stand on."""
    x, y, bottom = world.rocks.position_w[row]
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    places = np.array(STRADDLED_M)[:, None, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1) + [x, y]
    around = float(height_at(world.ground, places[..., 0], places[..., 1]).mean())
    return float(bottom + world.rocks.extents_m[row, 2]) - around


def _kind(world: World, row: int) -> int:
    length, width, _ = world.rocks.extents_m[row]
    if world.rocks.formation[row] in TWO_LOBES:
        return 3
    return 0 if length < 1.25 * width else 1 if length < 1.75 * width else 2


def _outside(hard: FloatArray, points: FloatArray) -> FloatArray:
    """Distance (P,) of each point to the nearest hard obstacle's edge, negative inside."""
    least = np.full(len(points), np.inf)
    for row in hard:
        close = np.abs(points - 0.5 * (row[0:2] + row[2:4])).max(axis=1) < 2.0
        rows = np.tile(row, (int(close.sum()), 1))
        rows[:, 0:4] -= np.tile(points[close], (1, 2))
        least[close] = np.minimum(least[close], distance_to(rows, np.zeros(2)))
    return np.asarray(np.minimum(least, 2.0))


def _filled(outline: FloatArray) -> FloatArray:
    """The outline (N, 2) and points at equal steps within it."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    axes = (np.arange(low[k], high[k], 0.02) for k in (0, 1))
    points = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    return np.vstack([outline, points[_on_rock(outline[None], points, 0.0)]])


def _on_rock(shapes: FloatArray, points: FloatArray, slack_m: float = NEAR_ROCK_M) -> BoolArray:
    """Which points (P, 2) lie within ``slack_m`` of an outline (R, N, 2)."""
    on = np.zeros(len(points), dtype=bool)
    for shape in shapes.astype(np.float32):
        low, high = shape.min(axis=0) - slack_m, shape.max(axis=0) + slack_m
        for n in np.flatnonzero(~on & ((points > low) & (points < high)).all(axis=1)):
            x, y = points[n]
            on[n] = cv2.pointPolygonTest(shape, (float(x), float(y)), measureDist=True) > -slack_m
    return on


def report(score: Score) -> list[str]:
    """The figures as lines."""
    rocks, lines = (
        np.array(score.rocks),
        [f"{'tall rocks':22s}range m     n  not covered, mean   sticks out m: 90 %, 98 %"],
    )
    for number, name in enumerate(KINDS):
        for low, high in RANGES_M:
            kept = rocks[(rocks[:, 0] == number) & (rocks[:, 1] >= low) & (rocks[:, 1] < high)]
            if len(kept):
                out = np.quantile(kept[:, 3], (0.9, 0.98))
                lines.append(
                    f"{name:22s}{low:.1f}-{high:.1f} {len(kept):5d} {100 * kept[:, 2].mean():16.1f} % "
                    f"{out[0]:19.2f} {out[1]:7.2f}"
                )
    believed = np.array(score.believed)
    for low, high in RANGES_M:
        area, false = believed[believed[:, 0] == low, 1:].sum(axis=0)
        lines.append(f"believed {low:.1f}-{high:.1f} m: {area:.1f} m2, false {100 * false / max(area, 1e-9):.1f} %")
    return [*lines, *_height_lines(np.array(score.heights))]


def _height_lines(heights: FloatArray) -> list[str]:
    """Believed over true height, and how many rocks of each height are believed too high, by range."""
    lines = []
    for near, far in pairwise(NEAR_M):
        away, true, believed, high = heights[(heights[:, 0] >= near) & (heights[:, 0] < far)].T
        share = (believed / true)[(true > COMPARED_M[0]) & (true < COMPARED_M[1])]
        few, middle, many = np.quantile(share, (0.05, 0.5, 0.95)) if len(share) else (np.nan,) * 3
        held = " ".join(
            f"{100 * low:.1f}:{high[(true >= low) & (true < top)].mean():.2f}"
            for low, top in pairwise(HEIGHTS_M)
            if ((true >= low) & (true < top)).any()
        )
        lines.append(
            f"heights {near:.1f}-{far:.1f} m: {middle:.3f} of the true ones (5 % {few:.2f}, 95 % {many:.2f}, "
            f"n {len(away)}); too high, by true cm: {held}"
        )
    return lines


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description="Believed tall rocks against their true outlines.")
    parser.add_argument("--seeds", type=int, nargs=2, default=(600, 606), metavar=("FIRST", "END"))
    parser.add_argument("--cfa", type=float, default=0.10, help="share of the ground under rocks")
    parser.add_argument("--sensors", choices=("camera", "stereo"), default="camera")
    options = parser.parse_args()
    cell: Choices = {"cfa": (options.cfa,), "slope_deg": (0.0,), "soil": ("mars_sand",)}
    stereo = options.sensors == "stereo"
    score, body, model = Score(), load_rover("husky").footprint(), STEREO_DRIVE if stereo else DriveModel()
    for trial in trials_of("nav", cell, range(*options.seeds), None):
        world = build_world(trial.scenario, trial.seed)
        way = oracle_way(world, body)
        if way is None:
            continue
        for number, moment in enumerate(carried(world, way, stereo=stereo)):
            if number % SCORED_EACH == 0:
                add(score, world, moment, body, model)
    print("\n".join(report(score)))


if __name__ == "__main__":
    main()
