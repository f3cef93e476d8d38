"""The serve command as a user meets it: a heartbeat on the port, files after Ctrl-C, one line for each mistake."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest

from rover_sim.cli import main
from rover_sim.live import FILES, LiveRover
from rover_sim.mavlink.dialect import Packer, Parser, mavlink
from rover_sim.mavlink.ftp_packet import Opcode, Packet
from rover_sim.mavlink.tlog import read_tlog
from rover_sim.pacing import RealTime

MOST_HEARTBEATS = 60  # one a second
YARD = """
name = "yard"
[terrain]
kind = "flat"
size_m = [12.0, 10.0]
resolution_m = 0.1
[soil]
preset = "firm"
[goal]
position_m = [3.0, 0.5]
"""


def _scenario(folder: Path) -> str:
    path = folder / "yard.toml"
    path.write_text(YARD, encoding="utf-8")
    return str(path)


@contextmanager
def _ended(command: list[str]) -> Iterator[subprocess.Popen[bytes]]:
    """A program that ends with the test, whatever becomes of it."""
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        try:
            yield process
        finally:
            process.kill()


def test_it_answers_in_real_time_and_ends_cleanly_by_ctrl_c(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        station.settimeout(60.0)
        url = f"udpout:127.0.0.1:{station.getsockname()[1]}"
        script = "from rover_sim.cli import main; raise SystemExit(main())"
        command = [sys.executable, "-c", script, "serve", _scenario(tmp_path), "--persona", "px4", "--out", str(out)]
        with _ended([*command, "--connect", url]) as process:
            parser, packer, seen, heartbeats = Parser(), Packer(255, 190), set[str](), 0
            arm = mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
            photograph = mavlink.MAVLink_command_long_message(1, 100, 2000, 0, 0, 0, 1, 1, 0, 0, 0)
            listing = Packet(0, 0, Opcode.LIST_DIRECTORY, b"/pictures").encode()
            ask = mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, listing)
            while "FILE_TRANSFER_PROTOCOL" not in seen and heartbeats < MOST_HEARTBEATS:
                data, address = station.recvfrom(4096)
                for message in parser.datagram(data):
                    seen.add(message.get_type())
                    if message.get_type() == "HEARTBEAT" and message.get_srcComponent() == 1:
                        assert message.autopilot == mavlink.MAV_AUTOPILOT_PX4
                        heartbeats += 1
                        # Datagrams get lost on a busy machine: what has no answer yet is said again.
                        for words in [ask] if "CAMERA_IMAGE_CAPTURED" in seen else [arm, photograph]:
                            station.sendto(packer.pack(words), address)
                    if message.get_type() == "FILE_TRANSFER_PROTOCOL":
                        assert Packet.decode(bytes(message.payload)).data.startswith(b"Fpicture-00001.png\t")
            assert "FILE_TRANSFER_PROTOCOL" in seen
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=30)
        assert process.returncode == 0, errors
    assert {path.name for path in out.iterdir()} == {*FILES, "pictures"}
    picture = cv2.imread(str(out / "pictures" / "picture-00001.png"))
    assert picture is not None
    assert picture.shape == (240, 320, 3)
    assert picture.std() > 5.0  # ground and sky
    assert any(frame[7:10] == b"\0\0\0" for _, frame in read_tlog(out / "telemetry.tlog"))  # a heartbeat
    trace = np.load(out / "trace.npz")
    assert len(trace["time_s"]) == len(trace["armed"]) > 0


@pytest.mark.parametrize(
    ("option", "url", "code", "says"),
    [
        ("--connect", "http://x:80", 2, "unknown kind 'http'"),
        ("--listen", "udpout:127.0.0.1:5", 2, "allowed: udpin:HOST:PORT or tcpin:HOST:PORT"),
        ("--listen", "udpin:127.0.0.1:TAKEN", 3, "is in use"),
        ("--connect", "tcp:127.0.0.1:1", 3, "cannot connect"),
    ],
)
def test_a_bad_link_is_one_line(
    option: str, url: str, code: int, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        url = url.replace("TAKEN", str(taken.getsockname()[1]))
        arguments = ["serve", _scenario(tmp_path), "--out", str(tmp_path / "out"), option, url]
        assert main(arguments) == code
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert says in line
    assert url in line


def test_with_a_key_it_signs_and_keeps_the_timestamps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    key, out = tmp_path / "key", tmp_path / "out"
    key.write_text("a passphrase\n")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        station.settimeout(10.0)
        forged = Packer(255, 190).pack(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))

        def lives_shortly(rover: LiveRover, _stopped: object, _show: object) -> bool:
            rover.step()
            data, address = station.recvfrom(4096)
            assert data[2] == 1  # signed
            station.sendto(forged, address)
            for _ in range(20):
                rover.step()
            assert not rover.autopilot.armed
            return True

        monkeypatch.setattr(LiveRover, "run", lives_shortly)
        url = f"udpout:127.0.0.1:{station.getsockname()[1]}"
        arguments = ["serve", _scenario(tmp_path), "--connect", url, "--signing-key", str(key)]
        assert main([*arguments, "--out", str(out)]) == 0
    assert "frames refused: 1 (" in capsys.readouterr().err
    assert (tmp_path / "key.timestamps").exists()
    assert main([*arguments, "--out", str(tmp_path)]) == 2  # the key would lie in the folder that is shown
    assert "shown over the link" in capsys.readouterr().err


def test_a_wrong_persona_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["serve", "--persona", "apm"])
    assert caught.value.code == 2
    assert "'ardupilot', 'px4', 'generic'" in capsys.readouterr().err


def test_time_that_was_lost_is_not_run_after(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr("rover_sim.pacing.time.perf_counter", lambda: now[0])
    pace = RealTime()
    assert pace.left_s(0.5) == 0.5
    now[0] = 3.0
    assert pace.left_s(1.0) <= 0.0  # two seconds late: given up
    assert pace.left_s(1.5) == pytest.approx(0.5)
    assert pace.factor == pytest.approx(1.0 / 3.0)
