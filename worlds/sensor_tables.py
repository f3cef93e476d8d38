"""Tables of a scenario about the sensors that an autopilot estimates by, and about the drive's actuators.

Units are those of data sheets. Defaults are typical figures of the part that each table names; what no data sheet says
is ours, and marked so.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from worlds.errors import ScenarioError
from worlds.strict_toml import Table

if TYPE_CHECKING:
    from worlds.scenario import Scenario

Window = tuple[float, float]  # seconds: from, to
Matrix = tuple[float, float, float, float, float, float, float, float, float]
Fix = Literal["3d", "dgps", "rtk_float", "rtk_fixed"]


class Imu(Table, frozen=True):
    """Inertial unit of the class of Bosch's BMI088 (data sheet BST-BMI088-DS001), axes forward, right, down."""

    gyro_noise_deg_s_rthz: float = 0.014  # one-sided density
    gyro_bias_deg_s: float = 0.33  # one sigma of the turn-on bias; the sheet's zero-rate offset of 1 taken as three
    gyro_instability_deg_h: float = 2.0  # in-run
    gyro_walk_deg_h_rth: float = 2.0  # rate random walk per square root of an hour; ours
    gyro_range_deg_s: float = 2000.0
    accel_noise_ug_rthz: float = 175.0
    accel_bias_mg: float = 6.7  # the sheet's zero-g offset of 20 taken as three sigma
    accel_instability_ug: float = 40.0  # ours, as is the next
    accel_walk_ug_rth: float = 20.0
    accel_range_g: float = 24.0
    instability_time_s: float = 500.0  # over which a bias is remembered; ours
    roughness_cm3: float | None = None  # ISO 8608 Gd(0.1 cycles/m) of the ground under the grid; None: by its texture
    contact_m: float = 0.10  # length of a wheel's footprint: shorter waves do not shake the rover
    lug_m_s2: float = 0.3  # chatter of the lugs, amplitude at 1 m/s; grows with the square of the speed; ours
    lug_pitch_m: float = 0.05


class Magnetometer(Table, frozen=True):
    """Three axes of the class of Bosch's BMM150 (data sheet BST-BMM150-DS001)."""

    rate_hz: float = 50.0
    noise_uT: float = 0.6  # one sigma of a sample, regular preset
    bias_uT: float = 0.5  # one sigma of what is left of hard iron after calibration; ours
    hard_iron_uT: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the rover, body axes
    soft_iron: Matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)  # by rows
    range_uT: float = 1300.0
    year: float = 2026.0  # for which the model is asked
    field_uT: tuple[float, float, float] | None = None  # north, east, down; None: that of the model at the origin


class Barometer(Table, frozen=True):
    """Pressure of the class of TE's MS5611 (data sheet MS5611-01BA03), in the standard atmosphere."""

    rate_hz: float = 50.0
    noise_Pa: float = 1.2  # one sigma at an oversampling of 4096
    bias_Pa: float = 50.0  # one sigma at turn-on; the sheet's accuracy of 150 taken as three
    drift_Pa: float = 10.0  # one sigma of weather and warming over a drive; ours, as is the next
    drift_time_s: float = 1800.0


class Gnss(Table, frozen=True):
    """Receiver of the class of u-blox' ZED-F9P with corrections (data sheet UBX-17051259)."""

    rate_hz: float = 5.0
    fix: Fix = "rtk_fixed"
    satellites: int = 18
    horizontal_m: float = 0.0085  # one sigma an axis, white; a circular error of 0.01 m holds half of the fixes
    vertical_m: float = 0.015
    wander_m: float = 0.01  # one sigma an axis of the slow part; the vertical one is half as much again; ours
    wander_time_s: float = 60.0
    velocity_m_s: float = 0.05
    delay_s: float = 0.11  # from measurement to message; PX4's EKF2_GPS_DELAY expects so much
    outages_s: tuple[Window, ...] = ()  # windows without a fix


class Encoder(Table, frozen=True):
    """Wheel encoders that count whole ticks."""

    counts_per_turn: int = 16384  # of the wheel: 4096 after quadrature, times a small gear


class Actuator(Table, frozen=True):
    """What lies between the command for a side's wheels, -1 to 1, and the speed that its motors hold; ours."""

    lag_s: float = 0.05  # first order
    dead_band: float = 0.02  # smaller commands do nothing
    limit: float = 1.0  # larger commands are clipped
    left_gain: float = 1.0  # the sides' mismatch
    right_gain: float = 1.0


LIMITS: dict[str, tuple[float, float]] = {
    "imu.gyro_noise_deg_s_rthz": (0.0, 1.0),
    "imu.gyro_bias_deg_s": (0.0, 20.0),
    "imu.gyro_instability_deg_h": (0.0, 1000.0),
    "imu.gyro_walk_deg_h_rth": (0.0, 10_000.0),
    "imu.gyro_range_deg_s": (10.0, 10_000.0),
    "imu.accel_noise_ug_rthz": (0.0, 1e5),
    "imu.accel_bias_mg": (0.0, 500.0),
    "imu.accel_instability_ug": (0.0, 1e4),
    "imu.accel_walk_ug_rth": (0.0, 1e5),
    "imu.accel_range_g": (1.1, 200.0),
    "imu.instability_time_s": (1.0, 1e5),
    "imu.roughness_cm3": (0.0, 65_536.0),
    "imu.contact_m": (0.01, 1.0),
    "imu.lug_m_s2": (0.0, 50.0),
    "imu.lug_pitch_m": (0.005, 1.0),
    "magnetometer.rate_hz": (1.0, 240.0),
    "magnetometer.noise_uT": (0.0, 50.0),
    "magnetometer.bias_uT": (0.0, 50.0),
    "magnetometer.hard_iron_uT": (-1000.0, 1000.0),
    "magnetometer.soft_iron": (-2.0, 2.0),
    "magnetometer.range_uT": (100.0, 1e5),
    "magnetometer.year": (2025.0, 2030.0),  # of validity of the model of 2025
    "magnetometer.field_uT": (-200.0, 200.0),
    "barometer.rate_hz": (1.0, 240.0),
    "barometer.noise_Pa": (0.0, 1000.0),
    "barometer.bias_Pa": (0.0, 5000.0),
    "barometer.drift_Pa": (0.0, 5000.0),
    "barometer.drift_time_s": (1.0, 1e6),
    "gnss.rate_hz": (0.1, 20.0),
    "gnss.satellites": (4, 60),
    "gnss.horizontal_m": (0.0, 100.0),
    "gnss.vertical_m": (0.0, 100.0),
    "gnss.wander_m": (0.0, 100.0),
    "gnss.wander_time_s": (1.0, 1e5),
    "gnss.velocity_m_s": (0.0, 10.0),
    "gnss.delay_s": (0.0, 2.0),
    "gnss.outages_s": (0.0, 1e6),
    "encoder.counts_per_turn": (4, 10_000_000),
    "actuator.lag_s": (0.0, 5.0),
    "actuator.dead_band": (0.0, 0.5),
    "actuator.limit": (0.05, 1.0),
    "actuator.left_gain": (0.1, 2.0),
    "actuator.right_gain": (0.1, 2.0),
}


def check_sensors(scenario: Scenario, source: str) -> None:
    """Raise a `ScenarioError` for keys of the tables that are at odds."""
    gnss, actuator = scenario.gnss, scenario.actuator
    if gnss is not None and not scenario.sensors.gnss:
        raise ScenarioError(f"{source}: gnss: sensors.gnss is false, so there is no receiver; leave the table out")
    for number, (begin_s, end_s) in enumerate(() if gnss is None else gnss.outages_s):
        if begin_s >= end_s:
            raise ScenarioError(f"{source}: gnss.outages_s[{number}] = [{begin_s:g}, {end_s:g}]: must be [from, to]")
    if actuator is not None and actuator.dead_band >= actuator.limit:
        raise ScenarioError(
            f"{source}: actuator.dead_band = {actuator.dead_band:g}: must be less than actuator.limit = "
            f"{actuator.limit:g}"
        )
