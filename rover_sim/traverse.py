"""One closed-loop traverse: the composition of world, rover, camera, perception, planner and link."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import gcd
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from perception.pipeline import load_knowledge
from planner import navigator
from planner.choice import Models
from planner.corridor import CAMERA_SPEED, SpeedModel
from planner.navigator_state import NavigatorModel
from planner.obstacle_map import STEREO_DRIVE, DriveModel
from planner.route_following import Following
from planner.terrain_map import STEREO_MEMORY, MemoryModel
from rover_sim.autopilot.modes import Severity
from rover_sim.autopilot.tuning import tuned_autopilot
from rover_sim.driven_rover import (
    CAMERA_STREAM,
    CONTROL_STEPS,
    LASER_STREAM,
    LINK_STREAM,
    STEPS_PER_S,
    TRACE_STEPS,
    DrivenRover,
    Driver,
    home,
)
from rover_sim.eyes import eyes
from rover_sim.fault_log import AutopilotKind
from rover_sim.given_way import GivenWay, Pilot, Way
from rover_sim.mavlink.faults import Faults
from rover_sim.mavlink.stack import BadLink, MavlinkStack
from rover_sim.onboard import OnboardComputer, Sight
from rover_sim.outcome import Judge, Limits, Reason
from rover_sim.pacing import WallClock
from rover_sim.planner_link import PlannerLink
from rover_sim.risk_belief import risk_vehicle
from rover_sim.risk_figures import risk_figures
from rover_sim.risk_watch import RiskWatch, RiskyWay
from rover_sim.route_map import first_route
from rover_sim.scoring import ClassScore
from rover_sim.sim.laser import LaserScanner
from rover_sim.sim.mobility_events import MobilityEvent, active_kinds
from rover_sim.sim.renderer import Renderer, add_noise, make_renderer
from rover_sim.sim.rover import RoverModel
from rover_sim.sim.ruts import SavedRuts
from rover_sim.sim.vehicle_state import VehicleState
from rover_sim.summary import Identity, summarize
from rover_sim.true_obstacles import check_start
from worlds.geometry import camera_pose, rotation_from_quaternion, to_sun, to_the_right
from worlds.types import Frame, Pose, RangeScan, World

if TYPE_CHECKING:
    from rover_sim.sim.recorder import TraceRecorder
    from rover_sim.sim.simulation import Simulation

STEREO_BASELINE_M = 0.12
NOT_ARRIVED = {"no_path": Reason.NO_PATH, "lost": Reason.LOST}  # how the planner may end a traverse
LASER_SD_M = 0.02  # that the rover believes of its scanner
LINK_GRACE_S = 5.0  # the first heartbeats of our own vehicle need not have come before


@dataclass(frozen=True)
class RunOptions:
    """What the user chose beside the scenario."""

    connect: tuple[str, ...] = ()
    faults: Faults | None = None  # of all links, the planner's too
    realtime: bool = False
    any_touch_ends: bool = False  # of an obstacle, by hull or wheel
    autopilot: AutopilotKind = "built-in"
    way: Way | None = None  # drive this one with closed eyes instead of seeing and planning
    link_grace_s: float = LINK_GRACE_S


@dataclass(frozen=True)
class Status:
    """What a progress display needs."""

    time_s: float
    goal_distance_m: float
    share_done: float
    slip: float
    doing: str
    faults: str  # those that last; empty without any


class Stepped(NamedTuple):
    """What one step of a traverse brought."""

    looked: bool  # an eye was used
    end: tuple[Reason, str] | None


_NOTHING_NEW = Stepped(looked=False, end=None)


def open_traverse(world: World, rover: RoverModel, options: RunOptions, tlog: Path | None = None) -> Traverse:
    """A traverse by the built-in autopilot; raises InputError or LinkError if a link cannot be opened."""
    autopilot = tuned_autopilot(rover.footprint(), home(world), world.scenario.gravity_m_s2)
    bad = None if options.faults is None else BadLink(options.faults, (world.seed, LINK_STREAM))
    link = MavlinkStack(world.origin, autopilot, options.connect, tlog, bad=bad)
    return Traverse(world, rover, autopilot, link, options)


class Traverse:
    """A rover in its world, ready to drive; a context manager, as it holds a link and a physics client."""

    def __init__(
        self,
        world: World,
        rover: RoverModel,
        driver: Driver,
        link: PlannerLink,
        options: RunOptions,
        steps_per_s: int = STEPS_PER_S,
    ) -> None:
        """``link`` is closed with the traverse, or at once if there can be none; ``steps_per_s``: of the physics."""
        scenario = world.scenario
        self.world, self._options = world, options
        self._camera = rover.camera(scenario.camera)
        self._camera_rng = np.random.default_rng([world.seed, CAMERA_STREAM])
        self._classes, self._judge = ClassScore(), Judge(Limits(touch_ends=options.any_touch_ends))
        self._eyes = eyes(scenario, steps_per_s) if options.way is None else {}
        self._look_steps = gcd(*(eye.steps for eye in self._eyes.values()))  # no eye looks in between; 0 without any
        self._stack, self._steps, self._steps_per_s = link, 0, steps_per_s
        try:
            check_start(world, rover.footprint())
            route = (
                first_route(world, rover.footprint(), risk_vehicle(rover, scenario)) if options.way is None else None
            )
            self.rover = DrivenRover(world, rover, driver, steps_per_s, options.autopilot)
            self._renderer = make_renderer(world, self.simulation.ruts) if "camera" in self._eyes else None
            scanner_rng = np.random.default_rng([world.seed, LASER_STREAM])
            self._scanner = LaserScanner(world, rover.laser(), scanner_rng) if "laser" in self._eyes else None
        except BaseException:
            self._stack.close()
            raise
        self._risk = RiskWatch(link.companion.say)
        self._computer: OnboardComputer | None = None
        self.onboard: Pilot
        if options.way is None:
            self.onboard = self._computer = self._planner(route)
        else:
            self.onboard = GivenWay(self._stack.companion, self._stack.frame, home(world), options.way)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End physics and link."""
        self.rover.close()
        self._stack.close()

    def run(
        self,
        show: Callable[[Status], None] | None = None,
        stopped: Callable[[], bool] = lambda: False,
        on_sight: Callable[[Sight], None] = lambda _: None,
    ) -> dict[str, Any]:
        """Drive until the traverse ends and return its summary; ``stopped`` is asked at each look of an eye."""
        clock, ended = WallClock(), None
        while ended is None:
            looked, ended = self.step(on_sight)
            if looked:
                if show is not None:  # a status takes another look at the truth
                    show(self.status())
                ended = (Reason.ABORTED, "interrupted") if stopped() else ended
            if self._options.realtime and self._steps % CONTROL_STEPS == 0:
                clock.wait_until(self.simulation.time_s)
        return self.summary(*ended, wall_time_s=clock.elapsed_s())

    def step(self, on_sight: Callable[[Sight], None] = lambda _: None) -> Stepped:
        """What is due now - control, trace and judge, eyes - and then one step of the physics."""
        step, ended = self._steps, None
        if step % CONTROL_STEPS == 0:
            self._control()
        if step % TRACE_STEPS == 0:
            ended = self._observe()
        looked = self._look_steps > 0 and step % self._look_steps == 0 and self._see(step, on_sight)
        self.rover.step()
        self._steps += 1
        return Stepped(looked, ended) if looked or ended is not None else _NOTHING_NEW

    def summary(self, reason: Reason, detail: str, *, wall_time_s: float) -> dict[str, Any]:
        """The summary of what was driven so far."""
        scenario = self.world.scenario
        trace = self.recorder.arrays()
        return summarize(
            trace,
            Identity(
                scenario=scenario.name,
                seed=self.world.seed,
                start_w=scenario.rover.start_m,
                goal_w=scenario.goal.position_m,
                wheel_radius_m=self.rover.footprint.wheel_radius_m,
            ),
            replace(self.onboard.counts, collisions=self._judge.collisions),
            reason,
            wall_time_s=wall_time_s,
            ttam=self._classes.ttam(),
            detail=detail,
            events=self.events,
            faults=self.rover.faults.summary(self.simulation.time_s),
            route=self.route,
            risk=risk_figures(self._risk, trace, reason),
        )

    @property
    def recorder(self) -> TraceRecorder:
        """The trace so far."""
        return self.rover.recorder

    @property
    def events(self) -> list[MobilityEvent]:
        """What befell the rover so far."""
        return self.rover.mobility.events

    @property
    def route(self) -> Following | None:
        """The route above navigation as it stands; None where there is none."""
        return None if self._computer is None else self._computer.route

    @property
    def risky_ways(self) -> list[RiskyWay]:
        """Legs of the route and what was forecast of them; none without a route."""
        return [] if self.route is None else self._risk.risky_ways(self.route)

    @property
    def simulation(self) -> Simulation:
        """The physics, for who is the world of an autopilot from outside."""
        return self.rover.simulation

    @property
    def ruts(self) -> SavedRuts | None:
        """The ruts driven so far; None where the ground does not deform."""
        ruts = self.simulation.ruts
        return None if ruts is None else ruts.copy()

    def save_mission(self, waypoints: Path, plan: Path) -> None:
        """Write the mission that the vehicle holds, in both of QGroundControl's formats."""
        self._stack.save_plans(waypoints, plan)

    def _planner(self, route: Following | None) -> OnboardComputer:
        """A pilot that sees and plans."""
        scenario = self.world.scenario
        goal = scenario.goal
        memory, drive = (STEREO_MEMORY, STEREO_DRIVE) if scenario.sensors.stereo else (MemoryModel(), DriveModel())
        model = NavigatorModel(memory, speed=SpeedModel() if "laser" in self._eyes else CAMERA_SPEED)
        area = self.world.ground.x_limits_m, self.world.ground.y_limits_m
        body = self.rover.footprint
        plan = navigator.begin(
            goal.position_m,
            goal.radius_m,
            body,
            scenario.rover.start_m,
            models=Models(body, drive if route is None else replace(drive, lifted_m=route.lifted_m)),
            model=model,
            area=area,
        )
        periods = {name: eye.steps / self._steps_per_s for name, eye in self._eyes.items()}
        knowledge = load_knowledge("rendered")
        link = self._stack
        return OnboardComputer(link.companion, link.frame, home(self.world), plan, knowledge, periods, route)

    def _control(self) -> None:
        """Sensors, estimate, autopilot, link."""
        readings = self.rover.control()
        self._stack.tick(self.simulation.time_s, self.rover.estimate, readings)
        self.onboard.tick(self.rover.estimate)
        if self.route is not None:
            self._risk.look(self.simulation.time_s, self.route, self.onboard.counts.failsafe_stops)
        if self.world.scenario.event:
            self.rover.faults.hear(self.simulation.time_s, self._stack.companion.status, self.onboard.doing)

    def _see(self, step: int, on_sight: Callable[[Sight], None]) -> bool:
        """Use the eyes whose time it is; whether any was."""
        due = [name for name, eye in self._eyes.items() if eye.due(step, self._steps_per_s)]
        if self._computer is None:
            return False
        if "camera" in due and self._renderer is not None:
            on_sight(self._look(self._renderer, self._computer))
        if "laser" in due and self._scanner is not None:
            self._scan(self._scanner, self._computer)
        return bool(due)

    def _scan(self, scanner: LaserScanner, computer: OnboardComputer) -> None:
        """A turn of the scanner where it truly is, placed where the rover believes it to be."""
        time_s, laser = self.simulation.time_s, scanner.laser
        believed = self.rover.estimate.pose
        place = believed.position_w + rotation_from_quaternion(believed.quaternion_w) @ np.asarray(laser.position_b)
        scan = RangeScan(
            time_s=time_s,
            angles_rad=laser.angles_rad,
            ranges_m=scanner.scan(self.simulation.state.pose),
            range_sd_m=np.full(len(laser.angles_rad), LASER_SD_M),
            least_m=np.zeros(len(laser.angles_rad)),
            reach_m=laser.reach_m,
            pose=Pose(place, believed.quaternion_w),
            ground=self.rover.ground(),
        )
        computer.scan(scan, self.rover.estimate, time_s)

    def _look(self, renderer: Renderer, computer: OnboardComputer) -> Sight:
        """A picture from where the camera truly is, judged from where the rover believes it to be."""
        time_s, camera = self.simulation.time_s, self._camera
        true_pose = camera_pose(self.simulation.state.pose, camera)
        rendered, right = renderer.render(camera, true_pose), None
        noise = self.world.scenario.camera.noise
        image = add_noise(rendered.image, noise, self._camera_rng)
        if self.world.scenario.sensors.stereo:
            beside = renderer.render(camera, to_the_right(true_pose, STEREO_BASELINE_M))
            right = add_noise(beside.image, noise, self._camera_rng)
        frame = Frame(
            time_s=time_s,
            image=image,
            camera=camera,
            camera_pose=camera_pose(self.rover.estimate.pose, camera),
            ground=self.rover.ground(),
            right=right,
            baseline_m=STEREO_BASELINE_M,
            to_sun_w=to_sun(self.world.scenario.sun.azimuth_deg, self.world.scenario.sun.elevation_deg),
        )
        searching = computer.search
        sight = computer.look(frame, self.rover.locate, time_s)
        if (computer.search is None) != (searching is None):
            text = "found where it is" if computer.search is None else f"lost: {computer.search.why}"
            self._stack.narrator.say(Severity.WARNING, f"The rover {text}")
        clasts = renderer.clasts(camera, true_pose, rendered)
        self._classes.add(clasts, rendered.depth_m, sight.perception.classes)
        return sight

    def _observe(self) -> tuple[Reason, str] | None:
        """Record the true state and judge it."""
        state, step_s = self.simulation.state, TRACE_STEPS / self._steps_per_s
        self.rover.watch(self._stack.narrator)
        self._record()
        contacts, wheel_touched = self.simulation.take_contacts(), self.simulation.take_wheel_touch()
        digging = self.rover.mobility.digging(state)
        reason = self._judge.look(state, contacts, step_s, digging=digging, wheel_touched=wheel_touched)
        if reason is not None:
            touched = f"touched obstacle {contacts[0].obstacle_id}" if contacts else ""
            return reason, touched
        if state.off_map:
            return Reason.ERROR, "the rover left the map"
        return self._declared_end(state)

    def _declared_end(self, state: VehicleState) -> tuple[Reason, str] | None:
        """The end that the rover itself has declared, or that link or time have."""
        goal, end = self.world.scenario.goal, self.onboard.end
        if end is not None and end.kind in NOT_ARRIVED:
            return NOT_ARRIVED[end.kind], end.reason
        if end is not None:
            near = self._goal_distance(state) <= goal.radius_m
            return (Reason.GOAL if near else Reason.GOAL_MISSED), end.reason
        if self.onboard.exhausted:
            return Reason.SLIP_STOP, self.onboard.stop_text
        if state.time_s >= goal.time_limit_s:
            return Reason.TIMEOUT, f"goal.time_limit_s = {goal.time_limit_s:g} is over"
        return self._loss(state.time_s)

    def _loss(self, time_s: float) -> tuple[Reason, str] | None:
        """The end that a silent eye or link makes."""
        if self._computer is not None and (silent := self._computer.silent_eye(time_s)):
            return Reason.SENSOR_LOST, silent
        if (trouble := self._stack.companion.trouble) is not None:
            return Reason.LINK_LOST, trouble.text
        if time_s > self._options.link_grace_s and not self._stack.companion.linked:
            return Reason.LINK_LOST, "the companion no longer hears the vehicle"
        return None

    def _record(self) -> None:
        status = self._stack.companion.status
        self.rover.record(
            **{kind.value: lasts for kind, lasts in active_kinds(self.rover.mobility.memory).items()},
            estimate_position_sd=self.rover.estimate.position_sd_m,
            mode=-1 if status.mode is None else status.mode,
            mission_current=-1 if status.current is None else status.current,
        )

    def _goal_distance(self, state: VehicleState) -> float:
        return float(np.hypot(*(state.pose.position_w[:2] - np.asarray(self.world.scenario.goal.position_m))))

    def status(self) -> Status:
        """How the traverse stands, for a display."""
        state = self.simulation.state
        scenario = self.world.scenario
        whole = float(np.hypot(*np.subtract(scenario.goal.position_m, scenario.rover.start_m)))
        left = self._goal_distance(state)
        slip = float(np.abs(state.slip).mean())
        done = max(0.0, 1.0 - left / max(whole, 1e-9))
        waits_for = self._stack.companion.waits_for
        doing = f"waits for {waits_for}" if waits_for else self.onboard.doing
        return Status(state.time_s, left, done, slip, doing, self.rover.faults.lasting)
