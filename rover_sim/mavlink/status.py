"""Health, battery, mission progress and texts."""

from __future__ import annotations

from rover_sim.autopilot.mission import Home
from rover_sim.autopilot.modes import MissionState, Mode
from rover_sim.mavlink.context import Context
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.dialect import mission_current as mission_current_message
from rover_sim.mavlink.tlog import SIMULATED_EPOCH_S
from worlds.types import BatteryReading

_TEXT_BYTES = 50  # of one STATUSTEXT
_ALWAYS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG  # the simulated IMU tells the heading as a compass does
    | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    | mavlink.MAV_SYS_STATUS_AHRS
    | mavlink.MAV_SYS_STATUS_PREARM_CHECK
)


def sys_status(context: Context) -> Message:
    """SYS_STATUS; the fields of a rover without battery are "unknown"."""
    gps = mavlink.MAV_SYS_STATUS_SENSOR_GPS if context.gnss is not None else 0
    enabled = _ALWAYS | gps
    healthy = enabled | mavlink.MAV_SYS_STATUS_GEOFENCE
    if context.autopilot.prearm_reason() is not None:
        healthy &= ~mavlink.MAV_SYS_STATUS_PREARM_CHECK
    if context.estimate is None:
        healthy &= ~mavlink.MAV_SYS_STATUS_AHRS
    healthy &= ~_silent(context)
    # The fence bit is always present, and healthy unless breached: MAVProxy reports a breach otherwise.
    present = enabled | mavlink.MAV_SYS_STATUS_GEOFENCE
    if context.autopilot.fence.on:
        enabled = present
        if context.autopilot.fence.breached:
            healthy &= ~mavlink.MAV_SYS_STATUS_GEOFENCE
    voltage_mv, current_ca, left = 65535, -1, -1
    battery = context.autopilot.battery.reading
    if battery is not None:
        bit = mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
        present, enabled = present | bit, enabled | bit
        healthy |= 0 if context.autopilot.battery.level else bit
        voltage_mv, current_ca = round(1e3 * battery.voltage_v), _centiampere(battery)
        left = int(100.0 * battery.left_share)
    return mavlink.MAVLink_sys_status_message(
        present, enabled, healthy, 0, voltage_mv, current_ca, left, 0, 0, 0, 0, 0, 0
    )


def _silent(context: Context) -> int:
    """Bits of the inertial sensors that give nothing."""
    if context.readings is None:
        return 0
    imu = context.readings.imu
    if imu is None:
        return int(
            mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
            | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
            | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
        )
    return int(mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG) if imu.heading_rad is None else 0


def battery_status(context: Context) -> Message:
    """BATTERY_STATUS, of a rover without battery too: QGroundControl takes it as a sign of life."""
    guard = context.autopilot.battery
    voltages = [65535] * 10
    if guard.reading is None:
        kind = mavlink.MAV_BATTERY_FUNCTION_UNKNOWN, mavlink.MAV_BATTERY_TYPE_UNKNOWN
        return mavlink.MAVLink_battery_status_message(0, *kind, 32767, voltages, -1, -1, -1, -1)
    battery = guard.reading
    kind = mavlink.MAV_BATTERY_FUNCTION_ALL, mavlink.MAV_BATTERY_TYPE_LION
    voltages[0] = min(round(1e3 * battery.voltage_v), 65534)  # of all cells together, which are not measured one by one
    return mavlink.MAVLink_battery_status_message(
        0,
        *kind,
        32767,
        voltages,
        _centiampere(battery),
        round(battery.used_mah),
        round(battery.used_j / 100.0),
        int(100.0 * battery.left_share),
        min(int(3.6 * battery.left_mah / max(battery.current_a, 1e-3)), 2**31 - 1),
        mavlink.MAV_BATTERY_CHARGE_STATE_OK + guard.level,
    )


def _centiampere(battery: BatteryReading) -> int:
    return min(round(100.0 * battery.current_a), 32767)


def landed_state(context: Context) -> int:
    """Landed state: "in the air" is how ground stations call a vehicle that drives by itself.

    For an ArduPilot QGroundControl takes it from the heartbeat as well, and with two sources its buttons flicker, so
    there the state is 0.
    """
    if not context.persona.tells_landed:
        return int(mavlink.MAV_LANDED_STATE_UNDEFINED)
    return int(mavlink.MAV_LANDED_STATE_IN_AIR if context.autopilot.driving else mavlink.MAV_LANDED_STATE_ON_GROUND)


def extended_sys_state(context: Context) -> Message:
    """EXTENDED_SYS_STATE."""
    return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, landed_state(context))


def mission_current(context: Context) -> Message:
    """MISSION_CURRENT; the total leaves a leading home out, as ArduPilot does."""
    runner = context.autopilot.auto
    items = runner.mission.items
    total = len(items) - sum(isinstance(item, Home) for item in items[:1])
    if runner.state is MissionState.NO_MISSION:
        total = 65535  # the message's own word for "no mission"
    in_auto = 1 if context.autopilot.mode is Mode.AUTO else 2
    mission, fence, rally = (plan.opaque_id for plan in context.plans)
    return mission_current_message(runner.current, total, int(runner.state), in_auto, (mission, fence, rally))


def fence_status(context: Context) -> Message | None:
    """FENCE_STATUS; None where no fence counts."""
    guard = context.autopilot.fence
    if not guard.on:
        return None
    kind = mavlink.FENCE_BREACH_BOUNDARY if guard.breaches else mavlink.FENCE_BREACH_NONE
    count, at_ms = min(guard.breaches, 65535), int(guard.breach_s * 1e3) & 0xFFFFFFFF
    return mavlink.MAVLink_fence_status_message(int(guard.breached), count, kind, at_ms, mavlink.FENCE_MITIGATE_NONE)


def slip(context: Context) -> Message:
    """NAMED_VALUE_FLOAT "slip": share of the wheels' travel that is lost, as the rover believes it."""
    return mavlink.MAVLink_named_value_float_message(context.boot_ms, b"slip", context.autopilot.failsafe.monitor.slip)


def system_time(context: Context) -> Message:
    """SYSTEM_TIME: simulated time counted from the log's epoch."""
    return mavlink.MAVLink_system_time_message(round((SIMULATED_EPOCH_S + context.time_s) * 1e6), context.boot_ms)


def status_texts(severity: int, text: str, number: int) -> list[Message]:
    """STATUSTEXT, in numbered chunks if the text is long; ``number`` (1..65535) tells chunked texts apart."""
    data = text.encode("ascii", errors="replace")
    chunks = [data[at : at + _TEXT_BYTES] for at in range(0, max(len(data), 1), _TEXT_BYTES)]
    if len(chunks) == 1:
        return [mavlink.MAVLink_statustext_message(severity, chunks[0])]
    if len(chunks[-1]) == _TEXT_BYTES:  # a chunk with room left is what ends a text
        chunks.append(b"")
    return [mavlink.MAVLink_statustext_message(severity, chunk, number, at) for at, chunk in enumerate(chunks)]
