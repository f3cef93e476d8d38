"""A million frames at the port, from fixed seeds: no crash, no hang, nothing torn, nothing out of its limits.

A small share runs with the other tests, the whole with ``pytest -m slow tests/test_mavlink_fuzz_frames.py``.
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import pytest

from rover_sim.mavlink.camera_messages import CAMERA, CameraPort
from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.persona import PERSONAS
from rover_sim.mavlink.plan_items import mission_items
from rover_sim.mavlink.signing import Signing
from tests.mavlink_offers import seeded
from tests.mavlink_random import frames
from tests.mavlink_rig import Station, Yard
from tests.test_mavlink_mission import download, upload
from worlds.types import CameraModel

BATCH = 25  # frames in 1/48 s
LOOK = 40  # batches between two looks


def check(yard: Yard, names: tuple[str, ...]) -> None:
    """Fails if anything that must hold at any time does not."""
    table, vehicle, autopilot = yard.autopilot.parameters, yard.vehicle, yard.autopilot
    assert table.names == names
    for name in names:
        assert table.takes(name, table[name]), (name, table[name])
        assert not table.describe(name).integer or table[name].is_integer()
    assert len(vehicle.store.items) == len(autopilot.auto.mission.items)
    assert len(vehicle.rally.items) == len(autopilot.returns.rally_w)
    assert bool(vehicle.fence.items) or not autopilot.fence.fence.areas
    rover = yard.rover
    assert all(math.isfinite(number) for number in (*autopilot.home_w, *rover.wheels, rover.x_m, rover.y_m))


def storm(folder: Path, persona: str, count: int, seed: int, signing: Signing | None = None) -> Yard:
    """The vehicle after so many frames from two stations."""
    (folder / "a.tlog").write_bytes(bytes(4000))
    camera = CameraPort(CameraModel(32, 24, 30.0), folder, lambda _: True)
    stations = Station(), Station(245)
    yard = Yard(*stations, persona=PERSONAS[persona], folder=folder, camera=camera, signing=signing)
    names, beats = yard.autopilot.parameters.names, 0
    rng = seeded(seed)
    modes = sorted(PERSONAS[persona].numbers.values())
    source = frames(rng, sorted(yard.vehicle._handlers), names, modes)
    for batch in range(1, count // BATCH + 1):
        for frame in itertools.islice(source, BATCH):
            rng.choice(stations).send_bytes(frame, yard.time_s)
        yard.step()
        if batch % LOOK == 0:
            check(yard, names)
            beats += sum(beat.get_srcComponent() == 1 for beat in stations[0].take("HEARTBEAT"))
            for station in stations:
                station.heard.clear()
    assert beats >= math.floor(yard.time_s) - 2
    yard.step(9.0)  # what was begun has ended
    return yard


def is_well(yard: Yard) -> None:
    """It takes a mission and gives it back, and its camera is there."""
    station = yard.stations[0]
    station.send(mavlink.MAVLink_mission_clear_all_message(1, 1, 255), yard.time_s)
    yard.step()
    items = mission_items([(5.0, 0.0, 0.0), (6.0, 1.0, 0.0)], yard.frame, (0.0, 0.0, 0.0))
    assert upload(yard, station, items) == [0]
    assert len(download(yard, station)) == len(items)
    ask = mavlink.MAVLink_command_long_message(1, CAMERA, 521, 0, 1, 0, 0, 0, 0, 0, 0)
    assert len(yard.ask(station, ask, "CAMERA_INFORMATION")) == 1
    yard.vehicle.close()


@pytest.mark.parametrize("persona", PERSONAS)
def test_a_share_of_the_storm(tmp_path: Path, persona: str) -> None:
    is_well(storm(tmp_path, persona, 5_000, 1))


def test_with_a_key_nothing_of_the_storm_is_obeyed(tmp_path: Path) -> None:
    signing = Signing(b"k" * 32, lambda: 1.7e9)
    yard = storm(tmp_path, "ardupilot", 2_500, 2, signing)
    assert not yard.autopilot.armed
    assert yard.autopilot.parameters.changes == 0
    assert yard.vehicle.store.items == ()
    assert signing.refused > 1_000
    yard.vehicle.close()


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize(("persona", "count"), [("ardupilot", 400_000), ("px4", 300_000), ("generic", 300_000)])
def test_a_million_frames(tmp_path: Path, persona: str, count: int) -> None:
    is_well(storm(tmp_path, persona, count, 3))
