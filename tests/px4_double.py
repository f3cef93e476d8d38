"""PX4's side of the simulator link, imitated: its clock, its answers, and no patience with what is wrong.

It is not PX4: a run with it is no run with the autopilot. `MemoryPx4` is deterministic and lives on a clock that only
waiting moves; `Px4Process` runs it behind a real socket.
"""

from __future__ import annotations

import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

from pymavlink.dialects.v20 import development as dialect

from rover_sim.mavlink.dialect import Message
from tests.px4_checks import STEP_USEC, Checks, ViolationError, require

ARMED, CUSTOM = 128, 1
RETRY_S = 0.0005  # between two attempts to connect
POLL_S = 0.05


@dataclass(frozen=True)
class Outputs:
    """What the controllers want."""

    armed: bool = False
    right: float = 0.0  # Motor 1
    left: float = 0.0  # Motor 2


Controller = Callable[[Checks], Outputs]


def resting(checks: Checks) -> Outputs:
    """Disarmed."""
    del checks
    return Outputs()


def armed_from(start_s: float, right: float, left: float) -> Controller:
    """Armed from a time after the first step, with constant outputs."""
    return lambda checks: Outputs(True, right, left) if checks.elapsed_usec >= start_s * 1e6 else Outputs()


class Px4Double:
    """One PX4 program: what it says when it has connected, and what it answers.

    ``period_usec``: of its controllers; their timer runs on PX4's clock, so only some steps make them run.
    ``silent_usec``: windows of its clock in which it has no outputs to send.
    """

    def __init__(
        self,
        controller: Controller = resting,
        *,
        period_usec: int = STEP_USEC,
        lockstep: bool = True,
        silent_usec: tuple[tuple[int, int], ...] = (),
        asks_truth: bool = True,
        gnss: bool = True,
        at_rest: bool = True,
    ) -> None:
        self.checks = Checks(gnss=gnss, at_rest=at_rest)
        self.answers = 0
        self.armed = False
        self._controller, self._period_usec, self._lockstep = controller, period_usec, lockstep
        self._silent_usec, self._asks_truth = silent_usec, asks_truth
        self._next_usec: int | None = None
        self._in = dialect.MAVLink(None)
        self._out = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
        self._sequences: dict[int, int] = {}  # of the last frame, by component

    def begin(self) -> bytes:
        """What its two threads say at once."""
        heartbeat = dialect.MAVLink_heartbeat_message(0, dialect.MAV_AUTOPILOT_PX4, 0, 0, 0, 3)
        data = self._pack(heartbeat)
        if self._asks_truth:
            wanted = float(dialect.MAVLINK_MSG_ID_HIL_STATE_QUATERNION)
            command = (dialect.MAV_CMD_SET_MESSAGE_INTERVAL, 0, wanted, 5000.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            data = self._pack(dialect.MAVLink_command_long_message(0, 0, *command)) + data
            self.checks.truth_asked = True
        return data

    def feed(self, data: bytes) -> bytes:
        """Bytes of the simulator in, answers out."""
        answer = b""
        for message in self._in.parse_buffer(data) or []:
            self._check_frame(message)
            self.checks.take(message)
            if message.get_type() == "HIL_SENSOR":
                answer += self._run()
        return answer

    def _run(self) -> bytes:
        """The clock has moved: the controllers run if their timer has expired."""
        now = self.checks.believed.clock_usec
        if self._next_usec is None:
            self._next_usec = now
        if now < self._next_usec:
            return b""
        while self._next_usec <= now:
            self._next_usec += self._period_usec
        outputs = self._controller(self.checks)
        self.armed = outputs.armed
        if any(begin <= now < end for begin, end in self._silent_usec):
            return b""
        self.answers += 1
        values = [outputs.right, outputs.left] if outputs.armed else [0.0, 0.0]
        mode = CUSTOM | (ARMED if outputs.armed else 0)
        flags = 1 if self._lockstep else 0
        controls = [*values, *[0.0] * 14]
        return self._pack(dialect.MAVLink_hil_actuator_controls_message(now, controls, mode, flags))

    def _pack(self, message: Message) -> bytes:
        frame = bytes(message.pack(self._out))
        self._out.seq = (self._out.seq + 1) % 256
        return frame

    def _check_frame(self, message: Message) -> None:
        require(message.get_type() != "BAD_DATA", f"bytes that are no frame: {message}")
        sequence, component = message.get_seq(), message.get_srcComponent()
        before = self._sequences.get(component, (sequence - 1) % 256)
        require(sequence == (before + 1) % 256, f"frame {sequence} after frame {before}")
        self._sequences[component] = sequence


class MemoryPx4:
    """A link in memory with a PX4 that takes ``latency_s`` to work off a step; also the `wait` of who waits for it."""

    is_stream = True

    def __init__(self, px4: Px4Double | None = None, latency_s: float | Callable[[int], float] = 0.0) -> None:
        self.now_s = 0.0
        self.waited_s: list[float] = []  # each wait, as asked for
        self.most_pending = 0  # steps that PX4 had not worked off when another came
        self._latency_s = latency_s
        self._count = 0
        self._px4: Px4Double | None = None
        self._answers: deque[tuple[float, bytes]] = deque()
        if px4 is not None:
            self.connect(px4)

    def connect(self, px4: Px4Double) -> None:
        """A new PX4, instead of one that was there."""
        self._px4, self._count, self._busy_s = px4, self._count + 1, self.now_s
        self._answers = deque([(self.now_s, px4.begin())])

    def disconnect(self) -> None:
        """The PX4 has ended."""
        self._px4, self._answers = None, deque()

    def peers(self, time_s: float) -> tuple[str, ...]:
        del time_s
        return () if self._px4 is None else (f"px4-{self._count}",)

    def send(self, frame: bytes, peer: str, time_s: float) -> None:
        del time_s
        if self._px4 is None or peer != f"px4-{self._count}":
            return  # lost, as on a connection whose other end has gone
        pending = sum(ready_s > self.now_s for ready_s, _ in self._answers)
        self.most_pending = max(self.most_pending, pending)
        latency_s = self._latency_s if isinstance(self._latency_s, float) else self._latency_s(self._px4.answers)
        self._busy_s = max(self.now_s, self._busy_s) + latency_s
        answer = self._px4.feed(frame)
        if answer:
            self._answers.append((self._busy_s, answer))

    def receive(self, time_s: float) -> list[tuple[str, bytes]]:
        del time_s
        chunks = []
        while self._answers and self._answers[0][0] <= self.now_s + 1e-12:
            chunks.append((f"px4-{self._count}", self._answers.popleft()[1]))
        return chunks

    def handles(self) -> tuple[int, ...]:
        return (0,)

    def wait(self, handles: tuple[int, ...], seconds: float) -> float:
        """Time passes until the next answer, at most so long; all of it without handles, as a plain pause."""
        ready_s = self._answers[0][0] if self._answers and handles else self.now_s + seconds
        passed_s = min(seconds, max(0.0, ready_s - self.now_s))
        self.now_s += passed_s
        self.waited_s.append(passed_s)
        return passed_s

    def close(self) -> None:
        self.disconnect()


class Px4Process:
    """A PX4 in a thread of its own that connects to a simulator's port; a context manager.

    ``within_s``: wall time in which it must get on, and end. What it found wrong is raised when it ends.
    """

    def __init__(self, port: int, px4: Px4Double, *, within_s: float = 60.0) -> None:
        self.px4 = px4
        self.error: Exception | None = None
        self.connected = threading.Event()
        self.poll_timeouts = 0
        self._port, self._deadline = port, time.monotonic() + within_s
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._live, name="px4", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self) -> None:
        """Kill it, and raise what it found wrong."""
        self._stop.set()
        self._thread.join(timeout=10.0)
        if self.error is not None:
            raise self.error

    def live(self) -> None:
        """Connect, and talk until the simulator ends or `end` is called; raises what it finds wrong."""
        with self._connected() as link:
            self._talk(link)

    def _live(self) -> None:
        try:
            self.live()
        except (ViolationError, OSError) as error:
            self.error = error

    def _connected(self) -> socket.socket:
        while True:
            link = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            try:
                link.connect(("127.0.0.1", self._port))
            except ConnectionError:
                link.close()
                require(time.monotonic() < self._deadline, "nobody listens")
                self._stop.wait(RETRY_S)
            else:
                self.connected.set()
                return link

    def _talk(self, link: socket.socket) -> None:
        link.settimeout(POLL_S)
        link.sendall(self.px4.begin())
        silent_since_s = time.monotonic()
        while not self._stop.is_set():
            try:
                data = link.recv(2048)
            except TimeoutError:
                if self.px4.checks.believed.sensors and time.monotonic() - silent_since_s >= 1.0:
                    self.poll_timeouts, silent_since_s = self.poll_timeouts + 1, time.monotonic()
                continue
            silent_since_s = time.monotonic()
            if not data:
                return  # the simulator has gone; a real PX4 does not connect a second time
            answer = self.px4.feed(data)
            if answer:
                link.sendall(answer)
