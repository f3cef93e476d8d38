"""The planner's side of a link to an autopilot that is not ours: found, waited for, given verified missions, started.

It does for a foreign vehicle what ``Companion`` does for our own, by the rules of that autopilot: modes and numbers of
items are ours, home is item 0.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from rover_sim.autopilot.modes import MissionState, Mode
from rover_sim.mavlink.commander import Commander, CommandState, PendingCommand
from rover_sim.mavlink.companion import COMPONENT
from rover_sim.mavlink.dialect import Message, Signer, mavlink
from rover_sim.mavlink.endpoint import Endpoint, Link
from rover_sim.mavlink.foreign_discovery import Found, find
from rover_sim.mavlink.foreign_pursuit import Patience, Pursuit, Wish
from rover_sim.mavlink.foreign_readiness import Readiness
from rover_sim.mavlink.foreign_set_points import REFRESH_S, turn_message
from rover_sim.mavlink.status import status_texts
from rover_sim.mavlink.uploader import Upload
from rover_sim.mavlink.vehicle_control import Trouble, TroubleKind
from rover_sim.mavlink.vehicle_watch import VehicleStatus, VehicleWatch
from rover_sim.mavlink.verified_upload import VerifiedUploader
from rover_sim.mavlink.wire import WAYPOINT, WireItem

# Before the vehicle is known; not 255, whose heartbeats an ArduPilot takes for those of its ground station.
_STRANGER = 254
_ARM, _SET_MODE = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_DO_SET_MODE
_UPLOADED = "flight plan received"  # an ArduPilot's text at the end of anybody's upload, in small letters
_COMPLETE = "mission complete"


class ForeignCompanion:
    """Companion of the first autopilot that is heard: it takes its system number, as component 191."""

    def __init__(
        self, link: Link, log: Link | None = None, patience: Patience | None = None, signer: Signer | None = None
    ) -> None:
        """``signer``: signs what is sent; what it does not believe is not heard."""
        self.found: Found | None = None
        self._link, self._log, self._signer, self._patience = link, log, signer, patience or Patience()
        self.endpoint = self._endpoint(_STRANGER)
        self._watch, self._readiness = VehicleWatch(), Readiness()
        self._commander, self._requests = Commander(self._send, 0, 0), Commander(self._send, 0, 0)
        self._uploader = VerifiedUploader(self._send)
        self._pursuit = Pursuit(self._commander, self._patience)
        self._latest: Upload | None = None
        self._trouble: Trouble | None = None
        self._time_s = 0.0
        self._start_s: float | None = None
        self._due_s = {"heartbeat": -math.inf, "set point": -math.inf}
        self._was_linked = False
        self._begun_s: float | None = None  # when the mission sent last was started
        self._texts_read_s = -math.inf
        self._texts = 0
        self._to_say: list[Message] = []
        self._asked: PendingCommand | None = None  # to tell of its estimator
        self._looked_into: tuple[int, int | None, int] | None = None  # mission, and what the vehicle told of another
        self._handlers = self._all_handlers()

    @property
    def status(self) -> VehicleStatus:
        """What is known of the vehicle now."""
        heard = self._watch.status
        mode, armed = self._pursuit.seen(heard)
        return replace(heard, mode=mode, armed=armed, mission_state=self._mission_state(heard))

    @property
    def linked(self) -> bool:
        """Whether the vehicle has been heard lately."""
        return self._watch.linked

    @property
    def trouble(self) -> Trouble | None:
        """What makes going on pointless; None while there is hope."""
        return self._trouble or self._pursuit.trouble

    @property
    def waits_for(self) -> str:
        """What the vehicle is still waited for, in words; empty once it is ready to drive."""
        return self._readiness.waits_for

    @property
    def transfers(self) -> bool:
        """Whether a mission is on its way, being read back or being cleared."""
        return self._uploader.busy

    @property
    def busy(self) -> bool:
        """Whether a mission is being transferred, or something is still to be brought about."""
        return self._uploader.busy or self._pursuit.wish is not None

    @property
    def sent(self) -> tuple[WireItem, ...]:
        """The mission that was given last, home first; empty before any was."""
        return () if self._latest is None else self._latest.items

    @property
    def reverses(self) -> bool:
        """Whether its missions can make it drive backwards, as far as is known."""
        return self.found is None or mavlink.MAV_CMD_DO_SET_REVERSE not in self.found.rules.unsupported

    @property
    def owns_mission(self) -> bool | None:
        """Whether the vehicle's mission was uploaded here; None without one, or before anything was read back."""
        if self._watch.status.mission_state is MissionState.NO_MISSION:
            return None
        if self._uploader.replaced:
            return False
        return True if self._uploader.verified is not None else None

    def upload(self, items: Sequence[WireItem], time_s: float) -> Upload:  # noqa: ARG002 - time comes with the ticks
        """Send a mission and read it back; while another is on its way it waits, and only the newest waits."""
        wish = self._pursuit.wish
        if wish is not None and wish.mode is Mode.AUTO:
            self._pursuit.want(None, self._watch.status)
        self._watch.forget_progress()
        self._begun_s = None
        self._latest = self._uploader.upload(items)
        return self._latest

    def drive(self, items: Sequence[WireItem], time_s: float) -> Upload:
        """Send a mission; once it was read back and the vehicle is ready, arm and start."""
        upload = self.upload(items, time_s)
        self._wish(Wish(_handle(_SET_MODE), Mode.AUTO, upload, armed=True))
        return upload

    def command(self, command: int, *parameters: float) -> PendingCommand:
        """Send a command (COMMAND_LONG) as it is; it fails at once while there is no vehicle."""
        if self.found is not None:
            return self._commander.command(command, *parameters)
        return replace(_handle(command, *parameters), state=CommandState.FAILED)

    def arm(self, *, on: bool = True) -> PendingCommand:
        """Arm once the vehicle is ready, trying again while it is refused; or disarm at once."""
        if not on:
            self._pursuit.want(None, self._watch.status)
            return self.command(_ARM, 0.0)
        wish = self._pursuit.wish
        return self._wish(Wish(_handle(_ARM, 1.0), armed=True) if wish is None else replace(wish, armed=True))

    def set_mode(self, number: int) -> PendingCommand:
        """Change to one of our modes; Auto only with the mission that was sent last, once it was read back."""
        if number == Mode.AUTO:
            return self.start_mission()
        return self._wish(Wish(_handle(_SET_MODE, float(number)), Mode(number)))

    def get_ready(self) -> PendingCommand:
        """Wait until the vehicle is ready to drive by itself, as long as it is waited for."""
        return self._wish(Wish(_handle(_ARM)))

    def start_mission(self) -> PendingCommand:
        """Start the mission that was sent last, once it was read back; nothing else is ever started."""
        handle = _handle(_SET_MODE, float(Mode.AUTO))
        if self._latest is None:
            handle.state = CommandState.FAILED
            return handle
        return self._wish(Wish(handle, Mode.AUTO, self._latest))

    def change_speed(self, speed_m_s: float) -> PendingCommand:
        """Cruise at another speed on what is being driven."""
        return self.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1.0, speed_m_s, -1.0)

    def turn_to(self, yaw_rad: float) -> PendingCommand:
        """Turn on the spot to a heading in the world and hold it, by set points, until something else is wanted."""
        before = self._pursuit.wish
        armed = before is not None and before.armed
        return self._wish(Wish(_handle(_SET_MODE, float(Mode.GUIDED)), Mode.GUIDED, yaw_rad=yaw_rad, armed=armed))

    def say(self, severity: int, text: str) -> None:
        """Tell people a text (STATUSTEXT), once the vehicle is found; ``severity`` as in MAV_SEVERITY."""
        self._texts = self._texts % 60000 + 1
        self._to_say.extend(status_texts(severity, text, self._texts))

    def tick(self, time_s: float) -> None:
        """Hear, answer, repeat, and show that we are here."""
        self._time_s = time_s
        self._start_s = time_s if self._start_s is None else self._start_s
        self._watch.look(time_s)
        for client, message in self.endpoint.poll(time_s):
            if self.found is None:
                self._meet(find(message))
            if self.found is not None and (client.system, client.component) == (
                self.found.system,
                self.found.component,
            ):
                for handler in self._handlers.get(message.get_type(), ()):
                    handler(message)
        if self.found is not None:
            for text in self._to_say:
                self._send(text)
            self._to_say.clear()
        if self.found is not None and self.trouble is None:
            self._go_on(self.found)
        elif self.found is None and time_s - self._start_s >= self._patience.vehicle_s and self._trouble is None:
            self._trouble = Trouble(TroubleKind.NO_VEHICLE, f"no autopilot heard within {self._patience.vehicle_s:g} s")
        self._finish()

    def close(self) -> None:
        """Close the link."""
        self.endpoint.close()

    def _endpoint(self, system: int) -> Endpoint:
        return Endpoint(system, COMPONENT, [self._link], self._log, signer=self._signer)

    def _meet(self, found: Found | None) -> None:
        """From now on we are a component of the vehicle's system."""
        if found is None:
            return
        self.found = found
        self.endpoint = self._endpoint(found.system)
        if not found.is_rover:
            self._trouble = Trouble(TroubleKind.WRONG_VEHICLE, f"a {found.name}; allowed: a ground rover")
            return
        target = found.system, found.component
        self._commander.target = self._requests.target = target
        self._watch.mode_of, self._watch.first_item = found.rules.mode_of, found.rules.first_item
        self._readiness.meet(found.rules, self._time_s)
        self._uploader.meet(*target, found.rules)
        self._pursuit.meet(found.rules)

    def _go_on(self, found: Found) -> None:
        time_s = self._time_s
        self._readiness.look(time_s)
        if self.linked and not self._was_linked:  # at first, and after a restart of the vehicle
            self._ask_for_streams(found)
            self._uploader.check(time_s)
        self._was_linked = self.linked
        if self._asked is not None and self._asked.result not in (None, mavlink.MAV_RESULT_ACCEPTED):
            self._asked = None
            self._readiness.refused()
        heard = self._watch.status
        self._pursuit.tick(heard, self.waits_for, time_s)
        if self._begun_s is None and self._drives_latest():
            self._begun_s = time_s
            self._watch.forget_progress()  # what was told until now belonged to the mission before
            self._watch.forget_state()
        self._look_after_mission(heard)
        if self._due("set point", REFRESH_S):
            self._refresh_set_point(found)

    def _finish(self) -> None:
        """What goes on in trouble too: a torn mission is still to be cleared."""
        time_s = self._time_s
        if self.trouble is not None:
            self._uploader.refuse(self.trouble.text)
        if self.found is not None and self.found.is_rover:
            self._uploader.tick(time_s, may_begin=self.trouble is None and self._pursuit.may_upload(self._watch.status))
            self._commander.tick(time_s)
            self._requests.tick(time_s)
        if self._due("heartbeat", 1.0):
            kind, no_autopilot = mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID
            self._send(mavlink.MAVLink_heartbeat_message(kind, no_autopilot, 0, 0, mavlink.MAV_STATE_ACTIVE, 3))

    def _ask_for_streams(self, found: Found) -> None:
        """The first of them is the estimator's."""
        asked = [
            self._requests.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, float(message), 1e6 / rate_hz)
            for message, rate_hz in found.rules.streams_hz.items()
        ]
        self._asked = asked[0]

    def _look_after_mission(self, heard: VehicleStatus) -> None:
        """Read the vehicle's mission again where somebody else seems to have changed it."""
        wish = self._pursuit.wish
        if self._uploader.waits and wish is None and not self._pursuit.may_upload(heard):
            self._uploader.refuse(
                "the vehicle is driving its mission, which an upload would tear; put it in Hold first"
            )
        fresh = [text for at_s, _, text in heard.texts if at_s > self._texts_read_s]
        self._texts_read_s = self._time_s
        verified = self._uploader.verified
        if verified is None or heard.mission_state is MissionState.NO_MISSION:
            return
        other_size = heard.total not in (None, self._uploader.vehicle_items)
        other_id = 0 not in (heard.mission_id, verified.opaque_id) and heard.mission_id != verified.opaque_id
        told = verified.number, heard.total, heard.mission_id
        news = (other_size or other_id) and told != self._looked_into
        if news or any(text.lower().startswith(_UPLOADED) for text in fresh):
            self._looked_into = told
            self._uploader.check(self._time_s)

    def _drives_latest(self) -> bool:
        """Whether the mission that was sent last has been started."""
        verified = self._uploader.verified
        auto = self._pursuit.wish is None and self._pursuit.seen(self._watch.status)[0] == Mode.AUTO
        return verified is not None and verified is self._latest and auto

    def _mission_state(self, heard: VehicleStatus) -> MissionState | None:
        """Of the mission that was sent last; told by what was reached where the vehicle has no word for it."""
        if heard.mission_state is MissionState.NO_MISSION or self._latest is None:
            return heard.mission_state
        begun_s = self._begun_s
        if begun_s is None:
            return MissionState.NOT_STARTED
        places = [seq for seq, item in enumerate(self._latest.items) if item.command == WAYPOINT and seq > 0]
        said = any(text.lower().startswith(_COMPLETE) for at_s, _, text in heard.texts if at_s > begun_s)
        if said or (places and places[-1] in heard.reached):
            return MissionState.COMPLETE
        return heard.mission_state

    def _refresh_set_point(self, found: Found) -> None:
        wish = self._pursuit.wish
        if wish is not None and wish.yaw_rad is not None:
            self._send(turn_message(found, wish.yaw_rad, self._time_s))

    def _wish(self, wish: Wish) -> PendingCommand:
        self._pursuit.want(wish, self._watch.status)
        return wish.handle

    def _due(self, what: str, every_s: float) -> bool:
        if self._time_s - self._due_s[what] < every_s:
            return False
        self._due_s[what] = self._time_s
        return True

    def _send(self, message: Message) -> None:
        self.endpoint.broadcast(message)

    def _all_handlers(self) -> Mapping[str, Sequence[Callable[[Message], None]]]:
        """Several parts may listen to one message."""
        handlers: defaultdict[str, list[Callable[[Message], None]]] = defaultdict(list)
        for part in (self._watch.handlers, self._readiness.handlers):
            for name, handler in part.items():
                handlers[name].append(handler)
        for name, timed in self._uploader.handlers.items():
            handlers[name].append(lambda message, timed=timed: timed(message, self._time_s))  # type: ignore[misc]
        for commander in (self._commander, self._requests):
            handlers["COMMAND_ACK"].append(
                lambda message, commander=commander: commander.acknowledged(message, self._time_s)  # type: ignore[misc]
            )
        return handlers


def _handle(command: int, *parameters: float) -> PendingCommand:
    return PendingCommand(command, (*parameters, *(0.0,) * (7 - len(parameters))))
