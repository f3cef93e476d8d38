"""Parameters over MAVLink, in the persona's encoding.

ArduPilot casts every value to float, others lay the bytes of an integer into the float field.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Mapping

from rover_sim.mavlink.context import Context, Handler
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Client

_FULL_NAME = 16
_HASH = "_HASH_CHECK"
_INTEGERS = (mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_UINT32)


class ParameterServer:
    """Lists, reads and sets the autopilot's parameters."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._table = context.autopilot.parameters

    @property
    def handlers(self) -> Mapping[str, Handler]:
        """The parameter protocol's requests."""
        return {"PARAM_REQUEST_LIST": self._list, "PARAM_REQUEST_READ": self._read, "PARAM_SET": self._set}

    def tick(self) -> None:
        """Nothing happens by itself."""

    def _list(self, client: Client, _message: Message) -> None:
        for name in self._table.names:
            self._context.endpoint.reply(client, self._value(name))

    def _read(self, client: Client, message: Message) -> None:
        names = self._table.names
        by_name = message.param_index < 0
        if by_name and message.param_id == _HASH and self._context.persona.px4_modes:
            self._context.endpoint.reply(client, self._hash())
            return
        if not by_name and message.param_index < len(names):
            self._context.endpoint.reply(client, self._value(names[message.param_index]))
        elif by_name and message.param_id in self._table:
            self._context.endpoint.reply(client, self._value(message.param_id))
        else:
            self._refuse(client, message.param_id, message.param_index, mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST)

    def _set(self, client: Client, message: Message) -> None:
        name = message.param_id
        if name == _HASH and self._context.persona.px4_modes:
            return  # the station has them all: PX4 would stop its list
        if name not in self._table:
            self._refuse(client, name, -1, mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST)
        elif self._table.set(name, self._decoded(name, message)):
            self._context.endpoint.broadcast(self._value(name))
        else:
            entry = self._table.describe(name)
            fixed = entry.low == entry.high
            error = mavlink.MAV_PARAM_ERROR_READ_ONLY if fixed else mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
            self._refuse(client, name, -1, error)
            self._context.endpoint.reply(client, self._value(name))  # for clients that know no PARAM_ERROR

    def _value(self, name: str) -> Message:
        return parameter_value(self._context, name)

    def _hash(self) -> Message:
        """PX4's checksum of all names and values, by which a ground station knows that it has them already."""
        checksum = 0
        for name in sorted(self._table.names):
            kind = "<i" if self._table.describe(name).integer else "<f"
            value = self._table[name]
            data = struct.pack(kind, int(value) if kind == "<i" else value)
            checksum = zlib.crc32(name.encode() + data, checksum)
        (number,) = struct.unpack("<f", struct.pack("<I", checksum))
        total = len(self._table.names)
        return mavlink.MAVLink_param_value_message(_HASH.encode(), number, mavlink.MAV_PARAM_TYPE_UINT32, total, 65535)

    def _decoded(self, name: str, message: Message) -> float:
        """The value that a PARAM_SET means; NaN, which nothing takes, for a type that is not the parameter's."""
        value = float(message.param_value)
        if not self._context.persona.bytewise:
            return value
        if self._table.describe(name).integer:
            whole = message.param_type in _INTEGERS
            return float(struct.unpack("<i", struct.pack("<f", value))[0]) if whole else math.nan
        return value if message.param_type == mavlink.MAV_PARAM_TYPE_REAL32 else math.nan

    def _refuse(self, client: Client, name: str, index: int, error: int) -> None:
        text = name.encode("ascii", errors="replace")[:_FULL_NAME]
        self._context.endpoint.reply(
            client, mavlink.MAVLink_param_error_message(client.system, client.component, text, index, error)
        )


def parameter_value(context: Context, name: str) -> Message:
    """PARAM_VALUE of a parameter that there is."""
    table = context.autopilot.parameters
    integer, names, value = table.describe(name).integer, table.names, table[name]
    if integer and context.persona.bytewise:
        (value,) = struct.unpack("<f", struct.pack("<i", int(value)))
    kind = mavlink.MAV_PARAM_TYPE_INT32 if integer else mavlink.MAV_PARAM_TYPE_REAL32
    return mavlink.MAVLink_param_value_message(name.encode(), value, kind, len(names), names.index(name))
