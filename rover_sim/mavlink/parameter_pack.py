"""All parameters as one file, in ArduPilot's packed format: what its ground stations fetch as ``@PARAM/param.pck``.

A header (magic, parameters here, parameters in all, 16 bits each), then for each parameter a byte of type and flags, a
byte of name lengths (shared with the name before; the rest, less one), the rest of the name, the value and, where
flagged, the default. Format: ArduPilot ``libraries/AP_Filesystem/AP_Filesystem_Param.cpp``. ArduPilot pads so that no
value is cut by a packet, as its values may change between two; this file is a snapshot and needs no padding.
"""

from __future__ import annotations

import struct
from urllib.parse import parse_qsl

from rover_sim.autopilot.parameters import Parameter, ParameterTable
from rover_sim.mavlink.ftp_packet import Failure, FtpError

NAME = "@PARAM/param.pck"
_MAGIC, _MAGIC_WITH_DEFAULTS = 0x671B, 0x671C
_INT32, _FLOAT = 3, 4
_HAS_DEFAULT = 0x10
_MOST = 65534  # of start and count


def packed_parameters(table: ParameterTable, query: str = "") -> bytes:
    """The file for ``start=N&count=N&withdefaults=0|1``, any of them left out; raises FtpError for a wrong query.

    With defaults, only those values that differ from theirs carry one.
    """
    start, count, with_defaults = _asked(query)
    names = table.names
    if start >= len(names):
        raise FtpError(Failure.FAIL)
    chosen = names[start : start + count] if count else names[start:]
    parts = [struct.pack("<HHH", _MAGIC_WITH_DEFAULTS if with_defaults else _MAGIC, len(chosen), len(names))]
    before = ""
    for name in chosen:
        parts.append(_entry(table.describe(name), table[name], before, with_defaults=with_defaults))
        before = name
    return b"".join(parts)


def _entry(parameter: Parameter, value: float, before: str, *, with_defaults: bool) -> bytes:
    name = parameter.name
    shared = 0
    while shared < min(len(before), len(name) - 1) and before[shared] == name[shared]:
        shared += 1
    rest = name[shared:].encode("ascii")
    add_default = with_defaults and value != parameter.default
    kind = (_INT32 if parameter.integer else _FLOAT) | (_HAS_DEFAULT if add_default else 0)
    values = (value, parameter.default) if add_default else (value,)
    numbers = b"".join(struct.pack("<i", int(one)) if parameter.integer else struct.pack("<f", one) for one in values)
    return bytes([kind, shared | (len(rest) - 1) << 4]) + rest + numbers


def _asked(query: str) -> tuple[int, int, bool]:
    asked = {"start": 0, "count": 0, "withdefaults": 0}
    for key, text in parse_qsl(query, keep_blank_values=True):
        if key in asked:
            number = int(text) if text.isascii() and text.isdigit() else -1
            if not 0 <= number <= (1 if key == "withdefaults" else _MOST):
                raise FtpError(Failure.FAIL)
            asked[key] = number
    return asked["start"], asked["count"], bool(asked["withdefaults"])
