"""A small Mamdani inference engine: linguistic rules as data, evaluated for many samples at once.

A rule base is decoded from a table such as TOML gives::

    norm = "minimum"                      # or "product": the AND, and how a rule shapes its output set
    aggregation = "maximum"               # or "sum": how rules for one output term come together (optional)
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
    then = "good"                         # or { good = 0.8, poor = 0.1 }: terms and the rule's weight for each
    weight = 1.0                          # optional, up to 1; with "sum" any positive number, as evidence is

With "sum" the base is an additive fuzzy system (Kosko, IEEE Trans. Computers 43(11), 1994): evidence that adds up.
Source: Mamdani and Assilian, Int. J. Man-Machine Studies 7 (1975) 1-13. With ``norm = "product"``, terms that sum
to one everywhere and a smooth monotone rule table the answer is monotone in each input (Van Broekhoven and
De Baets, IEEE Trans. Fuzzy Systems 17(5), 2009); with the minimum it need not be.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeGuard

import numpy as np
from numba import njit

from worlds.errors import InputError
from worlds.strict_toml import read_table
from worlds.types import FloatArray, IntArray

Corners = tuple[float, float, float, float]
Norm = Literal["minimum", "product"]
Aggregation = Literal["maximum", "sum"]
_UPRIGHT = 1e18  # slope of a flank that is
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


class Tables(NamedTuple):
    """A rule base as arrays; K terms of all inputs, in their order."""

    terms: IntArray  # (inputs,) how many terms each input has
    flanks: FloatArray  # (2, 3, K) where a flank begins, its slope and what it begins with
    low: FloatArray  # (inputs,) ends of the inputs' ranges
    high: FloatArray
    conditions: IntArray  # (rules + 1,) of all rules in a row: where those of each begin
    choices: IntArray  # (conditions + 1,) where the terms that each lists begin
    places: IntArray  # (choices,) of those terms among all
    single: bool  # each rule asks for one term of one input
    weights: FloatArray  # (rules,)
    owner: FloatArray  # (rules, output terms) one where the rule speaks for the term
    evidence: FloatArray  # (K, output terms) that each term brings where rules are ``single``


@dataclass(frozen=True)
class RuleBase:
    """Inputs, one output, rules and the norm that combines them."""

    inputs: tuple[Variable, ...]
    output: Variable
    rules: tuple[Rule, ...]
    norm: Norm = "minimum"
    aggregation: Aggregation = "maximum"

    def __hash__(self) -> int:
        return hash((self.output, len(self.inputs), len(self.rules), self.norm, self.aggregation))

    @cached_property
    def tables(self) -> Tables:
        """What evaluation needs of the rules: kept here, as a look-up by the base would compare hundreds of rules."""
        return _tables_of(self)

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


def rule_strengths(base: RuleBase, inputs: Mapping[str, FloatArray]) -> FloatArray:
    """How strongly each rule fires, (N, rules), its weight included; ``inputs`` maps input names to values (N,).

    Raises KeyError when an input of the rule base is missing.
    """
    tables = base.tables
    strengths = _fired(_all_degrees(base, inputs), *tables[4:7], base.norm == "product")
    combine = np.minimum if base.norm == "minimum" else np.multiply
    weigh = np.multiply if base.aggregation == "sum" else combine
    return np.asarray(weigh(strengths, tables.weights))


@njit(cache=True)
def _fired(degrees: FloatArray, conditions: IntArray, choices: IntArray, places: IntArray, product: bool) -> FloatArray:
    """How strongly each rule fires (N, rules), without its weight, by the ``degrees`` (N, K) of all terms."""
    strengths = np.empty((len(degrees), len(conditions) - 1))
    for sample in range(len(degrees)):
        for rule in range(len(conditions) - 1):
            strength = 1.0
            for condition in range(conditions[rule], conditions[rule + 1]):
                holds = degrees[sample, places[choices[condition]]]
                for choice in range(choices[condition] + 1, choices[condition + 1]):
                    holds = np.maximum(holds, degrees[sample, places[choice]])
                strength = strength * holds if product else np.minimum(strength, holds)
            strengths[sample, rule] = strength
    return strengths


def _all_degrees(base: RuleBase, inputs: Mapping[str, FloatArray]) -> FloatArray:
    """Membership (N, K) in every term of every input, inputs and terms in their order."""
    values = np.array([inputs[variable.name] for variable in base.inputs], dtype=np.float64)
    return _memberships(values.reshape(len(values), -1), *base.tables[:4]).T


@njit(cache=True)
def _memberships(
    values: FloatArray, terms: IntArray, flanks: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """Membership (K, N) of ``values`` (inputs, N); what is no number has none, NaN."""
    degrees, term = np.empty((flanks.shape[2], values.shape[1])), 0
    for name in range(len(values)):
        for _ in range(terms[name]):
            for sample in range(values.shape[1]):
                value = values[name, sample]
                value = np.minimum(np.maximum(value, low[name]), high[name])
                rising = (value - flanks[0, 0, term]) * flanks[0, 1, term] + flanks[0, 2, term]
                falling = (flanks[1, 0, term] - value) * flanks[1, 1, term] + flanks[1, 2, term]
                degrees[term, sample] = np.minimum(np.maximum(np.minimum(rising, falling), 0.0), 1.0)
            term += 1
    return degrees


def _tables_of(base: RuleBase) -> Tables:
    groups = [_term_places(base, rule) for rule in base.rules]
    lists = [places for group in groups for places in group]
    conditions = np.cumsum([0, *map(len, groups)], dtype=np.int32)
    choices = np.cumsum([0, *map(len, lists)], dtype=np.int32)
    places = np.array([place for listed in lists for place in listed], dtype=np.int32)
    weights = np.array([rule.weight for rule in base.rules])
    terms = base.output.term_names
    owner = np.array([[float(rule.consequent == term) for term in terms] for rule in base.rules])
    evidence = np.zeros((sum(len(variable.terms) for variable in base.inputs), len(terms)))
    single = len(places) == len(groups)
    if single:
        np.add.at(evidence, places, weights[:, None] * owner)
    return Tables(*_term_table(base), conditions, choices, places, single, weights, owner, evidence)


def _term_table(base: RuleBase) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """How many terms each input has, flanks, and ends of the inputs; upright flanks begin with full membership."""
    terms = np.array([len(v.terms) for v in base.inputs], dtype=np.int32)
    a, b, c, d = np.array([corners for v in base.inputs for _, corners in v.terms]).T
    widths = np.stack([b - a, d - c])
    upright = widths == 0.0
    slopes = np.where(upright, _UPRIGHT, 1.0 / np.where(upright, 1.0, widths))
    flanks = np.stack([np.stack([a, d]), slopes, upright.astype(np.float64)], axis=1)
    return terms, flanks, np.array([v.low for v in base.inputs]), np.array([v.high for v in base.inputs])


def _term_places(base: RuleBase, rule: Rule) -> list[list[int]]:
    """Places among all terms of those that each condition of a rule lists."""
    names = [(v.name, term) for v in base.inputs for term in v.term_names]
    return [[names.index((name, term)) for term in terms] for name, terms in rule.conditions]


def term_strengths(base: RuleBase, inputs: Mapping[str, FloatArray]) -> FloatArray:
    """Strongest rule, or sum of the rules, of each output term: (N, terms) in the order of the output's terms."""
    owner = base.tables.owner
    if base.aggregation == "sum" and base.tables.single:
        return np.asarray(_all_degrees(base, inputs) @ base.tables.evidence)
    strengths = rule_strengths(base, inputs)
    if base.aggregation == "sum":
        return np.asarray(strengths @ owner)
    return _strongest(strengths, owner)


@njit(cache=True)
def _strongest(strengths: FloatArray, owner: FloatArray) -> FloatArray:
    """Strongest of the rules (N, rules) of each output term, (N, terms)."""
    answer = np.zeros((len(strengths), owner.shape[1]))
    for sample in range(len(strengths)):
        for rule in range(len(owner)):
            for term in range(owner.shape[1]):
                if owner[rule, term] > 0.0:
                    answer[sample, term] = np.maximum(answer[sample, term], strengths[sample, rule])
    return answer


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
    _known(table, {"norm", "aggregation", "input", "output", "rule"}, source, "")
    norm = table.get("norm", "minimum")
    if norm not in {"minimum", "product"}:
        raise InputError(f"{source}: norm is {norm!r}; allowed are 'minimum' and 'product'")
    aggregation = table.get("aggregation", "maximum")
    if aggregation not in {"maximum", "sum"}:
        raise InputError(f"{source}: aggregation is {aggregation!r}; allowed are 'maximum' and 'sum'")
    inputs = tuple(_variable(name, part, f"{source}: input.{name}") for name, part in table.get("input", {}).items())
    outputs = [_variable(name, part, f"{source}: output.{name}") for name, part in table.get("output", {}).items()]
    if not inputs or len(outputs) != 1:
        raise InputError(f"{source}: has {len(inputs)} inputs and {len(outputs)} outputs; at least one and exactly one")
    heaviest = np.inf if aggregation == "sum" else 1.0
    rules = tuple(
        rule
        for index, part in enumerate(table.get("rule", []))
        for rule in _rules(part, inputs, outputs[0], heaviest, f"{source}: rule[{index}]")
    )
    if not rules:
        raise InputError(f"{source}: rule is empty; at least one rule is needed")
    return RuleBase(inputs, outputs[0], rules, norm, aggregation)


def rule_bases(path: Path, inputs: Mapping[str, set[str]]) -> dict[str, RuleBase]:
    """The rule bases of a TOML file, one a table; ``inputs``: the tables it must have, and the inputs of each.

    Raises InputError that names the file and what is wrong with it.
    """
    tables = read_table(path)
    if set(tables) != set(inputs):
        raise InputError(f"{path}: has the tables {', '.join(sorted(tables))}; exactly {', '.join(sorted(inputs))}")
    bases = {name: rule_base(tables[name], f"{path}: {name}") for name in inputs}
    for name, wanted in inputs.items():
        if set(bases[name].input_names) != wanted:
            raise InputError(f"{path}: {name}.input must be exactly {', '.join(sorted(wanted))}")
    return bases


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


def _rules(
    table: Mapping[str, Any], inputs: tuple[Variable, ...], output: Variable, heaviest: float, source: str
) -> list[Rule]:
    """One rule of a file, as one for each output term that it speaks for."""
    _known(table, {"if", "then", "weight"}, source, "")
    conditions = _conditions(table.get("if", {}), {variable.name: variable for variable in inputs}, source)
    then, weight = table.get("then"), table.get("weight", 1.0)
    spoken_for = then if isinstance(then, dict) else {then: weight}
    if isinstance(then, dict) and ("weight" in table or not then):
        raise InputError(f"{source}.then: its terms carry the weights; leave out weight and name one term or more")
    for term, share in spoken_for.items():
        if term not in output.term_names:
            raise InputError(f"{source}.then is {term!r}; allowed are {', '.join(output.term_names)}")
        if not isinstance(share, int | float) or not 0.0 < share <= heaviest or not np.isfinite(share):
            limit = " and at most 1" if heaviest == 1.0 else ""
            raise InputError(f"{source}.weight is {share!r}; above 0{limit}")
    return [Rule(conditions, str(term), float(share)) for term, share in spoken_for.items()]


def _conditions(
    table: Mapping[str, Any], by_name: Mapping[str, Variable], source: str
) -> tuple[tuple[str, tuple[str, ...]], ...]:
    conditions = []
    for name, wanted in table.items():
        terms = (wanted,) if isinstance(wanted, str) else tuple(wanted)
        if name not in by_name:
            raise InputError(f"{source}.if: unknown input {name!r}; allowed are {', '.join(by_name)}")
        if not terms or not set(terms) <= set(by_name[name].term_names):
            allowed = ", ".join(by_name[name].term_names)
            raise InputError(f"{source}.if.{name} is {wanted!r}; allowed are {allowed}")
        conditions.append((name, terms))
    if not conditions:
        raise InputError(f"{source}.if is empty; at least one condition is needed")
    return tuple(conditions)
