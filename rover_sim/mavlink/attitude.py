"""Position, attitude and speed as MAVLink wants them: north-east-down, clockwise headings, scaled integers."""

from __future__ import annotations

import math

import numpy as np

from rover_sim.mavlink.context import Context
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.geodesy import heading_deg
from worlds.geometry import euler_from_quaternion, wrap_angle

_UNKNOWN_U16 = 65535


def attitude(context: Context) -> Message | None:
    """ATTITUDE: forward-right-down against north-east-down, so pitch and its rate change sign."""
    if context.estimate is None:
        return None
    roll, pitch, yaw = euler_from_quaternion(context.estimate.pose.quaternion_w)
    imu = None if context.readings is None else context.readings.imu
    rates = (0.0, 0.0, 0.0) if imu is None else imu.rate_b
    return mavlink.MAVLink_attitude_message(
        context.boot_ms,
        roll,
        -pitch,
        wrap_angle(math.pi / 2.0 - yaw),
        rates[0],
        -rates[1],
        -context.estimate.yaw_rate_rad_s,
    )


def global_position_int(context: Context) -> Message | None:
    """GLOBAL_POSITION_INT."""
    if context.estimate is None:
        return None
    place = context.frame.to_geo(context.estimate.pose.position_w)
    home = context.frame.to_geo(context.autopilot.home_w)
    east, north, up = (_int16(100.0 * speed) for speed in context.estimate.velocity_w)
    yaw = euler_from_quaternion(context.estimate.pose.quaternion_w)[2]
    return mavlink.MAVLink_global_position_int_message(
        context.boot_ms,
        place.latitude_e7,
        place.longitude_e7,
        place.altitude_mm,
        place.altitude_mm - home.altitude_mm,
        north,
        east,
        -up,
        round(100.0 * heading_deg(yaw)) % 36000,
    )


def local_position_ned(context: Context) -> Message | None:
    """LOCAL_POSITION_NED about the world's zero."""
    if context.estimate is None:
        return None
    x, y, z = (float(value) for value in context.estimate.pose.position_w)
    vx, vy, vz = (float(value) for value in context.estimate.velocity_w)
    return mavlink.MAVLink_local_position_ned_message(context.boot_ms, y, x, -z, vy, vx, -vz)


def gps_raw_int(context: Context) -> Message:
    """GPS_RAW_INT of the last fix; NO_GPS while there is none."""
    time_us = int(context.time_s * 1e6)
    fix = context.gnss
    if fix is None or not np.isfinite((*fix.position_w, *fix.velocity_w)).all():
        unknown = (_UNKNOWN_U16,) * 4
        return mavlink.MAVLink_gps_raw_int_message(time_us, mavlink.GPS_FIX_TYPE_NO_GPS, 0, 0, 0, *unknown, 255)
    place = context.frame.to_geo(fix.position_w)
    speed = math.hypot(fix.velocity_w[0], fix.velocity_w[1])
    course = heading_deg(math.atan2(fix.velocity_w[1], fix.velocity_w[0]))
    return mavlink.MAVLink_gps_raw_int_message(
        time_us,
        mavlink.GPS_FIX_TYPE_3D_FIX,
        place.latitude_e7,
        place.longitude_e7,
        place.altitude_mm,
        _UNKNOWN_U16,  # dilution of precision and satellites: the simulated receiver has none
        _UNKNOWN_U16,
        min(round(100.0 * speed), _UNKNOWN_U16 - 1),
        round(100.0 * course) % 36000,
        255,
        h_acc=min(round(1e3 * fix.position_sd_m), 2**32 - 1),
    )


def vfr_hud(context: Context) -> Message | None:
    """VFR_HUD; the throttle is the commanded share of the top speed."""
    if context.estimate is None:
        return None
    speed = float(np.linalg.norm(context.estimate.velocity_w[:2]))
    yaw = euler_from_quaternion(context.estimate.pose.quaternion_w)[2]
    motion, footprint = context.autopilot.motion, context.autopilot.footprint
    altitude = context.frame.to_geo(context.estimate.pose.position_w).altitude_m
    throttle = min(round(100.0 * abs(motion.linear_m_s) / footprint.max_speed_m_s), 100)
    climb = float(context.estimate.velocity_w[2])
    return mavlink.MAVLink_vfr_hud_message(speed, speed, round(heading_deg(yaw)) % 360, throttle, altitude, climb)


def home_position(context: Context) -> Message:
    """HOME_POSITION; the heading at home is not kept, so the quaternion says north, level."""
    x, y, z = context.autopilot.home_w
    place = context.frame.to_geo((x, y, z))
    level_north = (1.0, 0.0, 0.0, 0.0)  # w, x, y, z
    return mavlink.MAVLink_home_position_message(
        place.latitude_e7,
        place.longitude_e7,
        place.altitude_mm,
        y,
        x,
        -z,
        level_north,
        0.0,
        0.0,
        0.0,
        int(context.time_s * 1e6),
    )


def _int16(value: float) -> int:
    return round(min(max(value, -32768.0), 32767.0))
