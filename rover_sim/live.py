"""The rover as a live vehicle at the pace of the wall clock: no planner, whoever is on the link drives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from planner import localization
from planner.localization import SensorModel
from rover_sim.autopilot.parameter_file import load_parameters, save_parameters
from rover_sim.autopilot.tuning import tuned_autopilot
from rover_sim.eyes import eyes
from rover_sim.files import write_text
from rover_sim.mavlink.camera_messages import CameraPort
from rover_sim.mavlink.faults import Faults
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.narrator import Narrator
from rover_sim.mavlink.persona import Persona
from rover_sim.mavlink.signing import Signing
from rover_sim.mavlink.stack import BadLink, open_links
from rover_sim.mavlink.vehicle import Vehicle
from rover_sim.pacing import RealTime
from rover_sim.photographs import Photographer
from rover_sim.sim.mobility_events import MobilityLog
from rover_sim.sim.recorder import TraceRecorder
from rover_sim.sim.rover import RoverModel
from rover_sim.sim.rover_urdf import wheel_names
from rover_sim.sim.simulation import Simulation
from rover_sim.sim.vehicle_state import trace_columns
from rover_sim.traverse import CAMERA_STREAM, CONTROL_STEPS, LINK_STREAM, SENSOR_STREAM, STEPS_PER_S, TRACE_STEPS
from worlds.scenario import dump_scenario
from worlds.types import World

TLOG = "telemetry.tlog"
FILES = (TLOG, "trace.npz", "mission.waypoints", "mission.plan", "scenario.toml")


@dataclass(frozen=True)
class LiveStatus:
    """What a display needs."""

    time_s: float
    real_time_factor: float
    mode: str
    armed: bool
    speed_m_s: float
    slip: float
    listeners: int


class LiveRover:
    """A rover in its world on its links; a context manager, as it holds links and a physics client."""

    def __init__(
        self,
        world: World,
        rover: RoverModel,
        persona: Persona,
        urls: Sequence[str] = (),
        tlog: Path | None = None,
        faults: Faults | None = None,
        parameters: Path | None = None,
        signing: Signing | None = None,
    ) -> None:
        """``parameters``: file that they are taken from, if it exists, and written to at each change."""
        scenario = world.scenario
        self.world = world
        self._footprint = rover.footprint()
        home = (*scenario.rover.start_m, float(world.start.position_w[2]))
        self.autopilot = tuned_autopilot(self._footprint, home, scenario.gravity_m_s2)
        eye, model = eyes(scenario, STEPS_PER_S).get("camera"), rover.camera(scenario.camera)
        bad = None if faults is None else BadLink(faults, (world.seed, LINK_STREAM))
        links, log = open_links(urls, tlog, bad=bad)
        folder = None if tlog is None else tlog.parent
        self._photographer: Photographer | None = None
        port = None if eye is None or folder is None else CameraPort(model, folder, self._photograph)
        self.vehicle = Vehicle(self.autopilot, LocalFrame(world.origin), links, log, persona, folder, port, signing)
        try:
            if parameters is not None and parameters.exists():
                load_parameters(parameters, self.autopilot.parameters)
            self._parameter_file, self._saved = parameters, self.autopilot.parameters.changes
            self._simulation = Simulation(world, rover, np.random.default_rng([world.seed, SENSOR_STREAM]))
            if eye is not None and port is not None:
                rng = np.random.default_rng([world.seed, CAMERA_STREAM])
                self._photographer = Photographer(world, self._simulation, model, eye, rng)
        except BaseException:
            self.vehicle.close()
            raise
        self._narrator = Narrator(self.vehicle.endpoint)
        self._recorder = TraceRecorder()
        self._mobility, self._wheel_names = MobilityLog(rover, scenario.gravity_m_s2), wheel_names(rover)
        self._model = SensorModel(gravity_m_s2=scenario.gravity_m_s2)
        readings = self._simulation.read_sensors()
        place = (home[0], home[1], home[2] + self._footprint.wheel_radius_m)  # a surveyed point
        self._located = localization.start(readings, place, model=self._model)
        self._wheel_speeds: tuple[float, ...] = (0.0,) * len(readings.wheel_speed_rad_s)
        self._steps = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._simulation.close()
        self.vehicle.close()

    def run(self, stopped: Callable[[], bool], show: Callable[[LiveStatus], None] = lambda _: None) -> bool:
        """Live until ``stopped``; False if the rover left the map before."""
        pace = RealTime()
        while not stopped():
            self.step()
            if self._steps % STEPS_PER_S == 0:
                show(self._status(pace.factor))
            if self._simulation.state.off_map:
                return False
            # What a station says is answered as it comes: a step of the physics takes longer than an answer.
            while (left_s := pace.left_s(self._simulation.time_s)) > 0.0:
                if self.vehicle.endpoint.wait(left_s):
                    self.vehicle.answer(self._simulation.time_s)
        return True

    def step(self) -> None:
        """One step of the physics; links are served at every one, sensors and autopilot at every fifth."""
        if self._steps % CONTROL_STEPS == 0:
            self._control()
        else:
            self.vehicle.answer(self._simulation.time_s)
        if self._steps % TRACE_STEPS == 0:
            self._observe()
            self._keep_parameters()
        self._simulation.step(self._wheel_speeds)
        self._steps += 1

    def save(self, folder: Path) -> None:
        """Write trace, mission and scenario; the log was written as it came."""
        write_text(folder / "scenario.toml", dump_scenario(self.world.scenario))
        self._recorder.save(folder / "trace.npz")
        self.vehicle.save_plans(folder / "mission.waypoints", folder / "mission.plan")

    def _photograph(self, path: Path) -> bool:
        return self._photographer is not None and self._photographer.take(path)

    def _keep_parameters(self) -> None:
        changes = self.autopilot.parameters.changes
        if self._parameter_file is not None and changes != self._saved:
            save_parameters(self._parameter_file, self.autopilot.parameters)
            self._saved = changes

    def _control(self) -> None:
        time_s = self._simulation.time_s
        readings = self._simulation.read_sensors()
        self._located = localization.localize(self._located, readings, self._footprint, self._model)
        estimate = localization.estimate(self._located)
        self._wheel_speeds = self.autopilot.update(time_s, estimate, readings)
        self.vehicle.tick(time_s, estimate, readings)

    def _observe(self) -> None:
        state, motion = self._simulation.state, self.autopilot.motion
        self._narrator.tell(state, self._mobility.look(state, TRACE_STEPS / STEPS_PER_S), self._wheel_names)
        estimate = localization.estimate(self._located)
        self._recorder.add(
            **trace_columns(state),
            command=(motion.linear_m_s, motion.yaw_rate_rad_s),
            wheel_command=self._wheel_speeds,
            estimate_position_w=estimate.pose.position_w,
            estimate_quaternion_w=estimate.pose.quaternion_w,
            mode=int(self.autopilot.mode),
            armed=self.autopilot.armed,
            mission_current=self.autopilot.auto.current,
        )

    def _status(self, factor: float) -> LiveStatus:
        state = self._simulation.state
        return LiveStatus(
            time_s=state.time_s,
            real_time_factor=factor,
            mode=self.autopilot.mode.name.title(),
            armed=self.autopilot.armed,
            speed_m_s=float(np.hypot(*state.linear_velocity_w[:2])),
            slip=float(np.abs(state.slip).mean()),
            listeners=self.vehicle.endpoint.station_count,
        )
