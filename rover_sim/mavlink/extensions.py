"""What our dialect lacks: ids of plans, which pymavlink's release does not have yet, and ArduPilot's EKF_STATUS_REPORT.

A receiver that does not know the ids reads the rest of the message as before.
"""

from __future__ import annotations

import struct
from typing import Any, ClassVar

from pymavlink.dialects.v20 import development as mavlink


def _extended(base: Any, names: tuple[str, ...]) -> Any:
    """A message class with more 32-bit extension fields, by name or behind the others; MAVLink 1 leaves them out."""
    known = len(base.fieldnames)

    class Extended(base):  # type: ignore[misc]
        fieldnames: ClassVar[list[Any]] = [*base.fieldnames, *names]
        ordered_fieldnames: ClassVar[list[Any]] = [*base.ordered_fieldnames, *names]
        fieldtypes: ClassVar[list[Any]] = [*base.fieldtypes, *("uint32_t" for _ in names)]
        native_format = base.native_format + b"I" * len(names)
        orders: ClassVar[list[Any]] = [*base.orders, *range(known, known + len(names))]
        lengths: ClassVar[list[Any]] = [*base.lengths, *(1 for _ in names)]
        array_lengths: ClassVar[list[Any]] = [*base.array_lengths, *(0 for _ in names)]
        unpacker = struct.Struct(base.unpacker.format + "I" * len(names))

        def __init__(self, *values: Any, **named: int) -> None:
            ids = dict.fromkeys(names, 0) | dict(zip(names, values[known:], strict=False))
            ids |= {name: named.pop(name) for name in names if name in named}
            super().__init__(*values[:known], **named)
            self._fieldnames = self.fieldnames
            self.__dict__.update(ids)

        def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
            payload = self.unpacker.pack(*(getattr(self, name) for name in self.ordered_fieldnames))
            if force_mavlink1:
                payload = payload[: base.unpacker.size]
            frame: bytes = self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1)
            return frame

    mavlink.mavlink_map[base.id] = Extended  # from here on it is also what is decoded
    return Extended


_Count = _extended(mavlink.MAVLink_mission_count_message, ("opaque_id",))
_Ack = _extended(mavlink.MAVLink_mission_ack_message, ("opaque_id",))
_Current = _extended(mavlink.MAVLink_mission_current_message, ("mission_id", "fence_id", "rally_points_id"))


def mission_count(system: int, component: int, count: int, kind: int, opaque_id: int) -> Any:
    """MISSION_COUNT to one client."""
    return _Count(system, component, count, kind, opaque_id=opaque_id)


def mission_ack(system: int, component: int, result: int, kind: int, opaque_id: int) -> Any:
    """MISSION_ACK to one client."""
    return _Ack(system, component, result, kind, opaque_id=opaque_id)


def mission_current(seq: int, total: int, state: int, mode: int, ids: tuple[int, int, int]) -> Any:
    """MISSION_CURRENT; ``ids`` of mission, fence and rally points."""
    return _Current(seq, total, state, mode, *ids)


class EkfStatusReport(mavlink.MAVLink_message):  # type: ignore[misc]
    """EKF_STATUS_REPORT (193) of ``ardupilotmega.xml``: which estimates an ArduPilot's filter has, as flag bits."""

    id = 193
    msgname = "EKF_STATUS_REPORT"
    _VARIANCES = ("velocity_variance", "pos_horiz_variance", "pos_vert_variance", "compass_variance")
    ordered_fieldnames: ClassVar[list[str]] = [*_VARIANCES, "terrain_alt_variance", "flags", "airspeed_variance"]
    fieldnames: ClassVar[list[str]] = ["flags", *_VARIANCES, "terrain_alt_variance", "airspeed_variance"]
    fieldtypes: ClassVar[list[str]] = ["uint16_t", *["float"] * 6]
    fielddisplays_by_name: ClassVar[dict[str, str]] = {"flags": "bitmask"}
    fieldenums_by_name: ClassVar[dict[str, str]] = {}
    fieldunits_by_name: ClassVar[dict[str, str]] = {}
    native_format = b"<fffffHf"
    orders: ClassVar[list[int]] = [5, 0, 1, 2, 3, 4, 6]
    lengths: ClassVar[list[int]] = [1] * 7
    array_lengths: ClassVar[list[int]] = [0] * 7
    crc_extra = 71
    unpacker = struct.Struct("<fffffHf")
    instance_field = None
    instance_offset = -1

    def __init__(self, flags: int, *variances: float) -> None:
        super().__init__(self.id, self.msgname)
        self._fieldnames = self.fieldnames
        self.__dict__.update(zip(self.fieldnames, (flags, *variances, *(0.0,) * (6 - len(variances))), strict=True))

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """The frame; MAVLink 1 leaves the last field out."""
        payload = self.unpacker.pack(*(getattr(self, name) for name in self.ordered_fieldnames))
        frame: bytes = self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1)
        return frame


mavlink.mavlink_map[EkfStatusReport.id] = EkfStatusReport


def ekf_status_report(flags: int) -> Any:
    """EKF_STATUS_REPORT with its flags; the variances are 0."""
    return EkfStatusReport(flags)
