"""Where the rover believes it is: an extended Kalman filter over compass, gyroscope, wheel encoders and GNSS.

State ``(x, y, z, yaw, gyro bias, speed factor, slide x 2, compass error, lean x 2, lasting lean x 2)``: the speed
factor is true over wheel speed, so one minus it is the mean slip; it wanders and returns to what the soil usually
gives. The slide is what the body moves beside that, downhill across a slope and while it turns on the spot, over the
travel of its wheels. Roll and pitch come from a complementary filter of gyroscope and accelerometer; the lean is what
they miss, about the level axes ahead and to the left, and it returns to the lasting lean, which biases of both make.
Without GNSS it is dead reckoning, and the standard deviations grow, unless rocks are watched (`planner.landmarks`).
Method: Thrun, Burgard, Fox, "Probabilistic Robotics" (2005), section 3.3; Mahony et al., IEEE TAC 53(5), 2008.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import atan2, cos, exp, hypot, sin, sqrt, tan

import numpy as np

from planner.localization_kernels import BIAS, COMPASS, FACTOR, SLIDE_X, SLIDE_Y, STATES, YAW, Z, advance
from planner.mobility import body_motion
from worlds.geometry import quaternion_from_euler, rotation_from_quaternion, wrap_angle
from worlds.types import (
    FloatArray,
    Footprint,
    GnssReading,
    GroundPlane,
    ImuReading,
    Pose,
    PoseEstimate,
    SensorReadings,
    Vector3,
)

_NO_NEWS = 1e12  # variance (rad2) of a heading that says nothing


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
    climb_sd: float = 0.06  # the same up and down: on soft ground a body is trimmed against its way
    slide_sd: float = 1.5  # slide over wheel travel, for each unit of the sine of the tilt; a turn on the spot has 2.2
    slide_distance_m: float = 1.0  # wheel travel after which a slide is forgotten
    tilt_time_s: float = 3.0  # the accelerometer corrects roll and pitch so slowly
    normal_distance_m: float = 8.0  # wheel travel over which the ground's normal is averaged
    first_normal_m: float = 1.0  # wheel travel that the first guess of the normal is worth
    compass_sd_rad: float = 0.0  # of an error that stays; 0: heading_sd_rad covers it
    lean_sd_rad: float = 0.0  # of what the attitude misses by chance; 0: nobody asks
    level_sd_rad: float = 0.0  # of what it misses all along
    lean_time_s: float = 3.0
    scale_sd: float = 0.0  # of the share that all distances seen by the cameras are off


def model_without_satellites(gravity_m_s2: float) -> SensorModel:
    """For landmarks: what the sensors' own noise is, and what stays off for a whole drive apart from it."""
    return SensorModel(
        gravity_m_s2=gravity_m_s2,
        heading_sd_rad=0.012,
        heading_correlation_s=0.02,
        gyro_sd_rad_s=0.002,
        compass_sd_rad=0.009,
        lean_sd_rad=0.009,
        level_sd_rad=0.008,
        climb_sd=0.3,
        scale_sd=0.004,
    )


@dataclass(frozen=True, eq=False)
class Carried:
    """What the readings since a start did to the state, so that what hung on it then can be brought up to date.

    Compressed extended Kalman filter: Guivant and Nebot, IEEE Trans. Robotics and Automation 17(3), 2001, section III.
    """

    passed: FloatArray  # (13, 13) what became of an error of the state
    learned: FloatArray  # (13, 13) information about the state at the start
    pulled: FloatArray  # (13,) the same times the innovations


def nothing_carried() -> Carried:
    """Of no readings."""
    return Carried(np.eye(STATES), np.zeros((STATES, STATES)), np.zeros(STATES))


@dataclass(frozen=True, eq=False)
class LocalizationState:
    """All that the filter remembers."""

    time_s: float
    mean: FloatArray  # (13,)
    covariance: FloatArray  # (13, 13)
    roll_rad: float
    pitch_rad: float
    speed_m_s: float  # along body x, after slip, without the slide
    yaw_rate_rad_s: float
    normal_w: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))  # (3,) smoothed ground normal
    travel_m: float = 0.0  # of the wheels, turning on the spot included
    slide_m_s_w: FloatArray = field(default_factory=lambda: np.zeros(2))  # (2,)
    carried: Carried = field(default_factory=nothing_carried)
    by_scale: FloatArray = field(default_factory=lambda: np.zeros(STATES))  # (13,) by the share seen distances are off
    scale_sd: float = 0.0

    @property
    def place_covariance(self) -> FloatArray:
        """Covariance (3, 3) of the place, m^2: by chance, and by distances that are all off alike."""
        by_chance = self.covariance[: Z + 1, : Z + 1]
        if self.scale_sd == 0.0:  # no distances are seen
            return by_chance.copy()
        by_scale = self.scale_sd * (self.carried.passed @ self.by_scale)[: Z + 1]
        return np.asarray(by_chance + np.outer(by_scale, by_scale))


def start(
    readings: SensorReadings,
    position_w: Vector3,
    position_sd_m: float = 0.05,
    model: SensorModel | None = None,
    attitude: tuple[Vector3, float] | None = None,
) -> LocalizationState:
    """State of a rover that stands still at a known place; tilt and heading come from ``readings``.

    Unless ``attitude`` is known as well: roll, pitch and yaw (rad), and one sigma of each.
    """
    model = model or SensorModel()
    if readings.imu is None or readings.imu.heading_rad is None:
        raise ValueError("a rover cannot start without inertial unit and compass")
    told = (*_tilt(readings.imu.acceleration_b), readings.imu.heading_rad), model.heading_sd_rad
    (roll, pitch, yaw), yaw_sd = attitude or told
    lean_sd = model.lean_sd_rad if attitude is None else min(yaw_sd, model.lean_sd_rad)
    mean = np.array([*position_w, yaw, 0.0, model.usual_factor, *(0.0,) * 7])
    slide_sd = model.slide_sd * float(np.sin(np.hypot(roll, pitch)))
    unseen = model.compass_sd_rad, lean_sd, lean_sd, model.level_sd_rad, model.level_sd_rad
    sd = np.array([*(position_sd_m,) * 3, yaw_sd, 0.01, model.factor_sd, slide_sd, slide_sd, *unseen])
    # One place tells the general slope no better than "level" does: half of each.
    normal = rotation_from_quaternion(quaternion_from_euler(roll / 2, pitch / 2, yaw))[:, 2]
    return LocalizationState(
        readings.time_s, mean, np.diag(sd**2), roll, pitch, 0.0, 0.0, normal, scale_sd=model.scale_sd
    )


def localize(
    state: LocalizationState, readings: SensorReadings, footprint: Footprint, model: SensorModel | None = None
) -> LocalizationState:
    """State after ``readings``; if they are no later, or without inertial unit, it comes back unchanged."""
    model = model or SensorModel()
    step = readings.time_s - state.time_s
    if step <= 0.0 or readings.imu is None:
        return state
    roll, pitch, yaw_rate = _attitude(state, readings.imu, model, step)
    compass = readings.imu.heading_rad
    wheel_speed = body_motion(readings.wheel_speed_rad_s, footprint).linear_m_s
    rim_speed = _rim_speed(readings, footprint)
    travelled = rim_speed * step
    mean, covariance = state.mean.copy(), state.covariance.copy()
    kept = (
        exp(-step / model.factor_time_s),
        exp(-travelled / model.slide_distance_m),
        exp(-step / model.lean_time_s),
    )
    before = state.carried
    carried = Carried(before.passed.copy(), before.learned.copy(), before.pulled.copy())
    advance(
        mean,
        covariance,
        (carried.passed, carried.learned, carried.pulled),
        (step, wheel_speed * step, travelled, yaw_rate, pitch),
        (model.usual_factor, *kept, 0.0 if compass is None else compass),
        _noise(model, step, wheel_speed, kept, hypot(roll, pitch), silent=compass is None),
    )
    if readings.gnss is not None:
        wheels = wheel_speed, rim_speed
        mean, covariance, carried = _correct_gnss((mean, covariance, carried), readings.gnss, wheels, pitch, model)
    return LocalizationState(
        readings.time_s,
        mean,
        covariance,
        roll,
        pitch,
        float(mean[FACTOR]) * wheel_speed,
        yaw_rate,
        _smoothed_normal(state, (roll, pitch, float(mean[YAW])), travelled, model),
        state.travel_m + travelled,
        rim_speed * mean[SLIDE_X:COMPASS],
        carried,
        state.by_scale,
        state.scale_sd,
    )


def estimate(state: LocalizationState) -> PoseEstimate:
    """The believed pose and motion."""
    yaw = float(state.mean[YAW])
    pose = Pose(state.mean[:3].copy(), quaternion_from_euler(state.roll_rad, state.pitch_rad, yaw))
    (xx, xy), (_, yy) = state.place_covariance[:2, :2].tolist()
    widest = (xx + yy) / 2 + hypot((xx - yy) / 2, xy)  # the larger eigenvalue
    velocity = state.speed_m_s * _forward(yaw, state.pitch_rad)
    velocity[:2] += state.slide_m_s_w
    yaw_sd = sqrt(max(float(state.covariance[YAW, YAW]), 0.0))
    return PoseEstimate(state.time_s, pose, velocity, state.yaw_rate_rad_s, sqrt(max(widest, 0.0)), yaw_sd)


def ground_plane(state: LocalizationState, body_height_m: float) -> GroundPlane:
    """The plane the rover believes it stands on; ``body_height_m`` is that of the body's origin over the ground.

    The normal is the body's up axis averaged over the last metres of wheel travel, as the tilt here says little of
    the ground ahead: on rolling ground of 0.10 m rms a plane through the wheels misses the height 4 m ahead by
    0.31 m, one along the general slope by 0.15 m.
    """
    return GroundPlane(state.mean[:3] - body_height_m * state.normal_w, state.normal_w.copy())


def _noise(
    model: SensorModel,
    step: float,
    wheel_speed: float,
    kept: tuple[float, float, float],
    lean_rad: float,
    *,
    silent: bool,
) -> tuple[float, ...]:
    """Variances that a step adds to x and y, heading, bias, factor, slide and lean; of the heading read; added to z.

    ``silent``: no heading is read.
    """
    return (
        (model.side_slip_sd * wheel_speed) ** 2 * step,
        model.gyro_sd_rad_s**2 * step * model.heading_correlation_s,
        model.bias_walk**2 * step,
        model.factor_sd**2 * (1 - kept[0] ** 2),
        (model.slide_sd * sin(lean_rad)) ** 2 * (1 - kept[1] ** 2),
        model.lean_sd_rad**2 * (1 - kept[2] ** 2),
        # Readings inside one correlation time carry one reading's worth of news.
        _NO_NEWS if silent else model.heading_sd_rad**2 * max(1.0, model.heading_correlation_s / step),
        (model.climb_sd * wheel_speed) ** 2 * step,
    )


def _attitude(state: LocalizationState, imu: ImuReading, model: SensorModel, step: float) -> tuple[float, float, float]:
    """Roll, pitch and yaw rate: turned by the gyroscope, pulled slowly to the direction of gravity."""
    p, q, r = imu.rate_b
    r -= float(state.mean[BIAS])
    roll, pitch = state.roll_rad, state.pitch_rad
    turn = q * sin(roll) + r * cos(roll)
    yaw_rate = turn / cos(pitch)
    roll += step * (p + tan(pitch) * turn)
    pitch += step * (q * cos(roll) - r * sin(roll))
    x, y, z = imu.acceleration_b
    # The turn's centripetal part is known and taken out; knocks are no gravity and count less.
    gravity_roll, gravity_pitch = _tilt((x, y - state.speed_m_s * yaw_rate, z))
    knock = (sqrt(x * x + y * y + z * z) - model.gravity_m_s2) / (0.1 * model.gravity_m_s2)
    pull = (1.0 - exp(-step / model.tilt_time_s)) * exp(-0.5 * knock**2)
    return roll + pull * (gravity_roll - roll), pitch + pull * (gravity_pitch - pitch), yaw_rate


def _tilt(force_b: Vector3) -> tuple[float, float]:
    """Roll and pitch (nose down positive) of a body that feels the specific force ``force_b`` at rest."""
    x, y, z = force_b
    return atan2(y, z), atan2(-x, hypot(y, z))


def _forward(yaw: float, pitch: float) -> FloatArray:
    return np.array([cos(yaw) * cos(pitch), sin(yaw) * cos(pitch), -sin(pitch)])


def _correct_gnss(
    belief: tuple[FloatArray, FloatArray, Carried],
    gnss: GnssReading,
    wheels_m_s: tuple[float, float],
    pitch: float,
    model: SensorModel,
) -> tuple[FloatArray, FloatArray, Carried]:
    """``wheels_m_s``: speed of the body that the wheels tell, and mean speed of the rims."""
    mean = belief[0]
    wheel_speed, rim_speed = wheels_m_s
    direction = _forward(mean[YAW], pitch)
    rows = np.zeros((5, STATES))
    rows[:3, :3] = np.eye(3)
    rows[3, SLIDE_X] = rows[4, SLIDE_Y] = rim_speed
    rows[3:, FACTOR] = wheel_speed * direction[:2]
    rows[3:, YAW] = mean[FACTOR] * wheel_speed * np.array([-direction[1], direction[0]])
    slide = rim_speed * mean[SLIDE_X:COMPASS]
    expected = np.concatenate([mean[:3], mean[FACTOR] * wheel_speed * direction[:2] + slide])
    measured = np.array([*gnss.position_w, *gnss.velocity_w[:2]])
    place = gnss.position_sd_m**2
    # Sideways drift is no error of the heading: it widens what the velocity may say.
    velocity = model.gnss_velocity_sd_m_s**2 + (2.0 * model.side_slip_sd * wheel_speed) ** 2
    noise = np.diag([place, place, place * model.gnss_vertical_ratio**2, velocity, velocity])
    return _update(belief, rows, measured - expected, noise)


def _update(
    belief: tuple[FloatArray, FloatArray, Carried], rows: FloatArray, innovation: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray, Carried]:
    """Kalman correction in Joseph's form, which keeps the covariance positive."""
    mean, covariance, carried = belief
    spread = rows @ covariance @ rows.T + noise
    gain = np.linalg.solve(spread, rows @ covariance).T
    kept = np.eye(STATES) - gain @ rows
    corrected = mean + gain @ innovation
    corrected[YAW] = wrap_angle(float(corrected[YAW]))
    corrected[FACTOR] = np.clip(corrected[FACTOR], -0.5, 1.5)
    seen = rows @ carried.passed
    told = np.linalg.solve(spread, np.column_stack([seen, innovation]))
    carried = Carried(
        kept @ carried.passed, carried.learned + seen.T @ told[:, :-1], carried.pulled + seen.T @ told[:, -1]
    )
    return corrected, kept @ covariance @ kept.T + gain @ noise @ gain.T, carried


def _smoothed_normal(
    before: LocalizationState, attitude: tuple[float, float, float], travelled: float, model: SensorModel
) -> FloatArray:
    """The ground's normal (3,) after some more wheel travel with the body's up axis at roll, pitch and yaw."""
    roll, pitch, yaw = attitude
    up_x = cos(yaw) * sin(pitch) * cos(roll) + sin(yaw) * sin(roll)
    up_y = sin(yaw) * sin(pitch) * cos(roll) - cos(yaw) * sin(roll)
    share = travelled / (min(before.travel_m + model.first_normal_m, model.normal_distance_m) + travelled)
    x, y, z = before.normal_w.tolist()
    x, y, z = x + share * (up_x - x), y + share * (up_y - y), z + share * (cos(pitch) * cos(roll) - z)
    length = sqrt(x * x + y * y + z * z)
    return np.array([x / length, y / length, z / length])


def _rim_speed(readings: SensorReadings, footprint: Footprint) -> float:
    """Mean speed (m/s) of the rims, whichever way they turn."""
    speeds = [abs(speed) for speed in readings.wheel_speed_rad_s]
    return sum(speeds) / len(speeds) * footprint.wheel_radius_m
