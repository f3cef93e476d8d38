"""What a component hears of a vehicle: mode, arming, progress of the mission, texts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from rover_sim.autopilot.modes import MissionState
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.geodesy import DEGREES_E7, GeoPoint

LINK_LOST_S = 3.5  # the silence after which QGroundControl gives a vehicle up
_LAST_TEXTS = 20
_NO_HEADING = 65535


@dataclass(frozen=True)
class VehicleStatus:
    """What has been heard of a vehicle; None where nothing has been heard."""

    heard_s: float | None = None  # time of the last heartbeat
    mode: int | None = None
    armed: bool = False
    current: int | None = None
    total: int | None = None  # items of the vehicle's mission without home, where it tells
    mission_state: MissionState | None = None
    mission_id: int = 0  # of the mission that the vehicle has; 0: none, or it tells no ids
    reached: tuple[int, ...] = ()  # items of the mission uploaded last
    texts: tuple[tuple[float, int, str], ...] = ()  # time, severity, text; oldest first
    place: GeoPoint | None = None
    heading_deg: float | None = None  # compass


class VehicleWatch:
    """Hears one vehicle's messages; the time is that of the last `look`."""

    def __init__(self, mode_of: Callable[[int], int] = int, first_item: int = 0) -> None:
        """``mode_of``: our number of its modes; ``first_item``: our number of its mission's item 0."""
        self.mode_of, self.first_item = mode_of, first_item
        self._status = VehicleStatus()
        self._chunks: dict[int, str] = {}
        self._time_s = 0.0
        self.handlers: Mapping[str, Callable[[Message], None]] = {
            "HEARTBEAT": self._heartbeat,
            "MISSION_CURRENT": self._mission_current,
            "MISSION_ITEM_REACHED": self._reached,
            "STATUSTEXT": self._text,
            "GLOBAL_POSITION_INT": self._position,
        }

    @property
    def status(self) -> VehicleStatus:
        """What is known of the vehicle now."""
        return self._status

    @property
    def linked(self) -> bool:
        """Whether the vehicle has been heard lately."""
        heard = self._status.heard_s
        return heard is not None and self._time_s - heard <= LINK_LOST_S

    def look(self, time_s: float) -> None:
        """What is heard from now on is heard at this time."""
        self._time_s = time_s

    def forget_progress(self) -> None:
        """Another mission: what was reached belonged to the one before."""
        self._status = replace(self._status, reached=())

    def forget_state(self) -> None:
        """Another mission is begun: the state told last belonged to the one before."""
        self._status = replace(self._status, mission_state=None)

    def _heartbeat(self, message: Message) -> None:
        armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        mode = self.mode_of(message.custom_mode)
        self._status = replace(self._status, heard_s=self._time_s, mode=mode, armed=armed)

    def _mission_current(self, message: Message) -> None:
        known = message.mission_state in set(MissionState)
        self._status = replace(
            self._status,
            current=message.seq + self.first_item,
            total=message.total or None,  # 0: it does not tell
            mission_state=MissionState(message.mission_state) if known else None,
            mission_id=message.mission_id,
        )

    def _reached(self, message: Message) -> None:
        seq = message.seq + self.first_item
        if seq not in self._status.reached:
            self._status = replace(self._status, reached=(*self._status.reached, seq))

    def _position(self, message: Message) -> None:
        if message.lat == 0 and message.lon == 0:
            return  # no position yet
        place = GeoPoint(message.lat / DEGREES_E7, message.lon / DEGREES_E7, message.alt / 1e3)
        heading = None if message.hdg == _NO_HEADING else message.hdg / 100.0
        self._status = replace(self._status, place=place, heading_deg=heading)

    def _text(self, message: Message) -> None:
        """A text, put together from its chunks: the last is the one with room left."""
        whole = self._chunks.pop(message.id, "") + message.text if message.id else message.text
        if message.id and len(message.text) == 50:
            self._chunks = {message.id: whole}  # chunks of one text come in a row
            return
        texts = (*self._status.texts, (self._time_s, message.severity, whole))
        self._status = replace(self._status, texts=texts[-_LAST_TEXTS:])
