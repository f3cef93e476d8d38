"""The one family of errors that a user can cause; each message names the file, the key and what is allowed."""

from __future__ import annotations


class InputError(Exception):
    """The input is wrong; its one-line text says where, what it is and what is allowed (exit code 2)."""


class ScenarioError(InputError):
    """A scenario, or a file that it names, cannot be used."""
