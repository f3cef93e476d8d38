"""The built-in autopilot: modes, arming, mission, fail-safes; believed pose in, wheel speeds out."""

from __future__ import annotations

import numpy as np

from planner.mobility import STOP, Command, Limits, ramp, wheel_speeds
from rover_sim.autopilot.events import Event, Reached, Text
from rover_sim.autopilot.failsafe import Failsafe
from rover_sim.autopilot.mission import DriveTo, Item, Mission, ReturnHome, TurnTo
from rover_sim.autopilot.modes import MissionState, Mode, Severity
from rover_sim.autopilot.parameters import ParameterTable
from rover_sim.autopilot.runner import MissionRunner
from rover_sim.autopilot.sticks import StickPilot
from rover_sim.autopilot.targets import Target, TargetFollower
from worlds.types import Footprint, PoseEstimate, SensorReadings, Vector3

YAW_PER_ACCELERATION = 2.0  # 1/m
LOOKAHEAD_LENGTHS, SLOW_RADIUS_LENGTHS = 0.5, 1.2  # of the rover
_LONGEST_STEP_S = 0.2  # a pause between two updates must not become a jump in speed


class Autopilot:
    """Drives the rover. `update` is to be called at about 20..60 Hz; everything else between two updates."""

    def __init__(self, footprint: Footprint, home_w: Vector3, parameters: ParameterTable | None = None) -> None:
        self.footprint = footprint
        self.home_w = home_w
        self.parameters = parameters or ParameterTable()
        self.mode = Mode.HOLD
        self.armed = False
        self.tripped = False  # a fail-safe stopped the rover, and nobody has changed the mode since
        self.auto = MissionRunner(footprint)
        self.failsafe = Failsafe(footprint)
        self.pilot = StickPilot()
        self._guided = MissionRunner(footprint)
        self._targets = TargetFollower(footprint)
        self._motion = STOP
        self._time_s: float | None = None
        self._estimate: PoseEstimate | None = None
        self._events: list[Event] = []

    def update(self, time_s: float, estimate: PoseEstimate | None, readings: SensorReadings) -> tuple[float, ...]:
        """Wheel speeds (rad/s; left side front to rear, then right side) to hold until the next update.

        ``estimate`` is None where there is no pose at all; an old one counts as lost after ``FS_POSE_S``.
        """
        step_s = 0.0 if self._time_s is None else min(max(time_s - self._time_s, 0.0), _LONGEST_STEP_S)
        self._time_s = time_s
        self._estimate = estimate
        trip = self.failsafe.update(time_s, estimate, readings, self._motion, self.parameters)
        if trip is not None and self.driving:
            self._say(trip.severity, f"{trip.text}, hold")
            self._enter(Mode.HOLD)
            self.tripped = True
        lost = self._operator_lost(time_s)
        wanted = self._wanted(time_s, estimate)
        if not self.armed or lost or wanted is None:
            self._motion = STOP
        else:
            self._motion = ramp(self._motion, wanted, self._limits(), step_s)
        return wheel_speeds(self._motion.linear_m_s, self._motion.yaw_rate_rad_s, self.footprint)

    @property
    def driving(self) -> bool:
        """Whether the autopilot itself may move the rover now."""
        return self.armed and self.mode in (Mode.AUTO, Mode.GUIDED, Mode.RETURN)

    @property
    def has_guided_task(self) -> bool:
        """Whether mode Guided has something to do or has done it, such as a place to drive to."""
        return not self._guided.mission.empty

    @property
    def motion(self) -> Command:
        """The motion commanded by the last update."""
        return self._motion

    def take_events(self) -> tuple[Event, ...]:
        """What happened since the last call."""
        events, self._events = tuple(self._events), []
        return events

    def arm(self, *, force: bool = False) -> str | None:
        """Arm; the reason if it is refused. ``force`` skips the checks."""
        reason = None if force else self.prearm_reason()
        if reason is None and not self.armed:
            self.armed = True
            self._say(Severity.INFO, "Armed")
            self._distrust_sticks()
            self._resume()
        elif reason is not None:
            self._say(Severity.ERROR, f"PreArm: {reason}")
        return reason

    def prearm_reason(self) -> str | None:
        """Why the rover cannot be armed now; None if it can."""
        return self._unfit() or self.pilot.unfit()

    def disarm(self) -> None:
        """Stop the wheels at once and forbid them to turn."""
        if self.armed:
            self.armed = False
            self.auto.pause()
            self._say(Severity.INFO, "Disarmed")

    def set_mode(self, number: int) -> str | None:
        """Change the mode by its number, Auto also begins a complete mission anew; the reason if it is refused."""
        try:
            mode = Mode(number)
        except ValueError:
            return f"mode {number} is not available"
        reason = self._refusal(mode)
        if reason is not None:
            self._say(Severity.WARNING, f"{mode.name.title()}: {reason}")
            return reason
        if mode is not self.mode:
            self._enter(mode)
            if mode is Mode.RETURN:
                self._guide(ReturnHome())
        if mode is Mode.AUTO and self.auto.state is MissionState.COMPLETE:
            self.auto.load(self.auto.mission)  # begins anew
        self._resume()
        return None

    def start_mission(self) -> str | None:
        """Mode Auto; the reason if it is refused."""
        return self.set_mode(Mode.AUTO)

    def set_mission(self, mission: Mission, current: int | None = None) -> None:
        """Replace the mission. In mode Auto and armed the rover goes on with the new one at once."""
        self.auto.load(mission, current)
        self._resume()

    def set_current(self, index: int) -> bool:
        """Make a mission item the current one; False if there is no such item."""
        found = self.auto.jump(index)
        if found:
            self._resume()
        return found

    def goto(self, position_w: Vector3) -> str | None:
        """Mode Guided and drive to a place in a straight line; the reason if it is refused."""
        return self._guided_to(DriveTo(position_w))

    def turn(self, heading_rad: float, *, relative: bool = False) -> str | None:
        """Mode Guided and turn on the spot; the reason if it is refused."""
        return self._guided_to(TurnTo(heading_rad, relative))

    def follow(self, target: Target, until_s: float, *, hold_on_loss: bool) -> None:
        """In mode Guided, follow a set point instead of what was there; without news until ``until_s``, stop."""
        if self.mode is Mode.GUIDED:
            self._guided.load(Mission())
            self._targets.aim(target, until_s, hold_on_loss=hold_on_loss)

    def end_guided_task(self) -> None:
        """In mode Guided, give up a place or a turn; set points are followed on."""
        self._guided.load(Mission())

    def set_speed(self, speed_m_s: float) -> None:
        """Cruise at this speed on what is being driven now."""
        self.auto.set_speed(speed_m_s)
        self._guided.set_speed(speed_m_s)

    def _guided_to(self, item: Item) -> str | None:
        reason = self.set_mode(Mode.GUIDED)
        if reason is None:
            self._guide(item)
        return reason

    def _guide(self, item: Item) -> None:
        self._targets.forget()
        self._guided.load(Mission((item,)))
        self._guided.start()

    def _refusal(self, mode: Mode) -> str | None:
        if mode is Mode.AUTO and self.auto.mission.empty:
            return "no mission"
        if mode in (Mode.AUTO, Mode.GUIDED, Mode.RETURN):
            return self._unfit()
        return None

    def _unfit(self) -> str | None:
        if self._time_s is None:
            return "no pose estimate yet"
        return self.failsafe.unfit(self._time_s, self._estimate, self.parameters)

    def _operator_lost(self, time_s: float) -> bool:
        """Whether sticks or set points that drive the rover have just been lost; the fail-safe is then done."""
        steering = self.armed and self.mode is Mode.MANUAL
        if self.pilot.lost(time_s) and steering:
            self._fall_back("Sticks lost", self.pilot.on_loss)
            return True
        guided = self.armed and self.mode is Mode.GUIDED
        if self._targets.lost(time_s) and guided:
            self._fall_back("Set points lost", Mode.HOLD if self._targets.hold_on_loss else None)
            return True
        return False

    def _fall_back(self, text: str, mode: Mode | None) -> None:
        if mode is not None and self._refusal(mode) is not None:
            mode = Mode.HOLD
        if mode is None:
            self._say(Severity.WARNING, f"{text}, stopped")
            return
        self._say(Severity.CRITICAL, f"{text}, {mode.name.lower()}")
        self._enter(mode)
        if mode is Mode.RETURN:
            self._guide(ReturnHome())
        self.tripped = True

    def _distrust_sticks(self) -> None:
        if self.pilot.distrust() and self.armed and self.mode is Mode.MANUAL:
            self._say(Severity.WARNING, "Sticks ignored until they are centred")

    def _enter(self, mode: Mode) -> None:
        if self.mode is Mode.AUTO:
            self.auto.pause()
        self._guided.load(Mission())
        self._targets.forget()
        self.mode = mode
        self.tripped = False
        self.failsafe.reset()
        self._distrust_sticks()

    def _resume(self) -> None:
        """In mode Auto an armed rover drives what is left of its mission."""
        if self.mode is Mode.AUTO and self.armed and self.auto.state is not MissionState.COMPLETE:
            self.auto.start()

    def _wanted(self, time_s: float, estimate: PoseEstimate | None) -> Command | None:
        """The motion to go over to; None: stand still at once."""
        if self.mode is Mode.MANUAL:
            return self.pilot.wanted(self.footprint)
        if estimate is None or not self.driving:
            return STOP
        if self._targets.target is not None:
            return self._targets.wanted(time_s, estimate, self._limits(), self.home_w)
        runner = self.auto if self.mode is Mode.AUTO else self._guided
        before = runner.state
        command, reached = runner.step(time_s, estimate, self._limits(), self.home_w)
        if runner is self.auto:
            self._events.extend(Reached(index) for index in reached)
            if runner.state is MissionState.COMPLETE is not before:
                self._say(Severity.INFO, "Mission complete")
        return command

    def _limits(self) -> Limits:
        return Limits(
            cruise_speed_m_s=self.parameters["CRUISE_SPEED"],
            turn_rate_rad_s=float(np.deg2rad(self.parameters["TURN_RATE"])),
            arrival_radius_m=self.parameters["WP_RADIUS"],
            acceleration_m_s2=self.parameters["ACCEL_MAX"],
            yaw_acceleration_rad_s2=YAW_PER_ACCELERATION * self.parameters["ACCEL_MAX"],
            lookahead_m=LOOKAHEAD_LENGTHS * self.footprint.length_m,
            slow_radius_m=SLOW_RADIUS_LENGTHS * self.footprint.length_m,
        )

    def _say(self, severity: Severity, text: str) -> None:
        self._events.append(Text(severity, text))
