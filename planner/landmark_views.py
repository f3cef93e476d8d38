"""What a picture says of a rock as a landmark, and what a landmark should look like: directions and distance.

A rock is seen under an azimuth from the rover's heading and a depression under the level, as the believed roll and
pitch put it, at a distance that two cameras measure; the believed place and heading do not matter. With w the landmark
from the body's origin in level axes ahead and to the left, c the camera there and d the lean that the attitude misses,
it is seen along v = w - d x w - c.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin

import numpy as np

from planner.localization import LocalizationState
from planner.localization_kernels import LEAN_X, STATES, YAW, Z
from worlds.geometry import euler_from_quaternion, quaternion_from_euler, rotation_from_quaternion
from worlds.types import FloatArray, Observation, PoseEstimate, Vector3

AZIMUTH, DEPRESSION, DISTANCE = range(3)  # the last as a logarithm
AXES = 3


@dataclass(frozen=True)
class ViewModel:
    """One-sigma errors of what is seen of a rock."""

    azimuth_sd_rad: float = 0.006
    depression_sd_rad: float = 0.008
    outline_sd: float = 0.10  # of the place, as a share of the diameter
    size_sd: float = 0.20  # of the logarithm of a diameter
    reach_m: float = 5.0
    distance_bias: tuple[float, float] = (-0.006, 0.0029)  # of the logarithm, and per metre, that two eyes see too near
    depression_bias: tuple[float, float] = (0.0005, 0.012)  # rad, and over the squared distance, that is seen too low


@dataclass(frozen=True, eq=False)
class RockViews:
    """K rocks as seen in one picture."""

    seen: FloatArray  # (K, 3) azimuth, depression (rad), logarithm of the distance (m) from the camera
    sd: FloatArray  # (K, 3)
    log_size: FloatArray  # (K,) of the diameter in metres

    def __len__(self) -> int:
        return len(self.log_size)


def rock_views(observation: Observation, estimate: PoseEstimate, camera_b: Vector3, model: ViewModel) -> RockViews:
    """The whole rocks within reach, as seen from the pose ``estimate`` by which ``observation`` was placed."""
    rocks = [rock for rock in observation.rocks if not rock.cut and rock.range_m <= model.reach_m]
    rotation = rotation_from_quaternion(estimate.pose.quaternion_w)
    eye = estimate.pose.position_w + rotation @ np.asarray(camera_b)
    sight = np.array([rock.position_w for rock in rocks]).reshape(len(rocks), 3) - eye
    level = sight @ level_axes(euler_from_quaternion(estimate.pose.quaternion_w)[2]).T
    diameter = np.sqrt([rock.length_m * rock.width_m for rock in rocks])
    seen = directions(level)
    distance = np.exp(seen[:, DISTANCE])
    seen[:, DISTANCE] += model.distance_bias[0] + model.distance_bias[1] * distance
    seen[:, DEPRESSION] -= model.depression_bias[0] + model.depression_bias[1] / np.maximum(distance, 1.0) ** 2
    outline = model.outline_sd * diameter / np.maximum(distance, 1e-6)
    sd = np.column_stack(
        [
            np.hypot(model.azimuth_sd_rad, outline),
            np.hypot(model.depression_sd_rad, outline * np.sin(seen[:, DEPRESSION])),
            np.array([rock.position_sd_m for rock in rocks]) / np.maximum(distance, 1e-6),
        ]
    )
    return RockViews(seen, sd.reshape(len(rocks), 3), np.log(diameter))


def level_axes(yaw: float) -> FloatArray:
    """Rows (3, 3): directions ahead, to the left and up of a heading."""
    return np.array([[cos(yaw), sin(yaw), 0.0], [-sin(yaw), cos(yaw), 0.0], [0.0, 0.0, 1.0]])


def directions(v: FloatArray) -> FloatArray:
    """Azimuth, depression and logarithm of the length (N, 3) of vectors (N, 3) in level axes."""
    flat = np.hypot(v[:, 0], v[:, 1])
    return np.column_stack([np.arctan2(v[:, 1], v[:, 0]), np.arctan2(-v[:, 2], flat), np.log(np.hypot(flat, v[:, 2]))])


def direction_slopes(v: FloatArray) -> FloatArray:
    """Derivatives (N, 3, 3) of `directions` by the vectors (N, 3)."""
    x, y, z = v.T
    flat2 = x * x + y * y
    flat, all2 = np.sqrt(flat2), flat2 + z * z
    none = np.zeros_like(x)
    rows = [[-y / flat2, x / flat2, none], [x * z / (flat * all2), y * z / (flat * all2), -flat / all2], (v.T / all2)]
    return np.moveaxis(np.array([[*row] for row in rows]), 2, 0)


def camera_offset(state: LocalizationState, camera_b: Vector3) -> FloatArray:
    """The camera (3,) from the body's origin in level axes."""
    tilt = rotation_from_quaternion(quaternion_from_euler(state.roll_rad, state.pitch_rad, 0.0))
    return np.asarray(tilt @ np.asarray(camera_b))


def expected_views(
    state: LocalizationState, place_w: FloatArray, camera_b: Vector3
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """How landmarks at ``place_w`` (M, 3) should be seen (M, 3), and its derivatives.

    Those are by the state (M, 3, 13) and by the places (M, 3, 3).
    """
    axes = level_axes(float(state.mean[YAW]))
    w = (place_w - state.mean[: Z + 1]) @ axes.T
    lean = np.array([state.mean[LEAN_X], state.mean[LEAN_X + 1], 0.0])
    v = w - np.cross(lean, w) - camera_offset(state, camera_b)
    slopes = direction_slopes(v)
    by_place = slopes @ axes
    by_state = np.zeros((len(w), 3, STATES))
    by_state[:, :, : Z + 1] = -by_place
    by_state[:, :, YAW] = np.einsum("nij,nj->ni", slopes, np.column_stack([w[:, 1], -w[:, 0], np.zeros(len(w))]))
    by_state[:, :, LEAN_X : LEAN_X + 2] = np.einsum("nij,njk->nik", slopes, crossing(w))[:, :, :2]
    return directions(v), by_state, by_place


def crossing(w: FloatArray) -> FloatArray:
    """Matrices (N, 3, 3) that take d to w x d, for vectors (N, 3)."""
    x, y, z = w.T
    none = np.zeros_like(x)
    return np.moveaxis(np.array([[none, -z, y], [z, none, -x], [-y, x, none]]), 2, 0)


def placed(state: LocalizationState, views: RockViews, camera_b: Vector3) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where rocks seen for the first time are (K, 3), with its derivative and error.

    The derivative is by the state (K, 3, 13), the covariance (K, 3, 3) what the view itself adds.
    """
    axes = level_axes(float(state.mean[YAW]))
    distance, down = np.exp(views.seen[:, DISTANCE]), views.seen[:, DEPRESSION]
    azimuth = views.seen[:, AZIMUTH]
    toward = np.column_stack([np.cos(down) * np.cos(azimuth), np.cos(down) * np.sin(azimuth), -np.sin(down)])
    v = distance[:, None] * toward
    lean = np.array([state.mean[LEAN_X], state.mean[LEAN_X + 1], 0.0])
    w = v + camera_offset(state, camera_b)
    w = w + np.cross(lean, w)
    by_view = np.linalg.inv(direction_slopes(v))  # of w by azimuth, depression, logarithm of the distance
    by_state = np.zeros((len(w), 3, STATES))
    by_state[:, :, : Z + 1] = np.eye(3)
    by_state[:, :, YAW] = np.column_stack([-w[:, 1], w[:, 0], np.zeros(len(w))]) @ axes
    by_state[:, :, LEAN_X : LEAN_X + 2] = np.einsum("ji,njk->nik", axes, -crossing(w)[:, :, :2])
    spread = np.einsum("ji,njk,nk->nik", axes, by_view, views.sd)
    return state.mean[: Z + 1] + w @ axes, by_state, spread @ np.swapaxes(spread, 1, 2)
