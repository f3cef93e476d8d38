"""MAVSDK's file transfer against a live rover: list, compare, download, over a good link and a bad one."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pymavlink.mavftp import MAVFTP

from rover_sim.mavlink.faults import Faults
from rover_sim.mavlink.persona import ARDUPILOT, PERSONAS
from rover_sim.mavlink.stack import BadLink
from tests.mavlink_live import connected_pair

CONTENT = bytes(range(256)) * 120


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("run")
    (root / "pictures").mkdir()
    (root / "telemetry.tlog").write_bytes(CONTENT)
    (root / "mission.plan").write_text("{}")
    (root / "short.tlog").write_bytes(CONTENT[:8000])
    return root


@pytest.fixture(params=PERSONAS)
def ftp(request: pytest.FixtureRequest, folder: Path) -> Iterator[Any]:
    with connected_pair(PERSONAS[request.param], folder) as (_, system):
        from mavsdk.plugins.ftp import Ftp

        plugin = Ftp(system)
        yield plugin
        plugin.destroy()


def download(plugin: Any, path: str, to: Path, *, burst: bool, limit_s: float = 10.0) -> Any:
    """The result of a download once it is over."""
    from mavsdk.plugins.ftp import FtpResult

    over = threading.Event()
    results: list[Any] = []

    def heard(result: Any, _progress: Any, _data: Any) -> None:
        if result != FtpResult.NEXT:
            results.append(result)
            over.set()

    plugin.download_async(path, str(to), burst, heard)
    assert over.wait(limit_s), "time limit"
    return results[0]


def test_the_folder_is_listed_and_a_file_comes_whole(ftp: Any, folder: Path, tmp_path: Path) -> None:
    from mavsdk.plugins.ftp import FtpError, FtpResult

    entries = {entry.name: (entry.entry_type, entry.size_bytes) for entry in ftp.list_directory("/").entries}
    assert entries == {
        "pictures": (2, 0),
        "telemetry.tlog": (1, len(CONTENT)),
        "mission.plan": (1, 2),
        "short.tlog": (1, 8000),
    }
    for burst in (True, False):
        assert download(ftp, "/telemetry.tlog", tmp_path, burst=burst) == FtpResult.SUCCESS
        assert (tmp_path / "telemetry.tlog").read_bytes() == CONTENT
        (tmp_path / "telemetry.tlog").unlink()
    assert ftp.are_files_identical(str(folder / "telemetry.tlog"), "/telemetry.tlog")
    assert not ftp.are_files_identical(str(folder / "mission.plan"), "/telemetry.tlog")
    assert download(ftp, "@PARAM/param.pck", tmp_path, burst=True) == FtpResult.SUCCESS
    assert MAVFTP.ftp_param_decode((tmp_path / "param.pck").read_bytes()) is not None
    assert download(ftp, "/nothing", tmp_path, burst=True) == FtpResult.FILE_DOES_NOT_EXIST
    with pytest.raises(FtpError, match="PROTECTED"):
        ftp.remove_file("/telemetry.tlog")
    with pytest.raises(FtpError, match="PROTECTED"):
        ftp.create_directory("/new")
    assert (folder / "telemetry.tlog").read_bytes() == CONTENT


def test_a_file_comes_whole_over_a_link_that_loses_a_fifth(folder: Path, tmp_path: Path) -> None:
    with connected_pair(ARDUPILOT, folder, BadLink(Faults(loss=0.2), (3,))) as (_, system):
        from mavsdk.plugins.ftp import Ftp, FtpResult

        plugin = Ftp(system)
        assert download(plugin, "/short.tlog", tmp_path, burst=True, limit_s=60.0) == FtpResult.SUCCESS
        plugin.destroy()
    assert (tmp_path / "short.tlog").read_bytes() == CONTENT[:8000]
