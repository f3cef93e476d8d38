"""Where the rover believes it is: an extended Kalman filter over compass, gyroscope, wheel encoders and GNSS.

State ``(x, y, z, yaw, gyro bias, speed factor, slide east, slide north)``: the speed factor is true over wheel speed,
so one minus it is the mean slip; it wanders and returns to what the soil usually gives. The slide is what the body
moves beside that, downhill across a slope and while it turns on the spot, over the travel of its wheels. Roll and pitch
come from a complementary filter of gyroscope and accelerometer. Without GNSS it is dead reckoning, and the standard
deviations grow. Method: Thrun, Burgard, Fox, "Probabilistic Robotics" (2005), section 3.3; Mahony et al., IEEE TAC
53(5), 2008.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from planner.mobility import body_motion
from worlds.geometry import quaternion_from_euler, rotation_from_quaternion, wrap_angle
from worlds.types import FloatArray, Footprint, GnssReading, GroundPlane, Pose, PoseEstimate, SensorReadings, Vector3

X, Y, Z, YAW, BIAS, FACTOR, SLIDE_X, SLIDE_Y = range(8)
STATES = 8


@dataclass(frozen=True)
class SensorModel:
    """One-sigma noises that the filter assumes, and time constants."""

    gravity_m_s2: float = 3.71
    heading_sd_rad: float = 0.035
    heading_correlation_s: float = 0.5  # compass errors closer than this are taken as one
    gyro_sd_rad_s: float = 0.01
    bias_walk: float = 2e-4  # rad/s per sqrt(s)
    gnss_velocity_sd_m_s: float = 0.05
    gnss_vertical_ratio: float = 1.5  # height is worse than place by so much
    usual_factor: float = 0.93  # 7 % slip on level sand
    factor_sd: float = 0.25
    factor_time_s: float = 3.0
    side_slip_sd: float = 0.06  # of the speed, per sqrt(s): skid-steer wheels drift sideways
    slide_sd: float = 1.5  # slide over wheel travel, for each unit of the sine of the tilt; a turn on the spot has 2.2
    slide_distance_m: float = 1.0  # wheel travel after which a slide is forgotten
    tilt_time_s: float = 3.0  # the accelerometer corrects roll and pitch so slowly
    normal_distance_m: float = 8.0  # wheel travel over which the ground's normal is averaged
    first_normal_m: float = 1.0  # wheel travel that the first guess of the normal is worth


@dataclass(frozen=True, eq=False)
class LocalizationState:
    """All that the filter remembers."""

    time_s: float
    mean: FloatArray  # (8,)
    covariance: FloatArray  # (8, 8)
    roll_rad: float
    pitch_rad: float
    speed_m_s: float  # along body x, after slip, without the slide
    yaw_rate_rad_s: float
    normal_w: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))  # (3,) smoothed ground normal
    travel_m: float = 0.0  # of the wheels, turning on the spot included
    slide_m_s_w: FloatArray = field(default_factory=lambda: np.zeros(2))  # (2,)


def start(
    readings: SensorReadings, position_w: Vector3, position_sd_m: float = 0.05, model: SensorModel | None = None
) -> LocalizationState:
    """State of a rover that stands still at a known place; heading and tilt come from ``readings``."""
    model = model or SensorModel()
    roll, pitch = _tilt(readings.imu.acceleration_b)
    mean = np.array([*position_w, readings.imu.heading_rad, 0.0, model.usual_factor, 0.0, 0.0])
    slide_sd = model.slide_sd * float(np.sin(np.hypot(roll, pitch)))
    sd = np.array([*(position_sd_m,) * 3, model.heading_sd_rad, 0.01, model.factor_sd, slide_sd, slide_sd])
    # One place tells the general slope no better than "level" does: half of each.
    normal = rotation_from_quaternion(quaternion_from_euler(roll / 2, pitch / 2, readings.imu.heading_rad))[:, 2]
    return LocalizationState(readings.time_s, mean, np.diag(sd**2), roll, pitch, 0.0, 0.0, normal)


def localize(
    state: LocalizationState, readings: SensorReadings, footprint: Footprint, model: SensorModel | None = None
) -> LocalizationState:
    """State after ``readings``, which are later than ``state`` (else it comes back unchanged)."""
    model = model or SensorModel()
    step = readings.time_s - state.time_s
    if step <= 0.0:
        return state
    predicted = _predict(state, readings, footprint, model, step)
    mean, covariance = _correct_heading(predicted, readings.imu.heading_rad, model, step)
    if readings.gnss is not None:
        wheels = body_motion(readings.wheel_speed_rad_s, footprint).linear_m_s, _rim_speed(readings, footprint)
        mean, covariance = _correct_gnss(mean, covariance, readings.gnss, wheels, predicted.pitch_rad, model)
    corrected = replace(predicted, mean=mean, covariance=covariance)
    return _with_motion(corrected, state, readings, footprint, model)


def estimate(state: LocalizationState) -> PoseEstimate:
    """The believed pose and motion."""
    yaw = float(state.mean[YAW])
    pose = Pose(state.mean[:3].copy(), quaternion_from_euler(state.roll_rad, state.pitch_rad, yaw))
    sd = float(np.sqrt(max(np.linalg.eigvalsh(state.covariance[:2, :2])[-1], 0.0)))
    velocity = state.speed_m_s * _forward(yaw, state.pitch_rad)
    velocity[:2] += state.slide_m_s_w
    return PoseEstimate(
        state.time_s, pose, velocity, state.yaw_rate_rad_s, sd, float(np.sqrt(max(state.covariance[YAW, YAW], 0.0)))
    )


def ground_plane(state: LocalizationState, body_height_m: float) -> GroundPlane:
    """The plane the rover believes it stands on; ``body_height_m`` is that of the body's origin over the ground.

    The normal is the body's up axis averaged over the last metres of wheel travel, as the tilt here says little of
    the ground ahead: on rolling ground of 0.10 m rms a plane through the wheels misses the height 4 m ahead by
    0.31 m, one along the general slope by 0.15 m.
    """
    return GroundPlane(state.mean[:3] - body_height_m * state.normal_w, state.normal_w.copy())


def _predict(
    state: LocalizationState, readings: SensorReadings, footprint: Footprint, model: SensorModel, step: float
) -> LocalizationState:
    roll, pitch, yaw_rate = _attitude(state, readings, model, step)
    wheel_speed = body_motion(readings.wheel_speed_rad_s, footprint).linear_m_s
    travel = _rim_speed(readings, footprint) * step
    mean = state.mean.copy()
    direction = _forward(mean[YAW] + 0.5 * step * yaw_rate, pitch)
    mean[:3] += mean[FACTOR] * wheel_speed * step * direction
    mean[:2] += travel * mean[SLIDE_X:]
    mean[YAW] = wrap_angle(mean[YAW] + step * yaw_rate)
    decay = np.exp(-step / model.factor_time_s)
    kept = float(np.exp(-travel / model.slide_distance_m))
    transition = np.eye(STATES)
    transition[X, SLIDE_X] = transition[Y, SLIDE_Y] = travel
    transition[SLIDE_X, SLIDE_X] = transition[SLIDE_Y, SLIDE_Y] = kept
    transition[:3, FACTOR] = wheel_speed * step * direction
    transition[:2, YAW] = mean[FACTOR] * wheel_speed * step * np.array([-direction[1], direction[0]])
    transition[YAW, BIAS] = -step
    transition[FACTOR, FACTOR] = decay
    mean[FACTOR] = model.usual_factor + decay * (mean[FACTOR] - model.usual_factor)
    mean[SLIDE_X:] *= kept
    side = (model.side_slip_sd * wheel_speed) ** 2 * step
    slide = (model.slide_sd * float(np.sin(np.hypot(roll, pitch)))) ** 2 * (1 - kept**2)
    factor = model.factor_sd**2 * (1 - decay**2)
    noise = np.array([side, side, side, 0.0, model.bias_walk**2 * step, factor, slide, slide])
    noise[YAW] = (model.gyro_sd_rad_s**2) * step * model.heading_correlation_s
    covariance = transition @ state.covariance @ transition.T + np.diag(noise)
    return replace(
        state,
        time_s=readings.time_s,
        mean=mean,
        covariance=covariance,
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rate_rad_s=yaw_rate,
    )


def _attitude(
    state: LocalizationState, readings: SensorReadings, model: SensorModel, step: float
) -> tuple[float, float, float]:
    """Roll, pitch and yaw rate: turned by the gyroscope, pulled slowly to the direction of gravity."""
    p, q, r = readings.imu.rate_b
    r -= float(state.mean[BIAS])
    roll, pitch = state.roll_rad, state.pitch_rad
    turn = q * np.sin(roll) + r * np.cos(roll)
    yaw_rate = float(turn / np.cos(pitch))
    roll += step * (p + np.tan(pitch) * turn)
    pitch += step * (q * np.cos(roll) - r * np.sin(roll))
    force = np.asarray(readings.imu.acceleration_b)
    # The turn's centripetal part is known and taken out; knocks are no gravity and count less.
    level = force - np.array([0.0, state.speed_m_s * yaw_rate, 0.0])
    knock = (np.linalg.norm(force) - model.gravity_m_s2) / (0.1 * model.gravity_m_s2)
    pull = (1.0 - np.exp(-step / model.tilt_time_s)) * np.exp(-0.5 * knock**2)
    gravity_roll, gravity_pitch = _tilt((float(level[0]), float(level[1]), float(level[2])))
    return float(roll + pull * (gravity_roll - roll)), float(pitch + pull * (gravity_pitch - pitch)), yaw_rate


def _tilt(force_b: Vector3) -> tuple[float, float]:
    """Roll and pitch (nose down positive) of a body that feels the specific force ``force_b`` at rest."""
    x, y, z = force_b
    return float(np.arctan2(y, z)), float(np.arctan2(-x, np.hypot(y, z)))


def _forward(yaw: float, pitch: float) -> FloatArray:
    return np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)])


def _correct_heading(
    state: LocalizationState, heading: float, model: SensorModel, step: float
) -> tuple[FloatArray, FloatArray]:
    # Readings inside one correlation time carry one reading's worth of news.
    variance = model.heading_sd_rad**2 * max(1.0, model.heading_correlation_s / step)
    row = np.zeros((1, STATES))
    row[0, YAW] = 1.0
    innovation = np.array([wrap_angle(heading - state.mean[YAW])])
    return _update(state.mean, state.covariance, row, innovation, np.array([[variance]]))


def _correct_gnss(
    mean: FloatArray,
    covariance: FloatArray,
    gnss: GnssReading,
    wheels_m_s: tuple[float, float],
    pitch: float,
    model: SensorModel,
) -> tuple[FloatArray, FloatArray]:
    """``wheels_m_s``: speed of the body that the wheels tell, and mean speed of the rims."""
    wheel_speed, rim_speed = wheels_m_s
    direction = _forward(mean[YAW], pitch)
    rows = np.zeros((5, STATES))
    rows[:3, :3] = np.eye(3)
    rows[3, SLIDE_X] = rows[4, SLIDE_Y] = rim_speed
    rows[3:, FACTOR] = wheel_speed * direction[:2]
    rows[3:, YAW] = mean[FACTOR] * wheel_speed * np.array([-direction[1], direction[0]])
    expected = np.concatenate([mean[:3], mean[FACTOR] * wheel_speed * direction[:2] + rim_speed * mean[SLIDE_X:]])
    measured = np.array([*gnss.position_w, *gnss.velocity_w[:2]])
    place = gnss.position_sd_m**2
    # Sideways drift is no error of the heading: it widens what the velocity may say.
    velocity = model.gnss_velocity_sd_m_s**2 + (2.0 * model.side_slip_sd * wheel_speed) ** 2
    noise = np.diag([place, place, place * model.gnss_vertical_ratio**2, velocity, velocity])
    return _update(mean, covariance, rows, measured - expected, noise)


def _update(
    mean: FloatArray, covariance: FloatArray, rows: FloatArray, innovation: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Kalman correction in Joseph's form, which keeps the covariance positive."""
    gain = np.linalg.solve(rows @ covariance @ rows.T + noise, rows @ covariance).T
    kept = np.eye(STATES) - gain @ rows
    corrected = mean + gain @ innovation
    corrected[YAW] = wrap_angle(float(corrected[YAW]))
    corrected[FACTOR] = np.clip(corrected[FACTOR], -0.5, 1.5)
    return corrected, kept @ covariance @ kept.T + gain @ noise @ gain.T


def _with_motion(
    state: LocalizationState,
    before: LocalizationState,
    readings: SensorReadings,
    footprint: Footprint,
    model: SensorModel,
) -> LocalizationState:
    """Speed, wheel travel and the smoothed normal after a correction."""
    speed = float(state.mean[FACTOR]) * body_motion(readings.wheel_speed_rad_s, footprint).linear_m_s
    step = state.time_s - before.time_s
    rim_speed = _rim_speed(readings, footprint)
    travelled = rim_speed * step
    up = rotation_from_quaternion(quaternion_from_euler(state.roll_rad, state.pitch_rad, float(state.mean[YAW])))[:, 2]
    share = travelled / (min(before.travel_m + model.first_normal_m, model.normal_distance_m) + travelled)
    normal = before.normal_w + share * (up - before.normal_w)
    normal = normal / np.linalg.norm(normal)
    slide = rim_speed * state.mean[SLIDE_X:]
    return replace(state, speed_m_s=speed, normal_w=normal, travel_m=before.travel_m + travelled, slide_m_s_w=slide)


def _rim_speed(readings: SensorReadings, footprint: Footprint) -> float:
    """Mean speed (m/s) of the rims, whichever way they turn."""
    return float(np.mean(np.abs(readings.wheel_speed_rad_s))) * footprint.wheel_radius_m
