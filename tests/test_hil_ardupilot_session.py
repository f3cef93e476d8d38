"""The session against the double: every step once, whatever happens to datagrams and processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_sim.errors import LinkError
from rover_sim.hil.ardupilot import ArduPilotSession, Clockwork
from rover_sim.hil.lockstep import Datagram, Lockstep
from rover_sim.hil.outputs import OutputDriver
from rover_sim.hil.servo_port import ServoPort
from rover_sim.hil.session import Driven, Watchers
from rover_sim.outcome import Reason
from rover_sim.sim.rover import load_rover
from rover_sim.traverse import Stepped, Traverse
from tests.ardupilot_double import NEUTRAL, Accepted, ArduPilotDouble, pack, servos
from tests.ardupilot_rig import Faults, MemoryPort
from worlds.fault_events import Event

STEP_S = 1.0 / 240.0
FOOTPRINT = load_rover("husky").footprint()
FASTEST = FOOTPRINT.max_speed_m_s / FOOTPRINT.wheel_radius_m


class Physics:
    """A rover that creeps east with the mean of its outputs, in place of the simulation."""

    def __init__(self) -> None:
        self.steps = 0
        self.x_m = self.speed_m_s = 0.0

    @property
    def time_s(self) -> float:
        return self.steps * STEP_S

    @property
    def chassis_motion(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        return np.array([self.x_m, 0, 0, 0, 0, 0, 1, self.speed_m_s, 0, 0, 0, 0, 0], float)


class Course:
    """A traverse of so many steps; keeps what the wheels were told."""

    def __init__(
        self, length: int, during: Callable[[int], None] = lambda _: None, events: Sequence[Event] = ()
    ) -> None:
        self.world = SimpleNamespace(scenario=SimpleNamespace(event=tuple(events), imu=None))
        self.simulation, self.length, self._during = Physics(), length, during
        self.outputs = OutputDriver(FOOTPRINT)
        self.wheels: list[tuple[float, float]] = []
        self.closed = False

    def step(self, on_sight: object) -> Stepped:
        del on_sight
        speeds = self.outputs.wheel_speed_rad_s
        self.wheels.append((speeds[0] / FASTEST, speeds[-1] / FASTEST))
        self._during(self.simulation.steps)
        self.simulation.speed_m_s = sum(self.wheels[-1]) / 2
        self.simulation.x_m += self.simulation.speed_m_s * STEP_S
        self.simulation.steps += 1
        ended = (Reason.GOAL, "") if self.simulation.steps >= self.length else None
        return Stepped(self.simulation.steps % 120 == 0, ended)

    def status(self) -> object:
        return self.simulation.time_s

    def summary(self, reason: Reason, detail: str, *, wall_time_s: float) -> dict[str, Any]:
        return {"reason": reason, "detail": detail, "wall_time_s": wall_time_s, "steps": self.simulation.steps}

    def close(self) -> None:
        self.closed = True


class Rig:
    """Double, port and session around courses."""

    def __init__(
        self,
        length: int = 240,
        double: ArduPilotDouble | None = None,
        faults: Faults | None = None,
        during: Callable[[int], None] = lambda _: None,
        at_count: Callable[[int], None] = lambda _: None,
        stopped: Callable[[], bool] = lambda: False,
        wait_s: float = 30.0,
        events: Sequence[Event] = (),
    ) -> None:
        self.double = double or ArduPilotDouble()
        self.port = MemoryPort(self.double, faults, at_count)
        self.courses: list[Course] = []
        self.said: list[str] = []
        self.lockstep = Lockstep(loopback_only=True)
        self._length, self._during, self._events = length, during, events
        self.session = ArduPilotSession(
            self.port,
            self.lockstep,
            self._begin,
            self.port.clockwork(wait_s),
            Watchers(say=self.said.append, stopped=stopped),
        )

    def _begin(self) -> Driven:
        self.courses.append(Course(self._length, self._during, self._events))
        return Driven(cast(Traverse, self.courses[-1]), self.courses[-1].outputs)

    def run(self) -> dict[str, Any]:
        return self.session.run()

    @property
    def course(self) -> Course:
        return self.courses[-1]


def straight(time_s: float, state: Accepted | None) -> Sequence[int]:
    del time_s, state
    return servos(1750, 1250)


def test_each_packet_is_one_step_and_one_reply() -> None:
    rig = Rig()
    assert rig.run()["reason"] is Reason.GOAL
    assert rig.course.simulation.steps == len(rig.port.sent) == 240
    rig.port.take()  # the last reply is taken in
    assert rig.double.count == 240
    assert rig.double.clock_s == pytest.approx(1.0)
    assert rig.said == []


def test_pulses_turn_the_wheels() -> None:
    rig = Rig(10, ArduPilotDouble(straight))
    rig.run()
    assert set(rig.course.wheels) == {(0.5, -0.5)}


def test_a_disabled_output_of_the_autopilot_is_full_speed_astern() -> None:
    """Its simulation clamps channels 1 and 3: the documentation warns of it."""
    rig = Rig(3, ArduPilotDouble(lambda _time_s, _state: (0,) * 16))
    rig.run()
    assert set(rig.course.wheels) == {(-1.0, -1.0)}


def test_packets_of_32_channels() -> None:
    rig = Rig(10, ArduPilotDouble(straight, channels=32))
    rig.run()
    assert set(rig.course.wheels) == {(0.5, -0.5)}


def test_a_lost_packet_is_asked_for_again() -> None:
    rig = Rig(20, faults=Faults(lost_packets={0, 7}))
    rig.run()
    assert rig.course.simulation.steps == len(rig.port.sent) == 20
    assert rig.port.now_s == pytest.approx(2.2, abs=0.2)


def test_a_lost_reply_is_sent_again_and_no_step_is_made() -> None:
    rig = Rig(20, faults=Faults(lost_replies={0, 7}))
    rig.run()
    assert rig.course.simulation.steps == 20
    assert len(rig.port.sent) == 22
    assert rig.port.sent[0] == rig.port.sent[1]
    assert rig.port.sent[8] == rig.port.sent[9]  # frame 7, after frame 0 twice


def test_a_doubled_packet_has_one_reply() -> None:
    """Two in the queue at once; a second reply would stay queued and delay every later step."""
    rig = Rig(20, faults=Faults(doubled_packets={0, 5, 6}))
    rig.run()
    assert rig.course.simulation.steps == len(rig.port.sent) == 20


def test_a_repetition_that_crosses_its_reply_has_no_second_one() -> None:
    """The next packet comes 10 ms later, as the autopilot paces itself: a second reply would be taken for its own."""
    rig = Rig(20, faults=Faults(crossed_replies={0, 5, 6}))
    rig.run()
    assert rig.course.simulation.steps == len(rig.port.sent) == 20


def test_a_stall_of_three_seconds_is_answered_once() -> None:
    rig: Rig | None = None

    def stall(step: int) -> None:
        assert rig is not None
        if step in (0, 9):
            rig.port.pass_time(3.0)  # two repetitions come in

    rig = Rig(20, during=stall)
    rig.run()
    assert len(rig.port.sent) == 20
    rig.port.take()
    assert rig.double.count == 20
    assert rig.double.clock_s == pytest.approx(20 * STEP_S)


def test_a_late_answer_of_the_scenario_is_late_once() -> None:
    """The autopilot asks twice more meanwhile, and has one answer."""
    rig = Rig(48, events=[Event(kind="late_physics", time_s=0.1, stall_s=2.5)])
    rig.run()
    assert rig.port.now_s == pytest.approx(2.5)
    assert len(rig.port.sent) == 48


def test_the_summary_tells_how_the_link_did() -> None:
    rig = Rig(20, faults=Faults(lost_replies={3}, before={5: [(b"?", ("127.0.0.1", 9))]}))
    assert rig.run()["hil"] == {
        "autopilot": "ardupilot",
        "steps": 20,
        "restarts": 0,
        "replies_repeated": 1,
        "datagrams_dropped": {"no servo packet": 1},
    }


def test_the_autopilot_may_begin_anew() -> None:
    rig: Rig | None = None
    done: list[int] = []

    def crash(count: int) -> None:
        assert rig is not None
        if count == 50 and not done:
            done.append(count)
            rig.port.restart_autopilot()

    rig = Rig(120, at_count=crash)
    assert rig.run()["steps"] == 120
    assert len(rig.courses) == 2
    assert rig.courses[0].closed
    assert not rig.courses[1].closed
    assert any("began anew" in text for text in rig.said)
    assert rig.double.states[0].time_s == pytest.approx(STEP_S)  # time and place begin anew, too
    assert rig.double.states[0].vector("position") == (0.0, 0.0, 0.0)


def test_the_physics_may_begin_anew() -> None:
    """The autopilot sees the time go back once, and goes on."""
    double = ArduPilotDouble(strict=False)
    Rig(50, double).run()
    double.packets(0.0)
    again = Rig(50, double)
    again.run()
    again.port.take()
    assert double.count == 100
    assert double.log == ["Detected physics reset"]
    assert len(again.courses) == 1
    assert any("for 50 steps" in text and "restart it" in text for text in again.said)
    assert double.clock_s == pytest.approx(99 * STEP_S)


def test_another_rate_is_told_and_nothing_else_changes() -> None:
    rig = Rig(20, ArduPilotDouble(rate_hz=1200))
    rig.run()
    assert rig.course.simulation.steps == 20
    assert [text for text in rig.said if "1200" in text and "--rate 240" in text]


def test_a_rate_that_creeps_is_not_told() -> None:
    rig = Rig(20, ArduPilotDouble(rate_hz=241))
    rig.run()
    assert rig.said == []


def test_what_is_no_packet_is_dropped_counted_and_said() -> None:
    strange: list[Datagram] = [
        (b"", ("127.0.0.1", 9)),
        (pack(240, 9, NEUTRAL) + b"\0", ("127.0.0.1", 9)),
        (b"\n{}\n", ("127.0.0.1", 9)),
    ]
    rig = Rig(20, faults=Faults(before={5: strange}))
    rig.run()
    assert rig.lockstep.dropped == {"no servo packet": 3}
    assert len(rig.said) == 1
    assert rig.course.simulation.steps == 20


def test_a_second_autopilot_gets_no_reply() -> None:
    other = ("127.0.0.1", 50100)
    rig = Rig(20, faults=Faults(before={5: [(pack(240, 0, NEUTRAL), other)]}))
    rig.run()
    assert [peer for _, peer in rig.port.sent if peer == other] == []
    assert len(rig.courses) == 1
    assert rig.lockstep.dropped == {"second autopilot": 1}


def test_bursts_with_pauses_change_nothing() -> None:
    rig: Rig | None = None

    def pause(count: int) -> None:
        assert rig is not None
        if count % 100 == 99:
            rig.port.now_s += 0.005

    rig = Rig(1000, at_count=pause)
    assert rig.run()["steps"] == 1000


def test_without_an_autopilot_the_wait_ends_as_a_link_error() -> None:
    rig = Rig(20, faults=Faults(lost_packets=set(range(9))))
    cast(Any, rig.double).packets = lambda _now_s: []
    with pytest.raises(LinkError, match="no autopilot has asked for a step of the physics in 30 s"):
        rig.run()
    assert rig.port.now_s == pytest.approx(30.0, abs=0.3)


def test_an_autopilot_that_falls_silent_is_a_lost_link() -> None:
    rig: Rig | None = None

    def die(count: int) -> None:
        assert rig is not None
        if count == 10:
            cast(Any, rig.double).packets = lambda _now_s: []

    rig = Rig(20, at_count=die)
    summary = rig.run()
    assert summary["reason"] is Reason.LINK_LOST
    assert summary["steps"] == 11


def test_a_wish_to_stop_ends_it_with_a_summary() -> None:
    rig: Rig | None = None
    rig = Rig(1000, stopped=lambda: rig is not None and rig.course.simulation.steps >= 120)
    assert rig.run()["reason"] is Reason.ABORTED


def test_a_wish_to_stop_before_the_first_step_is_an_interruption() -> None:
    rig = Rig(1000, stopped=lambda: True)
    cast(Any, rig.double).packets = lambda _now_s: []
    with pytest.raises(KeyboardInterrupt):
        rig.run()


def test_what_is_not_finite_is_never_sent() -> None:
    rig: Rig | None = None

    def explode(step: int) -> None:
        assert rig is not None
        if step == 10:
            rig.course.simulation.x_m = float("nan")

    rig = Rig(20, during=explode)
    summary = rig.run()
    assert summary["reason"] is Reason.ERROR
    assert "not finite" in summary["detail"]
    assert len(rig.port.sent) == 10


FRAMES = st.sets(st.integers(0, 29), max_size=8)
STRANGERS = st.tuples(
    st.binary(max_size=80), st.sampled_from([("127.0.0.1", 9), ("127.0.0.1", 50000), ("192.0.2.1", 5)])
)


@settings(deadline=None, max_examples=40)
@given(
    FRAMES,
    FRAMES,
    FRAMES,
    FRAMES,
    FRAMES,
    st.dictionaries(st.integers(0, 29), st.lists(STRANGERS, max_size=3), max_size=6),
    st.booleans(),
)
def test_whatever_happens_to_datagrams_each_frame_is_one_step(
    lost_packets: set[int],
    lost_replies: set[int],
    doubled: set[int],
    crossed: set[int],
    stalls: set[int],
    strangers: dict[int, list[Datagram]],
    wide: bool,
) -> None:
    """The double is strict: another reply to the same frame, a surplus one or another step would end the test.

    One thing cannot be told apart from a lost reply, and is left out: a repetition that crosses its reply while the
    packet behind it is lost.
    """
    rig: Rig | None = None
    lost = lost_packets - {count + 1 for count in crossed}

    def stall(step: int) -> None:
        assert rig is not None
        if step in stalls:
            rig.port.pass_time(1.7)

    faults = Faults(lost, set(lost_replies), set(doubled), set(crossed), dict(strangers))
    rig = Rig(30, ArduPilotDouble(straight, channels=32 if wide else 16), faults, stall)
    assert rig.run()["steps"] == 30
    rig.port.pass_time(0.1)
    assert rig.double.count == 30 or 29 in lost_replies
    assert len(rig.courses) == 1
    assert set(rig.course.wheels) == {(0.5, -0.5)}


def test_over_loopback_sockets() -> None:
    """The same bytes through the system, one process: who is asked answers before the other looks."""
    import socket

    port = ServoPort("127.0.0.1:0")
    double = ArduPilotDouble(straight)
    peer = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    peer.setblocking(False)

    class Loopback:
        def wait(self, seconds: float) -> bool:
            self._pump()
            return port.wait(seconds)

        def take(self) -> list[Datagram]:
            self._pump()
            return port.take()

        def send(self, data: bytes, address: tuple[str, int]) -> None:
            port.send(data, address)

        def _pump(self) -> None:
            try:
                while True:
                    double.deliver(peer.recv(65536))
            except BlockingIOError:
                for data in double.packets(0.0):
                    peer.sendto(data, port.address)

    course = Course(100)
    try:
        session = ArduPilotSession(
            Loopback(),
            Lockstep(loopback_only=True),
            lambda: Driven(cast(Traverse, course), course.outputs),
            Clockwork(lambda: 0.0, lambda _: None, 9.0),
        )
        assert session.run()["steps"] == 100
    finally:
        port.close()
        peer.close()
    assert double.count >= 99
