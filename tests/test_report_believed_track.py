from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from rover_sim.report.believed_track import draw_believed_track, ellipse, marks


def test_an_ellipse_is_four_sigma_long_and_lies_as_the_covariance_does() -> None:
    (width, height), angle = ellipse(np.array([[0.05, 0.04], [0.04, 0.05]]))  # 0.09 along the diagonal, 0.01 across
    assert (width, height) == pytest.approx((1.2, 0.4))
    assert angle % 180.0 == pytest.approx(45.0)


def test_ellipses_stand_every_five_metres_and_at_the_end() -> None:
    track = np.column_stack([np.arange(0.0, 13.0), np.zeros(13)])
    assert marks(track).tolist() == [5, 10, 12]


@pytest.mark.parametrize(("sd", "lines"), [(0.02, 0), (0.2, 1)])
def test_the_believed_track_is_drawn_where_it_may_differ(sd: float, lines: int) -> None:
    axes = Figure().subplots()
    trace = {
        "estimate_position_w": np.column_stack([np.arange(0.0, 13.0), np.zeros(13), np.zeros(13)]),
        "estimate_covariance_m2": np.tile(sd**2 * np.eye(2).ravel(), (13, 1)),
    }
    draw_believed_track(axes, trace)
    assert len(axes.lines) == lines
    assert len(axes.collections) == lines
