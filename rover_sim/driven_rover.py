"""What a run and a served rover share: physics, sensors, pose filter and autopilot of one rover, and its trace."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from planner import localization
from planner.landmarks import LandmarkMap, watch
from planner.localization import SensorModel, model_without_satellites
from planner.relocation import Located, moved
from rover_sim.autopilot.modes import Severity
from rover_sim.fault_log import AutopilotKind, FaultLog
from rover_sim.sim.mobility_events import MobilityLog
from rover_sim.sim.recorder import TraceRecorder
from rover_sim.sim.rover_urdf import wheel_names
from rover_sim.sim.simulation import Simulation
from rover_sim.sim.vehicle_state import trace_columns
from worlds.geometry import euler_from_quaternion

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from planner.localization import LocalizationState
    from planner.mobility import Command
    from rover_sim.mavlink.narrator import Narrator
    from rover_sim.sim.rover import RoverModel
    from worlds.types import GroundPlane, Observation, PoseEstimate, SensorReadings, Vector3, World

STEPS_PER_S = 240  # unless an autopilot from outside wants another rate; what is counted in steps goes with it
CONTROL_STEPS = 5  # sensors, estimate, autopilot and link at 48 Hz
TRACE_STEPS = 10  # trace and judge at 24 Hz
SENSOR_STREAM, CAMERA_STREAM, LASER_STREAM, LINK_STREAM, SURVEY_STREAM = 101, 102, 103, 104, 106  # of the seed
SURVEY_SD_M, SURVEY_SD_RAD = 0.02, 0.002  # of the start, where no GNSS tells


def home(world: World) -> Vector3:
    """The ground below the start, metres."""
    return (*world.scenario.rover.start_m, float(world.start.position_w[2]))


class Driver(Protocol):
    """Who turns the wheels: the built-in autopilot, or outputs from outside."""

    @property
    def motion(self) -> Command:
        """The motion commanded by the last update."""
        ...

    @property
    def wheel_speed_rad_s(self) -> tuple[float, ...]:
        """Wheel speeds (left side front to rear, then right side) for the next step."""
        ...

    def update(self, time_s: float, estimate: PoseEstimate, readings: SensorReadings) -> tuple[float, ...]:
        """Hear the sensors; returns the wheel speeds."""
        ...


class DrivenRover:
    """A rover at rest on a surveyed point, to be stepped; holds a physics client until it is closed."""

    def __init__(
        self,
        world: World,
        rover: RoverModel,
        driver: Driver,
        steps_per_s: int = STEPS_PER_S,
        autopilot: AutopilotKind = "built-in",
    ) -> None:
        """``autopilot``: whose sensors they are that faults befall."""
        gravity_m_s2 = world.scenario.gravity_m_s2
        self._driver, self.footprint, self._trace_s = driver, rover.footprint(), TRACE_STEPS / steps_per_s
        sensor_rng = np.random.default_rng([world.seed, SENSOR_STREAM])
        self.simulation = Simulation(world, rover, sensor_rng, time_step_s=1.0 / steps_per_s)
        self.faults = FaultLog(world.scenario.event, autopilot)
        self.recorder, self.mobility = TraceRecorder(), MobilityLog(rover, gravity_m_s2)
        self._wheel_names, self._camera_b = wheel_names(rover), rover.camera(world.scenario.camera).position_b
        self.sensor_model, self.located = self._at_rest(world)
        by_rocks = not world.scenario.sensors.gnss and world.scenario.sensors.stereo
        self._landmarks = LandmarkMap() if by_rocks else None
        self.estimate: PoseEstimate = localization.estimate(self.located)

    def _at_rest(self, world: World) -> tuple[SensorModel, LocalizationState]:
        """The belief at the start: with GNSS on the home point and turned as the compass says, else as surveyed."""
        readings, gravity = self.simulation.read_sensors(), world.scenario.gravity_m_s2
        if world.scenario.sensors.gnss:
            x, y, z = home(world)
            place, model = (x, y, z + self.footprint.wheel_radius_m), SensorModel(gravity_m_s2=gravity)
            return model, localization.start(readings, place, model=model)
        # A survey measures the rover as it has come to rest: on rough ground that may have turned it by degrees.
        model, pose = model_without_satellites(gravity), self.simulation.state.pose
        off = np.random.default_rng([world.seed, SURVEY_STREAM]).standard_normal(6)
        x, y, z = (pose.position_w + SURVEY_SD_M * off[:3]).tolist()
        yaw_off, roll_off, pitch_off = (SURVEY_SD_RAD * off[3:]).tolist()
        roll, pitch, yaw = euler_from_quaternion(pose.quaternion_w)
        attitude = roll + roll_off, pitch + pitch_off, yaw + yaw_off
        return model, localization.start(readings, (x, y, z), SURVEY_SD_M, model, (attitude, SURVEY_SD_RAD))

    def close(self) -> None:
        """End the physics."""
        self.simulation.close()

    def step(self) -> None:
        """One step of the physics, under the wheel speeds of the driver."""
        self.simulation.step(self._driver.wheel_speed_rad_s)

    def control(self) -> SensorReadings:
        """Sensors, estimate, driver; the readings are for the link."""
        readings = self.simulation.read_sensors()
        self.located = localization.localize(self.located, readings, self.footprint, self.sensor_model)
        self.estimate = localization.estimate(self.located)
        self._driver.update(self.simulation.time_s, self.estimate, readings)
        return readings

    def locate(self, observation: Observation) -> Located:
        """Correct the belief by the rocks of a picture taken now; without a map of landmarks nothing changes."""
        before = self.estimate
        if self._landmarks is None:
            return Located(observation, before)
        watched = watch(self.located, self._landmarks, observation, before, self._camera_b)
        self.located, self._landmarks = watched.state, watched.landmarks
        self.estimate = localization.estimate(self.located)
        return Located(moved(observation, before, self.estimate), self.estimate, watched.lost)

    def watch(self, narrator: Narrator) -> None:
        """Look for mobility events of the true state, and for faults, and have them told."""
        state = self.simulation.state
        for text in self.faults.turns(state.time_s):
            narrator.say(Severity.WARNING, f"SIM: {text}")
        narrator.tell(state, self.mobility.look(state, self._trace_s), self._wheel_names)

    def record(self, **more: ArrayLike) -> None:
        """One row of the trace, with more columns of the caller's."""
        state, motion = self.simulation.state, self._driver.motion
        self.recorder.add(
            **trace_columns(state),
            command=(motion.linear_m_s, motion.yaw_rate_rad_s),
            wheel_command=self._driver.wheel_speed_rad_s,
            estimate_position_w=self.estimate.pose.position_w,
            estimate_quaternion_w=self.estimate.pose.quaternion_w,
            estimate_covariance_m2=self.located.place_covariance[:2, :2].ravel(),
            **more,
        )

    def ground(self) -> GroundPlane:
        """The plane that the rover believes to stand on."""
        return localization.ground_plane(self.located, self.footprint.wheel_radius_m)
