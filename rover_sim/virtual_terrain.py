"""The paper's virtual terrain model (section 3, third phase): what a picture showed, as a scenario that can be driven.

The ground is the level plane that the picture was placed on. Rocks stand on it with their perceived places, sizes,
axes and sections A0..A8; the perceived classes choose the soil: the sand of the first preset under S and where nothing
is known, firm ground under the other four.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from perception.camera import rays_w
from perception.ground import ground_points, ground_range
from perception.pipeline import ImageRock, Perception
from perception.rock_placement import View
from planner.navigator import START_CLEAR_M
from rover_sim.picture_paths import in_view
from worlds.geometry import rotation_from_quaternion
from worlds.rock_shape import PROFILES
from worlds.scenario import (
    LEAST_SECTION,
    MAP_MARGIN_M,
    Camera,
    Goal,
    Obstacle,
    Rocks,
    RoverChoice,
    Scenario,
    SoilChoice,
    SoilPatch,
    Sun,
    Terrain,
)
from worlds.types import BoolArray, FloatArray, Footprint, PerceivedRock, Rock, RockShape, TerrainClass

SOIL = "mars_sand"  # under class S and where nothing is known
FIRM_SOIL = "firm"
FIRM_CLASSES = frozenset(
    {TerrainClass.VERY_SMALL_ROCKS, TerrainClass.ROUGH, TerrainClass.VERY_ROUGH, TerrainClass.BIG_ROCK}
)
GRAVITY_M_S2 = 3.71
RESOLUTION_M = 0.1
BESIDE_M = 3.0  # of ground around everything that matters
GOAL_RADIUS_M = 0.5
_ENDS_STEP_M = 0.25
_SLOWEST_M_S = 0.15  # on average, before a drive is given up
_LEAST_LIMIT_S = 60.0


def rock_of(seen: ImageRock, placed: PerceivedRock, sight_rad: float) -> Rock:
    """The perceived rock as a solid on z = 0; ``sight_rad`` is the direction in which it was seen."""
    x, y, _ = placed.position_w
    return Rock(
        id=seen.id,
        position_w=(x, y, 0.0),
        length_m=placed.length_m,
        width_m=placed.width_m,
        height_m=placed.height_m,
        yaw_rad=placed.yaw_rad,
        shape=RockShape(seen.formation, ground_sections(seen, placed.yaw_rad - sight_rad)),
    )


def ground_sections(seen: ImageRock, turn_rad: float) -> tuple[float, ...]:
    """Diameters A0..A8 over the largest along a rock's axis on the ground, ``turn_rad`` left of the line of sight.

    Right in the picture is to the right on the ground and up is away, so the probes run along the ground's axis or
    against it. Where the picture's axis lies across the one on the ground they say nothing of it: it is an ellipse.
    """
    widest = max(seen.sections_px)
    along = np.array([-np.sin(turn_rad), np.cos(turn_rad)]) @ [np.cos(seen.axis_rad), np.sin(seen.axis_rad)]
    if widest <= 0.0 or abs(along) < np.sqrt(0.5):
        profile = PROFILES[0]
    else:
        profile = np.array(seen.sections_px)[:: 1 if along > 0.0 else -1] / widest
    inner = np.clip(profile[1:-1], LEAST_SECTION, 1.0)
    return tuple(round(float(value), 4) for value in (profile[0], *inner, profile[-1]))


def placed_rocks(found: Perception, view: View) -> Iterator[Rock]:
    """All rocks of a picture that have a place on the ground."""
    for seen in found.rocks:
        if seen.placed is not None:
            x, y = np.asarray(seen.placed.position_w[:2]) - view.pose.position_w[:2]
            yield rock_of(seen, seen.placed, float(np.arctan2(y, x)))


def virtual_scenario(
    name: str, found: Perception, view: View, rover: str, footprint: Footprint, way_w: FloatArray, reach_m: float
) -> tuple[Scenario, tuple[int, ...]]:
    """The scenario of a picture, from the rover's place at x = y = 0 to the end of ``way_w`` (N, 2).

    The second answer names the rocks left out because the rover would stand in them.
    """
    rocks = list(placed_rocks(found, view))
    under = tuple(rock.id for rock in rocks if _under(rock, footprint))
    goal = (float(way_w[-1, 0]), float(way_w[-1, 1]))
    patches = _firm_patches(found, view, reach_m)
    length = float(np.linalg.norm(np.diff(way_w, axis=0), axis=1).sum())
    scenario = Scenario(
        name=name,
        gravity_m_s2=GRAVITY_M_S2,
        terrain=Terrain(kind="flat", size_m=_size(rocks, patches, goal, reach_m), resolution_m=RESOLUTION_M),
        rocks=Rocks(cfa=0.0),
        obstacle=tuple(_obstacle(rock) for rock in rocks if rock.id not in under),
        soil=SoilChoice(preset=SOIL, patch=patches),
        rover=RoverChoice(model=rover),
        goal=Goal(position_m=goal, radius_m=GOAL_RADIUS_M, time_limit_s=_LEAST_LIMIT_S + length / _SLOWEST_M_S),
        camera=Camera(),
        sun=_sun(view),
    )
    return scenario, under


def _sun(view: View) -> Sun:
    """The sun of the picture, or the usual one."""
    if view.to_sun_w is None:
        return Sun()
    x, y, z = view.to_sun_w
    return Sun(
        azimuth_deg=round(float(np.degrees(np.arctan2(y, x))), 3),
        elevation_deg=round(float(np.degrees(np.arcsin(z))), 3),
    )


def way_ahead(found: Perception, view: View, most_m: float) -> FloatArray:
    """A straight way (2, 2) ahead that ends on no rock, up to ``most_m`` long."""
    rocks = list(placed_rocks(found, view))
    for distance in np.arange(most_m, 0.5, -_ENDS_STEP_M):
        if all(np.hypot(rock.position_w[0] - distance, rock.position_w[1]) > rock.length_m / 2 for rock in rocks):
            break
    return np.array([[0.0, 0.0], [distance, 0.0]])


def _under(rock: Rock, footprint: Footprint) -> bool:
    """Whether a rock reaches under the rover at the origin, heading along x."""
    x, y = np.abs(rock.position_w[:2])
    beyond = np.hypot(max(x - footprint.length_m / 2, 0.0), max(y - footprint.width_m / 2, 0.0))
    return bool(beyond < rock.length_m / 2)


def _obstacle(rock: Rock) -> Obstacle:
    return Obstacle(
        kind="rock",
        position_m=(round(rock.position_w[0], 4), round(rock.position_w[1], 4)),
        radius_m=round(rock.diameter_m / 2, 4),
        height_m=round(rock.height_m, 4),
        formation=rock.shape.formation,
        yaw_deg=round(float(np.degrees(rock.yaw_rad)), 2),
        aspect=round(rock.length_m / rock.width_m, 4),
        sections=rock.shape.section_ratio,
    )


def _size(
    rocks: Sequence[Rock], patches: Sequence[SoilPatch], goal: tuple[float, float], reach_m: float
) -> tuple[float, float]:
    """Size in metres of a map about the middle of start and goal that holds all rocks and what can be seen."""
    places = [(0.0, 0.0), goal, (reach_m, 0.0), *(rock.position_w[:2] for rock in rocks)]
    places += [patch.position_m for patch in patches]
    middle = np.array(goal) / 2.0
    half = np.abs(np.array(places) - middle).max(axis=0) + BESIDE_M + MAP_MARGIN_M
    return float(np.ceil(2.0 * half[0])), float(np.ceil(2.0 * half[1]))


def _firm_patches(found: Perception, view: View, reach_m: float) -> tuple[SoilPatch, ...]:
    """Rectangles of firm soil: runs of windows of one row that are no sand, as they lie on the ground."""
    corners = window_corners(view, (found.classes.shape[0], found.classes.shape[1]), reach_m)
    forward = rotation_from_quaternion(view.pose.quaternion_w)[:2, 2]
    yaw = float(np.arctan2(forward[1], forward[0]))
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    patches = []
    for row, letters in enumerate(found.classes.tolist()):
        for first, last in _runs([letter in FIRM_CLASSES for letter in letters]):
            outline = corners[row : row + 2, first : last + 2]
            if np.isnan(outline).any():
                continue
            local = outline @ turn.T
            low, high = local[..., 0].min(), local[..., 0].max()
            # A window is a trapezium on the ground; the rectangle has its mean breadth.
            right, left = local[:, -1, 1].mean(), local[:, 0, 1].mean()
            middle = np.array([low + high, right + left]) / 2.0 @ turn
            patches.append(
                SoilPatch(
                    kind="rectangle",
                    preset=FIRM_SOIL,
                    position_m=(round(float(middle[0]), 3), round(float(middle[1]), 3)),
                    size_m=(round(max(float(high - low), 0.2), 3), round(max(float(left - right), 0.2), 3)),
                    yaw_deg=round(float(np.degrees(yaw)), 2),
                )
            )
    return tuple(patches)


def window_corners(view: View, shape: tuple[int, int], reach_m: float) -> FloatArray:
    """Ground x, y (rows + 1, columns + 1, 2) under the corners of the windows.

    The upper corners of a window that runs out beyond the reach lie at the reach; those of windows wholly beyond it,
    or that the lens does not see, are NaN.
    """
    rows = np.linspace(0.0, view.camera.height_px, shape[0] + 1)
    columns = np.linspace(0.0, view.camera.width_px, shape[1] + 1)
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1)
    points = ground_points(view.camera, view.pose, view.plane, pixels)
    near = ground_range(view.pose, view.plane, points) <= reach_m
    corners = np.where(near[..., None], points[..., :2], np.nan)
    below = np.vstack([near[1:], np.zeros((1, near.shape[1]), dtype=bool)])
    ahead = rays_w(view.camera, view.pose, pixels)[..., :2]
    ahead = ahead / np.linalg.norm(ahead, axis=-1, keepdims=True)
    return np.asarray(np.where((below & ~near)[..., None], view.pose.position_w[:2] + reach_m * ahead, corners))


def unseen_m(found: Perception, view: View, track_w: FloatArray, reach_m: float) -> float:
    """Length in metres of a track (N, 2) of small steps over ground that the picture does not show or cannot judge.

    That is outside of the picture, beyond the reach, or in a window of class U. What lies before the nearest ground
    in view, or within a metre of the start, where the rover was set down, does not count.
    """
    corners = window_corners(view, (found.classes.shape[0], found.classes.shape[1]), reach_m)
    known = found.classes != TerrainClass.UNCERTAIN.value
    near_edge = np.linalg.norm(corners[1:, 1:][known] - track_w[0], axis=-1)
    blind = START_CLEAR_M if np.isnan(near_edge).all() else max(START_CLEAR_M, float(np.nanmin(near_edge)))
    counted = np.linalg.norm(track_w - track_w[0], axis=1) > blind
    missed = counted & ~_shown(found, view, track_w, reach_m)
    steps = np.linalg.norm(np.diff(track_w, axis=0), axis=1)
    return float(steps[missed[1:]].sum())


def _shown(found: Perception, view: View, points_w: FloatArray, reach_m: float) -> BoolArray:
    """Which ground places (N, 2) lie in a window of the picture whose class is known."""
    shown, pixels = in_view(points_w, view)
    rows, columns = found.classes.shape
    place = np.where(shown[:, None], pixels, 0.0) * [columns / view.camera.width_px, rows / view.camera.height_px]
    column, row = np.minimum(place.astype(int), [columns - 1, rows - 1]).T
    known = found.classes[row, column] != TerrainClass.UNCERTAIN.value
    return np.asarray(shown & known & (np.linalg.norm(points_w - view.pose.position_w[:2], axis=1) <= reach_m))


def _runs(flags: Sequence[bool]) -> Iterator[tuple[int, int]]:
    """First and last place of each run of True."""
    edges = np.flatnonzero(np.diff([0, *(int(flag) for flag in flags), 0]))
    for first, after in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        yield first, after - 1
