"""Fuzzy traversability of paths, 0 (do not) to 1 (free), by rules that are data.

After Howard, Seraji and Tunstel, "A rule-based fuzzy traversability index for mobile robot navigation", ICRA 2001; the
rules stand in ``knowledge/traversability.toml``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from worlds.fuzzy import RuleBase, evaluate, rule_bases
from worlds.types import FloatArray

KNOWLEDGE = Path(__file__).parent / "knowledge" / "traversability.toml"
STAGES = {
    "obstacles": {"spare_m", "risk"},
    "ground": {"slope_deg", "roughness"},
    "path": {"openness", "ease", "length_ratio"},
}


@dataclass(frozen=True)
class TraversabilityRules:
    """The three rule tables."""

    obstacles: RuleBase
    ground: RuleBase
    path: RuleBase


@dataclass(frozen=True, eq=False)
class PathFeatures:
    """What is judged, one value a path: arrays (N,)."""

    spare_m: FloatArray  # clearance beyond what the rover needs
    risk: FloatArray  # mean of the hilly field
    roughness: FloatArray  # share 0..1
    slope_deg: FloatArray
    length_ratio: FloatArray  # over the straight line


def traversability(features: PathFeatures, rules: TraversabilityRules | None = None) -> FloatArray:
    """Traversability (N,) of paths: no better with less room, more rocks, rougher or steeper ground or a longer way."""
    rules = rules or shipped_rules()
    openness = evaluate(rules.obstacles, {"spare_m": features.spare_m, "risk": features.risk})
    ease = evaluate(rules.ground, {"slope_deg": features.slope_deg, "roughness": features.roughness})
    return evaluate(rules.path, {"openness": openness, "ease": ease, "length_ratio": features.length_ratio})


@cache
def shipped_rules() -> TraversabilityRules:
    """The rules that come with the package."""
    return load_rules(KNOWLEDGE)


def load_rules(path: Path) -> TraversabilityRules:
    """Rules of a TOML file; InputError names the file and what is wrong with it."""
    return TraversabilityRules(**rule_bases(path, STAGES))
