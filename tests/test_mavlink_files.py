from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_sim.errors import InputError
from rover_sim.mavlink.dialect import Parser
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.mission_file import read_plan, read_plan_areas, read_waypoints, write_plan, write_waypoints
from rover_sim.mavlink.persona import ARDUPILOT, PX4, Persona
from rover_sim.mavlink.plan_items import backing_items, mission_items, turning_items
from rover_sim.mavlink.stack import MavlinkStack
from rover_sim.mavlink.tlog import SIMULATED_EPOCH_S, TlogWriter, read_tlog
from rover_sim.mavlink.wire import WireItem
from tests.mavlink_rig import FOOTPRINT, KinematicRover, Yard
from tests.test_mavlink_fence import PLAN, POINTS
from worlds.scenario import Origin

FRAME = LocalFrame(Origin())
HOME = (0.0, 0.0, 0.0)
FLOAT = st.floats(-1e4, 1e4)
ITEM = st.builds(
    WireItem,
    st.sampled_from([0, 3, 2]),
    st.sampled_from([16, 178, 194, 115]),
    st.tuples(FLOAT, FLOAT, FLOAT, FLOAT),
    st.integers(-900_000_000, 900_000_000),
    st.integers(-1_800_000_000, 1_800_000_000),
    FLOAT,
)
PLAN_HOME = mission_items([], FRAME, HOME)[0]


def test_waypoints_text(tmp_path: Path) -> None:
    path = tmp_path / "mission.waypoints"
    write_waypoints(path, mission_items([(0.0, 0.0, 0.5)], FRAME, HOME))
    assert path.read_text() == (
        "QGC WPL 110\n"
        "0\t1\t0\t16\t0.0\t0.0\t0.0\t0.0\t38.4064\t-110.7919\t1380.0\t1\n"
        "1\t0\t3\t16\t0.0\t0.0\t0.0\t0.0\t38.4064\t-110.7919\t0.5\t1\n"
    )


@settings(max_examples=40)
@given(st.lists(ITEM, max_size=5))
def test_both_files_read_back_as_written(tmp_path_factory: pytest.TempPathFactory, items: list[WireItem]) -> None:
    folder = tmp_path_factory.mktemp("files")
    whole = [PLAN_HOME, *items]
    write_waypoints(folder / "m.waypoints", whole)
    write_plan(folder / "m.plan", whole, 0.6)
    # Numbers below 1e-4 are written to ten decimals, so they read back nearly.
    for read in (read_waypoints(folder / "m.waypoints"), read_plan(folder / "m.plan")):
        assert [(item.frame, item.command, item.x, item.y) for item in read] == [
            (item.frame, item.command, item.x, item.y) for item in whole
        ]
        for back, item in zip(read, whole, strict=True):
            assert (*back.params, back.z) == pytest.approx((*item.params, item.z), abs=1e-9)


def test_the_plan_has_what_qgroundcontrol_asks_for(tmp_path: Path) -> None:
    path = tmp_path / "mission.plan"
    write_plan(path, backing_items([(-1.0, 0.0, 0.0)], FRAME, HOME), 0.6)
    plan = json.loads(path.read_text())
    assert plan["fileType"] == "Plan"
    assert plan["version"] == 1
    assert plan["mission"]["version"] == 2
    assert plan["mission"]["plannedHomePosition"] == [38.4064, -110.7919, 1380.0]
    assert [item["command"] for item in plan["mission"]["items"]] == [194, 16, 194]
    assert [item["doJumpId"] for item in plan["mission"]["items"]] == [1, 2, 3]
    assert all(len(item["params"]) == 7 for item in plan["mission"]["items"])
    assert plan["geoFence"]["version"] == plan["rallyPoints"]["version"] == 2


def test_fence_and_rally_points_of_a_plan_read_back_as_written(tmp_path: Path) -> None:
    path = tmp_path / "mission.plan"
    write_plan(path, [PLAN_HOME], 0.6, PLAN, POINTS)
    plan = json.loads(path.read_text())
    assert [len(polygon["polygon"]) for polygon in plan["geoFence"]["polygons"]] == [4, 3]
    assert [polygon["inclusion"] for polygon in plan["geoFence"]["polygons"]] == [True, False]
    assert plan["geoFence"]["circles"][0]["circle"]["radius"] == 0.5
    assert len(plan["geoFence"]["breachReturn"]) == 3
    assert len(plan["rallyPoints"]["points"]) == 2
    assert read_plan_areas(path) == (PLAN, POINTS)
    assert read_plan(path) == [PLAN_HOME]


@pytest.mark.parametrize(
    "text",
    [
        "[]",
        '{"geoFence": {}}',
        '{"geoFence": {"polygons": [{"polygon": [[1, 2]]}]}, "rallyPoints": {}}',
        '{"geoFence": {"circles": [{"circle": {"center": [1], "radius": 2}, "inclusion": true}]}, "rallyPoints": {}}',
        '{"geoFence": {}, "rallyPoints": {"points": [[1, 2, null]]}}',
        '{"geoFence": [], "rallyPoints": {}}',
    ],
)
def test_bad_areas_of_a_plan_are_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.plan"
    path.write_text(text)
    with pytest.raises(InputError, match="geoFence") as caught:
        read_plan_areas(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("persona", [ARDUPILOT, PX4])
def test_a_plan_is_taken_over_as_if_it_were_uploaded(tmp_path: Path, persona: Persona) -> None:
    mission = mission_items([(2.0, 0.0, 0.0), (2.0, 2.0, 0.0)], FRAME, HOME)
    write_plan(tmp_path / "a.plan", mission, 0.6, PLAN, POINTS)
    yard = Yard(persona=persona)
    yard.vehicle.load_plan(tmp_path / "a.plan")
    assert [item.x for item in yard.vehicle.store.items] == [item.x for item in mission[persona is PX4 :]]
    assert (list(yard.vehicle.fence.items), list(yard.vehicle.rally.items)) == (PLAN, POINTS)
    yard.vehicle.save_plans(tmp_path / "b.waypoints", tmp_path / "b.plan")
    a, b = (json.loads((tmp_path / name).read_text()) for name in ("a.plan", "b.plan"))
    assert (b["mission"]["items"], b["geoFence"]) == (a["mission"]["items"], a["geoFence"])
    assert b["rallyPoints"] == a["rallyPoints"]
    write_plan(tmp_path / "c.plan", mission[:1], 0.6)
    yard.vehicle.load_plan(tmp_path / "c.plan")
    assert yard.vehicle.store.items == yard.vehicle.fence.items == ()
    write_plan(tmp_path / "d.plan", mission, 0.6, PLAN[:0], [WireItem(3, 5100, (0, 0, 0, 0), -384064000, 0, 0.0)])
    with pytest.raises(InputError, match=r"d.plan: rally, item 0 \(command 5100\): refused with result 5"):
        yard.vehicle.load_plan(tmp_path / "d.plan")


def test_nan_is_null_in_a_plan(tmp_path: Path) -> None:
    path = tmp_path / "mission.plan"
    write_plan(path, [PLAN_HOME, WireItem(3, 16, (0.0, 0.0, 0.0, math.nan), 1, 2, 3.0)], 0.6)
    assert json.loads(path.read_text())["mission"]["items"][0]["params"][3] is None
    assert math.isnan(read_plan(path)[1].params[3])


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.waypoints", "nonsense\n", "line 1"),
        ("a.waypoints", "QGC WPL 110\n0\t1\t0\n", "line 2: 3 fields"),
        ("a.waypoints", "QGC WPL 110\n" + "\t".join(["0", "1", "0", "16", *["x"] * 7, "1"]), "line 2"),
        ("a.waypoints", "QGC WPL 110\n" + "\t".join(["0", "1", "0", "16", *["nan"] * 7, "1"]), "line 2"),
        ("a.plan", "{", "line 1: not JSON"),
        ("a.plan", "[]", "mission"),
        ("a.plan", '{"mission": {"plannedHomePosition": [1, 2, 3], "items": [{"type": "Survey"}]}}', r"items\[0\]"),
        ("a.plan", '{"mission": {"plannedHomePosition": [1, null, 3], "items": []}}', "mission"),
    ],
)
def test_bad_files_are_one_line(tmp_path: Path, name: str, text: str, says: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    read = read_plan if name.endswith("plan") else read_waypoints
    with pytest.raises(InputError, match=says) as caught:
        read(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="cannot be read"):
        read(tmp_path / "missing")


def test_tlog_record_bytes(tmp_path: Path) -> None:
    path = tmp_path / "a.tlog"
    log = TlogWriter(path)
    log.record(b"\xfd\x00" + bytes(10), 1.5)
    log.close()
    # 2020-01-01T00:00:01.5Z in microseconds = 1577836801500000 = 0x59b08c2112360
    assert path.read_bytes() == (1577836801500000).to_bytes(8, "big") + b"\xfd\x00" + bytes(10)
    assert list(read_tlog(path)) == [(SIMULATED_EPOCH_S + 1.5, b"\xfd\x00" + bytes(10))]


def test_a_log_cut_short_ends_at_its_last_whole_record(tmp_path: Path) -> None:
    path = tmp_path / "a.tlog"
    log = TlogWriter(path)
    for _ in range(3):
        log.record(b"\xfd\x00" + bytes(10), 1.0)
    log.close()
    path.write_bytes(path.read_bytes()[:-1])
    assert len(list(read_tlog(path))) == 2


def drive(path: Path) -> bytes:
    from rover_sim.autopilot.autopilot import Autopilot

    rover, autopilot = KinematicRover(), Autopilot(FOOTPRINT, HOME)
    stack = MavlinkStack(Origin(), autopilot, tlog=path)
    for tick in range(480):
        estimate, readings = rover.estimate(), rover.readings()
        wheels = autopilot.update(rover.time_s, estimate, readings)
        stack.tick(rover.time_s, estimate, readings)
        rover.move(wheels, 1.0 / 48.0)
        if tick == 10:
            stack.companion.upload(mission_items([(2.0, 0.0, 0.0)], stack.frame, HOME), rover.time_s)
            stack.companion.arm()
        if tick == 60:
            stack.companion.start_mission()
    stack.close()
    return path.read_bytes()


def test_the_log_of_a_run_holds_both_sides_and_repeats_to_the_byte(tmp_path: Path) -> None:
    assert drive(tmp_path / "a.tlog") == drive(tmp_path / "b.tlog")
    parser = Parser()
    messages = [parser.datagram(frame)[0] for _, frame in read_tlog(tmp_path / "a.tlog")]
    vehicle = [message for message in messages if message.get_srcComponent() == 1]
    companion = [message for message in messages if message.get_srcComponent() == 191]
    names = {message.get_type() for message in vehicle}
    assert names >= {"HEARTBEAT", "GLOBAL_POSITION_INT", "ATTITUDE", "MISSION_REQUEST_INT", "MISSION_ACK"}
    assert {message.get_type() for message in companion} >= {"MISSION_COUNT", "MISSION_ITEM_INT", "COMMAND_LONG"}
    # One counter for all that the vehicle says in the log: a log viewer sees no loss.
    assert [message.get_seq() for message in vehicle] == [number % 256 for number in range(len(vehicle))]


def test_turning_items_carry_a_compass_heading() -> None:
    _, turn = turning_items(0.0, FRAME, HOME)
    assert (turn.command, turn.params[0]) == (115, 90.0)
