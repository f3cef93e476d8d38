from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from worlds.errors import ScenarioError
from worlds.rock_sizes import area_fraction, decay_per_m, expected_number, place_discs, sample_diameters

PROBES_M = (0.1, 0.2, 0.35, 0.5, 1.0)
# Rocks per 100 m^2 larger than 0.1, 0.2, 0.35 and 0.5 m, integrated from the law's number density.
COUNTS = {
    0.02: (38.9, 5.26, 0.513, 0.0678),
    0.05: (103.4, 24.01, 4.962, 1.3553),
    0.10: (186.4, 52.61, 14.197, 4.9934),
    0.19: (318.6, 99.24, 30.562, 12.1710),
}


def test_the_law_by_hand() -> None:
    assert decay_per_m(0.05) == pytest.approx(4.83)
    assert area_fraction(0.05, [0.1, 0.35]) == pytest.approx([0.0308, 0.00922], rel=0.01)


@pytest.mark.parametrize("cfa", COUNTS)
def test_expected_numbers_are_the_tabled_ones(cfa: float) -> None:
    numbers = [expected_number(cfa, low, 30.0, 100.0) for low in PROBES_M[:4]]
    assert numbers == pytest.approx(COUNTS[cfa], rel=0.005)


@pytest.mark.parametrize("cfa", [0.05, 0.10, 0.19])
def test_fields_follow_the_law_within_ten_percent(cfa: float) -> None:
    # 10^6 m^2: at k = 0.05 only four rocks of a metre lie on 10^4 m^2, too few to count to ten percent.
    area = 1e6
    diameters = sample_diameters(cfa, 0.1, 8.0, area, np.random.default_rng([0, 2]))
    for probe in PROBES_M:
        cover = np.pi / 4 * (diameters[diameters >= probe] ** 2).sum() / area
        assert cover == pytest.approx(area_fraction(cfa, probe), rel=0.10)


def test_a_placed_field_covers_what_the_law_says() -> None:
    rng = np.random.default_rng([0, 2])
    side = 250.0
    diameters = sample_diameters(0.10, 0.2, 8.0, side**2, rng)
    centres = place_discs(diameters / 2, (side, side), rng)
    # Share of probing points under a rock: placement neither loses nor overlaps any.
    nearest = cKDTree(centres).query(rng.uniform(0.0, side, (40_000, 2)), k=8)
    covered = (nearest[0] < diameters[nearest[1]] / 2).any(axis=1).mean()
    assert covered == pytest.approx(area_fraction(0.10, 0.2), rel=0.10)


def test_sizes_lie_within_the_cut_largest_first() -> None:
    diameters = sample_diameters(0.1, 0.05, 1.2, 1600.0, np.random.default_rng(1))
    assert np.all(np.diff(diameters) <= 0)
    assert diameters[0] <= 1.2
    assert diameters[-1] >= 0.05
    assert len(sample_diameters(0.0, 0.05, 1.2, 1600.0, np.random.default_rng(1))) == 0


@given(seed=st.integers(0, 2**32), count=st.integers(0, 60), largest=st.floats(0.05, 0.8))
def test_discs_never_overlap_and_stay_on_the_map(seed: int, count: int, largest: float) -> None:
    rng = np.random.default_rng(seed)
    radii = rng.uniform(0.02, largest, count)
    centres = place_discs(radii, (12.0, 15.0), rng)
    assert np.all(centres >= radii[:, None])
    assert np.all(centres <= np.array([12.0, 15.0]) - radii[:, None])
    gap = np.linalg.norm(centres[:, None] - centres[None], axis=2) - radii[:, None] - radii[None]
    assert np.all(gap[~np.eye(count, dtype=bool)] >= 0)


def test_places_are_uniform() -> None:
    centres = place_discs(np.full(4000, 0.02), (10.0, 10.0), np.random.default_rng(5))
    counts = np.bincount(centres.astype(int)[:, 0] // 2 * 5 + centres.astype(int)[:, 1] // 2)
    # 25 squares of 160 expected: five standard deviations of a Poisson count.
    assert np.abs(counts - 160).max() < 5 * np.sqrt(160)


def test_what_does_not_fit_is_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ScenarioError, match="does not fit the map"):
        place_discs(np.array([2.0]), (3.0, 9.0), rng)
    with pytest.raises(ScenarioError, match="cannot be laid without overlap"):
        place_discs(np.full(30, 0.5), (4.0, 4.0), rng)
