"""Faults in whole traverses and in a served rover: what was done about them, and how it is told."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest

from rover_sim.cli import main
from rover_sim.fault_log import FaultLog, acts, idle_notes
from rover_sim.live import LiveRover
from rover_sim.mavlink.persona import PERSONAS
from rover_sim.mavlink.vehicle_watch import VehicleStatus
from rover_sim.sim.rover import load_rover
from rover_sim.traverse import RunOptions, open_traverse
from worlds.build import build_world
from worlds.fault_events import Event
from worlds.scenario import (
    Camera,
    Goal,
    Rocks,
    Scenario,
    Sensors,
    SoilChoice,
    Terrain,
    check_scenario,
    dump_scenario,
)

ROVER = load_rover("husky")


def plain(*events: Event, limit_s: float = 12.0) -> Scenario:
    """Bare firm ground, driven by the scanner: the goal is 8 m ahead and takes 9 s."""
    return Scenario(
        name="plain",
        terrain=Terrain(kind="flat", size_m=(14.0, 10.0), resolution_m=0.1),
        rocks=Rocks(cfa=0.0),
        soil=SoilChoice(preset="firm"),
        goal=Goal(position_m=(8.0, 0.0), time_limit_s=limit_s),
        sensors=Sensors(laser=True),
        camera=Camera(rate_hz=0.0),
        event=events,
    )


def drive(scenario: Scenario) -> dict[str, Any]:
    check_scenario(scenario, "test")
    with open_traverse(build_world(scenario, 0), ROVER, RunOptions()) as traverse:
        return traverse.run()


def said(summary: dict[str, Any], by: str) -> list[str]:
    return [response["text"] for response in summary["faults"]["responses"] if response["by"] == by]


def test_without_its_inertial_unit_the_autopilot_stops_for_want_of_a_pose() -> None:
    summary = drive(plain(Event(kind="sensor_loss", sensor="imu", time_s=2.0), limit_s=5.0))
    assert summary["reason"] == "timeout"
    assert said(summary, "autopilot")[:2] == ["Pose lost: pose estimate is 1.0 s old, hold", "mode hold"]
    assert summary["failsafe_stops"] == 1
    assert summary["faults"]["events"] == [
        {"kind": "sensor_loss", "fault": "imu silent", "time_s": 2.0, "over_s": None, "happened": True}
    ]


def test_after_a_gap_of_its_inertial_unit_the_rover_goes_on() -> None:
    summary = drive(plain(Event(kind="sensor_loss", sensor="imu", time_s=3.0, duration_s=1.5), limit_s=30.0))
    assert summary["reason"] == "goal"
    assert said(summary, "autopilot")[2:4] == ["Auto: pose estimate is 1.2 s old", "mode auto"]


@pytest.mark.parametrize("sensor", ["magnetometer", "gnss"])
def test_the_goal_is_reached_without_compass_or_receiver(sensor: Any) -> None:
    summary = drive(plain(Event(kind="sensor_loss", sensor=sensor, time_s=3.0)))
    assert summary["reason"] == "goal"
    assert said(summary, "planner")[-1] == "arrived"


def test_a_silent_scanner_ends_the_run_unless_it_comes_back() -> None:
    lost = Event(kind="sensor_loss", sensor="laser", time_s=2.0)
    assert drive(plain(lost))["detail"] == "the laser has been silent for 1.0 s"
    assert drive(plain(msgspec.structs.replace(lost, duration_s=0.8)))["reason"] == "goal"


def test_a_jump_of_the_receiver_leads_past_the_goal() -> None:
    summary = drive(plain(Event(kind="gnss_jump", time_s=3.0, offset_m=(0.0, 2.0, 0.0))))
    assert summary["reason"] == "goal_missed"
    assert summary["goal_distance_m"] == pytest.approx(2.0, abs=0.5)


def test_a_loss_of_power_stops_the_rover_until_it_is_over() -> None:
    cut = Event(kind="power_loss", time_s=2.0, duration_s=1.5)
    summary = drive(plain(cut))
    assert summary["reason"] == "goal"
    assert summary["sim_time_s"] > 10.0
    assert summary["faults"]["events"][0]["over_s"] == 3.5
    stuck = drive(plain(msgspec.structs.replace(cut, duration_s=None), limit_s=9.5))
    assert stuck["reason"] == "timeout"
    assert "Stuck: no progress for 6 s, hold" in said(stuck, "autopilot")


def test_what_comes_after_the_end_did_not_happen() -> None:
    summary = drive(plain(Event(kind="power_loss", time_s=11.5)))
    assert summary["reason"] == "goal"
    assert summary["faults"]["events"][0]["happened"] is False
    assert summary["faults"]["responses"] == []


def test_texts_modes_and_intents_count_from_the_first_fault_on() -> None:
    log = FaultLog([Event(kind="power_loss", time_s=2.0)])
    log.hear(1.0, VehicleStatus(mode=10, texts=((0.5, 6, "ready"),)), "drive")
    log.hear(2.0, VehicleStatus(mode=10, texts=((0.5, 6, "ready"), (2.0, 3, "stuck"))), "drive")
    log.hear(3.0, VehicleStatus(mode=4, texts=((2.0, 3, "stuck"), (3.0, 3, "stuck"))), "wait")
    told = [(entry["time_s"], entry["by"], entry["text"]) for entry in log.summary(4.0)["responses"]]
    assert told == [
        (2.0, "autopilot", "stuck"),
        (3.0, "autopilot", "stuck"),
        (3.0, "autopilot", "mode hold"),
        (3.0, "planner", "wait"),
    ]


def test_begin_and_end_are_told_once() -> None:
    log = FaultLog([Event(kind="stuck_wheel", time_s=1.0, duration_s=1.0, wheel=2, stuck="held")])
    told = [text for step in range(30) for text in log.turns(0.1 * step)]
    assert told == ["fault: wheel 2 blocked", "over: wheel 2 blocked"]
    assert log.lasting == ""


def test_what_the_autopilot_does_not_have_is_said_to_mean_nothing_to_it() -> None:
    late = Event(kind="late_physics", time_s=1.0, stall_s=0.5)
    encoder = Event(kind="sensor_loss", time_s=1.0, sensor="encoder")
    assert (acts(late, "built-in"), acts(late, "px4"), acts(late, "ardupilot")) == (False, True, True)
    assert (acts(encoder, "built-in"), acts(encoder, "px4")) == (True, False)
    assert idle_notes([encoder, late], "built-in") == [
        "event[1], physics 0.5 s late: means nothing to the built-in autopilot"
    ]


def test_a_served_rover_loses_its_wheel_and_stations_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    world = build_world(plain(Event(kind="stuck_wheel", time_s=0.2, wheel=1, stuck="held")), 0)
    with LiveRover(world, ROVER, PERSONAS["ardupilot"]) as live:
        heard: list[str] = []
        monkeypatch.setattr(live._narrator, "say", lambda _, text: heard.append(text))
        for _ in range(60):
            live.step()
        assert heard == ["SIM: fault: wheel 1 blocked"]
        assert live._status(1.0).faults == "wheel 1 blocked"


def test_the_command_tells_faults_and_refuses_a_wheel_that_is_not_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = plain(Event(kind="stuck_wheel", time_s=0.5, wheel=0, stuck="free"), limit_s=1.5)
    path = tmp_path / "plain.toml"
    path.write_text(dump_scenario(scenario), encoding="utf-8")
    assert main(["run", str(path), "--out", str(tmp_path / "out")]) == 1
    told = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["faults"]
    assert told["events"][0]["fault"] == "wheel 0 without its motor"
    assert "wheel 0 without its motor, from 0.5 s to the end" in " ".join(capsys.readouterr().out.split())
    path.write_text(path.read_text(encoding="utf-8").replace("wheel = 0", "wheel = 7"), encoding="utf-8")
    assert main(["run", str(path), "--out", str(tmp_path / "out")]) == 2
    assert "plain: event[0].wheel = 7: husky has the wheels 0 to 3" in capsys.readouterr().err


def test_the_example_meets_four_faults_and_reaches_its_goal(tmp_path: Path) -> None:
    example = Path(__file__).parent.parent / "examples" / "faults.toml"
    assert main(["run", str(example), "--out", str(tmp_path / "out")]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert [(event["kind"], event["happened"]) for event in summary["faults"]["events"]] == [
        ("stuck_wheel", True),
        ("gnss_jump", True),
        ("sensor_loss", True),
        ("power_loss", True),
    ]
    assert "Stuck: no progress for 6 s, hold" in said(summary, "autopilot")
