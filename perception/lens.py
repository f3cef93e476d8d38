"""Distortion of real lenses: from ideal image points to those on the sensor and back.

Points are in units of the focal length, right and down from the principal point. The functions follow the models of
OpenCV, which the tests hold them to; the inverse is Newton's method with the exact derivative. A polynomial describes
a lens only out to where it stops growing: points beyond it have no ray and come back as NaN.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from worlds.types import FloatArray, Lens

COEFFICIENTS = {"brown": 5, "fisheye": 4}
_ROUNDS = 20
_EXACT = 1e-9  # of the focal length: far under a thousandth of a pixel
_MAX_ANGLE_RAD = np.deg2rad(88.0)  # a ray of depth 1 is endless at 90 degrees
_STEPS = 512


def distort(lens: Lens, ideal: FloatArray) -> FloatArray:
    """Points (..., 2) on the sensor of ideal points (..., 2); NaN beyond the reach of the lens model."""
    ideal = np.asarray(ideal, dtype=float)
    if lens.model == "fisheye":
        radius = np.linalg.norm(ideal, axis=-1)
        angle = np.arctan(radius)
        angle = np.where(angle <= _reach(lens), angle, np.nan)
        # On the axis both are zero, and the ratio is one.
        ratio = np.where(radius > 0, _turned(lens, angle) / np.where(radius > 0, radius, 1.0), 1.0)
        return np.asarray(ideal * ratio[..., None])
    inside = np.linalg.norm(ideal, axis=-1) <= np.tan(_reach(lens))
    return np.asarray(np.where(inside[..., None], _brown(lens, ideal)[0], np.nan))


def undistort(lens: Lens, sensor: FloatArray) -> FloatArray:
    """Ideal points (..., 2) of points (..., 2) on the sensor; NaN beyond the reach of the lens model."""
    sensor = np.asarray(sensor, dtype=float)
    return _undistort_fisheye(lens, sensor) if lens.model == "fisheye" else _undistort_brown(lens, sensor)


def _undistort_fisheye(lens: Lens, sensor: FloatArray) -> FloatArray:
    reach = _reach(lens)
    radius = np.linalg.norm(sensor, axis=-1)
    target = np.where(radius <= _turned(lens, np.array(reach)), radius, np.nan)
    angle = np.minimum(target, reach)
    for _ in range(_ROUNDS):
        angle = np.clip(angle - (_turned(lens, angle) - target) / _turned_slope(lens, angle), 0.0, reach)
    angle = np.where(np.abs(_turned(lens, angle) - target) < _EXACT, angle, np.nan)
    ratio = np.where(radius > 0, np.tan(angle) / np.where(radius > 0, radius, 1.0), 1.0)
    return np.asarray(sensor * ratio[..., None])


def _undistort_brown(lens: Lens, sensor: FloatArray) -> FloatArray:
    reach = np.tan(_reach(lens))
    point = sensor.copy()
    for _ in range(_ROUNDS):
        there, (xx, xy, yy) = _brown(lens, point)
        error = sensor - there
        determinant = xx * yy - xy * xy
        determinant = np.where(np.abs(determinant) > 1e-6, determinant, 1e-6)
        step = np.stack([yy * error[..., 0] - xy * error[..., 1], xx * error[..., 1] - xy * error[..., 0]], axis=-1)
        point = point + step / determinant[..., None]
        # A step may overshoot into where the polynomial folds back: pull it to the rim.
        length = np.linalg.norm(point, axis=-1, keepdims=True)
        point = np.where(length > reach, point * (reach / np.where(length > 0, length, 1.0)), point)
        if np.abs(error).max(initial=0.0) < _EXACT:
            break
    missed = np.abs(_brown(lens, point)[0] - sensor).max(axis=-1) >= _EXACT
    return np.asarray(np.where(missed[..., None], np.nan, point))


def _brown(lens: Lens, point: FloatArray) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray]]:
    """Distorted points (..., 2) and the derivatives xx, xy = yx, yy (...,) of the map."""
    k1, k2, p1, p2, k3 = lens.coefficients
    x, y = point[..., 0], point[..., 1]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3)  # of `radial` against r2
    there = np.stack(
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ],
        axis=-1,
    )
    xx = radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
    xy = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y
    yy = radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
    return there, (xx, xy, yy)


def _turned(lens: Lens, angle_rad: FloatArray) -> FloatArray:
    """Distance (...,) on the sensor of rays at an angle to the axis."""
    k1, k2, k3, k4 = lens.coefficients
    t2 = angle_rad * angle_rad
    return np.asarray(angle_rad * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)))))


def _turned_slope(lens: Lens, angle_rad: FloatArray) -> FloatArray:
    k1, k2, k3, k4 = lens.coefficients
    t2 = angle_rad * angle_rad
    return np.asarray(1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4))))


@lru_cache(maxsize=16)
def _reach(lens: Lens) -> float:
    """Largest angle to the axis up to which the radial polynomial grows."""
    angle = np.linspace(0.0, _MAX_ANGLE_RAD, _STEPS)
    if lens.model == "fisheye":
        slope = _turned_slope(lens, angle)
    else:
        k1, k2, _, _, k3 = lens.coefficients
        r2 = np.tan(angle) ** 2
        slope = 1.0 + r2 * (3.0 * k1 + r2 * (5.0 * k2 + r2 * 7.0 * k3))
    falling = np.nonzero(slope <= 1e-3)[0]
    return float(angle[falling[0] - 1] if len(falling) else _MAX_ANGLE_RAD)
