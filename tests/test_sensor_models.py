from __future__ import annotations

from math import cos, degrees, radians, sin, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_sim.sim import barometer, imu, magnetometer
from rover_sim.sim.atmosphere import air, pressure_altitude_m
from rover_sim.sim.ground_shake import shake_rms
from rover_sim.sim.ned_state import STANDARD_GRAVITY_M_S2, NedState
from worlds.geometry import wrap_angle
from worlds.scenario import Origin
from worlds.sensor_tables import Barometer, Imu, Magnetometer
from worlds.types import FloatArray, Vector3

NOTHING: Vector3 = (0.0, 0.0, 0.0)
HELD: Vector3 = (0.0, 0.0, -STANDARD_GRAVITY_M_S2)
MICRO_G = 1e-6 * STANDARD_GRAVITY_M_S2


def truth(
    time_s: float,
    *,
    speed_m_s: float = 0.0,
    rate_rad_s: Vector3 = NOTHING,
    felt: Vector3 = HELD,
    yaw_rad: float = 0.0,
    down_m: float = 0.0,
) -> NedState:
    turned = cos(yaw_rad / 2), 0.0, 0.0, sin(yaw_rad / 2)
    return NedState(time_s, (0.0, 0.0, down_m), (speed_m_s, 0.0, 0.0), turned, rate_rad_s, felt)


def imu_record(table: Imu, count: int, step_s: float, speed_m_s: float = 0.0, seed: int = 1) -> FloatArray:
    """Errors (count, 6) of a rover that stands, or shakes at a constant speed."""
    rng = np.random.default_rng(seed)
    model = imu.imu_model(table, "sand")
    state = imu.begin(model, rng)
    rows = np.empty((count, 6))
    for row in range(count):
        state, sample = imu.read(model, state, truth(row * step_s, speed_m_s=speed_m_s), rng)
        rows[row] = *sample.rate_rad_s, *np.subtract(sample.specific_force_m_s2, HELD)
    return rows


def allan_deviation(rows: FloatArray, averaged: int) -> FloatArray:
    """Overlapping Allan deviation (channels,) of samples (n, channels) at ``averaged`` samples (IEEE Std 952-1997)."""
    sums = np.vstack([np.zeros(rows.shape[1]), np.cumsum(rows, axis=0)])
    means = (sums[averaged:] - sums[:-averaged]) / averaged
    return np.asarray(np.sqrt(0.5 * np.mean((means[averaged:] - means[:-averaged]) ** 2, axis=0)))


def test_allan_deviation_of_a_still_record_begins_with_the_stated_noise_density() -> None:
    rows = imu_record(Imu(), 60_000, 0.02)
    for averaged in (1, 10, 100):
        shown = allan_deviation(rows, averaged)
        stated = np.array([radians(0.014)] * 3 + [175.0 * MICRO_G] * 3) / sqrt(2.0 * 0.02 * averaged)
        assert shown == pytest.approx(stated, rel=0.06), averaged


def test_allan_deviation_then_lies_at_the_stated_bias_instability() -> None:
    table = Imu(
        gyro_noise_deg_s_rthz=0.0,
        accel_noise_ug_rthz=0.0,
        gyro_walk_deg_h_rth=0.0,
        accel_walk_ug_rth=0.0,
        instability_time_s=100.0,
    )
    rows = imu_record(table, 60_000, 2.0)
    peaks = np.max([allan_deviation(rows, averaged) for averaged in (50, 70, 95, 120, 160)], axis=0)
    flat = 0.664 * np.array([radians(2.0 / 3600.0)] * 3 + [40.0 * MICRO_G] * 3)
    assert peaks == pytest.approx(flat, rel=0.15)


def test_allan_deviation_ends_with_the_stated_random_walk() -> None:
    table = Imu(
        gyro_noise_deg_s_rthz=0.0, accel_noise_ug_rthz=0.0, gyro_instability_deg_h=0.0, accel_instability_ug=0.0
    )
    rows = imu_record(table, 20_000, 10.0)
    walk = np.array([radians(2.0 / 3600.0)] * 3 + [20.0 * MICRO_G] * 3) / 60.0
    for averaged in (10, 40):
        assert allan_deviation(rows, averaged) == pytest.approx(walk * sqrt(10.0 * averaged / 3.0), rel=0.1)


def test_turn_on_bias_differs_from_seed_to_seed_as_stated() -> None:
    model = imu.imu_model(Imu(), "sand")
    biases = np.array([imu.begin(model, np.random.default_rng(seed)).turn_on for seed in range(2000)])
    stated = np.array([radians(0.33)] * 3 + [6.7e3 * MICRO_G] * 3)
    assert biases.std(axis=0) == pytest.approx(stated, rel=0.06)


def test_nothing_is_read_beyond_the_range() -> None:
    model = imu.imu_model(Imu(gyro_range_deg_s=100.0, accel_range_g=2.0), "sand")
    rng = np.random.default_rng(0)
    blow = truth(0.0, rate_rad_s=(3.0, -3.0, 0.0), felt=(30.0, -30.0, -30.0))
    _, sample = imu.read(model, imu.begin(model, rng), blow, rng)
    assert sample.rate_rad_s[:2] == (radians(100.0), -radians(100.0))
    assert sample.specific_force_m_s2 == pytest.approx((2 * STANDARD_GRAVITY_M_S2,) + (-2 * STANDARD_GRAVITY_M_S2,) * 2)


def test_shaking_is_that_of_iso_8608_and_grows_with_the_square_of_the_speed() -> None:
    assert shake_rms(64e-6, 0.1) == pytest.approx(sqrt(16 * np.pi**4 * 64e-6 * 0.01 / 0.003))  # 0.577
    assert shake_rms(256e-6, 0.1) == pytest.approx(2 * shake_rms(64e-6, 0.1))
    quiet = Imu(
        lug_m_s2=0.0, accel_noise_ug_rthz=0.0, gyro_noise_deg_s_rthz=0.0, accel_bias_mg=0.0, gyro_bias_deg_s=0.0
    )
    for speed in (0.5, 1.0):
        rows = imu_record(quiet, 24_000, 1 / 240, speed)
        assert rows[:, 5].std() == pytest.approx(0.577 * speed**2, rel=0.06)
        assert rows[:, 3].std() == pytest.approx(0.288 * speed**2, rel=0.06)
    assert np.abs(imu_record(quiet, 240, 1 / 240, 0.0)[:, 3:]).max() < 1e-3


def test_lugs_chatter_at_their_own_frequency() -> None:
    table = Imu(roughness_cm3=0.0, accel_noise_ug_rthz=0.0, accel_bias_mg=0.0, lug_m_s2=1.0, lug_pitch_m=0.05)
    rows = imu_record(table, 2400, 1 / 240, speed_m_s=0.8)
    spectrum = np.abs(np.fft.rfft(rows[:, 5] - rows[:, 5].mean()))
    assert np.fft.rfftfreq(2400, 1 / 240)[spectrum.argmax()] == pytest.approx(16.0)
    assert rows[:, 5].max() == pytest.approx(0.64, abs=0.01)


# NOAA NCEI, WMM2025_TEST_VALUES.txt: year, height (km), latitude, longitude; north, east, down (nT).
FIELDS = [
    (2025.0, 0.0, 80.0, 0.0, 6521.6, 145.9, 54791.5),
    (2025.0, 0.0, 0.0, 120.0, 39677.8, -109.6, -10580.2),
    (2025.0, 0.0, -80.0, -120.0, 6117.5, 15751.9, -52022.5),
]


@pytest.mark.parametrize(("year", "height_km", "latitude", "longitude", "north", "east", "down"), FIELDS)
def test_the_field_is_the_published_one(
    year: float, height_km: float, latitude: float, longitude: float, north: float, east: float, down: float
) -> None:
    place = Origin(latitude_deg=latitude, longitude_deg=longitude, altitude_m=1e3 * height_km)
    assert 1e3 * magnetometer.world_field_uT(place, year) == pytest.approx([north, east, down], abs=0.06)


def magnetometer_of(table: Magnetometer) -> magnetometer.MagnetometerModel:
    return magnetometer.magnetometer_model(table, Origin(), np.random.default_rng(3))


def test_a_compass_without_errors_points_to_magnetic_north_whatever_the_heading() -> None:
    ideal = magnetometer_of(Magnetometer(noise_uT=0.0, bias_uT=0.0, field_uT=(20.0, 4.0, 45.0)))
    for yaw in np.linspace(-3.0, 3.0, 7):
        x, y, z = magnetometer.read(ideal, truth(0.0, yaw_rad=float(yaw)), np.random.default_rng(0)).field_uT
        heading = np.arctan2(-y, x) + np.arctan2(4.0, 20.0)
        assert wrap_angle(heading - yaw) == pytest.approx(0.0, abs=1e-9)
        assert z == pytest.approx(45.0)


def test_iron_shifts_and_bends_the_field() -> None:
    iron = Magnetometer(
        noise_uT=0.0,
        bias_uT=0.0,
        field_uT=(20.0, 0.0, 40.0),
        hard_iron_uT=(1.0, 2.0, 3.0),
        soft_iron=(1.1, 0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 0.5),
    )
    read = magnetometer.read(magnetometer_of(iron), truth(0.0), np.random.default_rng(0))
    assert read.field_uT == pytest.approx((23.0, 12.0, 23.0))


# ISO 2533:1975 and US Standard Atmosphere 1976, by geometric height: Pa, K.
AIR = [
    (-1000.0, 113_930.0, 294.651),
    (0.0, 101_325.0, 288.15),
    (2000.0, 79_501.0, 275.154),
    (5000.0, 54_048.0, 255.676),
    (11_000.0, 22_700.0, 216.774),
    (20_000.0, 5_529.3, 216.65),
    (30_000.0, 1_197.0, 226.509),
]


@pytest.mark.parametrize(("height", "pressure", "temperature"), AIR)
def test_the_air_is_the_standard_atmosphere(height: float, pressure: float, temperature: float) -> None:
    assert air(height) == pytest.approx((pressure, temperature), rel=3e-5)


@given(st.floats(-12_000.0, 31_000.0))
def test_height_and_pressure_go_back_and_forth(height: float) -> None:
    assert pressure_altitude_m(air(height)[0]) == pytest.approx(height, abs=1e-3)


def test_barometer_rises_with_the_rover_and_wanders_as_stated() -> None:
    table = Barometer(bias_Pa=0.0, drift_time_s=10.0)
    rng = np.random.default_rng(5)
    state = barometer.begin(table, 0.0, rng)
    rows = []
    for step in range(20_000):
        state, sample = barometer.read(table, state, truth(0.5 * step, down_m=-100.0), 1380.0, rng)
        rows.append((sample.pressure_Pa, sample.temperature_C))
    pressure, temperature = np.array(rows).T
    assert pressure.mean() == pytest.approx(air(1480.0)[0], abs=1.0)
    assert pressure.std() == pytest.approx(sqrt(10.0**2 + 1.2**2), rel=0.06)
    assert np.diff(pressure).std() == pytest.approx(sqrt(2) * sqrt(1.2**2 + 100 * (1 - np.exp(-0.05))), rel=0.04)
    assert temperature[0] == pytest.approx(15.0 - 6.5e-3 * 1480.0, abs=0.01)


def test_declination_of_the_default_origin_is_east_and_the_field_dips_north() -> None:
    north, east, down = magnetometer.world_field_uT(Origin(), 2026.0)
    assert degrees(np.arctan2(east, north)) == pytest.approx(9.99, abs=0.01)
    assert down > north > 0.0
