"""Whatever a path says, file transfer shows what is in its folder and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from rover_sim.autopilot.parameters import ParameterTable
from rover_sim.mavlink.ftp_files import Files
from rover_sim.mavlink.ftp_packet import DATA_BYTES, FtpError

PARTS = st.sampled_from(
    ["", ".", "..", "...", "run", "in", "sub", "secret", "link", "folder_link", "~", "C:", "\\", "\0"]
)
PATHS = st.one_of(st.binary(max_size=DATA_BYTES), st.lists(PARTS, max_size=8).map("/".join).map(str.encode))


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    base = tmp_path_factory.mktemp("base")
    run = base / "run"
    (run / "sub").mkdir(parents=True)
    for inside in (run / "in", run / "sub" / "in"):
        inside.write_text("inside")
    for outside in (base / "secret", base / "in"):
        outside.write_text("outside")
    (run / "link").symlink_to(base / "secret")
    (run / "folder_link").symlink_to(base)
    (run / "sub" / "link").symlink_to("../../secret")
    return run


@settings(max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(path=PATHS)
@example(path=b"../run/in")
@example(path=b"folder_link/run/in")
@example(path=b"/sub//in")
def test_only_files_of_the_folder_are_read(root: Path, path: bytes) -> None:
    files = Files(root, ParameterTable())
    try:
        file, size = files.open(path)
    except FtpError:
        return
    with file:
        assert file.read() == b"inside"
        assert size == len(b"inside")


@settings(max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(path=PATHS)
def test_only_folders_of_the_folder_are_listed(root: Path, path: bytes) -> None:
    files = Files(root, ParameterTable())
    try:
        entries = files.entries(path)
    except FtpError:
        return
    assert entries in ([b"Fin\t6\0", b"Dsub\0"], [b"Fin\t6\0"])


@given(name=st.text(st.characters(codec="utf-8", exclude_characters="/\0"), min_size=1, max_size=60))
@settings(max_examples=150, deadline=None)
def test_what_is_listed_can_be_opened(tmp_path_factory: pytest.TempPathFactory, name: str) -> None:
    folder = tmp_path_factory.mktemp("names")
    if name in (".", ".."):
        return
    (folder / name).write_bytes(b"x")
    files = Files(folder, ParameterTable())
    for entry in files.entries(b""):
        file, size = files.open(entry[1:].partition(b"\t")[0])
        file.close()
        assert size == 1
