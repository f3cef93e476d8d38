"""The built-in autopilot: modes, arming, mission, fail-safes; believed pose in, wheel speeds out."""

from __future__ import annotations

import math

from planner.mobility import STOP, Command, Limits, ramp, wheel_speeds
from rover_sim.autopilot.admission import arming_refusal, mode_refusal, target_refusal
from rover_sim.autopilot.alarm import Alarm
from rover_sim.autopilot.battery_guard import BatteryGuard
from rover_sim.autopilot.events import Event, Reached, Text
from rover_sim.autopilot.failsafe import Failsafe
from rover_sim.autopilot.fence_guard import FenceGuard
from rover_sim.autopilot.mission import DriveTo, Item, Mission, SetFence, SetHome, TurnTo
from rover_sim.autopilot.modes import DRIVING_MODES, MissionState, Mode, Severity
from rover_sim.autopilot.motion_limits import limits
from rover_sim.autopilot.operator_watch import operator_alarm
from rover_sim.autopilot.parameters import ParameterTable
from rover_sim.autopilot.returning import ReturnPlaces
from rover_sim.autopilot.runner import MissionRunner
from rover_sim.autopilot.safety_parameters import ARDUPILOT_SAFETY
from rover_sim.autopilot.station_guard import StationGuard
from rover_sim.autopilot.sticks import StickPilot
from rover_sim.autopilot.targets import Target, TargetFollower
from rover_sim.autopilot.traction import Traction
from worlds.types import FloatArray, Footprint, PoseEstimate, SensorReadings, Vector3

_LONGEST_STEP_S = 0.2  # a pause between two updates must not become a jump in speed


class Autopilot:
    """Drives the rover. `update` is to be called at about 20..60 Hz; everything else between two updates."""

    def __init__(self, footprint: Footprint, home_w: Vector3, parameters: ParameterTable | None = None) -> None:
        self.footprint = footprint
        self.home_w = home_w
        self.parameters = parameters or ParameterTable()
        self.parameters.extend(ARDUPILOT_SAFETY)
        self.mode = Mode.HOLD
        self.armed = False
        self.tripped = False  # a fail-safe stopped the rover, and nobody has changed the mode since
        self.auto = MissionRunner(footprint)
        self.failsafe = Failsafe(footprint)
        self.pilot = StickPilot()
        self.stations, self.battery = StationGuard(self.parameters), BatteryGuard(self.parameters)
        self.fence = FenceGuard(self.parameters)
        self.returns = ReturnPlaces(self.parameters, self.fence)
        self._guided = MissionRunner(footprint)
        self._targets = TargetFollower(footprint)
        self._traction = Traction()
        self._motion = STOP
        self.wheel_speed_rad_s = (0.0,) * footprint.wheels  # of the last update
        self._limits_of, self._kept_limits = self.parameters.changes, limits(self.parameters, footprint)
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
        self._watch(time_s, estimate, readings)
        lost = operator_alarm(time_s, self.mode, self.pilot, self._targets) if self.armed else None
        if lost is not None:
            self._respond(lost)
        wanted = self._wanted(time_s, estimate)
        if not self.armed or lost is not None or wanted is None:
            self._motion = STOP
        else:
            self._motion = ramp(self._motion, wanted, self._limits(), step_s)
        self.wheel_speed_rad_s = wheel_speeds(self._motion.linear_m_s, self._motion.yaw_rate_rad_s, self.footprint)
        return self.wheel_speed_rad_s

    @property
    def driving(self) -> bool:
        """Whether the autopilot itself may move the rover now."""
        return self.armed and self.mode in DRIVING_MODES

    @property
    def has_guided_task(self) -> bool:
        """Whether mode Guided has something to do or has done it, such as a place to drive to."""
        return not self._guided.mission.empty

    @property
    def guided_place_w(self) -> Vector3 | None:
        """Where mode Guided drives to, or has driven to; None if it was told no place."""
        items = self._guided.mission.items
        return items[0].position_w if items and isinstance(items[0], DriveTo) else None

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
            self.returns.track.clear()
            self._say(Severity.INFO, "Armed")
            self._distrust_sticks()
            self._resume()
        elif reason is not None:
            self._say(Severity.ERROR, f"PreArm: {reason}")
        return reason

    def prearm_reason(self) -> str | None:
        """Why the rover cannot be armed now; None if it can."""
        return arming_refusal(self, self._time_s, self._estimate)

    def allows(self, position_w: FloatArray | Vector3) -> bool:
        """Whether the fence, if there is one, allows the rover to be at a place."""
        return self.fence.allows(position_w, self.home_w)

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
        if mode is Mode.AUTO and self.auto.state is MissionState.COMPLETE:
            self.auto.load(self.auto.mission)  # begins anew
        self._resume()
        return None

    def start_mission(self) -> str | None:
        """Mode Auto; the reason if it is refused."""
        return self.set_mode(Mode.AUTO)

    def set_mission(self, mission: Mission, current: int | None = None) -> None:
        """Replace the mission. In mode Auto and armed the rover goes on with the new one at once.

        One that leads out of the fence is kept, but not driven: the rover goes to Hold.
        """
        self.auto.load(mission, current)
        reason = self.fence.leads_out(self.auto.mission, self.home_w)
        if reason is not None and self.mode is Mode.AUTO and self.armed:
            self._respond(Alarm(Severity.ERROR, f"Mission: {reason}", (Mode.HOLD,)))
        self._resume()

    def set_current(self, index: int) -> bool:
        """Make a mission item the current one; False if there is no such item."""
        found = self.auto.jump(index)
        if found:
            self._resume()
        return found

    def goto(self, position_w: Vector3) -> str | None:
        """Mode Guided and drive to a place in a straight line; the reason if it is refused."""
        reason = target_refusal(self, self._estimate, position_w)
        if reason is not None:
            self._say(Severity.WARNING, f"Guided: {reason}")
            return reason
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

    def _guide(self, *items: Item) -> None:
        self._targets.forget()
        self._guided.load(Mission(items))
        self._guided.start()

    def _watch(self, time_s: float, estimate: PoseEstimate | None, readings: SensorReadings) -> None:
        """Everything that may take the wheel from whoever drives, other than what makes driving impossible."""
        alarms = [self.stations.update(time_s, self.mode), self.battery.update(time_s, readings.battery)]
        if estimate is not None and all(map(math.isfinite, estimate.pose.position_w.tolist())):
            alarms.append(self.fence.update(time_s, estimate, self.home_w, armed=self.armed))
            if self.armed and self.mode is not Mode.SMART_RETURN:
                self.returns.note(estimate.pose.position_w)
        for alarm in alarms:
            if alarm is not None:
                self._respond(alarm)

    def _respond(self, alarm: Alarm) -> None:
        """Say it, and change to the first mode of its response that is possible; a rover on its way back goes on."""
        mode = None
        if self.armed and alarm.response:
            back = self.mode in alarm.response and self.mode is not Mode.HOLD
            possible = (self.mode,) if back else alarm.response
            mode = next((mode for mode in possible if self._refusal(mode) is None), Mode.HOLD)
            if mode is not self.mode:
                self._enter(mode)
            self.tripped = True
        told = "" if mode is None else f", {mode.name.lower().replace('_', ' ')}"
        self._say(alarm.severity, alarm.text + told)

    def _refusal(self, mode: Mode) -> str | None:
        return mode_refusal(self, mode, self._time_s, self._estimate)

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
        if mode is Mode.RETURN and self._estimate is not None:
            what, place_w = self.returns.place(self._estimate.pose.position_w, self.home_w)
            self._say(Severity.INFO, f"Returning to {what}")
            self._guide(DriveTo(place_w))
        elif mode is Mode.SMART_RETURN:
            self._guide(*self.returns.way_back().items)

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
        command, reached = runner.step(
            time_s,
            estimate,
            self._limits(),
            lambda: self.returns.place(estimate.pose.position_w, self.home_w)[1],
        )
        if runner is self.auto:
            for index in reached:
                self._events.append(Reached(index))
                self._apply(runner.mission.items[index], estimate)
            if runner.state is MissionState.COMPLETE is not before:
                self._say(Severity.INFO, "Mission complete")
        return self._traction.relieve(command, self.failsafe.monitor)

    def _apply(self, item: Item, estimate: PoseEstimate) -> None:
        """What an item that was reached does beside driving."""
        if isinstance(item, SetHome):
            x, y, z = (float(value) for value in estimate.pose.position_w)
            self.home_w = (x, y, z) if item.position_w is None else item.position_w
        elif isinstance(item, SetFence):
            self.parameters.set("FENCE_ENABLE", float(item.on))

    def _limits(self) -> Limits:
        if self._limits_of != self.parameters.changes:
            self._limits_of, self._kept_limits = self.parameters.changes, limits(self.parameters, self.footprint)
        return self._kept_limits

    def _say(self, severity: Severity, text: str) -> None:
        self._events.append(Text(severity, text))
