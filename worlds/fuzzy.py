"""A small Mamdani inference engine: linguistic rules as data, evaluated for many samples at once.

A rule base is decoded from a table such as TOML gives::

    norm = "minimum"                      # or "product": the AND, and how a rule shapes its output set
    [input.slope_deg]
    range = [0.0, 40.0]                   # values outside are taken as the nearer end
    flat = [0.0, 0.0, 5.0, 15.0]          # four corners: trapezoid; three: triangle
    steep = [5.0, 15.0, 40.0, 40.0]
    [output.ease]
    range = [0.0, 1.0]
    poor = [0.0, 0.0, 0.5]
    good = [0.5, 1.0, 1.0]
    [[rule]]
    if = { slope_deg = "flat" }           # several inputs: AND; a list of terms: OR
    then = "good"
    weight = 1.0                          # optional

Source: Mamdani and Assilian, Int. J. Man-Machine Studies 7 (1975) 1-13. With ``norm = "product"``, terms that sum
to one everywhere and a smooth monotone rule table the answer is monotone in each input (Van Broekhoven and
De Baets, IEEE Trans. Fuzzy Systems 17(5), 2009); with the minimum it need not be.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, TypeGuard

import numpy as np

from worlds.errors import InputError
from worlds.types import FloatArray

Corners = tuple[float, float, float, float]
Norm = Literal["minimum", "product"]
GRID_POINTS = 201  # of the output axis; a centroid is then good to about 1e-4 of its range


@dataclass(frozen=True)
class Variable:
    """A linguistic variable: its range and its terms as trapezoid corners, in the order of the file."""

    name: str
    low: float
    high: float
    terms: tuple[tuple[str, Corners], ...]

    @property
    def term_names(self) -> tuple[str, ...]:
        """Names of the terms."""
        return tuple(name for name, _ in self.terms)


@dataclass(frozen=True)
class Rule:
    """``if`` each named input is one of its listed terms ``then`` the output is a term."""

    conditions: tuple[tuple[str, tuple[str, ...]], ...]
    consequent: str
    weight: float = 1.0


@dataclass(frozen=True)
class RuleBase:
    """Inputs, one output, rules and the norm that combines them."""

    inputs: tuple[Variable, ...]
    output: Variable
    rules: tuple[Rule, ...]
    norm: Norm = "minimum"

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs, which `evaluate` wants as keys."""
        return tuple(variable.name for variable in self.inputs)


def membership(corners: Corners, values: FloatArray) -> FloatArray:
    """Membership 0..1 of ``values`` (any shape) in the trapezoid with corners a <= b <= c <= d."""
    a, b, c, d = corners
    rising = np.ones_like(values) if b == a else np.clip((values - a) / (b - a), 0.0, 1.0)
    falling = np.ones_like(values) if d == c else np.clip((d - values) / (d - c), 0.0, 1.0)
    return np.where((values < a) | (values > d), 0.0, np.minimum(rising, falling))


def memberships(variable: Variable, values: FloatArray) -> dict[str, FloatArray]:
    """Membership of ``values`` (N,) in each term; values beyond the range count as its ends."""
    clipped = np.clip(values, variable.low, variable.high)
    return {name: membership(corners, clipped) for name, corners in variable.terms}


def rule_strengths(base: RuleBase, inputs: Mapping[str, FloatArray]) -> FloatArray:
    """How strongly each rule fires, (N, rules) in 0..1; ``inputs`` maps each input's name to its values (N,).

    Raises KeyError when an input of the rule base is missing.
    """
    degrees = {v.name: memberships(v, np.atleast_1d(np.asarray(inputs[v.name], dtype=float))) for v in base.inputs}
    combine = np.minimum if base.norm == "minimum" else np.multiply
    columns = []
    for rule in base.rules:
        strength = np.asarray(rule.weight, dtype=float)
        for name, terms in rule.conditions:
            strength = combine(strength, np.max([degrees[name][term] for term in terms], axis=0))
        columns.append(strength)
    return np.stack(columns, axis=-1)


def term_strengths(base: RuleBase, inputs: Mapping[str, FloatArray]) -> FloatArray:
    """Strongest rule of each output term, (N, terms) in the order of ``base.output.term_names``."""
    strengths = rule_strengths(base, inputs)
    names = np.array([rule.consequent for rule in base.rules])
    by_term = [strengths[:, names == term].max(axis=1, initial=0.0) for term in base.output.term_names]
    return np.stack(by_term, axis=-1)


def evaluate(base: RuleBase, inputs: Mapping[str, FloatArray]) -> FloatArray:
    """Centroid of the combined output set, (N,) in the output's units; NaN where no rule fires at all."""
    strengths = term_strengths(base, inputs)
    grid, terms = _output_shapes(base.output)
    shape = np.minimum if base.norm == "minimum" else np.multiply
    combined = np.zeros((strengths.shape[0], GRID_POINTS))
    for index, term in enumerate(terms):
        np.maximum(combined, shape(strengths[:, index, None], term), out=combined)
    area = combined.sum(axis=1)
    answer: FloatArray = np.full_like(area, np.nan)
    np.divide(combined @ grid, area, out=answer, where=area > 0)
    return answer


@cache
def _output_shapes(output: Variable) -> tuple[FloatArray, FloatArray]:
    """The output axis (G,) and each term on it (terms, G)."""
    grid = np.linspace(output.low, output.high, GRID_POINTS)
    return grid, np.stack([membership(corners, grid) for _, corners in output.terms])


def rule_base(table: Mapping[str, Any], source: str) -> RuleBase:
    """Rule base of a decoded table (see the module's text); InputError names ``source`` and the wrong key."""
    _known(table, {"norm", "input", "output", "rule"}, source, "")
    norm = table.get("norm", "minimum")
    if norm not in {"minimum", "product"}:
        raise InputError(f"{source}: norm is {norm!r}; allowed are 'minimum' and 'product'")
    inputs = tuple(_variable(name, part, f"{source}: input.{name}") for name, part in table.get("input", {}).items())
    outputs = [_variable(name, part, f"{source}: output.{name}") for name, part in table.get("output", {}).items()]
    if not inputs or len(outputs) != 1:
        raise InputError(f"{source}: has {len(inputs)} inputs and {len(outputs)} outputs; at least one and exactly one")
    rules = tuple(
        _rule(part, inputs, outputs[0], f"{source}: rule[{index}]") for index, part in enumerate(table.get("rule", []))
    )
    if not rules:
        raise InputError(f"{source}: rule is empty; at least one rule is needed")
    return RuleBase(inputs, outputs[0], rules, norm)


def _known(table: Mapping[str, Any], allowed: set[str], source: str, key: str) -> None:
    unknown = sorted(set(table) - allowed)
    if unknown:
        raise InputError(f"{source}: unknown key {key}{unknown[0]!r}; allowed are {', '.join(sorted(allowed))}")


def _variable(name: str, table: Mapping[str, Any], source: str) -> Variable:
    limits = table.get("range")
    if not _numbers(limits) or len(limits) != 2 or not limits[0] < limits[1]:
        raise InputError(f"{source}.range is {limits!r}; two rising numbers are needed")
    terms = tuple((term, _corners(corners, f"{source}.{term}")) for term, corners in table.items() if term != "range")
    if not terms:
        raise InputError(f"{source}: has no terms; at least one is needed")
    return Variable(name, float(limits[0]), float(limits[1]), terms)


def _corners(values: Any, source: str) -> Corners:
    if not _numbers(values) or len(values) not in {3, 4} or sorted(values) != list(values):
        raise InputError(f"{source} is {values!r}; three or four rising numbers are needed")
    a, *middle, d = (float(value) for value in values)
    return a, middle[0], middle[-1], d


def _numbers(values: Any) -> TypeGuard[list[float]]:
    return isinstance(values, list) and all(isinstance(v, int | float) and np.isfinite(v) for v in values)


def _rule(table: Mapping[str, Any], inputs: tuple[Variable, ...], output: Variable, source: str) -> Rule:
    _known(table, {"if", "then", "weight"}, source, "")
    by_name = {variable.name: variable for variable in inputs}
    conditions = []
    for name, wanted in table.get("if", {}).items():
        terms = (wanted,) if isinstance(wanted, str) else tuple(wanted)
        if name not in by_name:
            raise InputError(f"{source}.if: unknown input {name!r}; allowed are {', '.join(by_name)}")
        if not terms or not set(terms) <= set(by_name[name].term_names):
            allowed = ", ".join(by_name[name].term_names)
            raise InputError(f"{source}.if.{name} is {wanted!r}; allowed are {allowed}")
        conditions.append((name, terms))
    if not conditions:
        raise InputError(f"{source}.if is empty; at least one condition is needed")
    if table.get("then") not in output.term_names:
        raise InputError(f"{source}.then is {table.get('then')!r}; allowed are {', '.join(output.term_names)}")
    weight = float(table.get("weight", 1.0))
    if not 0.0 < weight <= 1.0:
        raise InputError(f"{source}.weight is {weight}; above 0 and at most 1")
    return Rule(tuple(conditions), str(table["then"]), weight)
