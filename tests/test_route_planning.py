from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from planner import route_kernels as kernels
from planner.denoise import denoised
from planner.route import CostMap, Place, Refusal, RouteModel, cost_map, plan_route, way_cost, without_limits
from planner.route_cost import (
    BIN,
    HELD_UP,
    KNOWLEDGE,
    UNKNOWN,
    SlopeLimits,
    load_soils,
    slope_costs,
    soils,
    tip_angles_deg,
)
from planner.route_ground import KNOWLEDGE as RULES
from planner.route_ground import ElevationMap, best_index, ground_layers, load_rules, traversability
from tests.planner_factory import FOOTPRINT
from worlds.errors import InputError
from worlds.synthesis import fractal
from worlds.types import FloatArray, HeightField, RigidBody

HUSKY = replace(FOOTPRINT, body=RigidBody(0.512, 0.571, 0.165, 0.114, (0.0, 0.0, 0.0235), ()))
COSTS = slope_costs("mars_sand", HUSKY, "husky")
TABLES: tuple[Any, ...] = (COSTS.along, COSTS.across, COSTS.risk, COSTS.limits, COSTS.holds_up, BIN)


def plane(slope_deg: float, azimuth_deg: float = 0.0, size: int = 41, cell_m: float = 1.0) -> HeightField:
    x, y = np.meshgrid(cell_m * np.arange(size), cell_m * np.arange(size))
    azimuth = np.radians(azimuth_deg)
    return HeightField(np.tan(np.radians(slope_deg)) * (x * np.cos(azimuth) + y * np.sin(azimuth)), cell_m, (0.0, 0.0))


def mapped(field: HeightField, error_m: float = 0.0) -> CostMap:
    return cost_map(ElevationMap.of(field, error_m), COSTS)


def ridge(gap: bool, height_m: float = 6.0) -> HeightField:
    """A wall across the way at x = 30, with a gap at y = 50 or none."""
    x, y = np.meshgrid(np.arange(61.0), np.arange(61.0))
    wall = height_m * np.exp(-0.5 * ((x - 30.0) / 3.0) ** 2)
    return HeightField(wall * (1.0 - np.exp(-(((y - 50.0) / 6.0) ** 4)) if gap else 1.0), 1.0, (0.0, 0.0))


def test_level_ground_costs_its_length_times_its_care() -> None:
    route = plan_route(mapped(plane(0.0)), (2.0, 2.0), (37.0, 28.0))
    care = 1.0 + RouteModel().care * (1.0 - level_index())
    assert route.refusal is None
    assert route.length_m == pytest.approx(np.hypot(35, 26), rel=1e-9)
    assert route.cost == pytest.approx(care * np.hypot(35, 26), rel=1e-6)


def level_index() -> float:
    layers = ground_layers(ElevationMap.of(plane(0.0)))
    return float(traversability(layers, COSTS.softness)[20, 20]) / best_index()


@pytest.mark.parametrize("slope_deg", [3.0, 8.0, 13.0])
def test_up_across_and_down_differ(slope_deg: float) -> None:
    map_ = mapped(plane(slope_deg))
    up, down = ((5.0, 20.0), (35.0, 20.0)), ((35.0, 20.0), (5.0, 20.0))
    across = (20.0, 5.0), (20.0, 35.0)
    costs = [plan_route(map_, *ends).cost for ends in (up, across, down)]
    assert costs[0] > costs[1] > costs[2]


def test_a_driven_way_over_the_limits_is_judged_by_what_slopes_cost() -> None:
    gentle, steep = mapped(plane(8.0)), mapped(plane(30.0))
    up = np.array([(5.0, 20.0), (35.0, 20.0)])
    assert np.isinf(way_cost(steep, up))
    assert way_cost(without_limits(gentle), up) == pytest.approx(way_cost(gentle, up), rel=1e-6)
    assert way_cost(without_limits(gentle), up) < way_cost(without_limits(steep), up) < 1000.0


def test_the_cost_of_a_climb_is_half_time_and_half_energy() -> None:
    # At 10 deg of mars_sand: slip .268, 43.2 W; on the level .078, 31.4 W; tipping along at 53.6 deg.
    time = (1 - 0.078) / (1 - 0.268)
    energy = time * 43.2 / 31.4
    entry = round(np.tan(np.radians(10.0)) / BIN)
    angle = np.degrees(np.arctan(entry * BIN))
    wanted = 0.5 * (time + energy) * (1 + (angle / tip_angles_deg(HUSKY)[1]) ** 2)
    assert COSTS.along[0, 100 + entry] == pytest.approx(wanted, rel=0.02)


def test_limits_come_from_slip_stop_and_drift() -> None:
    # mars_sand slips .397 at 15 and .483 at 17.5 deg up; carried off by 12.4 and 15.2 deg at 12.5 and 15 across.
    assert COSTS.up_deg == pytest.approx(15.0 + 2.5 * (0.40 - 0.397) / (0.483 - 0.397))
    assert COSTS.across_deg == pytest.approx(12.5 + 2.5 * (15.0 - 12.4) / (15.2 - 12.4))
    assert slope_costs("firm", HUSKY, "husky").up_deg == 22.5  # the last slope that it climbed


def test_a_soil_without_figures_is_taken_as_the_worst() -> None:
    worst = slope_costs("nowhere", HUSKY, "husky")
    for name in soils("husky"):
        known = slope_costs(name, HUSKY, "husky")
        assert worst.up_deg <= known.up_deg
        assert worst.across_deg <= known.across_deg
    assert soils("husky")[UNKNOWN].softness == 0.8


def test_no_cell_of_a_way_is_too_steep_for_it() -> None:
    flat = HeightField(np.zeros((121, 121)), 1.0, (0.0, 0.0))
    for seed in range(4):
        map_ = mapped(HeightField(fractal(flat, 0.9, np.random.default_rng(seed), (60.0, 4.0)), 1.0, (0.0, 0.0)))
        rows, columns = np.nonzero(map_.layers.slope_deg < 8.0)
        route = plan_route(map_, map_.place((rows[0], columns[0])), map_.place((rows[-1], columns[-1])))
        assert route.refusal is None
        assert np.isfinite(way_cost(map_, route.way_w))


@pytest.mark.parametrize(
    ("slope_deg", "azimuth_deg", "may"),
    [(15.0, 0.0, True), (16.0, 0.0, False), (14.5, 45.0, True), (16.0, 45.0, False), (19.0, 135.0, True)],
)
def test_a_climb_aslant_is_as_steep_as_the_slope(slope_deg: float, azimuth_deg: float, may: bool) -> None:
    # The rig: 15 deg at 45 deg of azimuth carry the rover off by 15.4 deg, 17.5 by 20.7; at 135 deg 20 by 13.6.
    rise, azimuth = np.tan(np.radians(slope_deg)), np.radians(azimuth_deg)
    price = kernels.metre_cost(rise * np.cos(azimuth), rise * np.sin(azimuth), 0, 1.0, 0.0, *TABLES)
    assert np.isfinite(price) == may


def test_an_unsure_map_may_seem_steeper_but_costs_more() -> None:
    assert COSTS.limits[0] == pytest.approx(np.tan(np.radians([COSTS.up_deg, COSTS.down_deg, COSTS.across_deg])))
    assert (np.diff(COSTS.limits, axis=0) >= 0.0).all()
    assert (COSTS.limits <= COSTS.holds_up).all()
    assert (COSTS.limits[-1] == COSTS.holds_up).all()
    assert (np.diff(COSTS.risk, axis=1) >= 0.0).all()  # with the slope
    below = COSTS.risk[:, :100]
    assert (np.diff(below, axis=0) >= 0.0).all()  # with the error, where the map shows what can be driven
    assert COSTS.risk[0, 99] == 0.0
    assert COSTS.risk[0, 101] == HELD_UP


def test_each_rover_has_its_own_slips_and_an_unknown_one_the_worst() -> None:
    # Jackal on mars_sand slips .347 at 7.5 and .443 at 10 deg up.
    jackal = slope_costs("mars_sand", HUSKY, "jackal")
    assert jackal.up_deg == pytest.approx(7.5 + 2.5 * (0.40 - 0.347) / (0.443 - 0.347))
    stranger = slope_costs("mars_sand", HUSKY, "/somewhere/mine.toml")
    for rover in ("husky", "jackal", "rocker_bogie"):
        known = slope_costs("mars_sand", HUSKY, rover)
        assert stranger.up_deg <= known.up_deg
        assert stranger.across_deg <= known.across_deg
    assert set(soils("mine")) == set(soils("husky"))


def test_goes_round_a_wall_through_its_gap() -> None:
    route = plan_route(mapped(ridge(gap=True)), (10.0, 10.0), (50.0, 10.0))
    assert route.refusal is None
    crossing = route.way_w[np.argmin(np.abs(route.way_w[:, 0] - 30.0))]
    assert abs(np.interp(30.0, route.way_w[:, 0], route.way_w[:, 1]) - 50.0) < 6.0, crossing


def test_refuses_a_wall_and_says_how_steep_it_is() -> None:
    route = plan_route(mapped(ridge(gap=False)), (10.0, 10.0), (50.0, 10.0))
    assert route.refusal is Refusal.NO_WAY
    assert len(route.way_w) == 0
    assert np.isinf(route.cost)
    assert "15 deg up, 23 down and 15 across" in route.reason
    assert "meets 4" in route.reason or "meets 5" in route.reason  # 6 m x exp(-.5) / 3 m: 50 deg at the steepest


@pytest.mark.parametrize(
    ("start", "goal", "code", "words"),
    [
        ((-3.0, 5.0), (50.0, 5.0), Refusal.START_OFF_MAP, "covers x 0.0 to 60.0"),
        ((5.0, 5.0), (70.0, 5.0), Refusal.GOAL_OFF_MAP, "(70.0, 5.0)"),
        ((26.0, 5.0), (50.0, 5.0), Refusal.START_FORBIDDEN, "the start"),
        ((5.0, 5.0), (33.0, 5.0), Refusal.GOAL_FORBIDDEN, "deg steep"),
    ],
)
def test_refuses_places_with_a_reason(start: Place, goal: Place, code: Refusal, words: str) -> None:
    route = plan_route(mapped(ridge(gap=True)), start, goal)
    assert route.refusal is code
    assert words in route.reason


def test_cells_without_heights_are_not_driven() -> None:
    field = plane(0.0, size=61)
    field.heights_m[:, 30] = np.nan
    closed = plan_route(mapped(field), (10.0, 30.0), (50.0, 30.0))
    assert closed.refusal is Refusal.NO_WAY
    assert "without heights" in closed.reason
    assert plan_route(mapped(field), (30.0, 30.0), (50.0, 30.0)).refusal is Refusal.START_UNKNOWN
    assert plan_route(mapped(field), (10.0, 30.0), (31.0, 30.0)).refusal is Refusal.GOAL_UNKNOWN
    field.heights_m[50:, 30] = 0.0
    assert plan_route(mapped(field), (10.0, 30.0), (50.0, 30.0)).way_w[:, 1].max() > 50.0


def test_a_rover_on_forbidden_ground_may_leave_it() -> None:
    map_ = mapped(ridge(gap=True))
    assert plan_route(map_, (26.0, 5.0), (10.0, 5.0), RouteModel(leave_m=6.0)).refusal is None


def test_blocked_cells_are_gone_round_at_no_less_cost() -> None:
    field, blocked = plane(0.0, size=61), np.zeros((61, 61), dtype=bool)
    free = plan_route(mapped(field), (5.0, 30.0), (55.0, 30.0))
    blocked[10:51, 30] = True
    round_ = plan_route(cost_map(ElevationMap.of(field), COSTS, blocked=blocked), (5.0, 30.0), (55.0, 30.0))
    assert round_.cost > free.cost
    assert not blocked[tuple(round_.cells.T)].any()


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10_000))
def test_the_search_finds_what_another_dijkstra_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    field = HeightField(rng.normal(0.0, 0.25, (9, 11)), 1.0, (0.0, 0.0))
    map_ = mapped(field)
    part, care = map_.layers, map_.care
    seeds = np.full(care.shape, np.inf)
    seeds[4, 5] = 0.0
    prices = kernels.step_prices(part.rise_x, part.rise_y, part.level, care, *TABLES)
    ours, _ = kernels.cost_to_goal(prices, seeds, 1.0)
    edges = [edge for y in range(9) for x in range(11) for edge in outgoing(map_, x, y)]
    tail, head, weight = (np.array(column) for column in zip(*edges, strict=True))
    theirs = dijkstra(csr_array((weight, (head, tail)), shape=(99, 99)), indices=4 * 11 + 5)
    np.testing.assert_allclose(ours.ravel(), theirs, rtol=1e-12)


def outgoing(map_: CostMap, x: int, y: int) -> list[tuple[int, int, float]]:
    part, found = map_.layers, []
    for dx, dy in kernels.STEPS.tolist():
        if not (0 <= x + dx < 11 and 0 <= y + dy < 9):
            continue
        length = np.hypot(dx, dy)
        # Cells in the middle of a step: of a diagonal its two corners, of a knight's move the two that it splits.
        middle = {(x + np.floor(dx / 2), y + np.floor(dy / 2)), (x + np.ceil(dx / 2), y + np.ceil(dy / 2))}
        if abs(dx) == abs(dy) == 1:
            middle = {(x + dx, y), (x, y + dy)}
        touched = [(x, y), (x + dx, y + dy), *([] if 0 in {dx, dy} else middle)]
        prices = []
        for column, row in touched:
            at = int(row), int(column)
            slope = part.rise_x[at], part.rise_y[at], part.level[at]
            prices.append(map_.care[at] * kernels.metre_cost(*slope, dx / length, dy / length, *TABLES))
        if np.all(np.isfinite(prices)):
            found.append((y * 11 + x, (y + dy) * 11 + x + dx, length * np.mean(prices)))
    return found


@settings(deadline=None, max_examples=40)
@given(st.floats(0.0, 45.0), st.floats(0.0, 0.45), st.floats(0.0, 1.1), st.floats(0.0, 1.0), st.sampled_from(range(4)))
def test_rules_are_monotone_in_each_input(
    slope_deg: float, rough_m: float, step_m: float, softness: float, moved: int
) -> None:
    line = np.linspace(0.0, 1.0, 60)
    values = [np.full(60, value) for value in (slope_deg, rough_m, step_m)]
    if moved < 3:
        values[moved] = line * (45.0, 0.45, 1.1)[moved]
    answers = [index_of(values, soft) for soft in (line[::12] if moved == 3 else [softness])]
    change = np.diff(np.array(answers)[:, 0]) if moved == 3 else np.diff(answers[0])
    assert (change <= 1e-9).all()


def index_of(values: list[FloatArray], softness: float) -> FloatArray:
    from planner.route_ground import GroundLayers

    slope, rough, step = (value[None] for value in values)
    rise = np.tan(np.radians(slope))
    layers = GroundLayers(
        rise,
        np.zeros_like(rise),
        np.zeros(rise.shape, dtype=np.int32),
        rough,
        step,
        step,
        np.zeros_like(step),
        np.ones(rise.shape, dtype=bool),
    )
    return np.asarray(traversability(layers, softness)[0])


@given(st.floats(-30.0, 30.0), st.floats(0.0, 360.0), st.sampled_from([0.2, 0.5, 1.0]))
@settings(deadline=None, max_examples=30)
def test_slope_of_a_plane_is_exact_and_it_is_smooth(slope: float, azimuth: float, cell_m: float) -> None:
    layers = ground_layers(ElevationMap.of(plane(slope, azimuth, cell_m=cell_m)))
    inner = np.s_[8:-8, 8:-8]
    rise = np.tan(np.radians(slope))
    np.testing.assert_allclose(layers.rise_x[inner], rise * np.cos(np.radians(azimuth)), atol=1e-9)
    np.testing.assert_allclose(layers.rise_y[inner], rise * np.sin(np.radians(azimuth)), atol=1e-9)
    assert layers.roughness_m[inner].max() < 1e-5
    assert layers.step_m[inner].max() < 1e-9


def test_a_step_is_seen_and_stated_noise_is_not() -> None:
    field = plane(0.0)
    field.heights_m[:, 20:] += 1.0
    assert ground_layers(ElevationMap.of(field)).step_m.max() == pytest.approx(0.5, abs=0.2)
    noisy = HeightField(np.random.default_rng(0).normal(0.0, 0.1, (200, 200)), 1.0, (0.0, 0.0))
    told, untold = (ground_layers(ElevationMap.of(noisy, error)) for error in (0.1, 0.0))
    assert np.median(told.roughness_m) < 0.25 * np.median(untold.roughness_m)


def test_filtering_halves_the_error_of_slopes_and_tells_what_is_left() -> None:
    flat = HeightField(np.zeros((301, 301)), 1.0, (0.0, 0.0))
    truth = HeightField(fractal(flat, 1.0, np.random.default_rng(0), (80.0, 4.0)), 1.0, (0.0, 0.0))
    heights = truth.heights_m + np.random.default_rng(1).normal(0.0, 0.1, truth.heights_m.shape)
    noisy = ElevationMap.of(HeightField(heights, 1.0, (0.0, 0.0)), 0.1)
    true = ground_layers(ElevationMap.of(truth))
    clean = denoised(noisy)
    before, after = (np.std(ground_layers(map_).rise_x - true.rise_x) for map_ in (noisy, clean))
    assert after < 0.55 * before
    assert after == pytest.approx(np.sqrt(clean.variance_m2[0, 0] / 6.0), rel=0.1)  # six: spread of 3 x 3 cells


def test_filtering_leaves_holes_and_exact_maps() -> None:
    field = plane(5.0)
    field.heights_m[3, 4] = np.nan
    assert np.isnan(denoised(ElevationMap.of(field, 0.1)).field.heights_m[3, 4])
    exact = ElevationMap.of(field)
    assert denoised(exact) is exact


def test_a_true_cost_is_within_15_percent_of_the_best() -> None:
    flat = HeightField(np.zeros((201, 201)), 1.0, (0.0, 0.0))
    for seed in range(3):
        truth = HeightField(fractal(flat, 0.8, np.random.default_rng(seed), (80.0, 4.0)), 1.0, (0.0, 0.0))
        noise = np.random.default_rng([seed, 1]).normal(0.0, 0.1, truth.heights_m.shape)
        noisy = denoised(ElevationMap.of(HeightField(truth.heights_m + noise, 1.0, (0.0, 0.0)), 0.1))
        true_map, ends = mapped(truth), ((20.0, 30.0), (180.0, 170.0))
        planned, best = plan_route(cost_map(noisy, COSTS), *ends), plan_route(true_map, *ends)
        assert way_cost(true_map, planned.way_w, slope_costs("mars_sand", HUSKY, "husky", SlopeLimits(slip=0.5))) < (
            1.15 * best.cost
        )


def test_files_of_knowledge_are_checked(tmp_path: Path) -> None:
    wrong = tmp_path / "slopes.toml"
    wrong.write_text(
        (KNOWLEDGE / "husky.toml").read_text(encoding="utf-8").replace("softness = 0.5", "hardness = 0.5"),
        encoding="utf-8",
    )
    with pytest.raises(InputError, match=r"slopes.toml: mars_sand: wanted are exactly softness, slip_up"):
        load_soils(wrong)
    wrong.write_text("slope_deg = [1.0, 2.0]\n[sand]\n", encoding="utf-8")
    with pytest.raises(InputError, match="rising slopes from 0"):
        load_soils(wrong)
    rules = tmp_path / "route.toml"
    rules.write_text(
        RULES.read_text(encoding="utf-8").replace("[index.input.softness]", "[index.input.wetness]"), encoding="utf-8"
    )
    with pytest.raises(InputError, match=r"route\.toml"):
        load_rules(rules)


def gully(depth_m: float, noise_m: float, seed: int) -> ElevationMap:
    """Rolling ground of 40 x 40 m at 0.5 m, measured and filtered, with a gully along x = 20 up to y = 30."""
    flat = HeightField(np.zeros((81, 81)), 0.5, (0.0, 0.0))
    rng = np.random.default_rng(seed)
    heights = fractal(flat, 0.1, rng, (20.0, 4.0))
    x, y = np.meshgrid(0.5 * np.arange(81), 0.5 * np.arange(81))
    heights -= depth_m * np.clip(1.0 - np.abs(x - 20.0) / 0.75, 0.0, 1.0) * (y < 30.0)
    noisy = HeightField(heights + rng.normal(0.0, noise_m, heights.shape), 0.5, (0.0, 0.0))
    return denoised(ElevationMap.of(noisy, noise_m))


@pytest.mark.parametrize("seed", range(3))
def test_a_gully_that_would_hold_the_belly_is_gone_round(seed: int) -> None:
    ground, free = gully(0.45, 0.03, seed), np.full_like(COSTS.limits, np.inf)
    slopes_pass, crossings = replace(COSTS, limits=free, risk=np.zeros_like(COSTS.risk)), []
    for break_rise in (COSTS.break_rise, np.inf):
        costs = replace(slopes_pass, break_rise=break_rise)
        way = plan_route(cost_map(ground, costs), (5.0, 20.0), (35.0, 20.0)).way_w
        crossings.append(np.interp(20.0, way[:, 0], way[:, 1]))
    assert crossings[0] > 30.0 > crossings[1]


def test_breaks_of_a_filtered_map_are_as_large_as_the_ground_s() -> None:
    flat = HeightField(np.zeros((121, 121)), 1.0, (0.0, 0.0))
    truth = fractal(flat, 0.3, np.random.default_rng(4), (30.0, 2.0))
    noisy = HeightField(truth + np.random.default_rng(5).normal(0.0, 0.05, truth.shape), 1.0, (0.0, 0.0))
    known = ground_layers(ElevationMap.of(HeightField(truth, 1.0, (0.0, 0.0))))
    told = ground_layers(denoised(ElevationMap.of(noisy, 0.05)))
    assert np.median(told.break_m) == pytest.approx(np.median(known.step_m), rel=0.25)
    assert np.corrcoef(told.break_m.ravel(), known.step_m.ravel())[0, 1] > 0.6
    assert (told.break_sd_m > 0.0).all()
    measured = ground_layers(ElevationMap.of(noisy, 0.05))  # noise is in these
    np.testing.assert_array_equal(measured.break_m, measured.step_m)
