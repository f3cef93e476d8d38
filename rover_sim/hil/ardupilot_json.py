"""ArduPilot's JSON physics interface as bytes: servo packets in, state messages out.

The format is that of ``libraries/SITL/SIM_JSON.h`` in ArduPilot 4.1 to 4.6. Its reader searches the text for key names
and scans what follows, without a JSON parser: so order of keys, line ends and the lack of spaces matter.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from math import asin, atan2

from rover_sim.hil.states import NedState
from worlds.types import Vector3

LEFT_CHANNEL, RIGHT_CHANNEL = 0, 2  # SERVO1 and SERVO3, where ArduPilot puts throttle left and throttle right
NOT_DRIVEN_US, NEUTRAL_US, SPAN_US = 0, 1500, 500
MAGIC_16, MAGIC_32 = 18458, 29569
_HEAD = struct.Struct("<HHI")
_LAYOUTS = {MAGIC_16: struct.Struct("<HHI16H"), MAGIC_32: struct.Struct("<HHI32H")}
LENGTHS = " or ".join(f"{layout.size} bytes with magic {magic}" for magic, layout in _LAYOUTS.items())


@dataclass(frozen=True)
class ServoPacket:
    """One request of the autopilot: what it drives its outputs with, for one step of the physics."""

    frame_rate_hz: int  # steps a second that it would like
    frame_count: int  # rises by one a step, begins at 0 when the autopilot does
    pwm_us: tuple[int, ...]  # (16,) or (32,) pulse widths, SERVO1 first; 0: not driven


def parse_servos(data: bytes) -> ServoPacket | None:
    """The packet in a datagram; None where length and magic number do not belong together (see `LENGTHS`)."""
    layout = _LAYOUTS.get(_HEAD.unpack_from(data)[0]) if len(data) >= _HEAD.size else None
    if layout is None or len(data) != layout.size:
        return None
    _, rate, count, *pwm = layout.unpack(data)
    return ServoPacket(rate, count, tuple(pwm))


def share(pwm_us: int) -> float:
    """Share of full speed in [-1, 1] that a pulse asks for; an output that is not driven is neutral."""
    if pwm_us == NOT_DRIVEN_US:
        return 0.0
    return min(max((pwm_us - NEUTRAL_US) / SPAN_US, -1.0), 1.0)


def side_shares(packet: ServoPacket) -> tuple[float, float]:
    """Shares of full speed of the left and the right side; the autopilot has mixed throttle and steering already."""
    return share(packet.pwm_us[LEFT_CHANNEL]), share(packet.pwm_us[RIGHT_CHANNEL])


def state_message(time_s: float, state: NedState) -> bytes:
    """The reply to a servo packet, ``time_s`` after the start of the physics.

    Raises ValueError for a value that is not finite: the autopilot would abort on it.
    """
    message = {
        "timestamp": time_s,
        "imu": {"gyro": _plain(state.rate_rad_s), "accel_body": _plain(state.specific_force_m_s2)},
        "position": _plain(state.position_m),
        "attitude": roll_pitch_yaw(state.quaternion),
        "velocity": _plain(state.velocity_m_s),
    }
    text = json.dumps(message, separators=(",", ":"), allow_nan=False)
    return f"\n{text}\n".encode("ascii")


def roll_pitch_yaw(quaternion: Sequence[float]) -> Vector3:
    """Roll, pitch and yaw (rad; z-y'-x'' order) of a quaternion (w, x, y, z) from body to north-east-down."""
    w, x, y, z = (float(value) for value in quaternion)
    return (
        atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0)),
        atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def _plain(vector: Sequence[float]) -> list[float]:
    return [float(value) for value in vector]
