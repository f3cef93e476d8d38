from __future__ import annotations

import numpy as np
import pytest

from rover_sim.autopilot.autopilot import Autopilot
from rover_sim.autopilot.mission import DriveTo, Mission
from rover_sim.autopilot.modes import MissionState, Mode
from rover_sim.autopilot.parameters import TABLE, ParameterTable
from tests.mavlink_rig import FOOTPRINT, KinematicRover
from tests.test_autopilot_mission import Drive

FAR = DriveTo((50.0, 0.0, 0.0))


def driving() -> Drive:
    drive = Drive()
    drive.begin(FAR)
    drive.until(lambda: drive.rover.x_m > 1.0)
    return drive


def test_slip_beyond_40_percent_for_a_wheel_revolution_holds() -> None:
    drive = driving()
    drive.rover.slip = 0.7
    travel = 0.0
    while drive.autopilot.mode is Mode.AUTO:
        drive.step()
        travel += drive.autopilot.motion.linear_m_s / 48.0
    assert drive.autopilot.mode is Mode.HOLD
    assert drive.autopilot.auto.state is MissionState.PAUSED
    assert any(text.startswith("Slip stop") for text in drive.texts)
    revolution = 2 * np.pi * FOOTPRINT.wheel_radius_m
    assert revolution <= travel < 1.6 * revolution  # the slip is averaged over 0.25 m first


def test_slip_below_the_limit_drives_on() -> None:
    drive = driving()
    drive.rover.slip = 0.3
    drive.until(lambda: drive.rover.x_m > 4.0)
    assert drive.autopilot.mode is Mode.AUTO


def test_the_slip_stop_can_be_switched_off() -> None:
    drive = driving()
    assert drive.autopilot.parameters.set("FS_SLIP_ENABLE", 0)
    drive.rover.slip = 0.6
    drive.until(lambda: drive.rover.x_m > 2.5)
    assert drive.autopilot.mode is Mode.AUTO


def test_after_a_slip_stop_a_new_task_gets_its_full_revolution() -> None:
    drive = driving()
    drive.rover.slip = 0.9
    drive.until(lambda: drive.autopilot.mode is Mode.HOLD)
    drive.rover.slip = 0.0
    drive.autopilot.set_mission(Mission((FAR,)))
    assert drive.autopilot.set_mode(Mode.AUTO) is None
    drive.until(lambda: drive.rover.x_m > 3.0)
    assert drive.autopilot.mode is Mode.AUTO


def test_tilt_must_last_to_trip() -> None:
    drive = driving()
    drive.rover.roll_rad = np.deg2rad(40.0)
    for _ in range(10):
        drive.step()
    drive.rover.roll_rad = 0.0
    drive.step()
    assert drive.autopilot.mode is Mode.AUTO
    drive.rover.roll_rad = np.deg2rad(40.0)
    drive.until(lambda: drive.autopilot.mode is Mode.HOLD, 1.0)
    assert any(text.startswith("Tilt 40 deg") for text in drive.texts)
    drive.autopilot.disarm()
    assert drive.autopilot.arm() == "tilted by 40 deg"


def test_a_leaning_rover_may_drive_back_but_not_lean_more() -> None:
    """Held for ever where it stopped it would never stand upright again."""
    drive = driving()
    drive.rover.roll_rad = np.deg2rad(40.0)
    drive.until(lambda: drive.autopilot.mode is Mode.HOLD, 1.0)
    assert drive.autopilot.set_mode(Mode.AUTO) is None
    drive.rover.roll_rad = np.deg2rad(42.0)
    for _ in range(100):
        drive.step()
    assert drive.autopilot.mode is Mode.AUTO
    drive.rover.roll_rad = np.deg2rad(44.0)
    drive.until(lambda: drive.autopilot.mode is Mode.HOLD, 1.0)


def test_once_upright_the_limit_is_what_it_was() -> None:
    drive = driving()
    drive.rover.roll_rad = np.deg2rad(40.0)
    drive.until(lambda: drive.autopilot.mode is Mode.HOLD, 1.0)
    assert drive.autopilot.set_mode(Mode.AUTO) is None
    for roll_deg in (30.0, 36.0):
        drive.rover.roll_rad = np.deg2rad(roll_deg)
        drive.step()
    drive.until(lambda: drive.autopilot.mode is Mode.HOLD, 1.0)


def test_no_progress_holds() -> None:
    drive = driving()
    drive.autopilot.parameters.set("FS_SLIP_ENABLE", 0)
    drive.rover.slip = 1.0
    drive.until(lambda: drive.autopilot.mode is Mode.HOLD, 8.0)
    assert any(text.startswith("Stuck") for text in drive.texts)


def test_pose_lost_holds_and_forbids_auto() -> None:
    drive = driving()
    drive.rover.position_sd_m = 9.0
    drive.step()
    assert drive.autopilot.mode is Mode.HOLD
    assert drive.autopilot.set_mode(Mode.AUTO) == "position uncertain by 9.0 m"


@pytest.mark.parametrize("sd_m", [float("nan"), float("inf")])
def test_an_uncertainty_that_is_no_number_is_a_lost_pose(sd_m: float) -> None:
    drive = driving()
    drive.rover.position_sd_m = sd_m
    drive.step()
    assert drive.autopilot.mode is Mode.HOLD


def test_no_estimate_and_an_old_one_are_a_lost_pose() -> None:
    drive = driving()
    old = drive.rover.estimate()
    readings = drive.rover.readings()
    drive.autopilot.update(drive.rover.time_s + 1.5, old, readings)
    assert drive.autopilot.mode is Mode.HOLD
    autopilot = Autopilot(FOOTPRINT, (0.0, 0.0, 0.0))
    assert autopilot.arm() == "no pose estimate yet"
    autopilot.update(0.0, None, readings)
    assert autopilot.arm() == "no pose estimate"


def test_disarmed_wheels_stand_still_at_once() -> None:
    drive = driving()
    drive.autopilot.disarm()
    assert drive.autopilot.update(drive.rover.time_s, drive.rover.estimate(), drive.rover.readings()) == (0, 0, 0, 0)
    assert drive.autopilot.auto.state is MissionState.PAUSED


def test_auto_without_a_mission_and_unknown_modes_are_refused() -> None:
    rover = KinematicRover()
    autopilot = Autopilot(FOOTPRINT, (0.0, 0.0, 0.0))
    autopilot.update(0.0, rover.estimate(), rover.readings())
    assert autopilot.set_mode(Mode.AUTO) == "no mission"
    assert autopilot.set_mode(77) == "mode 77 is not available"
    assert autopilot.set_mode(Mode.MANUAL) is None


def test_parameters_keep_their_limits() -> None:
    table = ParameterTable()
    assert table.set("WP_RADIUS", 0.5)
    assert table["WP_RADIUS"] == 0.5
    for bad in (float("nan"), float("inf"), -1.0, 11.0):
        assert not table.set("WP_RADIUS", bad)
    assert table["WP_RADIUS"] == 0.5
    assert table.set("FS_SLIP_ENABLE", 0.2)
    assert table["FS_SLIP_ENABLE"] == 0.0
    assert all(
        len(parameter.name) <= 16 and parameter.low <= parameter.default <= parameter.high for parameter in TABLE
    )


@pytest.mark.parametrize("name", ["FS_TILT_ENABLE", "FS_STUCK_ENABLE"])
def test_tilt_and_stuck_can_be_switched_off(name: str) -> None:
    drive = driving()
    drive.autopilot.parameters.set("FS_SLIP_ENABLE", 0)
    assert drive.autopilot.parameters.set(name, 0)
    if name == "FS_TILT_ENABLE":
        drive.rover.roll_rad = np.deg2rad(40.0)
    else:
        drive.rover.slip = 1.0
    for _ in range(8 * 48):
        drive.step()
    assert drive.autopilot.mode is Mode.AUTO
