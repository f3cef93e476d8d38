"""MAVSDK's camera plugin against a live rover of each persona: found, asked, and used."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rover_sim.mavlink.camera_messages import CAMERA, CameraPort
from rover_sim.mavlink.persona import PERSONAS
from tests.mavlink_live import LiveRover, connected_pair
from worlds.types import CameraModel

MODEL = CameraModel(320, 240, 208.0, (0.3, 0.0, 0.5), math.radians(25.0))


def shutter(path: Path) -> bool:
    path.write_bytes(b"png")
    return True


def storage_mib(camera: Any) -> float:
    from mavsdk.plugins.camera import CameraError

    try:
        return float(camera.get_storage(CAMERA).total_storage_mib)
    except CameraError:
        return 0.0


@pytest.fixture(params=PERSONAS)
def pair(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[LiveRover, Any]]:
    port = CameraPort(MODEL, tmp_path, shutter)
    with connected_pair(PERSONAS[request.param], tmp_path, camera=port) as found:
        yield found


def test_it_is_found_tells_of_itself_and_takes_pictures(pair: tuple[LiveRover, Any], tmp_path: Path) -> None:
    from mavsdk.plugins.camera import Camera, CameraError, CameraResult, Mode, PhotosRange

    live, system = pair
    camera = Camera(system)
    live.until(lambda: len(camera.camera_list().cameras) == 1)
    (found,) = camera.camera_list().cameras
    assert (found.component_id, found.vendor_name) == (CAMERA, "rover-sim")
    assert (found.horizontal_resolution_px, found.vertical_resolution_px) == (320, 240)
    infos: list[Any] = []
    camera.subscribe_capture_info(lambda info, _: infos.append(info))
    camera.take_photo(CAMERA)
    camera.take_photo(CAMERA)
    live.until(lambda: len(infos) == 2)
    assert [info.is_success for info in infos] == [True, True]
    assert infos[1].file_url.endswith("/pictures/picture-00002.png")
    assert infos[0].position.latitude_deg == pytest.approx(38.4064, abs=1e-4)
    assert (tmp_path / "pictures" / "picture-00002.png").exists()
    camera.set_mode(CAMERA, Mode.PHOTO)
    assert camera.get_mode(CAMERA) == Mode.PHOTO
    live.until(lambda: storage_mib(camera) > 0.0)  # asked for every 5 s
    assert len(camera.list_photos(CAMERA, PhotosRange.ALL)) == 2
    camera.start_photo_interval(CAMERA, 0.5)
    live.until(lambda: len(infos) >= 4)
    camera.stop_photo_interval(CAMERA)
    with pytest.raises(CameraError) as refused:
        camera.start_video(CAMERA)
    assert refused.value.result != CameraResult.TIMEOUT  # told at once
    camera.destroy()
