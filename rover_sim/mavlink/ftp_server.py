"""File transfer, read only: sessions of each client, and the answers to its requests."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import BinaryIO

from rover_sim.mavlink.context import Context, Handler
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Client
from rover_sim.mavlink.ftp_files import Files
from rover_sim.mavlink.ftp_packet import DATA_BYTES, Failure, FtpError, Opcode, Packet, checksum

EXPIRES_S = 20.0  # ArduPilot's time for an idle session
SESSIONS = 4  # of one client
_MOST_CLIENTS = 32
BURST_PACKETS = 12
_CHUNK_BYTES = 1 << 20
_MOST_SUMMED_BYTES = 64 << 20  # a larger file would hold up the vehicle
_WRITING = (
    Opcode.CREATE_FILE,
    Opcode.WRITE_FILE,
    Opcode.REMOVE_FILE,
    Opcode.CREATE_DIRECTORY,
    Opcode.REMOVE_DIRECTORY,
    Opcode.OPEN_FILE_WO,
    Opcode.TRUNCATE_FILE,
    Opcode.RENAME,
)


@dataclass(eq=False)
class _Session:
    """A file that a client reads; ``size`` as it was when opened."""

    file: BinaryIO
    size: int
    used_s: float

    def read(self, offset: int, wanted: int) -> bytes:
        """Up to one packet of it; raises FtpError at the end. ``wanted`` 0 means as much as fits."""
        if offset >= self.size:
            raise FtpError(Failure.EOF)
        self.file.seek(offset)
        data = self.file.read(min(wanted or DATA_BYTES, DATA_BYTES, self.size - offset))
        if not data:  # the file has been cut since
            raise FtpError(Failure.EOF)
        return data


@dataclass(eq=False)
class _Peer:
    """What is known of one client: its sessions, and its last request with what was answered."""

    heard_s: float
    sessions: dict[int, _Session] = field(default_factory=dict)
    request: bytes = b""
    answers: list[Packet] = field(default_factory=list)

    def end(self, number: int) -> None:
        """Close a session."""
        self.sessions.pop(number).file.close()

    def end_all(self) -> None:
        """Close all sessions."""
        for number in list(self.sessions):
            self.end(number)


class FileServer:
    """Answers FILE_TRANSFER_PROTOCOL; a request that comes again, as its answer was lost, gets the same answer."""

    def __init__(self, context: Context, files: Files) -> None:
        self._context = context
        self._files = files
        self._peers: dict[Client, _Peer] = {}
        self._actions: Mapping[int, Callable[[_Peer, Packet], list[Packet]]] = {
            Opcode.NONE: lambda _peer, request: [_ack(request)],
            Opcode.TERMINATE_SESSION: self._terminate,
            Opcode.RESET_SESSIONS: self._reset,
            Opcode.LIST_DIRECTORY: self._list,
            Opcode.OPEN_FILE_RO: self._open,
            Opcode.READ_FILE: self._read,
            Opcode.BURST_READ_FILE: self._burst,
            Opcode.CALC_FILE_CRC32: self._sum,
            **dict.fromkeys(_WRITING, _protected),
        }

    @property
    def handlers(self) -> Mapping[str, Handler]:
        """MAVFTP."""
        return {"FILE_TRANSFER_PROTOCOL": self._answer}

    def tick(self) -> None:
        """Close what has not been used for 20 s, and what belongs to a client whose channel is gone."""
        if not self._peers:
            return
        channels = self._context.endpoint.channels
        oldest_s = self._context.time_s - EXPIRES_S
        for client, peer in list(self._peers.items()):
            if client.channel not in channels or peer.heard_s < oldest_s:
                peer.end_all()
                del self._peers[client]
            for number, session in list(peer.sessions.items()):
                if session.used_s < oldest_s:
                    peer.end(number)

    def close(self) -> None:
        """Close all files."""
        for peer in self._peers.values():
            peer.end_all()
        self._peers.clear()

    def _answer(self, client: Client, message: Message) -> None:
        payload = bytes(message.payload)
        request = Packet.decode(payload)
        if request.opcode in (Opcode.ACK, Opcode.NAK):
            return
        peer = self._peer(client)
        peer.heard_s = self._context.time_s
        if payload != peer.request:
            peer.request, peer.answers = payload, self._do(peer, request)
        for answer in peer.answers:
            self._context.endpoint.reply(
                client,
                mavlink.MAVLink_file_transfer_protocol_message(0, client.system, client.component, answer.encode()),
            )

    def _peer(self, client: Client) -> _Peer:
        if client not in self._peers and len(self._peers) >= _MOST_CLIENTS:
            idlest = min(self._peers, key=lambda known: self._peers[known].heard_s)
            self._peers.pop(idlest).end_all()
        return self._peers.setdefault(client, _Peer(self._context.time_s))

    def _do(self, peer: _Peer, request: Packet) -> list[Packet]:
        action = self._actions.get(request.opcode)
        if action is None:
            return [_nak(request, Failure.UNKNOWN_COMMAND)]
        if request.size > DATA_BYTES:
            return [_nak(request, Failure.INVALID_DATA_SIZE)]
        try:
            return action(peer, request)
        except FtpError as error:
            return [_nak(request, error.failure)]
        except OSError:  # the disk, not the client
            return [_nak(request, Failure.FAIL)]

    def _terminate(self, peer: _Peer, request: Packet) -> list[Packet]:
        self._session(peer, request)
        peer.end(request.session)
        return [_ack(request)]

    def _reset(self, peer: _Peer, request: Packet) -> list[Packet]:
        peer.end_all()
        return [_ack(request)]

    def _list(self, _peer: _Peer, request: Packet) -> list[Packet]:
        data = b""
        for entry in self._files.entries(request.data)[request.offset :]:
            if len(data) + len(entry) > DATA_BYTES:
                break
            data += entry
        if not data:
            raise FtpError(Failure.EOF)
        return [replace(_ack(request), data=data)]

    def _open(self, peer: _Peer, request: Packet) -> list[Packet]:
        """The session gets the number that the client proposes, as pymavlink expects, or a free one."""
        file, size = self._files.open(request.data)
        if len(peer.sessions) >= SESSIONS:
            peer.end(min(peer.sessions, key=lambda number: peer.sessions[number].used_s))
        free = (number for number in (request.session, *range(256)) if number not in peer.sessions)
        number = next(free)
        peer.sessions[number] = _Session(file, size, self._context.time_s)
        return [replace(_ack(request), session=number, data=size.to_bytes(4, "little"))]

    def _read(self, peer: _Peer, request: Packet) -> list[Packet]:
        data = self._session(peer, request).read(request.offset, request.size)
        return [replace(_ack(request), data=data)]

    def _burst(self, peer: _Peer, request: Packet) -> list[Packet]:
        """A few packets at once; the client asks on from where they end."""
        session = self._session(peer, request)
        answers: list[Packet] = []
        offset = request.offset
        while len(answers) < BURST_PACKETS and (offset < session.size or not answers):
            data = session.read(offset, request.size)
            sequence = (request.sequence + 1 + len(answers)) & 0xFFFF
            answers.append(replace(_ack(request), sequence=sequence, data=data, offset=offset))
            offset += len(data)
        answers[-1] = replace(answers[-1], burst_ends=True)
        return answers

    def _sum(self, _peer: _Peer, request: Packet) -> list[Packet]:
        file, size = self._files.open(request.data)
        with file:
            if size > _MOST_SUMMED_BYTES:
                raise FtpError(Failure.FAIL)
            crc = 0
            while size > 0 and (chunk := file.read(min(_CHUNK_BYTES, size))):
                crc = checksum(chunk, crc)
                size -= len(chunk)
        return [replace(_ack(request), data=crc.to_bytes(4, "little"))]

    def _session(self, peer: _Peer, request: Packet) -> _Session:
        session = peer.sessions.get(request.session)
        if session is None:
            raise FtpError(Failure.INVALID_SESSION)
        session.used_s = self._context.time_s
        return session


def _ack(request: Packet) -> Packet:
    sequence = (request.sequence + 1) & 0xFFFF
    return Packet(sequence, request.session, Opcode.ACK, request_opcode=request.opcode, offset=request.offset)


def _nak(request: Packet, failure: Failure) -> Packet:
    return replace(_ack(request), opcode=Opcode.NAK, data=bytes([failure]))


def _protected(_peer: _Peer, _request: Packet) -> list[Packet]:
    raise FtpError(Failure.FILE_PROTECTED)
