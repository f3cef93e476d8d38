"""Which messages a listener gets by itself, and how often."""

from __future__ import annotations

from collections.abc import Mapping

from rover_sim.mavlink.dialect import mavlink

# Hz for a ground station: what QGroundControl, MAVSDK and MAVProxy use of a rover (docs/mavlink.md).
GROUND_STATION_RATES: Mapping[int, float] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 2.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 10.0,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 5.0,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
    mavlink.MAVLINK_MSG_ID_FENCE_STATUS: 1.0,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 4.0,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: 1.0,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0,
    mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT: 2.0,
}
# Hz for our own companion, which knows the pose from the same estimate.
COMPANION_RATES: Mapping[int, float] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: 1.0,
}
FASTEST_HZ = 50.0
SLOWEST_S = 2000.0  # MESSAGE_INTERVAL counts microseconds in 31 bits


class Streams:
    """The schedule of one listener."""

    def __init__(self, rates_hz: Mapping[int, float]) -> None:
        self._defaults = {message: 1.0 / rate for message, rate in rates_hz.items()}
        self._interval_s = dict(self._defaults)
        self._next_s = dict.fromkeys(self._interval_s, 0.0)
        self._earliest_s = 0.0

    def due(self, time_s: float) -> list[int]:
        """Messages whose time has come; each is then due again one interval later."""
        if time_s < self._earliest_s:
            return []
        messages = [message for message, at in self._next_s.items() if at <= time_s]
        for message in messages:
            after = self._next_s[message] + self._interval_s[message]
            # A late listener is not flooded with what it missed.
            self._next_s[message] = after if after > time_s else time_s + self._interval_s[message]
        self._earliest_s = min(self._next_s.values(), default=float("inf"))
        return messages

    def sent(self, message: int, time_s: float) -> None:
        """A message went out for another reason: its next turn is one interval later."""
        if message in self._next_s:
            self._next_s[message] = time_s + self._interval_s[message]

    def set_interval(self, message: int, interval_us: float, time_s: float) -> None:
        """As MAVLink's SET_MESSAGE_INTERVAL: microseconds, 0 the default rate (if any), below 0 off."""
        interval = self._defaults.get(message, 0.0) if interval_us == 0 else interval_us / 1e6
        if interval > 0.0:
            self._interval_s[message] = min(max(interval, 1.0 / FASTEST_HZ), SLOWEST_S)
            self._next_s[message] = time_s
        else:
            self._interval_s.pop(message, None)
            self._next_s.pop(message, None)
        self._earliest_s = 0.0

    def interval_us(self, message: int) -> int:
        """Interval in microseconds; -1 if the message is not streamed."""
        return round(self._interval_s[message] * 1e6) if message in self._interval_s else -1
