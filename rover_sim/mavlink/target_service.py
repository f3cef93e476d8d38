"""Set points: SET_POSITION_TARGET_LOCAL_NED and SET_POSITION_TARGET_GLOBAL_INT, followed in mode Guided.

A set point is one of: a place; a velocity; a velocity and a yaw rate; a yaw; a yaw rate. Heights, accelerations and
what the mask leaves out are not looked at, and NaN counts as left out. Nobody acknowledges these messages, so one that
cannot be followed is answered by a text.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from rover_sim.autopilot.admission import target_refusal
from rover_sim.autopilot.modes import Mode
from rover_sim.autopilot.targets import DriveAlong, DriveAt, DriveToward, Target
from rover_sim.mavlink.context import Context, Handler
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Client
from rover_sim.mavlink.status import status_texts
from rover_sim.mavlink.wire import FARTHEST_M, place_of
from worlds.geometry import euler_from_quaternion
from worlds.types import Vector3

_PLACE = mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
_VELOCITY = mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE | mavlink.POSITION_TARGET_TYPEMASK_VY_IGNORE
_YAW = mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
_YAW_RATE = mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
_BODY = (mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED, mavlink.MAV_FRAME_BODY_FRD)
_LOCAL = (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_OFFSET_NED, *_BODY)
_GLOBAL = (
    mavlink.MAV_FRAME_GLOBAL,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mavlink.MAV_FRAME_GLOBAL_INT,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
)
_COMPLAINT_S = 5.0  # a stream of bad set points makes one text in so long


@dataclass(frozen=True)
class Wish:
    """What the mask leaves of a message, still in its frame; None: left out."""

    in_body: bool  # velocity and yaw count from the rover's heading
    velocity: tuple[float, float] | None  # north and east, or forward and right, m/s
    yaw_rad: float | None  # clockwise
    yaw_rate_rad_s: float | None  # clockwise

    @classmethod
    def of(cls, message: Message) -> Wish:
        """The motion that a message asks for."""
        velocity = (message.vx, message.vy) if not message.type_mask & _VELOCITY else (math.nan, math.nan)
        return cls(
            message.coordinate_frame in _BODY,
            velocity if math.isfinite(velocity[0]) and math.isfinite(velocity[1]) else None,
            _given(message.yaw, message.type_mask & _YAW),
            _given(message.yaw_rate, message.type_mask & _YAW_RATE),
        )


def motion(wish: Wish, heading_rad: float, *, by_yaw: bool) -> Target | None:
    """Set point of a wish for a rover with this heading (from +x counter-clockwise); None if it asks for nothing.

    A rover cannot go sideways. With a yaw rate only the forward part of the velocity counts; without, the rover turns
    where the velocity points. ``by_yaw``: or where the yaw points, if there is one (ArduRover).
    """
    north_rad = heading_rad if wish.in_body else math.pi / 2.0  # world heading of the frame's first axis
    facing = None if wish.yaw_rad is None else north_rad - wish.yaw_rad
    if wish.velocity is None:
        turn = None if wish.yaw_rate_rad_s is None else DriveAt(0.0, -wish.yaw_rate_rad_s)
        return turn if facing is None else DriveAlong(facing, 0.0)
    speed = math.hypot(*wish.velocity)
    direction = north_rad - math.atan2(wish.velocity[1], wish.velocity[0])
    if wish.yaw_rate_rad_s is not None:
        return DriveAt(speed * math.cos(direction - heading_rad), -wish.yaw_rate_rad_s)
    if by_yaw and facing is not None:
        return DriveAlong(facing, math.copysign(speed, wish.velocity[0]))
    if wish.in_body and wish.velocity[0] < 0.0:
        return DriveAlong(direction + math.pi, -speed)  # the rear first, or it would turn round for ever
    return DriveAlong(direction, speed) if speed > 0.0 else DriveAt(0.0, 0.0)


class TargetService:
    """Hands set points on to the autopilot while it is in mode Guided; in another mode they are not meant for it."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._complained_s = -math.inf

    @property
    def handlers(self) -> Mapping[str, Handler]:
        """Both kinds of set points."""
        return {"SET_POSITION_TARGET_LOCAL_NED": self._local, "SET_POSITION_TARGET_GLOBAL_INT": self._global}

    def tick(self) -> None:
        """Nothing happens by itself: the autopilot sees when they stop coming."""

    def _local(self, client: Client, message: Message) -> None:
        if message.coordinate_frame not in _LOCAL:
            self._complain(client, f"frame {message.coordinate_frame}")
        else:
            self._follow(client, message, _local_place(message, self._context))

    def _global(self, client: Client, message: Message) -> None:
        if message.coordinate_frame not in _GLOBAL:
            self._complain(client, f"frame {message.coordinate_frame}")
        else:
            altitude = self._context.frame.to_geo(self._context.autopilot.home_w).altitude_m
            self._follow(client, message, place_of(message.lat_int, message.lon_int, altitude, self._context.frame))

    def _follow(self, client: Client, message: Message, place_w: Vector3 | None) -> None:
        context, rules = self._context, self._context.persona.steering
        offboard = context.persona.px4_modes and context.autopilot.has_guided_task  # shown as Hold, where none count
        if context.autopilot.mode is not Mode.GUIDED or offboard or context.estimate is None:
            return
        target: Target | None
        if not message.type_mask & _PLACE:
            target = None if place_w is None else DriveToward(place_w)
        else:
            heading = euler_from_quaternion(context.estimate.pose.quaternion_w)[2]
            target = motion(Wish.of(message), heading, by_yaw=rules.heading_by_yaw)
        if target is None:
            self._complain(client, f"mask {message.type_mask}, place or motion")
            return
        if isinstance(target, DriveToward):
            refused = target_refusal(context.autopilot, context.estimate, target.position_w)
            if refused is not None:
                self._complain(client, refused)
                return
        lasts_s = context.autopilot.parameters[rules.target_time]
        if isinstance(target, DriveToward) and not rules.places_expire:
            lasts_s = math.inf
        context.autopilot.follow(target, context.time_s + lasts_s, hold_on_loss=rules.hold_on_loss)

    def _complain(self, client: Client, what: str) -> None:
        if self._context.time_s - self._complained_s >= _COMPLAINT_S:
            self._complained_s = self._context.time_s
            for text in status_texts(mavlink.MAV_SEVERITY_WARNING, f"Set point ignored: {what}", 3):
                self._context.endpoint.reply(client, text)


def _local_place(message: Message, context: Context) -> Vector3 | None:
    """World position of a local set point; None if it is not finite or much too far away."""
    first, second = message.x, message.y
    if context.estimate is None or not (math.isfinite(first) and math.isfinite(second)):
        return None
    x, y = second, first
    here = context.estimate.pose
    if message.coordinate_frame in _BODY:
        yaw = euler_from_quaternion(here.quaternion_w)[2]
        x, y = first * math.cos(yaw) + second * math.sin(yaw), first * math.sin(yaw) - second * math.cos(yaw)
    if message.coordinate_frame != mavlink.MAV_FRAME_LOCAL_NED:
        x, y = x + float(here.position_w[0]), y + float(here.position_w[1])
    return (x, y, context.autopilot.home_w[2]) if math.hypot(x, y) <= FARTHEST_M else None


def _given(value: float, ignored: int) -> float | None:
    return value if not ignored and math.isfinite(value) else None
