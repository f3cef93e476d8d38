"""A board with PX4 in HITL, imitated at the far end of a pseudo-terminal, in a thread and on the wall clock."""

from __future__ import annotations

import os
import pty
import select
import threading
import time
import tty
from typing import Self

from pymavlink.dialects.v20 import development as dialect

from rover_sim.mavlink.dialect import Message
from tests.px4_checks import Checks, ViolationError, require
from tests.px4_double import ARMED, CUSTOM, Controller, Px4Double, resting

HIL = 32
SIMULATOR, PLANNER = 200, 191  # components
CONTROLS_S, HEARTBEAT_S = 1 / 200, 1.0
BOOTED_S = 3600.0  # that the board has been on before the simulator came


class Px4Board(Px4Double):
    """What a board makes of frames; it answers by its own clock, not by ours."""

    def __init__(self, controller: Controller = resting, *, in_hil: bool = True, at_rest: bool = True) -> None:
        super().__init__(controller, asks_truth=False, lockstep=False, at_rest=at_rest)
        self.checks.on_board()
        self.talks = False  # on USB it begins with the first heartbeat that it hears
        self.heartbeats = 0
        self.others: list[Message] = []  # to the autopilot, from planner and stations
        self._controller, self._in_hil = controller, in_hil

    def heard(self, data: bytes) -> int:
        """Take bytes in; how many inertial samples were in them."""
        before = self.checks.believed.sensors
        for message in self._in.parse_buffer(data) or []:
            self._check_frame(message)
            if message.get_srcComponent() != SIMULATOR:
                self.others.append(message)
                continue
            self.talks = self.talks or message.get_type() == "HEARTBEAT"
            self.heartbeats += message.get_type() == "HEARTBEAT"
            if self._in_hil or message.get_type() == "HEARTBEAT":
                self.checks.take(message)
            if self._in_hil and message.get_type() == "HIL_SENSOR":
                self.sampled()
        return self.checks.believed.sensors - before

    def sampled(self) -> None:
        """An inertial sample has arrived."""

    def heartbeat(self) -> bytes:
        mode = CUSTOM | (ARMED if self.armed else 0) | (HIL if self._in_hil else 0)
        rover, px4 = dialect.MAV_TYPE_GROUND_ROVER, dialect.MAV_AUTOPILOT_PX4
        return self._pack(dialect.MAVLink_heartbeat_message(rover, px4, mode, 0, dialect.MAV_STATE_ACTIVE, 3))

    def controls(self, now_s: float) -> bytes:
        """HIL_ACTUATOR_CONTROLS, stamped with the board's own clock."""
        if not self._in_hil:
            return b""
        outputs = self._controller(self.checks)
        self.armed = outputs.armed
        values = [outputs.right, outputs.left] if outputs.armed else [0.0, 0.0]
        mode = CUSTOM | HIL | (ARMED if outputs.armed else 0)
        self.answers += 1
        stamped = (round((now_s + BOOTED_S) * 1e6), [*values, *[0.0] * 14], mode, 0)
        return self._pack(dialect.MAVLink_hil_actuator_controls_message(*stamped))


class BoardOnPty:
    """The board in a thread at the far end of a pseudo-terminal; a context manager that raises what it found wrong."""

    def __init__(self, board: Px4Board, within_s: float = 60.0) -> None:
        self.board, self.error = board, None
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.device = os.ttyname(self._slave)
        self.gaps_s: list[float] = []  # between inertial samples, as they arrive
        self._within_s = within_s
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._live, name="board", daemon=True)

    error: Exception | None

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self) -> None:
        """Switch the board off: its device is gone."""
        self._stop.set()
        self._thread.join(timeout=10.0)
        for handle in (self._master, self._slave):
            if handle >= 0:
                os.close(handle)
        self._master = self._slave = -1
        if self.error is not None:
            error, self.error = self.error, None
            raise error

    @property
    def checks(self) -> Checks:
        return self.board.checks

    def _live(self) -> None:
        try:
            self._talk()
        except (ViolationError, OSError) as error:
            self.error = error

    def _talk(self) -> None:
        began_s = time.monotonic()
        next_controls_s = next_heartbeat_s = 0.0
        last_s: float | None = None
        while not self._stop.is_set():
            now_s = time.monotonic() - began_s
            require(now_s < self._within_s, "the simulator never ended")
            if select.select([self._master], [], [], CONTROLS_S / 2)[0]:
                got = self.board.heard(os.read(self._master, 4096))
                for _ in range(got):
                    here_s = time.monotonic()
                    if last_s is not None:
                        self.gaps_s.append(here_s - last_s)
                    last_s = here_s
            if not self.board.talks:
                continue
            if now_s >= next_heartbeat_s:
                next_heartbeat_s = now_s + HEARTBEAT_S
                os.write(self._master, self.board.heartbeat())
            if now_s >= next_controls_s:
                next_controls_s = now_s + CONTROLS_S
                os.write(self._master, self.board.controls(now_s))
