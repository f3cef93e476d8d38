"""The MAVLink side of ArduRover 4.6.0-dev in simulated time, as it was measured: time line, missions, modes, guided.

It imitates and is not ArduPilot. The motion is passed in, and the pulses for SERVO1 and SERVO3 come back, so that it
can be joined with any physics.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from rover_sim.mavlink.dialect import EkfStatusReport, Message, ekf_status_report, mavlink
from rover_sim.mavlink.transport import Transport
from rover_sim.mavlink.wire import WAYPOINT, WireItem
from tests.ardupilot_mission_double import ArduMissions
from tests.vehicle_double import HOME, NEUTRAL, VehicleDouble, Wheels, steer_heading, steer_towards, to_wheels
from worlds.scenario import Origin

MANUAL, HOLD, AUTO, RTL, GUIDED, INITIALISING = 0, 4, 10, 11, 15, 16
_MODES = (MANUAL, 1, 3, HOLD, 5, 6, 7, 8, 9, AUTO, RTL, 12, GUIDED)
_WITH_POSITION = (5, 6, 9, AUTO, RTL, 12, GUIDED)
_WITH_SPEED = (AUTO, GUIDED, RTL, 12)
READY_S, ACCELS_S, ARMABLE_S, GPS_USED_S, AUTO_S = 2.0, 12.8, 23.0, 41.8, 42.6
EXPIRES_S = 3.0
_OK, _FAILED, _DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_FAILED, mavlink.MAV_RESULT_DENIED
_UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED


@dataclass(frozen=True)
class Target:
    """What guided mode follows: a place, or heading and speed, or a turn rate."""

    place: tuple[float, float] | None = None  # north, east of home
    heading_rad: float | None = None
    rate_rad_s: float | None = None
    speed_m_s: float = 0.0
    until_s: float = math.inf


class ArduRoverDouble(VehicleDouble):
    """One ArduRover with an estimator of its own, which is ready 42.6 s after the start."""

    autopilot = int(mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)

    def __init__(self, transport: Transport, home: Origin = HOME, *, never_ready: str = "") -> None:
        """``never_ready``: a pre-arm text with which it refuses to be armed for ever."""
        super().__init__(transport, home)
        self.custom_mode = INITIALISING
        # Waypoints were passed by 0.06 to 0.17 m although WP_RADIUS was 1 m.
        self.speed_m_s, self.radius_m = 1.0, 0.15
        self.current, self.complete, self.reverse = 0, False, False
        self.driven: list[WireItem] = []  # places that it set out for, in order
        self.started_torn = False
        self.target: Target | None = None
        self._never_ready = never_ready
        self._held_until_s: float | None = None
        self._told: set[str] = set()
        place = self.frame.to_geo((0.0, 0.0, 0.0))
        none = (0.0, 0.0, 0.0, 0.0)
        stored_home = WireItem(0, WAYPOINT, none, place.latitude_e7, place.longitude_e7, round(place.altitude_m, 2))
        self.missions = ArduMissions(self.send, self.say, stored_home, self._mission_changed, self._runs)
        self._handlers = {
            "COMMAND_LONG": lambda message: self._command(message, whole=False),
            "COMMAND_INT": lambda message: self._command(message, whole=True),
            "MISSION_COUNT": lambda message: self.missions.count(message, self.time_s),
            "MISSION_ITEM_INT": lambda message: self.missions.item(message, self.time_s),
            "MISSION_REQUEST_LIST": self.missions.list,
            "MISSION_REQUEST_INT": self.missions.request,
            "MISSION_REQUEST": self.missions.request,
            "MISSION_CLEAR_ALL": self.missions.clear,
            "SET_POSITION_TARGET_LOCAL_NED": self._local_target,
        }

    # What it does by itself

    def live(self) -> None:
        self.missions.tick(self.time_s)
        if self.custom_mode == INITIALISING and self.time_s >= READY_S:
            self.custom_mode = MANUAL
        for text, at_s in (("ArduPilot Ready", READY_S), ("EKF3 IMU0 is using GPS", GPS_USED_S)):
            if self.time_s >= at_s and text not in self._told:
                self._told.add(text)
                self.say(mavlink.MAV_SEVERITY_INFO, text)
        if self.target is not None and self.time_s > self.target.until_s:
            self.target = None
            self.say(mavlink.MAV_SEVERITY_WARNING, "target not received last 3secs, stopping")

    @property
    def flags(self) -> int:
        """EKF_STATUS_REPORT.flags on the time line."""
        steps = ((3.0, 1024), (5.6, 0), (GPS_USED_S, 167))
        return next((flags for until_s, flags in steps if self.time_s < until_s), 831)

    def streamed(self, message_id: int) -> Message | None:
        if message_id == EkfStatusReport.id:
            return ekf_status_report(self.flags)
        if message_id == mavlink.MAVLINK_MSG_ID_MISSION_CURRENT:
            total = max(len(self.missions.items) - 1, 0)
            return mavlink.MAVLink_mission_current_message(self.current, total)
        if message_id == mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT and self.time_s < GPS_USED_S:
            return None
        return super().streamed(message_id)

    # Commands

    def _command(self, message: Message, *, whole: bool) -> None:
        command = message.command
        self.commands.append(command)
        result = _UNSUPPORTED
        if command == mavlink.MAV_CMD_DO_REPOSITION:
            result = self._reposition(message) if whole else _UNSUPPORTED
        elif not whole or command != mavlink.MAV_CMD_DO_SET_MODE:
            result = self._plain(command, message)
        self.send(
            mavlink.MAVLink_command_ack_message(
                command, result, 0, 0, message.get_srcSystem(), message.get_srcComponent()
            )
        )

    def _plain(self, command: int, message: Message) -> int:
        answers: dict[int, Callable[[Message], int]] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: lambda m: self._arm() if m.param1 == 1.0 else self._disarm(),
            mavlink.MAV_CMD_DO_SET_MODE: lambda m: self.set_mode(int(m.param2)) if int(m.param1) & 1 else int(_FAILED),
            mavlink.MAV_CMD_MISSION_START: lambda _: self.set_mode(AUTO),
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_DO_CHANGE_SPEED: self._change_speed,
            mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: lambda m: self._set_current(int(m.param1)),
        }
        return answers[command](message) if command in answers else int(_UNSUPPORTED)

    def _set_interval(self, message: Message) -> int:
        self.set_interval(int(message.param1), message.param2)
        return int(_OK)

    def _change_speed(self, message: Message) -> int:
        if self.custom_mode not in _WITH_SPEED:
            return int(_FAILED)
        self.speed_m_s = message.param2
        return int(_OK)

    def _arm(self) -> int:
        reason = self._never_ready
        if not reason and self.time_s < ARMABLE_S:
            reason = "Accels inconsistent" if self.time_s < ACCELS_S else "Gyros inconsistent"
        if not reason and self.custom_mode in _WITH_POSITION and self.time_s < AUTO_S:
            reason = "Need Position Estimate"
        if reason:
            self.say(mavlink.MAV_SEVERITY_CRITICAL, f"PreArm: {reason}")
            return int(_FAILED)
        self.armed = True
        return int(_OK)

    def _disarm(self) -> int:
        self.armed = False
        return int(_OK)

    def set_mode(self, number: int) -> int:
        """As DO_SET_MODE, or a person at a ground station."""
        if number not in _MODES:
            self.say(mavlink.MAV_SEVERITY_WARNING, f"No such mode {number}")
            return int(_FAILED)
        if self.armed and number in _WITH_POSITION and self.time_s < AUTO_S:
            self.say(mavlink.MAV_SEVERITY_WARNING, "Flight mode change failed")
            return int(_FAILED)
        if number == AUTO and len(self.missions.items) < 2:
            self.say(mavlink.MAV_SEVERITY_WARNING, "No Mission. Can't set AUTO.")
            return int(_FAILED)
        if number == AUTO and self.custom_mode != AUTO:
            self._start()
        self.custom_mode, self.target = number, None
        return int(_OK)

    def _reposition(self, message: Message) -> int:
        if message.x == 0 and message.y == 0:
            return int(_DENIED)
        if self.custom_mode != GUIDED:
            if not int(message.param2) & 1:
                return int(_DENIED)
            if self.set_mode(GUIDED) != _OK:
                return int(_FAILED)
        self.target = Target(place=self.metres(message.x, message.y), speed_m_s=self.speed_m_s)
        return int(_OK)

    def _set_current(self, seq: int) -> int:
        if not 0 < seq < len(self.missions.items):
            return int(_FAILED)
        self._set_out_for(seq)
        return int(_OK)

    # The mission

    def _runs(self) -> bool:
        return self.armed and self.custom_mode == AUTO

    def _start(self) -> None:
        """Goes on with the item whose number it had; a complete mission starts over."""
        self.started_torn = self.started_torn or self.missions.torn
        if self.complete or not 0 < self.current < len(self.missions.items):
            self._set_out_for(1)
        else:
            self._set_out_for(self.current)

    def _mission_changed(self) -> None:
        if self._runs():
            self.started_torn = True  # it drives what is half there
            self.say(mavlink.MAV_SEVERITY_INFO, "Auto mission changed, restarted command")

    def _set_out_for(self, seq: int) -> None:
        self.complete, self._held_until_s = False, None
        while seq < len(self.missions.items) and self.missions.items[seq].command != WAYPOINT:
            self._do(self.missions.items[seq])
            seq += 1
        self.current = seq

    def _do(self, item: WireItem) -> None:
        if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
            self.speed_m_s = item.params[1]
        elif item.command == mavlink.MAV_CMD_DO_SET_REVERSE:
            self.reverse = item.params[0] == 1.0

    def drive(self) -> Wheels:
        if self.custom_mode == AUTO:
            return self._drive_mission()
        if self.custom_mode == GUIDED and self.target is not None:
            return self._drive_target(self.target)
        return NEUTRAL, NEUTRAL

    def _drive_mission(self) -> Wheels:
        if self.complete:
            return NEUTRAL, NEUTRAL
        if self.current >= len(self.missions.items):
            self.complete, self.current = True, 0
            self.say(mavlink.MAV_SEVERITY_NOTICE, "Mission Complete")  # and stays in AUTO
            return NEUTRAL, NEUTRAL
        item = self.missions.items[self.current]
        if not self.driven or self.driven[-1] is not item:
            self.driven.append(item)
        north, east = self.metres(item.x, item.y)
        if self._held_until_s is None:
            if math.hypot(north - self.motion.north_m, east - self.motion.east_m) > self.radius_m:
                speed = -self.speed_m_s if self.reverse else self.speed_m_s
                return to_wheels(*steer_towards(self.motion, north, east, speed, self.gains))
            self._held_until_s = self.time_s + item.params[0]
        if self.time_s >= self._held_until_s:
            self.send(mavlink.MAVLink_mission_item_reached_message(self.current))
            self.say(mavlink.MAV_SEVERITY_INFO, f"Reached waypoint #{self.current}")
            self._set_out_for(self.current + 1)
        return NEUTRAL, NEUTRAL

    def _drive_target(self, target: Target) -> Wheels:
        if target.place is not None:
            if math.dist(target.place, (self.motion.north_m, self.motion.east_m)) < self.radius_m:
                return NEUTRAL, NEUTRAL
            return to_wheels(*steer_towards(self.motion, *target.place, target.speed_m_s, self.gains))
        if target.rate_rad_s is not None:
            return to_wheels(target.speed_m_s / self.gains.full_m_s, self.gains.feed_forward_s * target.rate_rad_s)
        heading = self.motion.heading_rad if target.heading_rad is None else target.heading_rad
        return to_wheels(*steer_heading(self.motion, heading, target.speed_m_s, self.gains))

    def _local_target(self, message: Message) -> None:
        """Dropped without a word where it cannot be followed."""
        if self.custom_mode != GUIDED or message.coordinate_frame not in (1, 7, 8, 9) or self.time_s < AUTO_S:
            return
        mask, until_s = message.type_mask, self.time_s + EXPIRES_S
        if not mask & 0b11:
            north, east = message.x, message.y
            if message.coordinate_frame in (8, 9):
                cos, sin = math.cos(self.motion.heading_rad), math.sin(self.motion.heading_rad)
                north, east = north * cos - east * sin, north * sin + east * cos
            if message.coordinate_frame != 1:
                north, east = north + self.motion.north_m, east + self.motion.east_m
            self.target = Target(place=(north, east), speed_m_s=self.speed_m_s)
        elif mask & 0b111000000 != 0b111000000:
            return  # an acceleration that is not masked
        elif not mask & 0b11000 and mask & 0x400 and mask & 0x800:
            speed = min(math.hypot(message.vx, message.vy), self.speed_m_s)
            heading = math.atan2(message.vy, message.vx)
            heading += self.motion.heading_rad if message.coordinate_frame in (8, 9) else 0.0
            self.target = Target(heading_rad=heading, speed_m_s=speed, until_s=until_s)
        elif not mask & 0x400:
            speed = 0.0 if mask & 0b11000 else message.vx
            self.target = Target(heading_rad=message.yaw, speed_m_s=speed, until_s=until_s)
        elif not mask & 0x800:
            speed = 0.0 if mask & 0b11000 else message.vx
            self.target = Target(rate_rad_s=message.yaw_rate, speed_m_s=speed, until_s=until_s)
