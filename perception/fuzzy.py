"""The rule bases as scikit-fuzzy objects: the definition to check against, not what runs on pictures.

A scikit-fuzzy simulation takes milliseconds an evaluation; `worlds.fuzzy` evaluates the same rules for all blobs or
windows at once. Tests hold the two equal.
"""

from __future__ import annotations

import warnings
from functools import reduce
from operator import and_, or_
from typing import Any

import numpy as np

from worlds.fuzzy import RuleBase, Variable
from worlds.types import FloatArray

_POINTS = 1001  # of each universe, beside the corners of its terms


def to_skfuzzy(base: RuleBase) -> Any:
    """A ``skfuzzy.control.ControlSystemSimulation`` with the variables, terms and rules of ``base``.

    Raises ValueError for the product norm, which scikit-fuzzy's control systems do not shape their outputs by.
    """
    from skfuzzy import control

    if base.norm != "minimum":
        raise ValueError(f"norm is {base.norm!r}; scikit-fuzzy can check 'minimum' only")
    inputs = {variable.name: _filled(control.Antecedent, variable) for variable in base.inputs}
    output = _filled(control.Consequent, base.output)
    if base.aggregation == "sum":
        output.accumulation_method = np.add
    # Rules of the same conditions are one to scikit-fuzzy: its network of rules grows slow with their number.
    spoken: dict[Any, list[Any]] = {}
    for rule in base.rules:
        spoken.setdefault(rule.conditions, []).append(output[rule.consequent] % rule.weight)
    rules = [
        control.Rule(
            reduce(and_, (reduce(or_, (inputs[name][term] for term in terms)) for name, terms in conditions)), said
        )
        for conditions, said in spoken.items()
    ]
    return control.ControlSystemSimulation(control.ControlSystem(rules))


def compute(simulation: Any, base: RuleBase, sample: dict[str, float]) -> float:
    """The output that scikit-fuzzy computes for one sample; inputs outside their range count as its ends."""
    used = {name for rule in base.rules for name, _ in rule.conditions}
    for variable in base.inputs:
        if variable.name in used:
            simulation.input[variable.name] = float(np.clip(sample[variable.name], variable.low, variable.high))
    with warnings.catch_warnings():
        # scikit-fuzzy 0.5.0 calls np.maximum with three positional arguments, which numpy 2.4 deprecates.
        warnings.simplefilter("ignore", DeprecationWarning)
        simulation.compute()
    return float(simulation.output[base.output.name])


def activations(simulation: Any, base: RuleBase, sample: dict[str, float]) -> FloatArray:
    """How strongly scikit-fuzzy activates each output term (T,) for one sample: `term_strengths` must agree."""
    compute(simulation, base, sample)
    output = next(simulation.ctrl.consequents)
    found = [output[term].membership_value[simulation] for term in base.output.term_names]
    return np.array([0.0 if value is None else float(value) for value in found])


def _filled(kind: Any, variable: Variable) -> Any:
    from skfuzzy import trapmf

    filled = kind(_universe(variable), variable.name)
    for name, corners in variable.terms:
        filled[name] = trapmf(filled.universe, list(corners))
    return filled


def _universe(variable: Variable) -> FloatArray:
    corners = [corner for _, term in variable.terms for corner in term if variable.low <= corner <= variable.high]
    return np.unique(np.concatenate([np.linspace(variable.low, variable.high, _POINTS), corners]))
