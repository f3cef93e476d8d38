"""One trial: the conditions of one traverse, and the row that it leaves in the table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from worlds.scenario import Scenario

Value = str | float
Choice = Mapping[str, Value]


@dataclass(frozen=True)
class Trial:
    """One traverse to be driven; trials of equal ``cell`` are counted together."""

    suite: str
    cell: Choice
    seed: int
    scenario: Scenario
    variant: Choice = field(default_factory=dict)  # what else tells it from its like, such as the number of a map
    touch_ends: bool = False  # the first touch of an obstacle by hull or wheel ends the traverse
    reference_m: float | None = None  # length of the way that the suite scores against; None: no such score

    @property
    def key(self) -> str:
        """Unique name in the table."""
        parts = [f"{name}={value:g}" if isinstance(value, float) else f"{name}={value}" for name, value in self._parts]
        return "/".join([self.suite, *parts, f"seed={self.seed}"])

    @property
    def folder_name(self) -> str:
        """The key as the name of a run folder."""
        return self.key.replace("/", "_").replace("=", "-")

    @property
    def _parts(self) -> list[tuple[str, Value]]:
        return [*self.cell.items(), *self.variant.items()]


@dataclass(frozen=True)
class Row:
    """What one trial left, as in the table ``trials`` of ``results.sqlite``."""

    key: str
    suite: str
    cell: Choice
    seed: int
    success: bool
    reason: str
    metrics: Mapping[str, Any]  # the keys of summary.json and those of `drive.trial_figures`; none after an error
    error: str | None
    wall_time_s: float
    version: str
