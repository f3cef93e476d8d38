from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.ground_cells import CELL_M, CELLS, GroundCells, Source, empty_cells
from planner.route_ground import ElevationMap
from planner.terrain_store import TerrainStore, fused, square, with_cells
from worlds.types import HeightField


def orbit(height_m: float = 2.0, error_m: float = 0.2, slope: float = 0.0) -> ElevationMap:
    x = np.arange(41.0) - 20.0
    field = HeightField(np.tile(height_m + slope * x, (41, 1)), 1.0, (-20.0, -20.0))
    return ElevationMap.of(field, error_m)


def rover(
    height_m: float, sd_m: float, where: tuple[slice, slice] = np.s_[:, :], source: Source = Source.CAMERA
) -> GroundCells:
    """Cells about (0, 0) that were seen at one height."""
    cells = empty_cells(np.zeros(2))
    layers = {name: getattr(cells, name).copy() for name in ("source", "height_m", "variance_m2")}
    layers["source"][where], layers["height_m"][where], layers["variance_m2"][where] = source, height_m, sd_m**2
    return replace(cells, **layers)


def middle(half_m: float) -> tuple[slice, slice]:
    half = round(half_m / CELL_M)
    return (slice(CELLS // 2 - half, CELLS // 2 + half),) * 2


def test_without_the_rover_the_orbiter_speaks() -> None:
    found = square(TerrainStore(orbit()), (3.0, 3.0), 1.0)
    assert found.variance_m2 == pytest.approx(0.04)
    assert (found.mean_m, found.seen) == (2.0, 0.0)
    assert found.sources == frozenset()
    assert square(TerrainStore(orbit()), (3.0, 3.0), 4.0).variance_m2 == pytest.approx(0.04 / 16)


def test_two_sources_are_weighed_by_their_variances() -> None:
    # 4 m^2 about (0, 0), too few cells to tell a difference of level: 2.0 (sd .2) and 2.3 (sd .1) give 2.24 (sd .089).
    store = with_cells(TerrainStore(orbit()), rover(2.3, 0.1, middle(1.0)))
    found = square(store, (0.0, 0.0), 1.0)
    assert found.mean_m == pytest.approx((2.0 / 0.04 + 2.3 / 0.01) / (1 / 0.04 + 1 / 0.01))
    assert found.variance_m2 == pytest.approx(1 / (1 / 0.04 + 1 / 0.01), rel=1e-3)
    assert found.seen == 1.0
    assert found.sources == {Source.CAMERA}


def test_a_difference_of_level_is_no_hill() -> None:
    store = with_cells(TerrainStore(orbit()), rover(7.0, 0.1, middle(4.0)))
    assert store.level_m == pytest.approx(5.0, abs=1e-6)
    assert square(store, (0.0, 0.0), 1.0).mean_m == pytest.approx(2.0)


def test_what_the_rover_saw_stays_when_its_window_moves_on_and_the_surer_reading_wins() -> None:
    store = with_cells(TerrainStore(orbit()), rover(2.1, 0.02, middle(1.0), Source.WHEELS))
    store = with_cells(store, rover(2.5, 0.2, middle(1.0)))
    store = with_cells(store, empty_cells(np.array([100.0, 0.0])))
    found = square(store, (0.0, 0.0), 0.5)
    assert found.sources == {Source.WHEELS}
    assert found.mean_m == pytest.approx(2.1, abs=0.01)


def test_roughness_is_about_a_plane_and_at_the_scale_that_is_asked_for() -> None:
    cells = rover(0.0, 0.02)
    step = CELL_M * np.arange(CELLS)
    waves = 0.05 * np.sin(2 * np.pi * step / 0.4)[None, :] + 0.1 * step[:, None]
    store = with_cells(TerrainStore(orbit(0.0)), replace(cells, height_m=waves.astype(np.float32)))
    assert square(store, (0.0, 0.0), 4.0).roughness_m == pytest.approx(0.05 / np.sqrt(2), rel=0.1)
    assert square(store, (0.0, 0.0), 0.1).roughness_m < 0.02


def test_off_the_map_nothing_is_known_and_small_squares_are_less_sure() -> None:
    store = TerrainStore(orbit(slope=0.3))
    beyond = square(store, (200.0, 0.0), 1.0)
    assert np.isnan(beyond.mean_m)
    assert np.isinf(beyond.variance_m2)
    assert square(store, (0.0, 0.0), 0.2).variance_m2 > square(store, (0.0, 0.0), 1.0).variance_m2


def test_the_fused_map_changes_only_where_the_rover_was() -> None:
    coarse = orbit()
    map_ = fused(with_cells(TerrainStore(coarse), rover(2.6, 0.05, middle(1.0))))
    changed = map_.field.heights_m != coarse.field.heights_m
    assert changed[20, 20]
    assert changed.sum() <= 9
    assert map_.variance_m2[20, 20] < 0.05**2
    assert np.all(map_.variance_m2 <= coarse.variance_m2 + 1e-12)


@settings(deadline=None, max_examples=25)
@given(st.floats(-15.0, 15.0), st.floats(-15.0, 15.0), st.floats(0.05, 8.0), st.floats(0.01, 0.5))
def test_seeing_never_makes_less_sure(x: float, y: float, side_m: float, sd_m: float) -> None:
    before = TerrainStore(orbit())
    after = with_cells(before, rover(2.0, sd_m, middle(3.0)))
    assert square(after, (x, y), side_m).variance_m2 <= square(before, (x, y), side_m).variance_m2 + 1e-12
