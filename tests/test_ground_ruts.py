from __future__ import annotations

from dataclasses import replace
from math import cos, radians, sqrt, tan
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_sim.sim import soil_kernels as kernel
from rover_sim.sim.motion_kernels import BODY_COLUMNS, MOTION_COLUMNS
from rover_sim.sim.rover import load_rover
from rover_sim.sim.rut_kernels import PILED_SHARE, TILE_TEXELS, Ruts, press_rut, rut_depth
from rover_sim.sim.ruts import RutField, load_ruts, no_ruts
from rover_sim.sim.simulation import Simulation
from rover_sim.sim.terramechanics import WheelSoil
from tests.sim_factory import make_world, slope
from worlds.soil import PRESETS, Soil
from worlds.types import FloatArray, SoilMap, World
from worlds.wong_reece import WheelShape, steady_wheel

ROVER = load_rover("husky")
TRACK = 0.5 * ROVER.track_m
WHEEL = ROVER.wheel_shape()


def flat_field(size_m: float = 8.0) -> RutField:
    return RutField(slope(0.0, size_m))


def press(ruts: RutField, x: float, y: float, sinkage: float, *, lean: float = 0.0, yaw_deg: float = 0.0) -> None:
    ahead = cos(radians(yaw_deg)), sqrt(1.0 - cos(radians(yaw_deg)) ** 2)
    press_rut(ruts.view, (x, y), ahead, (WHEEL.radius_m, 0.5 * WHEEL.width_m), sinkage, lean)
    ruts.reserve()


def volumes_m3(ruts: RutField) -> tuple[float, float]:
    """Pressed and piled volume."""
    depth = ruts.depth_m[: ruts.count].astype(np.float64)
    area = ruts.texel_m**2
    return float(depth[depth > 0].sum() * area), float(-depth[depth < 0].sum() * area)


def test_texels_divide_the_cells_of_the_ground() -> None:
    for resolution, texels in [(0.08, 4), (0.1, 5), (0.02, 1), (0.03, 2), (0.01, 1)]:
        ruts = RutField(slope(0.0, 2.0, resolution_m=resolution))
        assert ruts.per_cell == texels
        assert ruts.texel_m == pytest.approx(resolution / texels)


def test_a_pressed_rut_has_the_shape_of_the_rim() -> None:
    ruts = flat_field()
    press(ruts, 0.01, 0.01, 0.02)  # the middle of a texel
    r = WHEEL.radius_m
    for along in (0.0, 0.02, 0.04, 0.06):
        expected = 0.02 - along**2 / (2 * r)
        assert rut_depth(ruts.view, 0.01 + along, 0.01) == pytest.approx(expected, rel=1e-6)
        assert rut_depth(ruts.view, 0.01 - along, 0.01) == pytest.approx(expected, rel=1e-6)
    assert rut_depth(ruts.view, 0.01, 0.01 + 0.04) == pytest.approx(0.02, rel=1e-6)  # within half the width, 57 mm
    assert rut_depth(ruts.view, 0.01, 0.01 + 0.06) < 0.0  # the berm
    assert rut_depth(ruts.view, 0.01 + 0.12, 0.01) == 0.0
    assert rut_depth(ruts.view, 0.01, 0.01 + 0.14) == 0.0


def test_half_of_the_pressed_volume_rises_beside_the_wheel() -> None:
    for yaw in (0.0, 30.0, 90.0):
        ruts = flat_field()
        press(ruts, 0.3, -0.2, 0.02, yaw_deg=yaw)
        pressed, piled = volumes_m3(ruts)
        # Under the parabola of the rim: 2/3 of depth times chord, times width.
        by_hand = 4.0 / 3.0 * 0.02 * sqrt(2 * WHEEL.radius_m * 0.02) * WHEEL.width_m
        assert pressed == pytest.approx(by_hand, rel=0.1)
        assert piled == pytest.approx(PILED_SHARE * pressed, rel=0.15)


def test_a_wheel_that_slides_to_its_left_piles_up_there() -> None:
    ruts = flat_field()
    press(ruts, 0.01, 0.01, 0.02, lean=1.0)
    assert rut_depth(ruts.view, 0.01, 0.01 + 0.08) < -0.003
    assert rut_depth(ruts.view, 0.01, 0.01 - 0.08) == 0.0


def test_pressing_the_same_place_twice_changes_nothing() -> None:
    ruts = flat_field()
    press(ruts, 0.0, 0.0, 0.02)
    before = ruts.depth_m.copy()
    press(ruts, 0.0, 0.0, 0.02)
    assert np.array_equal(ruts.depth_m, before)


@settings(max_examples=40, deadline=None)
@given(st.floats(-6.0, 6.0), st.floats(-6.0, 6.0), st.floats(1e-4, 0.05), st.floats(0.0, 180.0), st.floats(-1.0, 1.0))
def test_no_rut_is_deeper_than_the_wheel_nor_a_berm_higher(
    x: float, y: float, sinkage: float, yaw: float, lean: float
) -> None:
    ruts = flat_field()
    for step in range(3):
        press(ruts, x + 0.01 * step, y, sinkage, lean=lean, yaw_deg=yaw)
    assert ruts.depth_m.max() <= sinkage + 1e-6
    assert ruts.depth_m.min() >= -sinkage - 1e-6


def test_tiles_come_only_where_a_wheel_was_and_never_run_out() -> None:
    ruts = RutField(slope(0.0, 200.0, resolution_m=0.2))
    assert ruts.count == 0
    rng = np.random.default_rng(3)
    places = rng.uniform(-95.0, 95.0, (300, 2))
    for x, y in places:
        press(ruts, float(x), float(y), 0.01)
        assert rut_depth(ruts.view, float(x), float(y)) > 0.0
    assert 250 < ruts.count < 700
    assert len(ruts.depth_m) < 2048


def test_changes_are_taken_once() -> None:
    ruts = flat_field()
    press(ruts, 0.5, 0.5, 0.02)
    changed = ruts.take_changes()
    assert len(changed) == ruts.count
    assert len(ruts.take_changes()) == 0
    press(ruts, -3.0, -3.0, 0.02)
    (row, column), *rest = ruts.take_changes()
    assert not rest
    assert (row, column) == (int(1.0 / 0.02) // TILE_TEXELS, int(1.0 / 0.02) // TILE_TEXELS)


def test_samples_are_means_over_half_a_cell_to_every_side() -> None:
    ruts = flat_field()
    press(ruts, 0.0, 0.0, 0.03)
    press(ruts, 1.21, 0.55, 0.02)
    for place in ruts.take_changes():
        rows, columns = ruts.cells(place)
        found = ruts.samples(rows, columns)
        for row in range(rows.start, rows.stop, 3):
            for column in range(columns.start, columns.stop, 3):
                x, y = -4.0 + 0.08 * column, -4.0 + 0.08 * row
                offsets = (-0.03, -0.01, 0.01, 0.03)
                by_hand = np.mean([rut_depth(ruts.view, x + a, y + b) for a in offsets for b in offsets])
                assert found[row - rows.start, column - columns.start] == pytest.approx(by_hand, abs=1e-7)


def test_what_is_saved_is_read_again(tmp_path: Path) -> None:
    ruts = flat_field()
    press(ruts, 0.5, 0.5, 0.02)
    press(ruts, -3.0, -3.0, 0.01)
    ruts.copy().save(tmp_path / "ruts.npz")
    saved = load_ruts(tmp_path / "ruts.npz")
    assert saved.texel_m == pytest.approx(0.02)
    assert saved.origin_m == (-4.0, -4.0)
    assert np.array_equal(saved.depth_m, ruts.depth_m[: ruts.count])
    assert np.array_equal(saved.tile, ruts.places())
    deepest = int(saved.depth_m.max(axis=(1, 2)).argmax())
    row, column = np.unravel_index(int(saved.depth_m[deepest].argmax()), (64, 64)) + 64 * saved.tile[deepest]
    middle = np.array(saved.origin_m) + saved.texel_m * (np.array([column, row]) + 0.5)
    assert middle == pytest.approx([0.5, 0.5], abs=0.07)


def drive(world: World, command: list[float], seconds: float) -> Simulation:
    simulation = Simulation(world, ROVER, np.random.default_rng(0))
    for _ in range(round(seconds * 240)):
        simulation.step(command)
    return simulation


def depth_at(simulation: Simulation, x: float, y: float) -> float:
    assert simulation.ruts is not None
    return float(rut_depth(simulation.ruts.view, x, y))


def test_a_drive_leaves_two_tracks_as_deep_as_its_wheels_and_does_not_dig_in() -> None:
    with drive(make_world(slope(0.0, 12.0), "loose_sand", start=(-5.0, 0.0)), [2.0] * 4, 8.0) as simulation:
        early = simulation.state
        for _ in range(12 * 240):
            simulation.step([2.0] * 4)
        state = simulation.state
        assert state.sinkage_m == pytest.approx(early.sinkage_m, rel=0.02)
        rear = state.sinkage_m[1]
        x = state.pose.position_w[0] - 1.5
        y = state.pose.position_w[1]
        assert depth_at(simulation, x, y + TRACK) == pytest.approx(rear, rel=0.02)
        assert depth_at(simulation, x, y - TRACK) == pytest.approx(rear, rel=0.02)
        assert depth_at(simulation, x, y) == 0.0
        assert depth_at(simulation, x, y + TRACK + 0.065) < -0.002
        assert depth_at(simulation, x + 3.0, y + TRACK) == 0.0
        assert simulation.ruts is not None
        pressed, piled = volumes_m3(simulation.ruts)
        assert piled == pytest.approx(PILED_SHARE * pressed, rel=0.2)


def test_rear_wheels_meet_packed_soil() -> None:
    soil = PRESETS["loose_sand"]
    with drive(make_world(slope(10.0, 12.0), "loose_sand", start=(-4.0, 0.0)), [2.0] * 4, 12.0) as simulation:
        state = simulation.state
        prior = simulation._ground.soil.state[:, kernel.PRIOR]
    assert prior[0] == pytest.approx(0.0, abs=1e-4)
    assert prior[1] == pytest.approx(state.sinkage_m[0], rel=0.03)
    for wheel in range(4):
        load, slip = float(state.normal_force_N[wheel]), float(state.slip[wheel])
        alone = steady_wheel(soil, WHEEL, load, slip, rut_m=float(prior[wheel]))
        assert state.sinkage_m[wheel] == pytest.approx(alone.sinkage_m, rel=0.03)
        assert state.drawbar_N[wheel] == pytest.approx(alone.drawbar_N, rel=0.05)
    load, slip = float(state.normal_force_N[1]), float(state.slip[1])
    assert state.drawbar_N[1] > steady_wheel(soil, WHEEL, load, slip).drawbar_N + 2.0  # than in virgin soil


def test_each_pass_sinks_less_than_the_one_before_and_costs_less() -> None:
    soil, load = PRESETS["loose_sand"], 139.0
    depths, costs = [0.0], []
    for _ in range(5):
        wheel = steady_wheel(soil, WHEEL, load, 0.1, rut_m=depths[-1])
        depths.append(wheel.sinkage_m)
        costs.append(wheel.resistance_N)
    increments = np.diff(depths)
    assert (increments[1:] < 0.5 * increments[0]).all()
    assert costs[1] < 0.65 * costs[0]
    for n, depth in enumerate(depths[1:], start=1):
        assert n ** (1 / 3.5) <= depth / depths[1] <= n ** (1 / 1.9)


def test_a_rut_has_the_pressure_that_made_it() -> None:
    # A wheel that could not sink further would stand on p = B z^n over its contact: with n = 1, no shear and a stress
    # peak at the bottom, W = b B int (z + h) cos over the arc, at h << z about b B z l.
    soil = Soil("x", 0.0, 1e6, 1.0, 0.0, 0.0, 0.0, 1.0, 1e-9, 0.0, reload_share=1e-4)
    found = steady_wheel(soil, WheelShape(0.165, 0.114), 50.0, 0.0, 4001, rut_m=0.05)
    arc = found.contact_m
    assert found.sinkage_m - 0.05 < 0.001
    assert 0.114 * 1e6 * 0.05 * arc == pytest.approx(50.0, rel=0.02)


def test_the_same_drive_leaves_the_same_ruts() -> None:
    depths = []
    for _ in range(2):
        with drive(make_world(slope(3.0), "mars_sand", 3.71), [3.0, 3.0, 2.0, 2.5], 3.0) as simulation:
            assert simulation.ruts is not None
            depths.append(simulation.ruts.depth_m.tobytes())
    assert depths[0] == depths[1]


def test_a_parked_rover_sinks_no_further() -> None:
    with drive(make_world(slope(10.0), "loose_sand"), [0.0] * 4, 1.0) as simulation:
        assert simulation.ruts is not None
        before = simulation.ruts.depth_m.copy()
        for _ in range(30 * 240):
            simulation.step([0.0] * 4)
        assert np.array_equal(simulation.ruts.depth_m, before)


def test_ground_without_ruts_stays_as_it_is() -> None:
    world = make_world(slope(0.0), "loose_sand")
    rigid = msgspec.structs.replace(world.scenario, soil=msgspec.structs.replace(world.scenario.soil, ruts=False))
    with drive(replace(world, scenario=rigid), [2.0] * 4, 3.0) as simulation:
        assert simulation.ruts is None
        assert (simulation._ground.soil.state[:, kernel.PRIOR] == 0.0).all()
        state = simulation.state
        load, slip = float(state.normal_force_N[1]), float(state.slip[1])
        virgin = steady_wheel(world.soil, WHEEL, load, slip).sinkage_m
        assert state.sinkage_m[1] == pytest.approx(virgin, rel=0.03)


def test_wheels_meet_the_soil_of_the_patch_they_are_in() -> None:
    ground = slope(0.0, 12.0)
    x = -6.0 + 0.08 * np.arange(ground.heights_m.shape[1])
    index = np.broadcast_to(x > 0.0, ground.heights_m.shape).astype(np.uint8)
    soils = (PRESETS["firm"], PRESETS["loose_sand"])
    world = make_world(ground, "firm", start=(-1.5, 0.0))
    patched = replace(world, soil_map=SoilMap(soils, index))
    with drive(patched, [2.0] * 4, 4.0) as simulation:
        state = simulation.state
        assert -0.5 < state.pose.position_w[0] < 0.25
        for _ in range(9 * 240):
            simulation.step([2.0] * 4)
            state = simulation.state
            if -0.05 < state.pose.position_w[0] < 0.05:  # front wheels in sand, rear wheels on firm ground
                assert state.sinkage_m[0] > 0.01
                assert state.sinkage_m[1] < 0.002
        assert state.sinkage_m.min() > 0.015
        assert 0.02 < depth_at(simulation, 1.0, TRACK) < 0.04
        assert depth_at(simulation, -0.8, TRACK) < 0.002


def wall_soil(sinkage: float, name: str = "loose_sand") -> tuple[FloatArray, FloatArray]:
    wheels = WheelSoil(slope(0.0), PRESETS[name], ROVER, 9.80665)
    wheels.settle(np.full(4, 100.0), (0.0, 0.0))
    wheels.state[:, kernel.SINKAGE] = sinkage
    return wheels.constants[0], wheels.state[0]


def test_bulldozing_is_passive_earth_pressure_by_hand() -> None:
    constants, state = wall_soil(0.02)
    soil = PRESETS["loose_sand"]
    kp = tan(radians(45.0) + soil.friction_angle_rad / 2) ** 2
    # Pressure 2 c sqrt(Kp) + gamma h Kp down to the rim, h = z - a^2 / 2 r, integrated over the chord numerically.
    chord = sqrt(2 * WHEEL.radius_m * 0.02)
    a = np.linspace(-chord, chord, 20001)
    h = 0.02 - a**2 / (2 * WHEEL.radius_m)
    by_hand = np.trapezoid(2 * soil.cohesion_Pa * sqrt(kp) * h + 0.5 * soil.unit_weight_N_m3 * kp * h**2, a)
    side, front = kernel._walls(constants, state, -1.0)
    assert side == pytest.approx(by_hand, rel=1e-4)
    assert front == pytest.approx(
        WHEEL.width_m * (2 * soil.cohesion_Pa * sqrt(kp) * 0.02 + 0.5 * soil.unit_weight_N_m3 * kp * 0.02**2), rel=1e-6
    )
    assert kernel._walls(constants, state, 0.3)[1] == 0.0  # a driven wheel has it in its stress
    state[kernel.BESIDE] = 0.02
    assert kernel._walls(constants, state, -1.0)[0] == 0.0  # nothing stands beside it


def test_a_locked_wheel_is_held_by_the_soil_that_it_pushes() -> None:
    drags = []
    for spin in (2.0, 0.0):
        wheels = WheelSoil(slope(0.0), PRESETS["loose_sand"], ROVER, 9.81)
        depth = wheels.settle(np.full(4, 139.0), (0.0, 0.0))
        motion = np.zeros((4, MOTION_COLUMNS))
        motion[:, 2] = ROVER.wheel.radius_m - depth
        motion[:, 3] = 2.0 * WHEEL.shear_radius_m
        motion[:, 7] = 1.0
        motion[:, 12] = spin
        for _ in range(60):
            out = wheels.step(motion, 1 / 240)[0]
        drags.append(out[kernel.THRUST] - out[kernel.DRAWBAR])
    assert drags[1] > drags[0] + 5.0


def test_the_belly_clears_a_ridge_that_was_pressed_down() -> None:
    ground = slope(0.0)
    ruts = RutField(ground)
    heights = np.full_like(ground.heights_m, 0.14)  # 8 mm above the belly
    body = np.zeros(BODY_COLUMNS)
    body[2], body[9], body[13], body[17] = 0.132, 1.0, 1.0, 1.0
    constants, wrench = np.array([25000.0, 500.0, 0.5]), np.zeros(6)
    points = np.array([[0.01, 0.01, 0.0]])
    grid = (-4.0, -4.0, 1 / 0.08)

    def touching(view: Ruts) -> int:
        return int(kernel.belly_wrench(heights, grid, view, points, body, constants, wrench))

    assert touching(no_ruts()) == 1
    assert wrench[2] == pytest.approx(25000.0 * 0.008)
    assert touching(ruts.view) == 1
    press(ruts, 0.01, 0.01, 0.02)
    assert touching(ruts.view) == 0
    # A berm reaches up to a belly that is clear of the natural ground.
    body[2] = 0.141
    points[0, 1] = 0.09
    assert touching(no_ruts()) == 0
    assert touching(ruts.view) == 1
