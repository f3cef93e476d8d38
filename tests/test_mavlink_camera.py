"""The camera component with a shutter that writes nothing real: what it tells, what it takes, whom it answers."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rover_sim.mavlink.camera_messages import CAMERA, CameraPort
from rover_sim.mavlink.camera_service import LEAST_INTERVAL_S
from rover_sim.mavlink.dialect import Message, mavlink
from tests.mavlink_rig import Station, Yard
from worlds.types import CameraModel

MODEL = CameraModel(320, 240, 208.0, (0.3, 0.0, 0.5), math.radians(25.0))
INFORMATION, SETTINGS, STORAGE, STATUS, CAPTURED, STREAM = 259, 260, 261, 262, 263, 269
START, STOP = 2000, 2001


class Shutter:
    """Counts, fails where told to."""

    def __init__(self) -> None:
        self.works = True
        self.disk_full = False

    def take(self, path: Path) -> bool:
        if self.disk_full:
            raise OSError("no space")
        if self.works:
            path.write_bytes(b"png")
        return self.works


@pytest.fixture
def shutter() -> Shutter:
    return Shutter()


@pytest.fixture
def make_yard(tmp_path: Path, shutter: Shutter) -> Callable[..., Yard]:
    return lambda *stations: Yard(*stations, folder=tmp_path, camera=CameraPort(MODEL, tmp_path, shutter.take))


@pytest.fixture
def station() -> Station:
    return Station()


@pytest.fixture
def yard(make_yard: Callable[..., Yard], station: Station) -> Yard:
    return make_yard(station)


def command(number: int, *parameters: float, component: int = CAMERA) -> Message:
    padded = (*parameters, *(0.0,) * (7 - len(parameters)))
    return mavlink.MAVLink_command_long_message(1, component, number, 0, *padded)


def result(yard: Yard, station: Station, message: Message) -> int:
    acks = [ack for ack in yard.ask(station, message, "COMMAND_ACK") if ack.get_srcComponent() == CAMERA]
    (ack,) = acks
    assert (ack.command, ack.target_system, ack.target_component) == (message.command, 255, 190)
    return int(ack.result)


def test_it_beats_by_itself_with_its_own_unbroken_numbers(yard: Yard, station: Station) -> None:
    yard.step(10.0)
    heard = station.heard
    beats = [one for one in heard if one.get_type() == "HEARTBEAT" and one.get_srcComponent() == CAMERA]
    assert len(beats) == pytest.approx(10, abs=1)
    assert (beats[0].type, beats[0].autopilot) == (30, 8)
    for component in (1, CAMERA):
        numbers = [one.get_seq() for one in heard if one.get_srcComponent() == component]
        assert numbers == [(numbers[0] + at) % 256 for at in range(len(numbers))]


@pytest.mark.parametrize(
    ("message", "older", "name"),
    [
        (INFORMATION, 521, "CAMERA_INFORMATION"),
        (SETTINGS, 522, "CAMERA_SETTINGS"),
        (STORAGE, 525, "STORAGE_INFORMATION"),
        (STATUS, 527, "CAMERA_CAPTURE_STATUS"),
    ],
)
def test_it_tells_of_itself_by_the_new_and_the_older_request(
    yard: Yard, station: Station, message: int, older: int, name: str
) -> None:
    for request in (command(512, message), command(older, 1.0), command(512, message, component=0)):
        (answer,) = yard.ask(station, request, name)
        assert answer.get_srcComponent() == CAMERA
        acks = station.take("COMMAND_ACK")
        assert [(ack.result, ack.get_srcComponent()) for ack in acks] == [(0, CAMERA)]


def test_what_it_says_of_itself(yard: Yard, station: Station) -> None:
    (information,) = yard.ask(station, command(512, INFORMATION), "CAMERA_INFORMATION")
    assert (information.resolution_h, information.resolution_v, information.flags) == (320, 240, 2)
    assert bytes(information.vendor_name).rstrip(b"\0") == b"rover-sim"
    assert information.cam_definition_uri == ""
    (storage,) = yard.ask(station, command(512, STORAGE), "STORAGE_INFORMATION")
    assert (storage.storage_count, storage.status) == (1, 2)
    assert storage.total_capacity > storage.available_capacity > 0.0
    (settings,) = yard.ask(station, command(512, SETTINGS), "CAMERA_SETTINGS")
    assert settings.mode_id == 0


def test_there_is_no_video_and_it_says_so_at_once(yard: Yard, station: Station) -> None:
    for request in (
        command(512, STREAM),
        command(512, 270),
        command(2504),
        command(2505),
        command(2500),
        command(2502),
    ):
        assert result(yard, station, request) == 3
    assert result(yard, station, command(530, 0, 0)) == 0
    assert result(yard, station, command(530, 0, 1)) == 2
    assert result(yard, station, command(9999)) == 3


def test_the_autopilot_is_no_camera(yard: Yard, station: Station) -> None:
    for request in (command(512, INFORMATION, component=1), command(521, 1, component=1), command(START, component=1)):
        acks = yard.ask(station, request, "COMMAND_ACK")
        assert [(ack.result, ack.get_srcComponent()) for ack in acks] == [(3, 1)]
    (ack,) = yard.ask(station, command(400, 0, component=0), "COMMAND_ACK")
    assert (ack.result, ack.get_srcComponent()) == (0, 1)
    assert yard.ask(station, mavlink.MAVLink_param_request_list_message(1, CAMERA), "PARAM_VALUE") == []


def test_a_picture_lies_in_the_folder_and_everyone_is_told(make_yard: Callable[..., Yard], tmp_path: Path) -> None:
    station, other = Station(), Station(254)
    yard = make_yard(station, other)
    yard.step(0.5)
    assert result(yard, station, command(START, 0, 0, 1, 1)) == 0
    assert (tmp_path / "pictures" / "picture-00001.png").read_bytes() == b"png"
    for listener in (station, other):
        (told,) = listener.take("CAMERA_IMAGE_CAPTURED")
        assert told.file_url == "mftp://[;comp=1]/pictures/picture-00001.png"
        assert (told.image_index, told.capture_result, told.lat) == (0, 1, 384064000)
        w, x, y, z = told.q  # the rover looks east, the camera 25 degrees down
        pitch = math.asin(2.0 * (w * y - z * x))
        yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        assert (math.degrees(pitch), math.degrees(yaw)) == pytest.approx((-25.0, 90.0), abs=1e-3)
        assert listener.take("CAMERA_CAPTURE_STATUS")[-1].image_count == 1
    (again,) = yard.ask(station, command(512, CAPTURED, 0), "CAMERA_IMAGE_CAPTURED")
    assert again.file_url == told.file_url
    assert result(yard, station, command(2002, 0)) == 0
    assert result(yard, station, command(2002, 7)) == 2


def test_a_command_that_is_sent_again_takes_one_picture(yard: Yard, station: Station) -> None:
    for _ in range(3):
        assert result(yard, station, command(START, 0, 0, 1, 5)) == 0
    assert len(station.take("CAMERA_IMAGE_CAPTURED")) == 1
    assert result(yard, station, command(START, 0, 0, 1, 6)) == 0
    yard.step(6.0)
    assert result(yard, station, command(START, 0, 0, 1, 6)) == 0  # a new client that counts from the same number
    assert len(station.take("CAMERA_IMAGE_CAPTURED")) == 2
    for _ in range(3):  # MAVSDK's first has the number 0
        assert result(yard, station, command(START, 0, 0, 1, 0)) == 0
    assert len(station.take("CAMERA_IMAGE_CAPTURED")) == 1
    yard.step(0.7)
    assert result(yard, station, command(START, 0, 0, 1, 0)) == 0
    assert len(station.take("CAMERA_IMAGE_CAPTURED")) == 1


def test_pictures_at_an_interval(yard: Yard, station: Station, tmp_path: Path) -> None:
    assert result(yard, station, command(START, 0, 2.0, 3)) == 0
    assert result(yard, station, command(START, 0, 2.0, 3)) == 1
    yard.step(10.0)
    assert len(list((tmp_path / "pictures").iterdir())) == 3
    assert station.take("CAMERA_CAPTURE_STATUS")[-1].image_status == 0
    assert result(yard, station, command(START, 0, 1.0, 0)) == 0
    yard.step(2.5)
    assert result(yard, station, command(STOP)) == 0
    yard.step(5.0)
    assert len(list((tmp_path / "pictures").iterdir())) == 6
    for wrong in ((0.0, 0), (LEAST_INTERVAL_S / 2, 2), (math.nan, 2), (math.inf, 2), (1.0, 1.5), (1.0, math.nan)):
        assert result(yard, station, command(START, 0, *wrong)) == 2


def test_a_failed_camera_and_a_full_disk_are_told(yard: Yard, station: Station, shutter: Shutter) -> None:
    shutter.works = False
    assert result(yard, station, command(START, 0, 0, 1, 1)) == 4
    shutter.works, shutter.disk_full = True, True
    assert result(yard, station, command(START, 0, 0, 1, 2)) == 4
    assert [told.capture_result for told in station.take("CAMERA_IMAGE_CAPTURED")] == [0, 0]
    shutter.disk_full = False
    assert result(yard, station, command(START, 0, 0, 1, 2)) == 0


def test_earlier_pictures_are_kept(make_yard: Callable[..., Yard], tmp_path: Path) -> None:
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "picture-00041.png").write_bytes(b"old")
    station = Station()
    assert result(make_yard(station), station, command(START, 0, 0, 1, 1)) == 0
    assert (tmp_path / "pictures" / "picture-00041.png").read_bytes() == b"old"
    assert (tmp_path / "pictures" / "picture-00042.png").exists()


def test_without_a_camera_nobody_answers_for_it() -> None:
    station = Station()
    yard = Yard(station)
    yard.step(2.0)
    assert yard.ask(station, command(512, INFORMATION), "COMMAND_ACK") == []
    assert not any(one.get_srcComponent() == CAMERA for one in station.heard)


def test_random_commands_to_the_camera(yard: Yard, station: Station) -> None:
    rng = np.random.default_rng(4)
    values = [0.0, 1.0, -1.0, 2.0, 259.0, 261.0, 263.0, 1e30, math.nan, math.inf, -math.inf, 0.5]
    for _ in range(800):
        number = int(rng.choice([512, 521, 522, 525, 527, 530, START, STOP, 2002, 2504, 511, 9]))
        chosen = [float(rng.choice(values)) for _ in range(7)]
        assert result(yard, station, command(number, *chosen)) in range(5)
