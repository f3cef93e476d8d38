"""The error tree: what ends a command, and with which exit code."""

from __future__ import annotations

from worlds.errors import InputError, ScenarioError

__all__ = ["InputError", "LinkError", "ScenarioError"]


class LinkError(Exception):
    """A link or device failed (exit code 3)."""
