from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from worlds.build import build_world
from worlds.rock_sizes import place_discs
from worlds.scenario import Goal, Rocks, Scenario, Terrain, check_scenario

BENCHMARK = Path(__file__).resolve().parents[1] / "benchmarks" / "big_world.py"


def test_a_square_of_half_a_kilometre_at_a_decimetre_is_allowed() -> None:
    check_scenario(Scenario(name="big", terrain=Terrain(size_m=(500.0, 500.0), resolution_m=0.1)), "test")


def test_discs_do_not_overlap_and_stay_inside() -> None:
    rng = np.random.default_rng(5)
    radii = rng.uniform(0.02, 0.9, 3000) ** 3 + 0.02
    centres = place_discs(radii, (60.0, 25.0), rng)
    assert (centres >= radii[:, None]).all()
    assert (centres <= np.array([60.0, 25.0]) - radii[:, None]).all()
    gaps = np.linalg.norm(centres[:, None] - centres, axis=2) - radii[:, None] - radii
    np.fill_diagonal(gaps, 1.0)
    assert gaps.min() >= 0.0


def test_bumps_do_not_depend_on_the_bands_they_are_worked_out_in(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = Scenario(
        name="bumps",
        terrain=Terrain(size_m=(12.0, 9.0), resolution_m=0.05),
        rocks=Rocks(cfa=0.1, min_diameter_m=0.03, max_diameter_m=0.1),
        goal=Goal(position_m=(4.0, 0.0)),
    )
    whole = build_world(scenario, 2).ground.heights_m
    for module in ("worlds.rock_field", "worlds.synthesis"):
        monkeypatch.setattr(f"{module}.BAND_ROWS", 17)
    np.testing.assert_array_equal(build_world(scenario, 2).ground.heights_m, whole)


@pytest.mark.slow
@pytest.mark.parametrize("detail_m", ["0", "0.02"])
def test_half_a_kilometre_needs_less_than_one_and_a_half_gigabytes(detail_m: str) -> None:
    done = subprocess.run(
        [sys.executable, str(BENCHMARK), "500", "--detail", detail_m, "--one"],
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        check=True,
        capture_output=True,
        text=True,
    )
    found = json.loads(done.stdout)
    assert found["rocks"] > 300_000
    assert found["drive_MB"] < 1500.0
