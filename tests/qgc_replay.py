"""QGroundControl as a whole: it connects, and does what its guided actions send (``GuidedActionsController``)."""

from __future__ import annotations

from rover_sim.mavlink.dialect import mavlink
from tests.qgc_connect import PLAN_S, QgcConnect
from tests.qgc_station import Script

MODE_S, MODE_TRIES, ARM_S = 1.3, 3, 1.5


class Qgc(QgcConnect):
    """A station with guided actions."""

    def set_mode(self, number: int) -> Script:
        """A mode as this firmware's plugin sets it; only a heartbeat proves it."""
        for again in range(MODE_TRIES):
            self._retry(again, f"mode {number}")
            if self.persona.name == "ardupilot":
                yield from self.command(mavlink.MAV_CMD_DO_SET_MODE, 1.0, number)
            else:
                self.send(mavlink.MAVLink_set_mode_message(1, 1, number))
            if (yield from self._until(lambda: self.mode == number, MODE_S)):
                return True
        self.complaints.append(f"vehicle did not change to mode {number}")
        return False

    def arm(self) -> Script:
        yield from self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
        if not (yield from self._until(lambda: self.armed, ARM_S)):
            self.complaints.append("vehicle did not arm")

    def start_mission(self) -> Script:
        """From a disarmed rover."""
        numbers = {mode.name: number for mode, number in self.persona.numbers.items()}
        if self.persona.name == "ardupilot":
            yield from self.set_mode(numbers["GUIDED"])
            yield from self.arm()
            yield from self.command(mavlink.MAV_CMD_MISSION_START)
        else:
            yield from self.set_mode(numbers["AUTO"])
            yield from self.arm()

    def go_to(self, latitude_e7: int, longitude_e7: int, *, first: bool = True) -> Script:
        """Go to a place; the first time an ArduPilot gets it in three ways at once."""
        goto = mavlink.MAVLink_command_int_message(
            1, 1, 0, 192, 0, 0, -1.0, 1.0, 0.0, float("nan"), latitude_e7, longitude_e7, 0.0
        )
        if self.persona.name == "ardupilot" and first:
            guided = next(number for mode, number in self.persona.numbers.items() if mode.name == "GUIDED")
            self.send(goto)
            self.send(mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1.0, guided, 0, 0, 0, 0, 0))
            item = mavlink.MAVLink_mission_item_message(
                1, 1, 0, 3, 16, 2, 1, 0, 0, 0, 0, latitude_e7 / 1e7, longitude_e7 / 1e7, 0.0
            )
            self.send(item)
            ack = yield from self._await(lambda one: one.get_type() == "MISSION_ACK", PLAN_S)
            if ack is None or ack.type != 0:
                self.complaints.append("go to: no MISSION_ACK")
            yield from self._until(lambda: self.mode == guided, MODE_S)
        else:
            yield from self._command(goto, 1)
