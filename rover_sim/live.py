"""The rover as a live vehicle at the pace of the wall clock: no planner, whoever is on the link drives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from rover_sim.autopilot.parameter_file import load_parameters, save_parameters
from rover_sim.autopilot.tuning import tuned_autopilot
from rover_sim.driven_rover import (
    CAMERA_STREAM,
    CONTROL_STEPS,
    LINK_STREAM,
    STEPS_PER_S,
    TRACE_STEPS,
    DrivenRover,
    home,
)
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
from rover_sim.sim.rover import RoverModel
from worlds.scenario import dump_scenario
from worlds.types import World

TLOG = "telemetry.tlog"
FILES = (TLOG, "trace.npz", "mission.waypoints", "mission.plan", "scenario.toml")


def clear(folder: Path) -> None:
    """Remove what an earlier one left, but for the log, which has begun anew with the links."""
    for name in FILES:
        if name != TLOG:
            (folder / name).unlink(missing_ok=True)


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
    faults: str  # those that last; empty without any


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
        self.autopilot = tuned_autopilot(rover.footprint(), home(world), scenario.gravity_m_s2)
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
            self._rover = DrivenRover(world, rover, self.autopilot)
            if eye is not None and port is not None:
                rng = np.random.default_rng([world.seed, CAMERA_STREAM])
                self._photographer = Photographer(world, self._rover.simulation, model, eye, rng)
        except BaseException:
            self.vehicle.close()
            raise
        self._narrator = Narrator(self.vehicle.endpoint)
        self._steps = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._rover.close()
        self.vehicle.close()

    def run(self, stopped: Callable[[], bool], show: Callable[[LiveStatus], None] = lambda _: None) -> bool:
        """Live until ``stopped``; False if the rover left the map before."""
        pace = RealTime()
        while not stopped():
            self.step()
            if self._steps % STEPS_PER_S == 0:
                show(self._status(pace.factor))
            if self._rover.simulation.state.off_map:
                return False
            # What a station says is answered as it comes: a step of the physics takes longer than an answer.
            while (left_s := pace.left_s(self._rover.simulation.time_s)) > 0.0:
                if self.vehicle.endpoint.wait(left_s):
                    self.vehicle.answer(self._rover.simulation.time_s)
        return True

    def step(self) -> None:
        """One step of the physics; links are served at every one, sensors and autopilot at every fifth."""
        if self._steps % CONTROL_STEPS == 0:
            self._control()
        else:
            self.vehicle.answer(self._rover.simulation.time_s)
        if self._steps % TRACE_STEPS == 0:
            self._observe()
            self._keep_parameters()
        self._rover.step()
        self._steps += 1

    def save(self, folder: Path) -> None:
        """Write trace, mission and scenario; the log was written as it came."""
        write_text(folder / "scenario.toml", dump_scenario(self.world.scenario))
        self._rover.recorder.save(folder / "trace.npz")
        self.vehicle.save_plans(folder / "mission.waypoints", folder / "mission.plan")

    def _photograph(self, path: Path) -> bool:
        return self._photographer is not None and self._photographer.take(path)

    def _keep_parameters(self) -> None:
        changes = self.autopilot.parameters.changes
        if self._parameter_file is not None and changes != self._saved:
            save_parameters(self._parameter_file, self.autopilot.parameters)
            self._saved = changes

    def _control(self) -> None:
        readings = self._rover.control()
        self.vehicle.tick(self._rover.simulation.time_s, self._rover.estimate, readings)

    def _observe(self) -> None:
        self._rover.watch(self._narrator)
        self._rover.record(
            mode=int(self.autopilot.mode), armed=self.autopilot.armed, mission_current=self.autopilot.auto.current
        )

    def _status(self, factor: float) -> LiveStatus:
        state = self._rover.simulation.state
        return LiveStatus(
            time_s=state.time_s,
            real_time_factor=factor,
            mode=self.autopilot.mode.name.title(),
            armed=self.autopilot.armed,
            speed_m_s=float(np.hypot(*state.linear_velocity_w[:2])),
            slip=float(np.abs(state.slip).mean()),
            listeners=self.vehicle.endpoint.station_count,
            faults=self._rover.faults.lasting,
        )
