"""Telemetry: the messages that the vehicle can build of its state, and the streams of each listener."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from rover_sim.mavlink import attitude, status
from rover_sim.mavlink.context import Context, Handler
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Client
from rover_sim.mavlink.heartbeat import autopilot_version, heartbeat
from rover_sim.mavlink.mode_lists import available_modes, current_mode
from rover_sim.mavlink.stick_service import rc_channels

Builder = Callable[[Context], Message | None]  # None: nothing to tell, such as a position before the first pose

BUILDERS: Mapping[int, Builder] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: lambda context: heartbeat(context.autopilot, context.persona),
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: lambda context: autopilot_version(context.persona),
    mavlink.MAVLINK_MSG_ID_CURRENT_MODE: current_mode,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: status.sys_status,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: status.battery_status,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: status.extended_sys_state,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: status.mission_current,
    mavlink.MAVLINK_MSG_ID_FENCE_STATUS: status.fence_status,
    mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT: status.slip,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: status.system_time,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: attitude.attitude,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: attitude.global_position_int,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: attitude.local_position_ned,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: attitude.gps_raw_int,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: attitude.vfr_hud,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: attitude.home_position,
    mavlink.MAVLINK_MSG_ID_RC_CHANNELS: rc_channels,
}
# The groups of the older REQUEST_DATA_STREAM, as far as there is anything in them.
_GROUPS: Mapping[int, tuple[int, ...]] = {
    mavlink.MAV_DATA_STREAM_RAW_SENSORS: (mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,),
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
        mavlink.MAVLINK_MSG_ID_FENCE_STATUS,
    ),
    mavlink.MAV_DATA_STREAM_RC_CHANNELS: (mavlink.MAVLINK_MSG_ID_RC_CHANNELS,),
    mavlink.MAV_DATA_STREAM_POSITION: (mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,),
    mavlink.MAV_DATA_STREAM_EXTRA1: (mavlink.MAVLINK_MSG_ID_ATTITUDE,),
    mavlink.MAV_DATA_STREAM_EXTRA2: (mavlink.MAVLINK_MSG_ID_VFR_HUD,),
    mavlink.MAV_DATA_STREAM_EXTRA3: (
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
        mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT,
    ),
}
_ALL_GROUPS = tuple({message: None for group in _GROUPS.values() for message in group})


class Telemetry:
    """Serves the streams, and pushes what changed."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._shown: dict[int, tuple[object, ...]] = {}

    @property
    def handlers(self) -> Mapping[str, Handler]:
        """The older way to ask for streams; the newer one is a command."""
        return {"REQUEST_DATA_STREAM": self._data_stream}

    def tick(self) -> None:
        """Send what is due; a change of mode, arming or mission goes out at once."""
        context = self._context
        changed = self._changed()
        for channel in context.endpoint.channels:
            due = channel.streams.due(context.time_s)
            for message_id in changed:
                channel.streams.sent(message_id, context.time_s)
            for message_id in dict.fromkeys((*changed, *due)):
                message = BUILDERS[message_id](context)
                if message is not None:
                    context.endpoint.stream(channel, message)

    def send(self, client: Client, message_id: int, index: float = 0.0) -> bool:
        """Send one message to one client; False if there is no such message or nothing to tell.

        ``index`` chooses among AVAILABLE_MODES.
        """
        if message_id == mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES:
            modes = available_modes(self._context, index)
            for mode in modes:
                self._context.endpoint.reply(client, mode)
            return bool(modes)
        builder = BUILDERS.get(message_id)
        message = builder(self._context) if builder else None
        if message is None:
            return False
        self._context.endpoint.reply(client, message)
        return True

    def set_interval(self, client: Client, message_id: int, interval_us: float) -> bool:
        """Change one stream of one client; False if there is no such message, or if it is the heartbeat.

        Programs that share a channel share its streams: none may silence the sign of life for the others.
        """
        fixed = message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT
        if message_id not in BUILDERS or fixed or not math.isfinite(interval_us):
            return False
        client.channel.streams.set_interval(message_id, interval_us, self._context.time_s)
        return True

    def _changed(self) -> list[int]:
        """Messages whose content must be known at once; the first tick counts as no change."""
        autopilot = self._context.autopilot
        shown: dict[int, tuple[object, ...]] = {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: (
                self._context.persona.custom_mode(autopilot),
                autopilot.armed,
                autopilot.tripped,
            ),
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: (
                autopilot.auto.current,
                autopilot.auto.state,
                len(autopilot.auto.mission.items),
                *(plan.opaque_id for plan in self._context.plans),
            ),
            mavlink.MAVLINK_MSG_ID_FENCE_STATUS: (autopilot.fence.breached, autopilot.fence.breaches),
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: (autopilot.home_w,),
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: (status.landed_state(self._context),),
        }
        changed = [message for message, content in shown.items() if self._shown.get(message, content) != content]
        self._shown = shown
        return changed

    def _data_stream(self, client: Client, message: Message) -> None:
        group = message.req_stream_id
        ids = _ALL_GROUPS if group == mavlink.MAV_DATA_STREAM_ALL else _GROUPS.get(group, ())
        on = message.start_stop and message.req_message_rate
        for message_id in ids:
            self.set_interval(client, message_id, 1e6 / message.req_message_rate if on else -1.0)
