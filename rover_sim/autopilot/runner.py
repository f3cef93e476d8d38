"""Mission execution: from the current item and the believed pose to a wanted motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import hypot

import numpy as np

from planner.mobility import STOP, Command, Limits, Progress, follow_path, turn_to
from rover_sim.autopilot.mission import (
    DriveTo,
    Home,
    Jump,
    Mission,
    ReturnHome,
    SetFence,
    SetHome,
    SetReverse,
    SetSpeed,
    TurnTo,
    Wait,
)
from rover_sim.autopilot.modes import MissionState
from worlds.geometry import euler_from_quaternion
from worlds.types import FloatArray, Footprint, PoseEstimate, Vector3


@dataclass
class _Leg:
    """Waypoints that are driven through without a stop, the last one being a stop."""

    path_w: FloatArray  # (N, 2), from where the leg began
    arcs_m: FloatArray  # (N - 1,) arc length of each waypoint
    progress: Progress = field(default_factory=Progress)


class MissionRunner:
    """Executes one mission; `step` is called at the control rate while its mode is active."""

    def __init__(self, footprint: Footprint) -> None:
        self.mission = Mission()
        self.state = MissionState.NO_MISSION
        self.current = 0
        self._footprint = footprint
        self._return_w: Callable[[], Vector3] = lambda: (0.0, 0.0, 0.0)
        self._reverse = False
        self._speed_m_s: float | None = None
        self._leg: _Leg | None = None
        self._heading_rad: float | None = None
        self._until_s: float | None = None
        self._tuned: tuple[tuple[Limits, float, float], Limits] | None = None
        self._jumps: dict[int, int] = {}  # how often each was made

    def load(self, mission: Mission, current: int | None = None) -> None:
        """Replace the mission; a running one goes on with the new one's first item, or with ``current``."""
        running = self.state is MissionState.ACTIVE
        self.mission = mission
        self._begin(mission.first if current is None else max(current, mission.first))
        if mission.empty:
            self.state = MissionState.NO_MISSION
        else:
            self.state = MissionState.ACTIVE if running else MissionState.NOT_STARTED

    def set_speed(self, speed_m_s: float) -> None:
        """Cruise at this speed until the mission says otherwise or begins anew."""
        self._speed_m_s = speed_m_s

    def jump(self, index: int) -> bool:
        """Make an item the current one; False if there is no such item."""
        if not self.mission.first <= index < len(self.mission.items):
            return False
        self._enter(index)
        if self.state is MissionState.COMPLETE:
            self.state = MissionState.NOT_STARTED
        return True

    def start(self) -> None:
        """Run: from the first item if the mission is complete, else from the current one."""
        if self.state is MissionState.COMPLETE:
            self._begin(self.mission.first)
        if self.state is not MissionState.NO_MISSION:
            self.state = MissionState.ACTIVE

    def pause(self) -> None:
        """Stop running; `start` goes on with the current item from wherever the rover then is."""
        if self.state is MissionState.ACTIVE:
            self.state = MissionState.PAUSED
            self._enter(self.current)

    def step(
        self, time_s: float, estimate: PoseEstimate, limits: Limits, return_w: Callable[[], Vector3]
    ) -> tuple[Command, tuple[int, ...]]:
        """Wanted motion and the indices of the items that were reached; `STOP` unless the state is ACTIVE.

        ``return_w`` is asked where "return" leads when the rover sets out for it.
        """
        self._return_w = return_w
        reached: list[int] = []
        for _ in range(len(self.mission.items) + 1):  # jumps that lead in a circle without driving end here too
            if self.state is not MissionState.ACTIVE:
                break
            before = self.current
            command = self._execute(time_s, estimate, limits)
            if not isinstance(self.mission.items[before], Jump):
                reached.extend(range(before, self.current))
            if self.current >= len(self.mission.items):
                self.current = len(self.mission.items) - 1
                self.state = MissionState.COMPLETE
            elif command is not None:
                return command, tuple(reached)
        return STOP, tuple(reached)

    def _execute(self, time_s: float, estimate: PoseEstimate, limits: Limits) -> Command | None:
        """Work on the current item; None as soon as it is done, and then ``current`` has moved on."""
        item = self.mission.items[self.current]
        match item:
            case DriveTo() | ReturnHome():
                return self._drive(time_s, estimate, limits)
            case TurnTo():
                return self._turn(item, estimate, limits)
            case Wait():
                return self._wait(item.duration_s, time_s)
            case SetSpeed():
                self._speed_m_s = item.speed_m_s
                self.current += 1  # a leg goes on
                return None
            case SetReverse():
                self._reverse = item.reverse
            case Jump():
                return self._jump(item)
            case Home() | SetHome() | SetFence():
                pass  # what concerns more than driving is done by whoever hears that it is reached
        return self._done()

    def _jump(self, item: Jump) -> Command | None:
        done = self._jumps.get(self.current, 0)
        if 0 <= item.times <= done:
            return self._done()
        self._jumps[self.current] = done + 1
        self._enter(item.index)
        return None

    def _drive(self, time_s: float, estimate: PoseEstimate, limits: Limits) -> Command | None:
        if self._until_s is not None:  # arrived before: only the hold is left
            return self._wait(0.0, time_s)
        leg = self._leg = self._leg or self._plan_leg(estimate)
        stops = len(leg.arcs_m) == 1
        item = self.mission.items[self.current]
        radius = item.radius_m if isinstance(item, DriveTo) and item.radius_m > 0.0 else limits.arrival_radius_m
        cruise = limits.cruise_speed_m_s if self._speed_m_s is None else self._speed_m_s
        arrival = radius if stops else limits.arrival_radius_m
        tuned = self._tune(limits, cruise, arrival)
        command, leg.progress = follow_path(
            leg.path_w, estimate, self._footprint, tuned, leg.progress, reverse=self._reverse
        )
        if leg.progress.arrived and stops:
            return self._wait(item.hold_s if isinstance(item, DriveTo) else 0.0, time_s)
        if not stops and self._passed(leg, estimate, radius):
            leg.arcs_m = leg.arcs_m[1:]
            self.current += 1
            return None
        return command

    def _tune(self, limits: Limits, cruise_m_s: float, arrival_m: float) -> Limits:
        """The limits with another speed and radius; the last ones are kept, as they are asked for at every step."""
        wanted = limits, cruise_m_s, arrival_m
        if self._tuned is None or self._tuned[0] != wanted:
            self._tuned = wanted, replace(limits, cruise_speed_m_s=cruise_m_s, arrival_radius_m=arrival_m)
        return self._tuned[1]

    def _passed(self, leg: _Leg, estimate: PoseEstimate, radius_m: float) -> bool:
        """Whether the waypoint is within its radius, or lies behind on the path: a cut corner counts."""
        x_m, y_m, _ = self._place(self.current)
        near = hypot(x_m - float(estimate.pose.position_w[0]), y_m - float(estimate.pose.position_w[1])) < radius_m
        return near or leg.progress.arrived or leg.progress.arc_m > float(leg.arcs_m[0])

    def _plan_leg(self, estimate: PoseEstimate) -> _Leg:
        stops: list[int] = []
        index: int | None = self.current
        while index is not None:
            stops.append(index)
            index = self._through(index)
        path = np.vstack([estimate.pose.position_w[:2], *(self._place(index)[:2] for index in stops)])
        return _Leg(path, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))

    def _through(self, index: int) -> int | None:
        """The waypoint that follows without a stop in between; changes of speed need none."""
        item = self.mission.items[index]
        if not isinstance(item, DriveTo) or item.hold_s > 0.0:
            return None
        for after in range(index + 1, len(self.mission.items)):
            following = self.mission.items[after]
            if isinstance(following, DriveTo):
                return after
            if not isinstance(following, SetSpeed):
                return None
        return None

    def _place(self, index: int) -> Vector3:
        item = self.mission.items[index]
        return item.position_w if isinstance(item, DriveTo) else self._return_w()

    def _turn(self, item: TurnTo, estimate: PoseEstimate, limits: Limits) -> Command | None:
        if self._heading_rad is None:
            yaw = euler_from_quaternion(estimate.pose.quaternion_w)[2]
            self._heading_rad = item.heading_rad + (yaw if item.relative else 0.0)
        command, there = turn_to(self._heading_rad, estimate, self._footprint, limits)
        return self._done() if there else command

    def _wait(self, duration_s: float, time_s: float) -> Command | None:
        if self._until_s is None:
            self._until_s = time_s + duration_s
        return self._done() if time_s >= self._until_s else STOP

    def _done(self) -> Command | None:
        """The current item is done; as None is what a done item returns, so is this."""
        self._enter(self.current + 1)
        return None

    def _begin(self, index: int) -> None:
        """Start of a mission: its own speed and direction are forgotten."""
        self._reverse = False
        self._speed_m_s = None
        self._jumps = {}
        self._enter(index)

    def _enter(self, index: int) -> None:
        self.current = index
        self._leg = None
        self._heading_rad = None
        self._until_s = None
