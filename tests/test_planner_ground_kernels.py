from __future__ import annotations

import numpy as np

from planner.ground_kernels import nearest_values


def test_each_cell_takes_the_value_of_the_nearest_place_within_a_metre() -> None:
    rng = np.random.default_rng(3)
    first, step, shape = np.array([-2.1, 0.4]), 0.25, (23, 31)
    cells = np.stack(np.meshgrid(np.arange(31), np.arange(23)), axis=-1) * step + first
    for places in (rng.uniform(-4.0, 9.0, (60, 2)), np.round(rng.uniform(-3.0, 7.0, (40, 2)) * 4.0) / 4.0):
        values = np.arange(len(places), dtype=np.float64)
        out = np.full(shape, -1.0, dtype=np.float32)
        nearest_values(places, values, first, step, out)
        apart = np.linalg.norm(cells[:, :, None] - places, axis=-1)
        wanted = np.where(apart.min(axis=-1) < 1.0, values[apart.argmin(axis=-1)], np.nan)
        clear = np.sort(apart, axis=-1)[..., 1] - apart.min(axis=-1) > 1e-9  # of two as near either will do
        np.testing.assert_array_equal(out[clear], wanted[clear])
        assert np.isnan(out).any()
        assert (~np.isnan(out)).any()
