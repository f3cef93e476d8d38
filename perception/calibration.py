"""A camera's lens from pictures of a flat board with a regular pattern (Zhang, IEEE Trans. PAMI 22(11), 2000).

The work is OpenCV's; here its answers are brought to this project's pixels (the centre of the first one at (0.5, 0.5)),
and pictures whose board was read wrongly are left out by their own error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from worlds.types import BoolArray, ByteArray, CameraModel, FloatArray, Lens

Pattern = Literal["checkerboard", "circles", "acircles"]
Model = Literal["brown", "fisheye"]
LEAST_BOARDS = 3
_OUTLIER = 3.0  # times the median error, and at least the next many pixels
_OUTLIER_PX = 0.5
_CORNER_SHARE, _CORNER_PX = 0.4, 5.0  # of the nearest other corner; what is looked at around each, and the most
_CORNERS = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY


@dataclass(frozen=True, eq=False)
class Calibration:
    """A camera, and how well it explains the boards, one row a board."""

    camera: CameraModel
    error_px: FloatArray  # (B,) rms of each board
    residual_px: FloatArray  # (B, N, 2) seen minus explained
    used: BoolArray  # (B,) boards that the camera was taken from

    @property
    def rms_px(self) -> float:
        """Root mean square distance of the used boards' points from where they should be."""
        return float(np.sqrt(np.mean(self.error_px[self.used] ** 2)))


def board_points(pattern: Pattern, board: tuple[int, int], spacing: float) -> FloatArray:
    """Places (N, 2) of the pattern's points on the board, in the unit of ``spacing``, in the order they are found.

    ``board`` counts inner corners or circles along a row and rows. In an asymmetric grid every other row is shifted
    by ``spacing``, half the distance of its circles, and rows are ``spacing`` apart.
    """
    column, row = (index.ravel() for index in np.meshgrid(np.arange(board[0]), np.arange(board[1])))
    across = 2 * column + row % 2 if pattern == "acircles" else column
    return np.stack([across, row], axis=-1) * float(spacing)


def find_board(grey: ByteArray, pattern: Pattern, board: tuple[int, int]) -> FloatArray | None:
    """Pixels (N, 2) of the pattern's points in a grey picture (H, W); None where no whole board is found."""
    if min(grey.shape) < 2 * max(board):  # OpenCV refuses pictures smaller than the pattern
        return None
    if pattern == "checkerboard":
        found, points = cv2.findChessboardCornersSB(grey, board, flags=_CORNERS)
        points = _refined(grey, np.asarray(points), board) if found else points
    else:
        kind = cv2.CALIB_CB_ASYMMETRIC_GRID if pattern == "acircles" else cv2.CALIB_CB_SYMMETRIC_GRID
        found, points = cv2.findCirclesGrid(grey, board, flags=kind)
    return np.asarray(points, dtype=np.float64).reshape(-1, 2) + 0.5 if found else None


def _refined(grey: ByteArray, points: FloatArray, board: tuple[int, int]) -> FloatArray:
    """Corners where the gradients around them say; halves the error of the finder on pictures whose truth is known."""
    grid = points.reshape(board[1], board[0], 2)
    nearest = min(float(np.linalg.norm(np.diff(grid, axis=axis), axis=-1).min()) for axis in (0, 1))
    half = int(np.clip(_CORNER_SHARE * nearest, 1, _CORNER_PX))
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
    return np.asarray(cv2.cornerSubPix(grey, points.astype(np.float32), (half, half), (-1, -1), stop), dtype=np.float64)


def calibrate(
    boards_px: Sequence[FloatArray], places: FloatArray, size_px: tuple[int, int], model: Model
) -> Calibration:
    """Camera of ``size_px`` (width, height) from points (N, 2) of each board at their ``places`` (N, 2) on it.

    Boards whose error is far above the others' are left out, and the camera is taken from the rest. Raises ValueError
    with fewer than `LEAST_BOARDS` boards, or where no camera explains them.
    """
    used = np.ones(len(boards_px), dtype=bool)
    while True:
        if used.sum() < LEAST_BOARDS:
            raise ValueError(f"{int(used.sum())} boards can be used; {LEAST_BOARDS} or more are needed")
        camera = _solve([b for b, use in zip(boards_px, used, strict=True) if use], places, size_px, model)
        residual = np.stack([_residual(camera, board, places) for board in boards_px])
        error = np.sqrt((residual**2).sum(axis=2).mean(axis=1))
        fair = error <= max(_OUTLIER * float(np.median(error[used])), _OUTLIER_PX)
        if not (used & ~fair).any():
            return Calibration(camera, error, residual, used)
        used &= fair


def _solve(boards_px: Sequence[FloatArray], places: FloatArray, size_px: tuple[int, int], model: Model) -> CameraModel:
    space = np.column_stack([places, np.zeros(len(places))]).astype(np.float32)[None]
    seen = [(board - 0.5).astype(np.float32)[None] for board in boards_px]
    try:
        if model == "fisheye":
            flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW
            _, matrix, bend, *_ = cv2.fisheye.calibrate(
                [space] * len(seen), seen, size_px, np.eye(3), np.zeros(4), flags=flags
            )
        else:
            _, matrix, bend, *_ = cv2.calibrateCamera([space] * len(seen), seen, size_px, np.eye(3), np.zeros(5))
    except cv2.error as error:
        raise ValueError(f"no camera explains the boards ({error.err})") from error
    if not np.isfinite(matrix).all() or not np.isfinite(bend).all():
        raise ValueError("no camera explains the boards")
    return _camera(np.asarray(matrix, dtype=np.float64), tuple(np.ravel(bend).tolist()), size_px, model)


def _camera(matrix: FloatArray, bend: tuple[float, ...], size_px: tuple[int, int], model: Model) -> CameraModel:
    across, down = float(matrix[0, 0]), float(matrix[1, 1])
    centre = (float(matrix[0, 2]) + 0.5, float(matrix[1, 2]) + 0.5)
    return CameraModel(size_px[0], size_px[1], across, lens=Lens(model, bend, centre, down / across))


def opencv_matrix(camera: CameraModel) -> FloatArray:
    """OpenCV's matrix (3, 3) of a camera, the centre of the first pixel at (0, 0)."""
    aspect = camera.lens.aspect if camera.lens else 1.0
    across, down = camera.centre_px
    return np.array(
        [[camera.focal_px, 0.0, across - 0.5], [0.0, camera.focal_px * aspect, down - 0.5], [0.0, 0.0, 1.0]]
    )


def _residual(camera: CameraModel, board_px: FloatArray, places: FloatArray) -> FloatArray:
    """Seen minus explained points (N, 2) of a board in its best pose before ``camera``."""
    assert camera.lens is not None
    space = np.column_stack([places, np.zeros(len(places))])
    matrix, bend = opencv_matrix(camera), np.array(camera.lens.coefficients)
    points = np.ascontiguousarray(board_px - 0.5).reshape(-1, 1, 2)
    if camera.lens.model == "fisheye":
        _, turn, shift = cv2.fisheye.solvePnP(space[:, None], points, matrix, bend)
        explained, _ = cv2.fisheye.projectPoints(space[:, None], turn, shift, matrix, bend)
    else:
        _, turn, shift = cv2.solvePnP(space[:, None], points, matrix, bend)
        explained, _ = cv2.projectPoints(space[:, None], turn, shift, matrix, bend)
    return np.asarray(board_px - 0.5 - explained.reshape(-1, 2), dtype=np.float64)
