"""The onboard computer: pictures and pose in, missions and commands out over MAVLink, as its own component."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from perception.pipeline import Knowledge, Perception, perceive
from perception.tall import TallThings, ground_hue, tall_things
from planner import navigator, route_following, trouble
from planner.lost import Search, search
from planner.navigator_state import Decision, NavigatorState
from planner.relocation import Located
from planner.route_following import Following
from planner.terrain_map import RockMemory
from rover_sim.autopilot.modes import MissionState, Mode, Severity
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.plan_items import CRUISE_M_S, backing_items, mission_items, risky_speed, way_items
from rover_sim.mavlink.uploader import Upload, UploadState
from rover_sim.mavlink.vehicle_control import VehicleControl
from rover_sim.mavlink.wire import WireItem
from rover_sim.summary import Counts
from worlds.types import FloatArray, Frame, Observation, PoseEstimate, RangeScan, Vector3

SPEED_STEP = 0.08  # a smaller share of change is not worth a message
UPLOAD_S = 0.3  # that a mission takes: what the rover passes meanwhile is left out
SILENT_LOOKS, SILENT_S = 3, 1.0  # the longer of the two makes an eye count as lost
STOPS_ALLOWED, TRYING_S = 6, 70.0  # fail-safe stops without getting on, and the time that they must have taken
PROGRESS_M = 2.0  # that count as getting on


@dataclass(frozen=True, eq=False)
class Sight:
    """One picture, what was seen in it and what was decided."""

    frame: Frame
    perception: Perception
    decision: Decision


class OnboardComputer:
    """Decides at each picture, and sees to it at each tick that the vehicle does what was decided."""

    def __init__(
        self,
        companion: VehicleControl,
        local: LocalFrame,
        home_w: Vector3,
        plan: NavigatorState,
        knowledge: Knowledge,
        eyes_s: Mapping[str, float] | None = None,
        route: Following | None = None,
    ) -> None:
        """``eyes_s``: seconds between two looks of each eye carried; one that is silent for long is reported lost.

        ``route``: the route above the plan; without one the plan's goal is driven to straight.
        """
        self.counts = Counts()
        self.ways_w: list[FloatArray] = []  # of the drive missions sent
        self.plan = plan if route is None else route_following.aimed(plan, route, (home_w[0], home_w[1]))
        self.route = route
        self.search: Search | None = None  # for landmarks, while the rover is lost
        self.stop_text = ""  # of the last fail-safe stop
        self._companion = companion
        self._local = local
        self._home_w = home_w
        self._knowledge = knowledge
        self._decision: Decision | None = None
        self._upload: Upload | None = None
        self._wanted_mode: Mode | None = None
        self._confirmed = False  # the vehicle has been seen in the wanted mode
        self._taken_over = False
        self._stored = False  # the vehicle has been seen with the mission that was sent last
        self._stops_here = 0  # since the rover last got on
        self._first_stop_s = self._tried_s = 0.0  # time of the first of them, and from then to the last
        self._stop_place_w: FloatArray | None = None
        self._texts_read_s = -1.0
        self._speed_m_s = CRUISE_M_S  # told last
        self._ground_hue: float | None = None
        self._eyes_s = dict(eyes_s or {})
        self._seen_s = dict.fromkeys(self._eyes_s, 0.0)

    @property
    def end(self) -> Decision | None:
        """What ended the traverse as the planner sees it; None while it goes on."""
        return self.plan.end

    @property
    def rocks(self) -> RockMemory:
        """Rocks as they are remembered."""
        return self.plan.memory.rocks

    @property
    def doing(self) -> str:
        """What the rover is about, in a word or two."""
        if self._taken_over:
            return "taken over"
        return "waiting" if self._decision is None else self._decision.kind.replace("_", " ")

    def look(self, frame: Frame, locate: Callable[[Observation], Located], time_s: float) -> Sight:
        """Perceive, have the rover located by what was seen, decide, and send what is new."""
        self._seen_s["camera"] = time_s
        tall = None if "laser" in self._eyes_s else self._tall(frame)
        perception = perceive(frame, self._knowledge, None if tall is None else tall.covered)
        self.counts = replace(self.counts, frames=self.counts.frames + 1)
        # Once something tall has been met near by, every picture tells where nothing tall stands. What merely crosses
        # the horizon far away may be a rock on a rise.
        met = tall is not None and np.isfinite(tall.scan.ranges_m).any()
        scan = tall.scan if tall is not None and (met or self.plan.memory.laser is not None) else None
        assert perception.observation is not None
        located = locate(perception.observation)
        self._look_around(located, time_s)
        decision = self._decide(located.estimate, time_s, located.observation, scan)
        return Sight(frame, perception, decision)

    def _look_around(self, located: Located, time_s: float) -> None:
        """A rover that is lost looks around for landmarks; one that is not, or no longer, makes a new way."""
        if located.lost:
            self.search = search(self.search, located.lost, self.plan, located.estimate, time_s)
            if self.search.decision.kind == "lost":
                self.plan = replace(self.plan, end=self.search.decision)
        elif self.search is not None:
            self.search, self.plan = None, replace(self.plan, way=None, manoeuvre=None)

    def _tall(self, frame: Frame) -> TallThings | None:
        """Things taller than the camera, over ground of the hue before the rover's first picture."""
        if self._ground_hue is None:
            self._ground_hue = ground_hue(frame)
        return tall_things(frame, self._ground_hue)

    def scan(self, scan: RangeScan, estimate: PoseEstimate, time_s: float) -> None:
        """Decide by one turn of the laser scanner, and send what is new."""
        self._seen_s["laser"] = time_s
        self._decide(estimate, time_s, None, scan)

    def silent_eye(self, time_s: float) -> str:
        """What is to be said of an eye that has given nothing for long; empty if all see."""
        for name, period_s in self._eyes_s.items():
            silent_s = time_s - self._seen_s[name]
            if silent_s > max(SILENT_LOOKS * period_s, SILENT_S):
                return f"the {name} has been silent for {silent_s:.1f} s"
        return ""

    def _decide(
        self, estimate: PoseEstimate, time_s: float, observation: Observation | None, scan: RangeScan | None
    ) -> Decision:
        before = self._decision
        decision = self._step(estimate, time_s, observation, scan)
        planned = decision.kind != "drive" or decision.changed
        self.counts = replace(self.counts, plans=self.counts.plans + planned)
        self._decision = decision
        if self._taken_over:
            self._offer(decision, estimate, time_s)
            return decision
        if before is None or self._upload_failed() or self._cleared() or _is_new(before, decision):
            self._send(decision, estimate, time_s)
        elif decision.kind == "drive" and decision.speed_m_s is not None:
            self._adjust_speed(decision.speed_m_s)
        return decision

    def _step(
        self, estimate: PoseEstimate, time_s: float, observation: Observation | None, scan: RangeScan | None
    ) -> Decision:
        """One step of navigation, under the route if there is one; a rover that is lost only looks around."""
        if self.search is not None:
            return self.search.decision
        if self.route is None:
            self.plan, decision = navigator.step(self.plan, observation, estimate, time_s, scan)
            return decision
        self.route, self.plan, decision = route_following.step(
            self.route, self.plan, observation, estimate, time_s, scan
        )
        return decision

    def _adjust_speed(self, speed_m_s: float) -> None:
        """Tell the vehicle a new speed on the way that it has, if it differs enough."""
        if abs(speed_m_s - self._speed_m_s) > SPEED_STEP * self._speed_m_s:
            self._speed_m_s = speed_m_s
            self._companion.change_speed(speed_m_s)

    def tick(self, estimate: PoseEstimate) -> None:
        """After each round of the link: notice when the vehicle stopped by itself, or a person took it over."""
        mode = self._companion.status.mode
        owns = self._companion.owns_mission
        self._stored = self._stored or bool(owns)
        if owns is False:
            self._taken_over = True  # a person's mission, until a person clears it
        elif self._taken_over:
            self._release(mode)
        elif mode == self._wanted_mode:
            self._confirmed = True
        elif self._confirmed and mode is not None:
            self._mode_lost(mode, estimate)

    @property
    def exhausted(self) -> bool:
        """Whether fail-safes have stopped the rover too often, and for too long, without its getting on."""
        return self._stops_here > STOPS_ALLOWED and self._tried_s > TRYING_S

    def _send(self, decision: Decision, estimate: PoseEstimate, time_s: float) -> None:
        if decision.kind == "drive":
            self._send_way(decision, estimate, time_s)
        elif decision.kind == "back_up":
            here = float(estimate.pose.position_w[2])
            places = [(float(x), float(y), here) for x, y in decision.waypoints_w[1:]]
            # A vehicle that cannot back up turns round and drives there: that needs more room, but leads out as well.
            items = backing_items if self._companion.reverses else mission_items
            self._drive(items(places, self._local, self._home_w, decision.speed_m_s), time_s)
        elif decision.kind == "look":
            self._upload = None
            if not self._companion.status.armed:
                self._companion.arm()
            self._companion.turn_to(decision.heading_rad)
            self._want(Mode.GUIDED)
        else:
            self._upload = None
            self._companion.set_mode(Mode.HOLD)
            self._want(Mode.HOLD)

    def _send_way(self, decision: Decision, estimate: PoseEstimate, time_s: float) -> None:
        """Upload the way and drive it."""
        ahead = _not_passed(decision.waypoints_w, estimate)
        self._drive(self._way(decision, estimate), time_s)
        self.ways_w.append(np.asarray(decision.waypoints_w))
        self.counts = replace(self.counts, waypoints_sent=self.counts.waypoints_sent + len(ahead))

    def _way(self, decision: Decision, estimate: PoseEstimate) -> list[WireItem]:
        """The mission of a way; its first point is where the rover is, and no item."""
        ahead, height = _not_passed(decision.waypoints_w, estimate), float(estimate.pose.position_w[2])
        self._speed_m_s = risky_speed(decision.risk) if decision.speed_m_s is None else decision.speed_m_s
        return way_items(ahead, height, self._local, self._home_w, self._speed_m_s)

    def _drive(self, items: list[WireItem], time_s: float) -> None:
        self._upload, self._stored = self._companion.drive(items, time_s), False
        self._want(Mode.AUTO)
        self.counts = replace(self.counts, missions_sent=self.counts.missions_sent + 1)

    def _want(self, mode: Mode) -> None:
        self._wanted_mode, self._confirmed = mode, self._companion.status.mode == mode

    def _upload_failed(self) -> bool:
        return self._upload is not None and self._upload.state is UploadState.FAILED

    def _cleared(self) -> bool:
        """Whether a person has cleared the mission that was sent."""
        return self._stored and self._companion.status.mission_state is MissionState.NO_MISSION

    def _offer(self, decision: Decision, estimate: PoseEstimate, time_s: float) -> None:
        """Where a person who holds the rover has cleared its mission, send ours but do not start it."""
        waits = self._upload is not None and self._upload.state is UploadState.SENDING
        none = self._companion.status.mission_state is MissionState.NO_MISSION
        if none and not waits and decision.kind == "drive":
            self._upload = self._companion.upload(self._way(decision, estimate), time_s)

    def _mode_lost(self, mode: int, estimate: PoseEstimate) -> None:
        """The vehicle left the wanted mode: with a grave text it was a fail-safe, without one a person."""
        texts = self._companion.status.texts
        fresh = [text for text in texts if text[0] > self._texts_read_s and text[1] <= Severity.ERROR]
        if mode == Mode.HOLD and fresh:
            self._texts_read_s, _, self.stop_text = fresh[-1]
            self._note_stop(estimate)
        else:
            self._taken_over = True

    def _release(self, mode: int | None) -> None:
        """A person who sets the vehicle to Auto gives it back to the planner."""
        if mode == Mode.AUTO:
            self._taken_over, self._decision = False, None
            self._want(Mode.AUTO)

    def _note_stop(self, estimate: PoseEstimate) -> None:
        """Avoid the place from now on; the next picture decides how to get away from it."""
        place = np.asarray(estimate.pose.position_w[:2])
        near = self._stop_place_w is not None and float(np.linalg.norm(place - self._stop_place_w)) < PROGRESS_M
        self._stops_here = self._stops_here + 1 if near else 1
        self.counts = replace(self.counts, failsafe_stops=self.counts.failsafe_stops + 1)
        if not near:
            self._stop_place_w, self._first_stop_s = place, estimate.time_s
        self._tried_s = estimate.time_s - self._first_stop_s
        if self.route is not None and self.exhausted:
            # Where the rover cannot get on, the route may know another way.
            reason, self._stops_here = f"stopped {self._stops_here} times about one place ({self.stop_text})", 0
            xy = (float(place[0]), float(place[1]))
            self.route, self.plan = route_following.given_up(self.route, self.plan, xy, reason)
        self.plan = trouble.note_trouble(self.plan, estimate)
        self._decision, self._upload = None, None
        self._want(Mode.HOLD)


def _not_passed(way_w: FloatArray, estimate: PoseEstimate) -> FloatArray:
    """The waypoints (N, 2) after the first, less those that the rover passes during the upload; never none."""
    passed_m = UPLOAD_S * float(np.linalg.norm(estimate.velocity_w[:2]))
    arcs = np.cumsum(np.linalg.norm(np.diff(way_w, axis=0), axis=1))
    return way_w[1 + min(int(np.searchsorted(arcs, passed_m)), len(arcs) - 1) :]


def _is_new(before: Decision, decision: Decision) -> bool:
    """Whether the vehicle must be told: another kind, another way, another heading."""
    if before.kind != decision.kind:
        return True
    if decision.kind == "drive":
        return decision.changed
    return before.heading_rad != decision.heading_rad or not np.array_equal(before.waypoints_w, decision.waypoints_w)
