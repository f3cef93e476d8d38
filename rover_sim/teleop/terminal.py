"""A terminal whose keys come one by one, and which is left as it was found."""

from __future__ import annotations

import os
import select
import sys
import termios
import tty
from collections.abc import Iterator
from contextlib import contextmanager

from rover_sim.errors import InputError

_FOCUS_ON, _FOCUS_OFF = "\x1b[?1004h", "\x1b[?1004l"  # xterm and its kin then tell when the window loses the focus
_CLEAR_LINE = "\r\x1b[K"


class Terminal:
    """Keys in, one line of state and lines of text out; make one with `open_terminal`."""

    def __init__(self, keyboard: int) -> None:
        self._keyboard = keyboard
        self.closed = False  # the terminal has gone away

    def read(self, wait_s: float) -> bytes:
        """What was typed, at most ``wait_s`` later; empty if nothing was."""
        if self.closed or not select.select([self._keyboard], [], [], wait_s)[0]:
            return b""
        try:
            data = os.read(self._keyboard, 1024)
        except OSError:
            data = b""
        self.closed = not data
        return data

    def show(self, line: str) -> None:
        """Replace the line of state."""
        self._write(_CLEAR_LINE + line)

    def say(self, text: str) -> None:
        """A line of its own, above the line of state."""
        self._write(f"{_CLEAR_LINE}{text}\r\n")

    def _write(self, text: str) -> None:
        if not self.closed:
            sys.stderr.write(text)
            sys.stderr.flush()


@contextmanager
def open_terminal() -> Iterator[Terminal]:
    """The terminal of standard input; raises InputError if there is none."""
    if not sys.stdin.isatty():
        raise InputError("standard input is not a terminal; allowed: a terminal, whose keys steer")
    keyboard = sys.stdin.fileno()
    before = termios.tcgetattr(keyboard)
    terminal = Terminal(keyboard)
    tty.setcbreak(keyboard)
    try:
        terminal._write(_FOCUS_ON)  # noqa: SLF001  (its own maker)
        yield terminal
    finally:
        if not terminal.closed:
            terminal._write(f"{_FOCUS_OFF}\r\n")  # noqa: SLF001
            termios.tcsetattr(keyboard, termios.TCSADRAIN, before)
