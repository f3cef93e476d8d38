"""The planner's onboard computer on bare sand, with foreign autopilots in the place of our own."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from perception.pipeline import Knowledge, load_knowledge
from planner import navigator
from planner.navigator_state import Decision
from planner.relocation import Located
from rover_sim.autopilot.modes import MissionState, Mode
from rover_sim.mavlink.memory import MemoryEnd
from rover_sim.onboard import OnboardComputer
from tests.ardupilot_mavlink_double import ArduRoverDouble
from tests.foreign_rig import ForeignPair
from tests.mavlink_rig import FOOTPRINT
from tests.px4_mavlink_double import Px4RoverDouble
from tests.test_run_onboard import CAMERA, SAND
from tests.vehicle_double import Motion, VehicleDouble
from worlds.geometry import camera_pose, quaternion_from_euler
from worlds.types import Frame, GroundPlane, Pose, PoseEstimate

HOME = (0.0, 0.0, 0.0)
LOOK_S = 0.5


@pytest.fixture(scope="module")
def knowledge() -> Knowledge:
    return load_knowledge("rendered")


class Drive:
    """A foreign autopilot, its companion and the onboard computer; the rover looks east at first."""

    def __init__(
        self, double: Callable[[MemoryEnd], VehicleDouble], goal_w: tuple[float, float], knowledge: Knowledge
    ) -> None:
        self.pair = ForeignPair(double, start_s=60.0)
        self.pair.rover.motion = Motion(heading_rad=math.pi / 2.0)
        plan = navigator.begin(goal_w, 0.5, FOOTPRINT, (0.0, 0.0))
        self.onboard = OnboardComputer(self.pair.companion, self.pair.double.frame, HOME, plan, knowledge)
        self._look_s = 0.0

    def until(self, done: Callable[[], bool], limit_s: float) -> None:
        end_s = self.pair.time_s + limit_s
        while not done():
            assert self.pair.time_s < end_s, f"not within {limit_s} s; {self.pair.companion.trouble}"
            self.pair.step()
            estimate = self._estimate()
            self.onboard.tick(estimate)
            if self.pair.time_s >= self._look_s:
                self._look_s = self.pair.time_s + LOOK_S
                ground = GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0]))
                pose = camera_pose(estimate.pose, CAMERA)
                frame = Frame(self.pair.time_s, SAND, CAMERA, pose, ground)
                self.onboard.look(frame, partial(Located, estimate=estimate), self.pair.time_s)

    def _estimate(self) -> PoseEstimate:
        motion = self.pair.rover.motion
        yaw = math.pi / 2.0 - motion.heading_rad
        speed = motion.speed_m_s
        return PoseEstimate(
            time_s=self.pair.time_s,
            pose=Pose(np.array([motion.east_m, motion.north_m, 0.0]), quaternion_from_euler(0.0, 0.0, yaw)),
            velocity_w=np.array([speed * math.cos(yaw), speed * math.sin(yaw), 0.0]),
            yaw_rate_rad_s=0.0,
            position_sd_m=0.05,
            yaw_sd_rad=0.02,
        )


@pytest.mark.parametrize("double", [ArduRoverDouble, Px4RoverDouble])
def test_the_planner_drives_it_to_the_goal_and_holds(
    double: Callable[[MemoryEnd], VehicleDouble], knowledge: Knowledge
) -> None:
    drive = Drive(double, (7.0, 2.0), knowledge)
    drive.until(lambda: drive.onboard.end is not None, 60.0)
    assert drive.onboard.end is not None
    assert drive.onboard.end.kind == "arrived"
    motion = drive.pair.rover.motion
    assert math.hypot(motion.east_m - 7.0, motion.north_m - 2.0) < 0.6
    drive.until(lambda: drive.pair.companion.status.mode == Mode.HOLD, 3.0)
    assert drive.onboard.doing == "arrived"


@pytest.mark.parametrize(("double", "faces"), [(ArduRoverDouble, 90.0), (Px4RoverDouble, -90.0)])
def test_where_it_cannot_back_up_it_turns_round_instead(
    double: Callable[[MemoryEnd], VehicleDouble], faces: float, knowledge: Knowledge
) -> None:
    drive = Drive(double, (20.0, 0.0), knowledge)
    pair = drive.pair
    pair.run(1.0)
    back = Decision("back_up", "a test", np.array([[0.0, 0.0], [-1.5, 0.0]]))
    drive.onboard._send(back, drive._estimate(), pair.time_s)
    pair.until(lambda: pair.companion.status.mission_state is MissionState.COMPLETE, 30.0)
    assert pair.companion.trouble is None
    assert pair.rover.motion.east_m == pytest.approx(-1.5, abs=0.35)
    assert math.degrees(pair.rover.motion.heading_rad) == pytest.approx(faces, abs=15.0)


def test_a_person_who_sets_hold_has_the_rover_until_auto_is_set_again(knowledge: Knowledge) -> None:
    drive = Drive(ArduRoverDouble, (9.0, 0.0), knowledge)
    double = drive.pair.double
    assert isinstance(double, ArduRoverDouble)
    drive.until(lambda: drive.pair.rover.motion.east_m > 1.5, 30.0)
    double.set_mode(int(Mode.HOLD))
    drive.until(lambda: drive.onboard.doing == "taken over", 3.0)
    sent, end_s = drive.onboard.counts.missions_sent, drive.pair.time_s + 6.0
    drive.until(lambda: drive.pair.time_s > end_s, 8.0)
    assert (double.custom_mode, drive.onboard.counts.missions_sent) == (Mode.HOLD, sent)
    double.set_mode(int(Mode.AUTO))
    drive.until(lambda: drive.onboard.end is not None, 60.0)
    assert drive.onboard.end is not None
    assert drive.onboard.end.kind == "arrived"
