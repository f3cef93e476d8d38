"""Wheel-slip control of what the autopilot drives by itself."""

from __future__ import annotations

from planner.mobility import Command, relieve
from planner.monitor import MonitorState


class Traction:
    """Remembers whether the outer wheels of a bend spin."""

    def __init__(self) -> None:
        self._spinning = False

    def relieve(self, command: Command, monitor: MonitorState) -> Command:
        """The command with which spinning wheels get hold of the ground again; see `planner.mobility.relieve`."""
        command, self._spinning = relieve(command, (monitor.slip_left, monitor.slip_right), spinning=self._spinning)
        return command
