"""Rules of the six terrain classes, learned from labelled windows: two forms, both readable tables.

`learn_additive`: each feature gets triangular terms at quantiles of its values, and every rule is one term with the
evidence that it brings to each class; the evidence is the penalised maximum of the multinomial likelihood (Hastie and
Tibshirani, Generalized Additive Models, Statistical Science 1(3), 1986). Windows count by their class's TTAM weight.

`learn_paper_rules`: three terms a feature and rules over all features together, in the form of the 2004 paper's
classifier; which rules there are follows Wang and Mendel, IEEE Trans. SMC 22(6), 1992: a window supports the rule of
its strongest terms, and the class with most support among the windows of a rule is its consequent.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import minimize

from perception.additive_fit import hat_weights, quantile_knots
from perception.class_definition import STAGES
from perception.knowledge_base import CLAST_INPUTS
from perception.ttam import WEIGHTS
from worlds.fuzzy import RuleBase, membership, rule_base
from worlds.types import FloatArray, IntArray, TerrainClass

LETTERS = tuple(member.value for member in TerrainClass)
TERMS = {
    2: ("low", "high"),
    3: ("low", "middle", "high"),
    4: ("lowest", "low", "high", "highest"),
    5: ("lowest", "low", "middle", "high", "highest"),
}
STAGE_KNOTS = np.arange(len(STAGES), dtype=np.float64)
STONE_TERMS = ("sand", "very_small_rocks", "rough", "very_rough", "big_rock")  # of inputs that hold a stage
QUANTILES = (0.03, 0.25, 0.5, 0.75, 0.97)
STIFFNESS, SIZE_PENALTY = 3e-3, 3e-3  # of bends of the evidence, and of its size; a window's share
COMMENTS = {
    "sum": "# What one term of one input brings to each terrain class, in log odds; learned from labelled windows.",
    "maximum": "# Terrain classes by the 2004 paper's own features, the strongest rule decides; learned as well.",
}
LEAST_EVIDENCE = 0.05  # in a rule; less is left out
PAPER_QUANTILES = (0.1, 0.5, 0.9)
_U_WEIGHT = 1.0  # the paper prints none

Features = Mapping[str, FloatArray]


def learn_additive(
    features: Features, letters: Sequence[str], emphasis: Mapping[str, float] | None = None, penalty: float = 1.0
) -> dict[str, Any]:
    """Table of additive rules for windows with ``features`` (each (N,)) and class ``letters`` (N,).

    ``emphasis`` multiplies the weight of a class, ``penalty`` both penalties. The table is what `rule_base` decodes.
    """
    names, truth = list(features), np.array([LETTERS.index(letter) for letter in letters])
    knots = [STAGE_KNOTS if name in CLAST_INPUTS else _knots(features[name]) for name in names]
    design = np.concatenate([hat_weights(features[n], k).toarray() for n, k in zip(names, knots, strict=True)], axis=1)
    weight = np.array([{**WEIGHTS, "U": _U_WEIGHT}[x] * (emphasis or {}).get(x, 1.0) for x in letters])
    evidence = _fit(design, truth, weight / weight.sum(), penalty * _penalty([len(k) for k in knots]))
    parts = np.split(evidence, np.cumsum([len(k) for k in knots])[:-1])
    # What a term gives to all classes alike decides nothing: the least is taken off, and no evidence is negative.
    rules = [
        {"if": {name: term}, "then": _spoken(row - row.min())}
        for name, places, part in zip(names, knots, parts, strict=True)
        for term, row in zip(_terms(name, places), part, strict=True)
        if _spoken(row - row.min())
    ]
    return {"norm": "minimum", "aggregation": "sum", **_variables(names, knots), "rule": rules}


def _knots(values: FloatArray) -> FloatArray:
    """Rising places of the terms; a feature that is mostly zero has its quantiles taken where it is not."""
    knots = quantile_knots(values, QUANTILES)
    if len(knots) < 4 and (values > values.min()).any():
        knots = np.unique([knots[0], *quantile_knots(values[values > values.min()], (0.1, 0.4, 0.7, 0.95))])
    return knots[:5]


def _terms(name: str, knots: FloatArray) -> tuple[str, ...]:
    return STONE_TERMS if name in CLAST_INPUTS else TERMS[len(knots)]


def _spoken(row: FloatArray) -> dict[str, float]:
    return {x: round(float(v), 2) for x, v in zip(LETTERS, row, strict=True) if v >= LEAST_EVIDENCE}


def _variables(names: Sequence[str], knots: Sequence[FloatArray]) -> dict[str, Any]:
    """Inputs with triangular terms at their knots that sum to one, and the output: an axis of class names."""
    inputs = {}
    for name, places in zip(names, knots, strict=True):
        k = [float(f"{place:.4g}") for place in places]
        ends = [k[0], *k, k[-1]]
        terms = {term: [ends[i], ends[i + 1], ends[i + 2]] for i, term in enumerate(_terms(name, places))}
        inputs[name] = {"range": [k[0], k[-1]], **terms}
    classes = {letter: [float(i), i + 0.5, i + 1.0] for i, letter in enumerate(LETTERS)}
    return {"input": inputs, "output": {"class": {"range": [0.0, float(len(LETTERS))], **classes}}}


def _penalty(sizes: Sequence[int]) -> FloatArray:
    penalty = np.zeros((sum(sizes), sum(sizes)))
    start = 0
    for size in sizes:
        bends = np.diff(np.eye(size), 2, axis=0) if size > 2 else np.zeros((0, size))
        block = slice(start, start + size)
        penalty[block, block] = STIFFNESS * bends.T @ bends + SIZE_PENALTY * np.eye(size)
        start += size
    return penalty


def _fit(design: FloatArray, truth: IntArray, weight: FloatArray, penalty: FloatArray) -> FloatArray:
    """Evidence (columns of ``design``, classes) of the penalised multinomial likelihood, by L-BFGS."""
    classes = len(LETTERS)
    wanted = np.eye(classes)[truth]

    def loss(flat: FloatArray) -> tuple[float, FloatArray]:
        evidence = flat.reshape(-1, classes)
        total = design @ evidence
        total -= total.max(axis=1, keepdims=True)
        chance = np.exp(total)
        chance /= chance.sum(axis=1, keepdims=True)
        pull = penalty @ evidence
        missed = -float(weight @ np.log(chance[np.arange(len(truth)), truth] + 1e-12))
        slope = design.T @ ((chance - wanted) * weight[:, None]) + pull
        return missed + 0.5 * float((evidence * pull).sum()), slope.ravel()

    start = np.zeros(design.shape[1] * classes)
    found = minimize(loss, start, jac=True, method="L-BFGS-B", options={"maxiter": 120})
    return np.asarray(found.x).reshape(-1, classes)


def learn_paper_rules(features: Features, letters: Sequence[str]) -> dict[str, Any]:
    """Table of rules over all ``features`` (each (N,)) together; the weight is the class's share of the support."""
    names = list(features)
    knots = [quantile_knots(features[name], PAPER_QUANTILES) for name in names]
    table = {"norm": "minimum", "aggregation": "maximum", **_variables(names, knots)}
    support: dict[tuple[str, ...], dict[str, float]] = defaultdict(lambda: defaultdict(float))
    degrees = [_term_degrees(table["input"][name], features[name]) for name in names]
    for index, letter in enumerate(letters):
        best = [max(terms.items(), key=lambda item: item[1][index]) for terms in degrees]
        weight = {**WEIGHTS, "U": _U_WEIGHT}[letter]
        support[tuple(term for term, _ in best)][letter] += weight * float(np.prod([d[index] for _, d in best]))
    rules = []
    for terms, classes in sorted(support.items()):
        letter, most = max(classes.items(), key=lambda item: item[1])
        share = round(most / sum(classes.values()), 2)
        rules.append({"if": dict(zip(names, terms, strict=True)), "then": {letter: max(share, 0.01)}})
    return {**table, "rule": rules}


def _term_degrees(variable: Mapping[str, Any], values: FloatArray) -> dict[str, FloatArray]:
    low, high = variable["range"]
    corners = {term: (c[0], c[1], c[1], c[2]) for term, c in variable.items() if term != "range"}
    return {term: membership(c, np.clip(values, low, high)) for term, c in corners.items()}


def learned_base(table: Mapping[str, Any]) -> RuleBase:
    """The rule base of a learned table."""
    return rule_base(table, "learned rules")


def rules_toml(name: str, table: Mapping[str, Any]) -> str:
    """A learned table as the table ``[name]`` of a knowledge file."""
    lines = [
        COMMENTS[table["aggregation"]],
        f"[{name}]",
        f'norm = "{table["norm"]}"',
        f'aggregation = "{table["aggregation"]}"',
    ]
    for kind in ("input", "output"):
        for variable, terms in table[kind].items():
            lines += [f"[{name}.{kind}.{variable}]", *(f"{key} = {value}" for key, value in terms.items())]
    for rule in table["rule"]:
        asked = ", ".join(f'{key} = "{term}"' for key, term in rule["if"].items())
        spoken = ", ".join(f"{letter} = {weight}" for letter, weight in rule["then"].items())
        lines += [f"[[{name}.rule]]", f"if = {{ {asked} }}", f"then = {{ {spoken} }}"]
    return "\n".join(lines) + "\n"
