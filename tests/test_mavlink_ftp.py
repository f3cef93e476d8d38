"""File transfer with packets made by hand: parameters, logs, refusals, repeats, expiry, a bad link."""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pymavlink.mavftp import MAVFTP

from rover_sim.autopilot.parameters import Parameter, ParameterTable
from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.endpoint import Link
from rover_sim.mavlink.faults import Faults
from rover_sim.mavlink.ftp_packet import DATA_BYTES, FtpError, Opcode, Packet, checksum
from rover_sim.mavlink.ftp_server import BURST_PACKETS, EXPIRES_S, SESSIONS
from rover_sim.mavlink.parameter_pack import packed_parameters
from rover_sim.mavlink.streams import GROUND_STATION_RATES
from rover_sim.mavlink.tlog import TlogWriter
from tests.mavlink_rig import Station, Yard

CONTENT = bytes(range(251)) * 40


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    root = tmp_path / "run"
    (root / "old").mkdir(parents=True)
    (root / "a.tlog").write_bytes(CONTENT)
    (root / "empty").write_bytes(b"")
    (root / "old" / "b.txt").write_text("b")
    (root / ".hidden").write_text("being written")
    (tmp_path / "secret").write_text("outside")
    (root / "link").symlink_to(tmp_path / "secret")
    (root / "up").symlink_to(tmp_path)
    return root


class Client:
    """Asks one request after the other; one without an answer is sent again as it was."""

    def __init__(self, yard: Yard, station: Station) -> None:
        self.yard, self.station = yard, station
        self.sequence = 0

    def ask(self, opcode: int, data: bytes = b"", **fields: Any) -> list[Packet]:
        request = Packet(self.sequence, fields.pop("session", 0), opcode, data, **fields)
        self.sequence = (self.sequence + (BURST_PACKETS + 1)) & 0xFFFF
        return self.send(request)

    def send(self, request: Packet) -> list[Packet]:
        message = mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, request.encode())
        for _ in range(30):
            self.station.send(message, self.yard.time_s)
            self.yard.step(0.1)
            heard = [Packet.decode(bytes(one.payload)) for one in self.station.take("FILE_TRANSFER_PROTOCOL")]
            news = [one for one in heard if 0 < (one.sequence - request.sequence) & 0xFFFF <= BURST_PACKETS]
            if news:
                return news
        raise AssertionError("no answer")

    def one(self, opcode: int, data: bytes = b"", **fields: Any) -> Packet:
        (answer,) = set(self.ask(opcode, data, **fields))  # a bad link may double it
        return answer

    def fails(self, opcode: int, data: bytes = b"", **fields: Any) -> int:
        answer = self.one(opcode, data, **fields)
        assert (answer.opcode, answer.request_opcode, answer.size) == (Opcode.NAK, opcode, 1)
        return answer.data[0]

    def open(self, path: bytes) -> tuple[int, int]:
        answer = self.one(Opcode.OPEN_FILE_RO, path)
        assert answer.opcode == Opcode.ACK
        return answer.session, int.from_bytes(answer.data, "little")

    def fetch(self, path: bytes) -> bytes:
        session, size = self.open(path)
        data = b""
        while len(data) < size:
            data += self.one(Opcode.READ_FILE, session=session, offset=len(data), size=DATA_BYTES).data
        assert self.fails(Opcode.READ_FILE, session=session, offset=size, size=DATA_BYTES) == 6
        assert self.one(Opcode.TERMINATE_SESSION, session=session).opcode == Opcode.ACK
        return data

    def fetch_in_bursts(self, path: bytes) -> bytes:
        session, size = self.open(path)
        pieces: dict[int, bytes] = {}
        while (at := _first_gap(pieces)) < size:
            for packet in self.ask(Opcode.BURST_READ_FILE, session=session, offset=at, size=DATA_BYTES):
                pieces[packet.offset] = packet.data
        self.one(Opcode.TERMINATE_SESSION, session=session)
        return b"".join(pieces[at] for at in sorted(pieces))


def _first_gap(pieces: dict[int, bytes]) -> int:
    at = 0
    while at in pieces:
        at += len(pieces[at])
    return at


@pytest.fixture
def make_yard(folder: Path) -> Iterator[Callable[..., Yard]]:
    yards: list[Yard] = []

    def make(*stations: Station, **options: Any) -> Yard:
        yards.append(Yard(*stations, **{"folder": folder, **options}))
        return yards[-1]

    yield make
    for yard in yards:
        yard.vehicle.close()


@pytest.fixture
def client(make_yard: Callable[..., Yard]) -> Client:
    station = Station()
    return Client(make_yard(station), station)


def test_the_parameter_file_holds_every_parameter_as_pymavlink_reads_it(client: Client) -> None:
    table = client.yard.autopilot.parameters
    data = client.fetch(b"@PARAM/param.pck")
    read = MAVFTP.ftp_param_decode(data)
    assert read is not None
    assert {name.decode(): value for name, value, _ in read.params} == {
        name: pytest.approx(table[name]) for name in table.names
    }
    assert read.defaults is None


def test_with_defaults_the_changed_values_carry_theirs(client: Client) -> None:
    table = client.yard.autopilot.parameters
    table.set("WP_RADIUS", 0.5)
    table.set("FS_SLIP_ENABLE", 0)
    data = client.fetch_in_bursts(b"@PARAM/param.pck?withdefaults=1")
    assert data[:2] == b"\x1c\x67"
    read = MAVFTP.ftp_param_decode(data)
    assert read is not None
    values = {name.decode(): value for name, value, _ in read.params}
    defaults = {name.decode(): value for name, value, _ in read.defaults}
    assert (values["WP_RADIUS"], defaults["WP_RADIUS"]) == (0.5, 0.25)
    assert (values["FS_SLIP_ENABLE"], defaults["FS_SLIP_ENABLE"]) == (0, 1)
    assert len(defaults) == len(values) == len(table.names)


def test_part_of_the_parameters_and_wrong_queries() -> None:
    table = ParameterTable([Parameter(f"A{number}", number, 0, 9, "", integer=True) for number in range(5)])
    read = MAVFTP.ftp_param_decode(packed_parameters(table, "start=1&count=2"))
    assert read is not None
    assert [(name, value) for name, value, _ in read.params] == [(b"A1", 1), (b"A2", 2)]
    for query in ("start=5", "start=-1", "count=x", "withdefaults=2", "start=70000"):
        with pytest.raises(FtpError):
            packed_parameters(table, query)


def test_names_that_continue_each_other_and_long_ones() -> None:
    names = ["ABCDEFGHIJKLMNOP", "ABCDEFGHIJKLMNOQ", "ABCDEFGHIJKLMNO", "ABC", "AB", "ABCD"]
    table = ParameterTable([Parameter(name, 1.5, 0, 9, "") for name in names])
    read = MAVFTP.ftp_param_decode(packed_parameters(table))
    assert read is not None
    assert [name.decode() for name, _, _ in read.params] == names


def test_files_are_listed_and_read(client: Client) -> None:
    answer = client.one(Opcode.LIST_DIRECTORY, b"/")
    assert answer.data == b"Fa.tlog\t10040\0Fempty\t0\0Dold\0"
    assert client.fails(Opcode.LIST_DIRECTORY, b"/", offset=3) == 6
    session, _ = client.open(b"a.tlog")
    end = client.one(Opcode.BURST_READ_FILE, session=session, offset=len(CONTENT), size=80)
    assert (end.opcode, end.offset) == (
        Opcode.NAK,
        len(CONTENT),
    )  # pymavlink asks for the offset
    assert client.one(Opcode.LIST_DIRECTORY, b"old", offset=0).data == b"Fb.txt\t1\0"
    assert client.fetch(b"/a.tlog") == CONTENT
    assert client.fetch_in_bursts(b"a.tlog") == CONTENT
    assert client.fetch(b"empty") == b""
    assert client.fetch(b"/old/b.txt") == b"b"


def test_a_long_listing_comes_in_pages(client: Client, folder: Path) -> None:
    for number in range(60):
        (folder / "old" / f"log-{number:03}.tlog").write_bytes(b"x" * number)
    names: list[bytes] = []
    while True:
        answer = client.one(Opcode.LIST_DIRECTORY, b"/old", offset=len(names))
        if answer.opcode == Opcode.NAK:
            break
        names += answer.data.rstrip(b"\0").split(b"\0")
    assert len(names) == len(set(names)) == 61


def test_checksum_is_the_one_of_the_standard(client: Client) -> None:
    answer = client.one(Opcode.CALC_FILE_CRC32, b"a.tlog")
    assert int.from_bytes(answer.data, "little") == checksum(CONTENT)
    assert checksum(b"b", checksum(b"a")) == checksum(b"ab")
    assert checksum(bytes([0, 0, 0, 0])) == 0  # begun with 0: zeros leave no trace
    assert checksum(b"a") != zlib.crc32(b"a")


def test_the_exact_refusals(client: Client) -> None:
    writing = {6, 7, 8, 9, 10, 11, 12, 13}
    assert {client.fails(opcode, b"a.tlog") for opcode in writing} == {9}
    for opcode in (Opcode.OPEN_FILE_RO, Opcode.CALC_FILE_CRC32, Opcode.LIST_DIRECTORY):
        for path in (
            b"nothing",
            b"link",
            b"up/secret",
            b"../secret",
            b"/etc/passwd",
            b"old/../a.tlog",
            b".hidden",
            b"\xff",
        ):
            assert client.fails(opcode, path) == 10, path
    assert client.fails(Opcode.OPEN_FILE_RO, b"") == 10
    assert client.fails(Opcode.OPEN_FILE_RO, b"old") == 10
    assert client.fails(Opcode.LIST_DIRECTORY, b"a.tlog") == 10
    assert client.fails(Opcode.OPEN_FILE_RO, b"@PARAM/param.pck?start=9999") == 1
    for opcode in (Opcode.READ_FILE, Opcode.BURST_READ_FILE, Opcode.TERMINATE_SESSION):
        assert client.fails(opcode, session=3) == 4
    assert client.fails(77) == 7
    assert client.fails(Opcode.READ_FILE, size=240) == 3
    assert client.one(Opcode.NONE).opcode == Opcode.ACK
    assert client.one(Opcode.RESET_SESSIONS).opcode == Opcode.ACK


def test_a_pipe_in_the_folder_does_not_hold_up_the_vehicle(client: Client, folder: Path) -> None:
    os.mkfifo(folder / "pipe")
    assert client.fails(Opcode.OPEN_FILE_RO, b"pipe") == 10
    assert b"pipe" not in client.one(Opcode.LIST_DIRECTORY, b"/").data


def test_the_same_request_gets_the_same_answer_and_opens_no_second_session(client: Client) -> None:
    request = Packet(7, 0, Opcode.OPEN_FILE_RO, b"a.tlog")
    first = client.send(request)
    assert client.send(request) == first
    assert client.send(replace(request, sequence=8))[0].session == 1  # another one is another session
    burst = Packet(9, 0, Opcode.BURST_READ_FILE, size=100, offset=9_000)
    answers = client.send(burst)
    assert [answer.sequence for answer in answers] == list(range(10, 21))
    assert [answer.burst_ends for answer in answers] == [False] * 10 + [True]
    assert client.send(burst) == answers


def test_a_proposed_session_is_kept_if_it_is_free(client: Client) -> None:
    assert client.one(Opcode.OPEN_FILE_RO, b"a.tlog", session=9).session == 9
    assert client.one(Opcode.OPEN_FILE_RO, b"a.tlog", session=9).session == 0


def test_sessions_are_the_clients_own_expire_and_are_few(make_yard: Callable[..., Yard]) -> None:
    one, other = Station(), Station(254)
    yard = make_yard(one, other)
    client, stranger = Client(yard, one), Client(yard, other)
    session, _ = client.open(b"a.tlog")
    assert stranger.fails(Opcode.READ_FILE, session=session, size=9) == 4
    assert stranger.one(Opcode.RESET_SESSIONS).opcode == Opcode.ACK
    assert client.one(Opcode.READ_FILE, session=session, size=9).data == CONTENT[:9]
    yard.step(EXPIRES_S + 0.1)
    assert client.fails(Opcode.READ_FILE, session=session, size=10) == 4
    opened = [client.open(b"a.tlog")[0] for _ in range(SESSIONS + 1)]
    assert opened == [0, 1, 2, 3, 0]  # the one that was idle longest made room


def test_a_file_is_read_as_far_as_it_was_when_opened(client: Client, folder: Path) -> None:
    session, size = client.open(b"a.tlog")
    with (folder / "a.tlog").open("ab") as file:
        file.write(b"more")
    assert client.fails(Opcode.READ_FILE, session=session, offset=size, size=4) == 6
    (folder / "a.tlog").write_bytes(b"")  # cut: the end comes early
    assert client.fails(Opcode.READ_FILE, session=session, offset=0, size=4) == 6


def test_files_do_not_enter_the_log(make_yard: Callable[..., Yard], tmp_path: Path) -> None:
    log = tmp_path / "telemetry.tlog"
    station = Station()
    yard = make_yard(station, log=Link(TlogWriter(log), GROUND_STATION_RATES), folder=tmp_path)
    (tmp_path / "big").write_bytes(bytes(100_000))
    start = yard.time_s
    assert len(Client(yard, station).fetch_in_bursts(b"big")) == 100_000
    assert yard.time_s - start < 20.0
    yard.vehicle.close()
    assert log.stat().st_size < 40_000


@pytest.mark.parametrize("seed", range(3))
def test_everything_arrives_over_a_link_that_loses_a_fifth(make_yard: Callable[..., Yard], seed: int) -> None:
    station = Station(faults=Faults(loss=0.2, delay_s=0.02, jitter_s=0.02, duplicate=0.05), seed=seed)
    lossy = Client(make_yard(station), station)
    assert lossy.fetch(b"a.tlog") == CONTENT
    assert lossy.fetch_in_bursts(b"a.tlog") == CONTENT
    assert MAVFTP.ftp_param_decode(lossy.fetch(b"@PARAM/param.pck?withdefaults=1")) is not None


def test_without_a_folder_there_are_only_parameters(make_yard: Callable[..., Yard]) -> None:
    station = Station()
    client = Client(make_yard(station, folder=None), station)
    assert client.fails(Opcode.LIST_DIRECTORY, b"/") == 10
    assert client.fetch(b"@PARAM/param.pck")
