from __future__ import annotations

import numpy as np
import pytest

from perception.calibration import Pattern, board_points, calibrate, find_board
from perception.camera import rays_c
from tests.board_pictures import board_views, picture, true_points
from worlds.types import CameraModel, Lens

BROWN = CameraModel(320, 240, 230.0, lens=Lens("brown", (-0.22, 0.06, 0.001, -0.0015, 0.0), (163.0, 117.0), 1.01))
FISHEYE = CameraModel(320, 240, 150.0, lens=Lens("fisheye", (-0.02, 0.004, -0.002, 0.0005), (158.0, 122.0), 1.0))
BOARD = (9, 6)
PLACES = board_points("checkerboard", BOARD, 0.025)


def angle_error_rad(true: CameraModel, found: CameraModel, margin: float = 0.2) -> float:
    """Largest angle between the rays of both cameras over where boards were seen."""
    columns = np.linspace(margin, 1 - margin, 9) * true.width_px
    rows = np.linspace(margin, 1 - margin, 9) * true.height_px
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1)
    one, two = (rays_c(camera, pixels) for camera in (true, found))
    cosine = (one * two).sum(-1) / np.linalg.norm(one, axis=-1) / np.linalg.norm(two, axis=-1)
    return float(np.arccos(np.clip(cosine, -1, 1)).max())


@pytest.mark.parametrize("camera", [BROWN, FISHEYE], ids=["brown", "fisheye"])
def test_exact_points_give_the_exact_camera(camera: CameraModel) -> None:
    assert camera.lens is not None
    boards = [true_points(camera, view, PLACES) for view in board_views(12, 0.2, 0.125, 0.3)]
    found = calibrate(boards, PLACES, (320, 240), camera.lens.model)
    assert found.used.all()
    assert found.rms_px < 2e-3
    assert found.camera.focal_px == pytest.approx(camera.focal_px, rel=1e-3)
    assert found.camera.centre_px == pytest.approx(camera.centre_px, abs=0.1)
    assert angle_error_rad(camera, found.camera, 0.0) < 1e-3


@pytest.mark.parametrize(("camera", "distance"), [(BROWN, 0.3), (FISHEYE, 0.2)], ids=["brown", "fisheye"])
def test_rendered_boards_give_the_camera_back(camera: CameraModel, distance: float) -> None:
    assert camera.lens is not None
    views = board_views(9, 0.2, 0.125, distance)
    boards = [find_board(picture(camera, view, BOARD, 0.025, "checkerboard"), "checkerboard", BOARD) for view in views]
    seen = [board for board in boards if board is not None]
    assert len(seen) >= 6
    found = calibrate(seen, PLACES, (320, 240), camera.lens.model)
    assert found.rms_px < 0.2
    assert found.camera.focal_px == pytest.approx(camera.focal_px, rel=0.01)
    # A pixel is 0.25 to 0.38 degrees.
    assert angle_error_rad(camera, found.camera) < np.deg2rad(0.3)


@pytest.mark.parametrize(("pattern", "board"), [("checkerboard", (9, 6)), ("circles", (7, 5)), ("acircles", (4, 9))])
def test_points_are_found_where_they_are(pattern: Pattern, board: tuple[int, int]) -> None:
    places = board_points(pattern, board, 0.025)
    view = board_views(5, float(places[:, 0].max()), float(places[:, 1].max()), 0.35)[4]
    found = find_board(picture(BROWN, view, board, 0.025, pattern), pattern, board)
    assert found is not None
    true = true_points(BROWN, view, places)
    # A pattern that looks the same from behind may be counted from its other end.
    away = min(np.linalg.norm(found - order, axis=1).max() for order in (true, true[::-1]))
    assert away < 0.35


def test_a_board_read_wrongly_is_left_out() -> None:
    boards = [true_points(BROWN, view, PLACES) for view in board_views(8, 0.2, 0.125, 0.3)]
    boards[3] = boards[3] + np.random.default_rng(0).normal(0.0, 6.0, boards[3].shape)
    found = calibrate(boards, PLACES, (320, 240), "brown")
    assert found.used.tolist() == [True] * 3 + [False] + [True] * 4
    assert found.error_px[3] > 3.0
    assert found.rms_px < 2e-3


def test_too_few_boards_and_empty_pictures() -> None:
    assert find_board(np.full((240, 320), 127, np.uint8), "checkerboard", BOARD) is None
    assert find_board(np.zeros((1, 1), np.uint8), "circles", BOARD) is None
    with pytest.raises(ValueError, match="3 or more"):
        calibrate(
            [true_points(BROWN, view, PLACES) for view in board_views(2, 0.2, 0.125, 0.3)], PLACES, (320, 240), "brown"
        )
