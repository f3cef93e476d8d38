"""Scoring and learning from labelled pictures: one module a kind of label.

Each offers ``score(pairs, knowledge, folder, workers)`` and ``learn(pairs, base, out, workers)``; both write their
files and return the lines to print. ``label_of(image, folder)`` is the path of an image's label.
"""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

KINDS = {"rocks": "rover_sim.learning.rocks", "grid": "rover_sim.learning.grid"}


def kind_module(kind: str) -> ModuleType:
    """The module of a kind of label."""
    return import_module(KINDS[kind])
