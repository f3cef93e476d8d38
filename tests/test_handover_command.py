"""The handover command as a user meets it: plans of all kinds, files, our own vehicles on UDP, one line a mistake."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from rover_sim.autopilot.modes import Mode
from rover_sim.cli import main
from rover_sim.mavlink.dialect import Packer, mavlink
from rover_sim.mavlink.geodesy import GeoPoint, LocalFrame
from rover_sim.mavlink.mission_file import read_plan, read_waypoints, write_plan, write_waypoints
from rover_sim.mavlink.persona import PERSONAS
from rover_sim.mavlink.plan_items import home_item, mission_items
from rover_sim.mavlink.signing import Signing, open_signing
from rover_sim.mavlink.tlog import read_tlog
from rover_sim.mavlink.transport import parse_url
from rover_sim.mavlink.udp import UdpIn
from rover_sim.mavlink.wire import WAYPOINT, WireItem
from rover_sim.pacing import unix_time_s
from tests.mavlink_live import LiveRover
from worlds.scenario import Origin

HOME = (0.0, 0.0, 0.0)
YARD = """
name = "yard"
[terrain]
kind = "flat"
size_m = [14.0, 14.0]
resolution_m = 0.1
[soil]
preset = "firm"
[rover]
start_m = [-4.0, 0.0]
heading_deg = 0.0
[goal]
position_m = [4.0, 0.0]
"""


def mission(folder: Path, *places: tuple[float, float]) -> Path:
    path = folder / "mission.plan"
    items = mission_items([(x, y, 0.0) for x, y in places], LocalFrame(Origin()), HOME, 0.6)
    write_plan(path, items, 0.6)
    return path


@contextmanager
def live(persona: str, signing: Signing | None = None) -> Iterator[tuple[LiveRover, str]]:
    """A rover without physics that waits on a port, and the URL that leads there."""
    free = UdpIn(parse_url("udpin:127.0.0.1:0"))
    port = free.port
    free.close()
    rover = LiveRover(f"udpin:127.0.0.1:{port}", PERSONAS[persona], signing=signing)
    rover.start()
    try:
        yield rover, f"udpout:127.0.0.1:{port}"
    finally:
        rover.close()


@pytest.mark.parametrize("persona", PERSONAS)
def test_our_own_vehicle_as_each_persona_takes_a_mission_and_drives_it(persona: str, tmp_path: Path) -> None:
    plan, out = mission(tmp_path, (1.5, 0.0), (1.5, 0.8)), tmp_path / "out"
    with live(persona) as (rover, url):
        command = ["handover", "--mission", str(plan), "--autopilot", url, "--out", str(out), "--limit", "60"]
        assert main(command) == 0
        stored = rover.vehicle.store.items
        assert [(item.command, item.x, item.y) for item in stored if item.command == WAYPOINT][-2:] == [
            (item.command, item.x, item.y) for item in read_plan(plan)[-2:]
        ]
        assert rover.autopilot.mode is Mode.HOLD
        assert not rover.autopilot.armed  # a vehicle does not move unless it is asked to
        table = json.loads((out / "summary.json").read_text())
        assert (table["reason"], table["waypoints"], table["started"]) == ("uploaded", 2, False)
        assert main([*command, "--arm-and-start"]) == 0
        assert math.hypot(rover.rover.x_m - 1.5, rover.rover.y_m - 0.8) < 0.5
        assert rover.autopilot.mode is Mode.HOLD
    table = json.loads((out / "summary.json").read_text())
    assert (table["success"], table["reason"], table["waypoints_reached"]) == (True, "complete", 2)
    assert len(list(read_tlog(out / "telemetry.tlog"))) > 50


def test_ctrl_c_holds_the_vehicle(tmp_path: Path) -> None:
    import signal

    plan, out = mission(tmp_path, (30.0, 0.0)), tmp_path / "out"
    with live("ardupilot") as (rover, url):

        def interrupt() -> None:
            rover.until(lambda: rover.rover.x_m > 0.2, 20.0)
            signal.raise_signal(signal.SIGINT)

        person = threading.Thread(target=interrupt)
        person.start()
        assert main(["handover", "--mission", str(plan), "--autopilot", url, "--out", str(out), "--arm-and-start"]) == 1
        person.join()
        assert rover.autopilot.mode is Mode.HOLD
    assert json.loads((out / "summary.json").read_text())["reason"] == "aborted"


def test_nobody_there_is_one_line_and_exit_code_3(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = mission(tmp_path, (1.0, 0.0))
    free = UdpIn(parse_url("udpin:127.0.0.1:0"))
    url = f"udpout:127.0.0.1:{free.port}"
    free.close()
    command = ["handover", "--mission", str(plan), "--autopilot", url, "--wait", "0.5", "--out", str(tmp_path / "o")]
    assert main(command) == 3
    assert capsys.readouterr().err.strip() == (
        f"rover-sim handover: --autopilot {url}: no autopilot heard within 0.5 s"
    )
    assert json.loads((tmp_path / "o" / "summary.json").read_text())["reason"] == "no_vehicle"


def picture(folder: Path, *paths: dict[str, object], verification: dict[str, object] | None = None) -> Path:
    table: dict[str, object] = {"waypoints": list(paths)}
    if verification is not None:
        table["verification"] = verification
    path = folder / "view.json"
    path.write_text(json.dumps(table))
    return path


PATH = {"traversability": 0.5, "points_px": [], "points_m": [[2.0, 0.0], [4.0, 1.0]]}
OTHER = {"traversability": 1.0, "points_px": [], "points_m": [[3.0, 0.0]]}


def to_world(item: WireItem, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    frame = LocalFrame(Origin(latitude_deg, longitude_deg, 0.0))
    x, y, _ = frame.to_world(GeoPoint(item.x / 1e7, item.y / 1e7, 0.0))
    return x, y


def test_a_path_in_a_picture_is_laid_from_where_the_rover_stands_and_looks(tmp_path: Path) -> None:
    out = tmp_path / "way.waypoints"
    view = picture(tmp_path, PATH, OTHER)
    command = ["handover", "--picture", str(view), "--at", "47.0,8.5", "--heading", "90", "--to-file", str(out)]
    assert main(command) == 0
    home, speed, *places = read_waypoints(out)
    assert to_world(home, 47.0, 8.5) == pytest.approx((0.0, 0.0), abs=0.02)
    assert speed.params[1] == pytest.approx(0.45)  # 0.6 m/s, less a quarter for half the risk
    # East is where it looks, and what lies to its left is north.
    assert to_world(places[0], 47.0, 8.5) == pytest.approx((2.0, 0.0), abs=0.02)
    assert to_world(places[1], 47.0, 8.5) == pytest.approx((4.0, 1.0), abs=0.02)
    command[6] = "180"
    assert main([*command, "--path", "1", "--speed", "0.3"]) == 0
    _, speed, place = read_waypoints(out)
    assert speed.params[1] == pytest.approx(0.3)
    assert to_world(place, 47.0, 8.5) == pytest.approx((0.0, -3.0), abs=0.02)


def test_a_path_in_a_picture_is_laid_from_where_the_vehicle_says_that_it_stands(tmp_path: Path) -> None:
    view, out = picture(tmp_path, PATH), tmp_path / "out"
    with live("ardupilot") as (rover, url):
        rover.locked(lambda: vars(rover.rover).update(x_m=7.0, y_m=-3.0, yaw_rad=math.pi / 2.0))  # looks north
        command = ["handover", "--picture", str(view), "--at", "vehicle", "--autopilot", url, "--out", str(out)]
        assert main(command) == 0
        x_m, y_m = to_world(rover.vehicle.store.items[-1], Origin().latitude_deg, Origin().longitude_deg)
        assert (x_m, y_m) == pytest.approx((6.0, 1.0), abs=0.1)  # 4 m ahead, 1 m to the left
        assert main([*command, "--heading", "90"]) == 0
        x_m, y_m = to_world(rover.vehicle.store.items[-1], Origin().latitude_deg, Origin().longitude_deg)
        assert (x_m, y_m) == pytest.approx((11.0, -2.0), abs=0.1)


def test_of_verified_paths_the_best_is_taken_and_of_unverified_ones_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "way.waypoints"
    command = ["handover", "--at", "47,8", "--to-file", str(out), "--picture"]
    view = picture(tmp_path, PATH, OTHER, verification={"best_verified_path": 1})
    assert main([*command, str(view)]) == 0
    assert len(read_waypoints(out)) == 3
    view = picture(tmp_path, PATH, OTHER, verification={"best_verified_path": None})
    assert main([*command, str(view)]) == 2
    assert "none of its paths was verified; choose one yourself with --path N" in capsys.readouterr().err


def test_the_first_plan_in_a_scenario_goes_to_a_file(tmp_path: Path) -> None:
    scenario, out = tmp_path / "yard.toml", tmp_path / "way.plan"
    scenario.write_text(YARD)
    assert main(["handover", str(scenario), "--to-file", str(out)]) == 0
    places = [item for item in read_plan(out)[1:] if item.command == WAYPOINT]
    last = to_world(places[-1], Origin().latitude_deg, Origin().longitude_deg)
    assert last == pytest.approx((3.2, 0.0), abs=0.3)  # as far as one picture shows, short of the goal at 4 m
    assert main(["handover", str(scenario), "--at", "10,20", "--heading", "0", "--to-file", str(out)]) == 0
    places = [item for item in read_plan(out)[1:] if item.command == WAYPOINT]
    assert to_world(places[-1], 10.0, 20.0) == pytest.approx((0.0, 7.2), abs=0.3)  # ahead is north now


def test_the_last_mission_of_a_run(tmp_path: Path) -> None:
    write_waypoints(tmp_path / "mission.waypoints", mission_items([(1.0, 0.0, 0.0)], LocalFrame(Origin()), HOME))
    assert main(["handover", "--run", str(tmp_path), "--to-file", str(tmp_path / "copy.plan")]) == 0
    assert len(read_plan(tmp_path / "copy.plan")) == 2


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "nothing to do"),
        (["--to-file", "x.plan"], "0 plans given"),
        (["demo", "--run", ".", "--to-file", "x.plan"], "2 plans given"),
        (["demo", "--to-file", "x.plan", "--arm-and-start"], "needs --autopilot"),
        (["--run", "nowhere", "--to-file", "x.plan"], "no mission.plan and no mission.waypoints"),
        (["--mission", "x.txt", "--to-file", "x.plan"], "ends in .plan or .waypoints"),
        (["--mission", "MISSION", "--to-file", "x.txt"], "ends in .plan or .waypoints"),
        (["--mission", "MISSION", "--to-file", "no/x.plan"], "there is no folder no"),
        (["--mission", "MISSION", "--at", "1,2", "--to-file", "x.plan"], "--at: allowed: with picture or scenario"),
        (["--mission", "HOME", "--to-file", "x.plan"], "no waypoint after home"),
        (["--mission", "MISSION", "--autopilot", "nonsense"], "unknown kind"),
        (["--picture", "VIEW", "--to-file", "x.plan"], "needs --at LAT,LON"),
        (["--picture", "VIEW", "--at", "vehicle", "--to-file", "x.plan"], "with --autopilot URL and without --to-file"),
        (["demo", "--at", "vehicle", "--to-file", "x.plan"], "--at vehicle: allowed: with --picture"),
        (["--picture", "VIEW", "--at", "1,2", "--path", "7", "--to-file", "x.plan"], "has 1 paths; allowed: 0 to 0"),
        (["--picture", "BARE", "--at", "1,2", "--to-file", "x.plan"], "run perceive with --camera FILE"),
        (["--picture", "EMPTY", "--at", "1,2", "--to-file", "x.plan"], "no path was found"),
        (["--picture", "MISSION", "--at", "1,2", "--to-file", "x.plan"], "allowed: a STEM.json of perceive"),
        (["--picture", "missing.json", "--at", "1,2", "--to-file", "x.plan"], "missing.json"),
        (["nosuchworld", "--to-file", "x.plan"], "nosuchworld"),
    ],
)
def test_wrong_input_is_one_line_and_exit_code_2(
    arguments: list[str],
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    bare = {key: value for key, value in PATH.items() if key != "points_m"}
    (tmp_path / "bare").mkdir()
    (tmp_path / "empty").mkdir()
    write_waypoints(tmp_path / "home.waypoints", [home_item(LocalFrame(Origin()), HOME)])
    names = {
        "MISSION": mission(tmp_path, (1.0, 0.0)),
        "HOME": tmp_path / "home.waypoints",
        "VIEW": picture(tmp_path, PATH),
        "BARE": picture(tmp_path / "bare", bare),
        "EMPTY": picture(tmp_path / "empty"),
    }
    assert main(["handover", *(str(names.get(word, word)) for word in arguments)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert says in lines[0]


@pytest.mark.parametrize(
    "arguments", [["--at", "1"], ["--at", "95,0"], ["--heading", "north"], ["--speed", "0"], ["--path", "-1"]]
)
def test_numbers_that_cannot_be_are_told_by_the_parser(arguments: list[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["handover", *arguments])
    assert caught.value.code == 2


def test_a_vehicle_of_another_kind_is_refused_by_its_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = mission(tmp_path, (1.0, 0.0))
    copter = UdpIn(parse_url("udpin:127.0.0.1:0"))
    stop = threading.Event()

    def beat() -> None:
        packer = Packer(7, 1)
        while not stop.wait(0.05):
            for peer, _ in copter.receive(0.0):
                copter.send(packer.pack(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3)), peer, 0.0)

    person = threading.Thread(target=beat)
    person.start()
    url = f"udpout:127.0.0.1:{copter.port}"
    try:
        assert main(["handover", "--mission", str(plan), "--autopilot", url, "--out", str(tmp_path / "o")]) == 2
    finally:
        stop.set()
        person.join()
        copter.close()
    assert "a quadrotor (PX4, system 7); allowed: a ground rover" in capsys.readouterr().err


@pytest.mark.parametrize(("theirs", "code"), [("open sesame", 0), ("mellon", 3)])
def test_a_vehicle_that_signs_is_heard_with_the_same_key_only(theirs: str, code: int, tmp_path: Path) -> None:
    plan, keys = mission(tmp_path, (1.0, 0.0)), tmp_path / "keys"
    keys.mkdir()
    for name, text in (("ours", "open sesame"), ("theirs", theirs)):
        (keys / name).write_text(text)
    signing = open_signing(keys / "theirs", unix_time_s, tmp_path / "shown")
    with live("ardupilot", signing) as (_, url):
        command = ["handover", "--mission", str(plan), "--autopilot", url, "--signing-key", str(keys / "ours")]
        assert main([*command, "--out", str(tmp_path / "out"), "--wait", "4"]) == code
