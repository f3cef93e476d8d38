"""How QGroundControl connects: its states in order, each with its time-out and its tries.

Written after its sources (``InitialConnectStateMachine``, ``ParameterManager``, ``FTPManager``, ``PlanManager``,
``APMFirmwarePlugin``).
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.ftp_packet import DATA_BYTES, Opcode, Packet
from tests.qgc_station import QgcStation, Script, Step

PLAN_S, LIST_S, FTP_S = 1.5, 5.0, 1.0
FENCE, RALLY = 0x4000, 0x8000
# Groups of the older streams that its plugin for ArduPilot asks for, and Hz.
STREAMS = ((1, 2), (2, 2), (3, 2), (6, 3), (10, 10), (11, 10), (12, 3))


class QgcConnect(QgcStation):
    """A station that connects."""

    def connect(self) -> Script:
        """All states, until the station is ready."""
        yield from self._step("streams", self._streams())
        version = yield from self._step("version", self.request(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION))
        capabilities = version.capabilities if version else 0xC00C
        yield from self._step("modes", self._modes())
        yield from self._step("component information", self._information())
        yield from self._step("parameters", self._parameters())
        for _ in range(2):
            self.send(mavlink.MAVLink_system_time_message(0, 0))
        yield from self._step("mission", self.download(0))
        if capabilities & FENCE:
            yield from self._step("fence", self.download(1))
        if capabilities & RALLY:
            yield from self._step("rally", self.download(2))

    def _step(self, name: str, script: Script) -> Script:
        start_s, before = self.time_s, self._sent
        result = yield from script
        self.steps.append(Step(name, self.time_s - start_s, self._sent - before))
        return result

    def _streams(self) -> Script:
        if self.persona.name == "ardupilot":
            for group, rate_hz in STREAMS:
                self.send(mavlink.MAVLink_request_data_stream_message(1, 1, group, rate_hz, 1))
            for message_id in (mavlink.MAVLINK_MSG_ID_HOME_POSITION, mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE):
                yield from self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, 1e6)

    def _modes(self) -> Script:
        index, count = 1, 1
        while index <= count:
            mode = yield from self.request(mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES, index)
            if mode is None:
                return
            index, count = mode.mode_index + 1, mode.number_modes

    def _information(self) -> Script:
        for message_id in (397, 395):
            if (yield from self.request(message_id)) is not None:
                return

    def _parameters(self) -> Script:
        if self.persona.name == "px4":
            yield from self._hash()
        data = None if self.persona.name == "generic" else (yield from self._file(b"@PARAM/param.pck?withdefaults=1"))
        if data is not None:
            self.parameters.update(unpacked(data))
        else:
            yield from self._list()
        missing = [name for name in EXPECTED[self.persona.name].split() if name not in self.parameters]
        if missing:
            self.complaints.append(f"Parameters are missing from firmware: {missing}")

    def _hash(self) -> Script:
        self.send(mavlink.MAVLink_param_request_read_message(1, 1, b"_HASH_CHECK", -1))
        found = yield from self._await(
            lambda one: one.get_type() == "PARAM_VALUE" and one.param_id == "_HASH_CHECK", FTP_S
        )
        if found is None:
            self.retries.append("_HASH_CHECK")

    def _list(self) -> Script:
        self.send(mavlink.MAVLink_param_request_list_message(1, 1))
        seen: dict[int, Message] = {}
        limit_s = LIST_S
        while not seen or len(seen) < next(iter(seen.values())).param_count:
            value = yield from self._await(lambda one: one.get_type() == "PARAM_VALUE", limit_s)
            if value is None:
                self.complaints.append("parameters did not come")
                return
            seen[value.param_index] = value
            limit_s = 3.0
        for value in seen.values():
            number = value.param_value
            if self.persona.bytewise and value.param_type == mavlink.MAV_PARAM_TYPE_INT32:
                (number,) = struct.unpack("<i", struct.pack("<f", number))
            self.parameters[value.param_id] = number

    def _file(self, path: bytes) -> Script:
        """A file by MAVFTP, in bursts; None if it is not there."""
        opened = yield from self._transfer(Packet(1, 0, Opcode.OPEN_FILE_RO, path))
        if opened is None or opened.opcode == Opcode.NAK:
            return None
        data, sequence = b"", 10
        asked = Packet(sequence, opened.session, Opcode.BURST_READ_FILE, b"", size=DATA_BYTES)
        part = yield from self._transfer(asked)
        while part is not None and part.opcode == Opcode.ACK:
            assert part.offset == len(data)
            data += part.data
            if part.burst_ends:
                sequence = part.sequence + 1
                asked = Packet(sequence, opened.session, Opcode.BURST_READ_FILE, b"", size=DATA_BYTES, offset=len(data))
                part = yield from self._transfer(asked)
            else:
                part = yield from self._packet(FTP_S)
        yield from self._transfer(Packet(sequence + 100, 0, Opcode.RESET_SESSIONS, b""))
        return data

    def _transfer(self, packet: Packet) -> Script:
        for again in range(4):
            self._retry(again, f"file transfer {packet.opcode}")
            self.send(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, packet.encode()))
            answer = yield from self._packet(FTP_S)
            if answer is not None:
                return answer
        self.complaints.append("file transfer unanswered")
        return None

    def _packet(self, seconds: float) -> Script:
        message = yield from self._await(lambda one: one.get_type() == "FILE_TRANSFER_PROTOCOL", seconds)
        return None if message is None else Packet.decode(bytes(message.payload))

    def download(self, kind: int) -> Script:
        """Number of items of a mission (0), fence (1) or rally list (2)."""

        def of_kind(name: str) -> Callable[[Message], bool]:
            return lambda one: one.get_type() == name and one.mission_type == kind

        count = yield from self._plan(
            mavlink.MAVLink_mission_request_list_message(1, 1, kind), of_kind("MISSION_COUNT"), 7
        )
        for seq in range(count.count if count else 0):
            request = mavlink.MAVLink_mission_request_int_message(1, 1, seq, kind)
            yield from self._plan(request, of_kind("MISSION_ITEM_INT"), 6)
        self.send(mavlink.MAVLink_mission_ack_message(1, 1, 0, kind))
        return count.count if count else None

    def _plan(self, message: Message, wanted: Callable[[Message], bool], tries: int) -> Script:
        for again in range(tries):
            self._retry(again, message.get_type())
            self.send(message)
            found = yield from self._await(wanted, PLAN_S)
            if found is not None:
                return found
        self.complaints.append(f"{message.get_type()} unanswered")
        return None


# Names that QGroundControl reads without asking whether they exist.
EXPECTED = {
    "ardupilot": " ".join(
        (
            "RCMAP_ROLL RCMAP_PITCH RCMAP_YAW RCMAP_THROTTLE FRAME_CLASS ARMING_REQUIRE",
            *(f"RC{channel}_{end}" for channel in (1, 2, 3, 4) for end in ("MIN", "MAX", "TRIM")),
            *(f"COMPASS_DEV_ID{n} COMPASS_USE{n}" for n in ("", "2", "3")),
            "COMPASS_OFS_X COMPASS_OFS_Y COMPASS_OFS_Z INS_ACCOFFS_X INS_ACCOFFS_Y INS_ACCOFFS_Z",
        )
    ),
    "px4": "SYS_AUTOSTART COM_RC_IN_MODE CAL_GYRO0_ID CAL_ACC0_ID CAL_MAG0_ID SYS_HAS_MAG RC_MAP_ROLL RC_MAP_PITCH "
    "RC_MAP_YAW RC_MAP_THROTTLE BAT1_SOURCE BAT1_V_CHARGED BAT1_V_EMPTY BAT1_N_CELLS SYS_HAS_NUM_ASPD",
    "generic": "",
}


def unpacked(data: bytes) -> dict[str, float]:
    """Parameters of ArduPilot's packed format, as QGroundControl reads it."""
    magic, here, total = struct.unpack_from("<HHH", data)
    assert magic in (0x671B, 0x671C)
    assert here == total
    found: dict[str, float] = {}
    name, at = b"", 6
    while at < len(data):
        if data[at] == 0:
            at += 1
            continue
        kind, default = data[at] & 15, data[at] >> 4 & 1
        length, common = (data[at + 1] >> 4) + 1, data[at + 1] & 15
        name = name[:common] + data[at + 2 : at + 2 + length]
        at += 2 + length
        code = {1: "b", 2: "h", 3: "i", 4: "f"}[kind]
        (found[name.decode()],) = struct.unpack_from(f"<{code}", data, at)
        at += struct.calcsize(code) * (1 + default)
    assert len(found) == total
    return found


def needs_setup(parameters: dict[str, float]) -> list[str]:
    """What QGroundControl would mark as to be set up on an ArduPilot rover."""
    wanting = []
    pulses = [parameters[f"RC{n}_{end}"] for n in (1, 2, 3, 4) for end in ("MIN", "MAX", "TRIM")]
    if pulses == [1100, 1900, 1500] * 4:
        wanting.append("radio")
    if parameters["COMPASS_USE"] and 0 in (
        parameters["COMPASS_DEV_ID"],
        *(parameters[f"COMPASS_OFS_{a}"] for a in "XYZ"),
    ):
        wanting.append("compass")
    if not any(parameters[f"INS_ACCOFFS_{axis}"] for axis in "XYZ"):
        wanting.append("accelerometer")
    if parameters["FRAME_CLASS"] == 0:
        wanting.append("frame")
    return wanting
