from __future__ import annotations

import numpy as np
import pytest

from benchmarks.pose_check import STARTS, add_rocks, cell_bounds, outside, true_ground, truly
from planner.pose_check import GroundBounds, PoseLimits, pose_bounds, rigid_body
from rover_sim.sim.rover import load_rover
from tests.settling import settle
from worlds.errors import InputError
from worlds.types import HeightField

HUSKY = rigid_body(load_rover("husky").footprint())
LIMITS = PoseLimits()
RNG = np.random.default_rng(3)


def plane(rise_x: float, rise_y: float, half_m: float = 0.0) -> GroundBounds:
    """A plane of 4 m through the origin."""
    axis = (np.arange(80) - 39.5) * 0.05
    height = rise_x * axis + rise_y * axis[:, None]
    layers = np.stack(
        [height, np.full_like(height, rise_x), np.full_like(height, rise_y), np.full_like(height, half_m)]
    )
    return GroundBounds(np.array([-2.0, -2.0]), 0.05, layers.astype(np.float32))


def test_level_ground_by_hand() -> None:
    bounds = pose_bounds(plane(0.0, 0.0), np.array([[0.0, 0.0, 0.7]]), HUSKY, LIMITS)
    assert bounds.safe(LIMITS).all()
    # Wheels of 0.1651 m under a belly 0.0327 m below their axles.
    assert 0.10 < bounds.clearance_m[0] <= 0.1324
    assert bounds.roll[0, 0] <= 0.0 <= bounds.roll[0, 1]
    assert bounds.margin[0] <= np.arctan2(0.2854, 0.1651 + HUSKY.centre_of_mass_m[2])


@pytest.mark.parametrize("heading", [0.0, 0.6, 2.0, -1.2])
def test_the_lean_of_a_slope_is_inside_its_bounds(heading: float) -> None:
    rise = np.tan(np.radians(14.0))
    bounds = pose_bounds(plane(rise, 0.0), np.array([[0.1, 0.0, heading]]), HUSKY, LIMITS)
    # The body's up axis is the normal of the plane.
    nose, side = -np.arctan(rise * np.cos(heading)), np.arcsin(-np.sin(np.radians(14.0)) * np.sin(heading))
    assert bounds.safe(LIMITS).all()
    assert bounds.pitch[0, 0] <= nose <= bounds.pitch[0, 1]
    assert bounds.roll[0, 0] <= side <= bounds.roll[0, 1]


def test_a_slope_beyond_the_limit_unknown_ground_and_the_rim_of_the_map_are_not_safe() -> None:
    here = np.array([[0.0, 0.0, 0.3]])
    assert not pose_bounds(plane(np.tan(np.radians(31.0)), 0.0), here, HUSKY, LIMITS).safe(LIMITS).any()
    assert not pose_bounds(plane(0.0, 0.0, np.inf), here, HUSKY, LIMITS).safe(LIMITS).any()
    rim = np.array([[1.7, 0.0, 0.0], [5.0, 0.0, 0.0], [-2.1, 0.0, 0.0]])
    assert not pose_bounds(plane(0.0, 0.0), rim, HUSKY, LIMITS).safe(LIMITS).any()


def test_a_stone_is_straddled_as_far_as_the_belly_clears_it() -> None:
    ground = plane(0.0, 0.0)
    ground.layers[0, 38:42, 38:42] = 0.09
    here = np.array([[0.0, 0.0, 0.0]])
    low = pose_bounds(ground, here, HUSKY, LIMITS)
    assert low.safe(LIMITS).all()
    assert low.clearance_m[0] <= 0.1324 - 0.09
    ground.layers[0, 38:42, 38:42] = 0.14
    assert not pose_bounds(ground, here, HUSKY, LIMITS).safe(LIMITS).any()
    ground.layers[0, 38:42, 38:42] = 0.09
    ground.layers[3] = 0.03  # three centimetres of doubt everywhere
    assert not pose_bounds(ground, here, HUSKY, LIMITS).safe(LIMITS).any()


@pytest.mark.parametrize(("cover", "slope_deg"), [(0.0, 15.0), (0.10, 5.0), (0.20, 10.0)])
def test_no_unsafe_pose_is_called_safe(cover: float, slope_deg: float) -> None:
    ground = true_ground(cover, slope_deg, 5)
    poses = np.column_stack([RNG.uniform(-6, 6, (60, 2)), RNG.uniform(-np.pi, np.pi, 60)])
    rests = settle(ground, poses, HUSKY, STARTS)
    bounds = pose_bounds(cell_bounds(ground, 0.05, 0.0, RNG), poses, HUSKY, LIMITS)
    safe, unsafe = truly(rests, LIMITS)
    assert not (bounds.safe(LIMITS) & unsafe).any()
    assert outside(bounds, rests, LIMITS) == 0
    assert (bounds.safe(LIMITS) & safe).any()


def test_more_doubt_never_makes_a_pose_safe() -> None:
    ground = true_ground(0.05, 5.0, 6)
    poses = np.column_stack([RNG.uniform(-6, 6, (60, 2)), RNG.uniform(-np.pi, np.pi, 60)])
    known = cell_bounds(ground, 0.05, 0.0, RNG)
    before = pose_bounds(known, poses, HUSKY, LIMITS).safe(LIMITS)
    doubted = GroundBounds(
        known.origin_w, known.cell_m, known.layers + np.array([0, 0, 0, 0.02], np.float32)[:, None, None]
    )
    after = pose_bounds(doubted, poses, HUSKY, LIMITS).safe(LIMITS)
    assert before.sum() > after.sum() > 0
    # Halving may stop elsewhere: a pose on the edge may turn, all others may not.
    assert (after & ~before).sum() <= 1


def test_the_settled_truth_of_a_block_under_one_wheel() -> None:
    # The plane of three wheels on the ground and one raised by h leans by h over the diagonal's two arms.
    heights = np.zeros((321, 321))
    ground = HeightField(heights, 0.0125, (-2.0, -2.0))
    x, y = np.meshgrid(np.arange(321) * 0.0125 - 2.0, np.arange(321) * 0.0125 - 2.0)
    heights[(np.abs(x - 0.256) < 0.15) & (np.abs(y - 0.2854) < 0.15)] = 0.04
    rest = settle(ground, np.zeros((1, 3)), HUSKY, STARTS[:1])[0, 0]
    assert rest[5] < 1e-3
    assert rest[2] == pytest.approx(0.1651 + 0.02 + HUSKY.centre_of_mass_m[2], abs=2e-3)


def test_a_rover_with_arms_is_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"footprint\.body is None \(6 wheels\)"):
        rigid_body(load_rover("rocker_bogie").footprint())


def test_rocks_of_the_benchmark_stand_as_high_as_half_their_width() -> None:
    from worlds.rock_field import RockField

    ground = HeightField(np.zeros((161, 161)), 0.0125, (0.0, 0.0))
    one = np.ones(1)
    add_rocks(
        ground, RockField(np.array([[1.0, 1.0]]), 0.4 * one, np.zeros(1, np.int32), 0 * one, one, np.ones((1, 9)))
    )
    assert ground.heights_m.max() == pytest.approx(0.2, abs=1e-3)
    assert ground.heights_m[80, 40] == 0.0
