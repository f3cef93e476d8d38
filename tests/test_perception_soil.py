"""The soil of a picture: gradients, percentiles and the trend of the light against other implementations."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from perception.soil_reference import SoilReference, even_light, mean_gradient, percentile


@given(
    arrays(np.float32, st.integers(1, 60), elements=st.floats(-100.0, 100.0, width=32)),
    st.floats(0.0, 100.0),
)
def test_a_percentile_is_numpys(values: np.ndarray, share: float) -> None:
    expected = np.percentile(values.astype(np.float64), share)
    assert percentile(values, share) == pytest.approx(float(expected), abs=1e-9)


@pytest.mark.parametrize("shape", [(24, 31), (2, 2), (1, 5), (5, 1), (1, 1)])
def test_the_gradient_is_that_of_sobels_kernel(shape: tuple[int, int]) -> None:
    lightness = np.random.default_rng(3).uniform(0.0, 100.0, shape).astype(np.float32)
    across = cv2.Sobel(lightness, cv2.CV_32F, 1, 0, scale=0.125)
    down = cv2.Sobel(lightness, cv2.CV_32F, 0, 1, scale=0.125)
    np.testing.assert_allclose(mean_gradient(lightness, 1), np.hypot(across, down), atol=1e-4)


def test_even_light_takes_the_trend_out_of_the_lightness_alone() -> None:
    y, x = ((np.arange(n) + 0.5) * 2.0 / n - 1.0 for n in (6, 8))
    trend = np.array([1.0, 2.0, -3.0, 0.5, 4.0, -1.5], dtype=np.float32)
    terms = np.stack(np.broadcast_arrays(1.0, x, y[:, None], x * x, x * y[:, None], (y * y)[:, None]), axis=-1)
    lab = np.stack([50.0 + terms @ trend, np.full((6, 8), 7.0), np.full((6, 8), 9.0)], axis=-1).astype(np.float32)
    soil = SoilReference(np.array([50.0, 7.0, 9.0], dtype=np.float32), 1.0, trend, coloured=True)
    np.testing.assert_allclose(even_light(lab, soil), np.broadcast_to([50.0, 7.0, 9.0], (6, 8, 3)), atol=1e-4)
