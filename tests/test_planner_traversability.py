from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.traversability import KNOWLEDGE, PathFeatures, load_rules, shipped_rules, traversability
from worlds.errors import InputError
from worlds.fuzzy import RuleBase, evaluate
from worlds.types import FloatArray

RANGES = {
    "spare_m": (0.0, 0.7),
    "risk": (0.0, 1.1),
    "roughness": (0.0, 1.0),
    "slope_deg": (0.0, 45.0),
    "length_ratio": (1.0, 3.5),
}


def features(**values: float) -> PathFeatures:
    return PathFeatures(**{name: np.atleast_1d(value) for name, value in values.items()})


BEST = {"spare_m": 0.6, "risk": 0.0, "roughness": 0.0, "slope_deg": 0.0, "length_ratio": 1.0}
WORST = {"spare_m": 0.0, "risk": 1.0, "roughness": 1.0, "slope_deg": 40.0, "length_ratio": 3.0}


def test_the_ends_of_the_scale() -> None:
    # Pure "high" and pure "poor": centroids of right triangles of base 1/3.
    assert traversability(features(**BEST))[0] == pytest.approx(8 / 9, abs=5e-3)
    assert traversability(features(**WORST))[0] == pytest.approx(1 / 9, abs=5e-3)


@settings(deadline=None, max_examples=60)
@given(st.fixed_dictionaries({name: st.floats(*limits) for name, limits in RANGES.items()}), st.sampled_from([*RANGES]))
def test_monotone_in_each_input(place: dict[str, float], moved: str) -> None:
    line = np.linspace(*RANGES[moved], 80)
    values = PathFeatures(**{name: line if name == moved else np.full(80, value) for name, value in place.items()})
    change = np.diff(traversability(values))
    assert (change >= -1e-9).all() if moved == "spare_m" else (change <= 1e-9).all()


def test_monotone_where_rules_that_join_by_the_maximum_are_not() -> None:
    line = np.linspace(*RANGES["length_ratio"], 80)
    place = {"spare_m": 0.1875, "risk": 0.0, "roughness": 0.5, "slope_deg": 0.0}
    values = PathFeatures(length_ratio=line, **{name: np.full(80, value) for name, value in place.items()})
    assert (np.diff(traversability(values)) <= 1e-9).all()


@pytest.mark.parametrize("stage", [field.name for field in fields(shipped_rules())])
def test_every_input_meets_a_rule_and_terms_sum_to_one(stage: str) -> None:
    base: RuleBase = getattr(shipped_rules(), stage)
    axes = [np.linspace(v.low, v.high, 25) for v in base.inputs]
    grid = [axis.ravel() for axis in np.meshgrid(*axes)]
    assert np.isfinite(evaluate(base, dict(zip(base.input_names, grid, strict=True)))).all()


def by_skfuzzy(base: RuleBase, inputs: dict[str, float]) -> float:
    """The same rules through scikit-fuzzy's own membership and centroid functions."""
    import skfuzzy as sk

    degrees = {
        v.name: {
            term: float(sk.trapmf(np.array([np.clip(inputs[v.name], v.low, v.high)]), list(corners))[0])
            for term, corners in v.terms
        }
        for v in base.inputs
    }
    axis = np.linspace(base.output.low, base.output.high, 4001)
    total: FloatArray = np.zeros_like(axis)
    strengths = dict.fromkeys(base.output.term_names, 0.0)
    for rule in base.rules:
        degree = np.prod([max(degrees[n][t] for t in terms) for n, terms in rule.conditions])
        strengths[rule.consequent] += float(rule.weight * degree)
    for term, corners in base.output.terms:
        total = np.fmax(total, strengths[term] * sk.trapmf(axis, list(corners)))
    return float(sk.defuzz(axis, total, "centroid"))


@settings(deadline=None, max_examples=25)
@given(st.fixed_dictionaries({name: st.floats(*limits) for name, limits in RANGES.items()}))
def test_agrees_with_scikit_fuzzy(place: dict[str, float]) -> None:
    rules = shipped_rules()
    openness = by_skfuzzy(rules.obstacles, place)
    ease = by_skfuzzy(rules.ground, place)
    expected = by_skfuzzy(rules.path, {"openness": openness, "ease": ease, "length_ratio": place["length_ratio"]})
    assert traversability(features(**place))[0] == pytest.approx(expected, abs=0.01)


def test_a_free_path_beats_a_tight_one_and_a_detour_on_sand_beats_rocky_ground() -> None:
    base = {**BEST, "risk": 0.1}
    assert traversability(features(**base)) > traversability(features(**{**base, "spare_m": 0.02}))
    detour, rocky = {**BEST, "length_ratio": 1.3}, {**BEST, "roughness": 0.8}
    assert traversability(features(**detour)) > traversability(features(**rocky))


def test_a_wrong_rule_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.toml: cannot be read"):
        load_rules(tmp_path / "none.toml")
    text = KNOWLEDGE.read_text(encoding="utf-8")
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(text.replace('then = "high"', 'then = "hihg"', 1), encoding="utf-8")
    with pytest.raises(InputError, match=r"obstacles: rule\[0\].then is 'hihg'"):
        load_rules(wrong)
    wrong.write_text(text.replace("slope_deg", "tilt_deg"), encoding="utf-8")
    with pytest.raises(InputError, match=r"ground\.input must be exactly"):
        load_rules(wrong)
    assert replace(shipped_rules()) == load_rules(KNOWLEDGE)
