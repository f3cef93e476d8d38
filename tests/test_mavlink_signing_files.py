"""What message signing keeps in files: the key, and timestamps over restarts and crashes."""

from __future__ import annotations

from pathlib import Path

import pytest

from rover_sim.errors import InputError
from rover_sim.mavlink.dialect import Parser
from rover_sim.mavlink.signing import Signing, open_signing
from rover_sim.mavlink.signing_file import SigningFile, Stream, Times, load_key
from tests.mavlink_signer import KEY, PING, Clock, Signer


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.mark.parametrize("clean", [True, False])
def test_timestamps_outlive_a_restart_and_a_crash(tmp_path: Path, clock: Clock, clean: bool) -> None:
    file = SigningFile(tmp_path / "times")
    before, sender = Signing(KEY, clock, file), Signer(clock)
    old = [sender.pack(PING) for _ in range(50)]
    assert all(len(Parser(before).datagram(frame)) == 1 for frame in old)
    sent = [before.stamp() for _ in range(50)]
    if clean:
        before.close()
    clock.s += 0.0 if clean else 3.0
    after = Signing(KEY, clock, SigningFile(file.path))
    assert all(Parser(after).datagram(frame) == [] for frame in old)
    again = sender if clean else Signer(clock)
    assert len(Parser(after).datagram(again.pack(PING))) == 1
    assert after.stamp() > sent[-1]


def test_the_file_is_written_about_once_in_two_seconds(tmp_path: Path, clock: Clock) -> None:
    writes: list[Times] = []

    class Counting(SigningFile):
        def save(self, times: Times) -> None:
            writes.append(times)
            super().save(times)

    signing, sender = Signing(KEY, clock, Counting(tmp_path / "times")), Signer(clock)
    for _ in range(500):
        clock.s += 0.02
        sender.mav.signing.timestamp = clock.ticks
        signing.stamp()
        assert len(Parser(signing).datagram(sender.pack(PING))) == 1
    assert len(writes) <= 12


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"sent": -1, "streams": {}}',
        '{"sent": 1, "streams": {"1/2": 3}}',
        '{"sent": 1.5, "streams": {}}',
    ],
)
def test_a_wrong_file_of_timestamps_is_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "times"
    path.write_text(text)
    with pytest.raises(InputError, match="begin anew"):
        SigningFile(path).load()


def test_times_are_read_as_they_were_written(tmp_path: Path) -> None:
    file = SigningFile(tmp_path / "times")
    times = Times(7, {Stream(0, 255, 190): 5, Stream(3, 1, 191): 6})
    file.save(times)
    assert SigningFile(file.path).load() == times
    lost = SigningFile(tmp_path / "no" / "times")
    lost.save(times)
    assert "could not be kept" in lost.trouble


def test_keys_of_files(tmp_path: Path) -> None:
    path = tmp_path / "key"
    path.write_text("correct horse\n")
    assert load_key(path) == KEY
    path.write_text(KEY.hex() + "\n")
    assert load_key(path) == KEY
    for wrong in (b"", b"\n", b"\xff\xfe"):
        path.write_bytes(wrong)
        with pytest.raises(InputError, match="--signing-key"):
            load_key(path)
    with pytest.raises(InputError, match="cannot be read"):
        load_key(tmp_path / "none")


def test_a_key_that_everyone_could_read_is_refused(tmp_path: Path, clock: Clock) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "key").write_text("x")
    with pytest.raises(InputError, match="shown over the link"):
        open_signing(tmp_path / "run" / "key", clock, tmp_path / "run")
    assert not open_signing(None, clock, tmp_path).active
