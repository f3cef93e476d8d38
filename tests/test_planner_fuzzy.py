from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from worlds import fuzzy
from worlds.errors import InputError


def table() -> dict[str, Any]:
    return {
        "norm": "minimum",
        "input": {
            "slope": {"range": [0.0, 40.0], "flat": [0, 0, 10, 20], "steep": [10, 20, 40, 40]},
            "rough": {"range": [0.0, 1.0], "low": [0, 0, 1], "high": [0, 1, 1]},
        },
        "output": {"ease": {"range": [0.0, 1.0], "poor": [0, 0, 0.5], "fair": [0, 0.5, 1], "good": [0.5, 1, 1]}},
        "rule": [
            {"if": {"slope": "flat", "rough": "low"}, "then": "good"},
            {"if": {"slope": "flat", "rough": "high"}, "then": "fair"},
            {"if": {"slope": "steep", "rough": ["low", "high"]}, "then": "poor", "weight": 0.8},
        ],
    }


def test_a_trapezoid_has_its_corners() -> None:
    values = np.array([-1.0, 0.0, 0.5, 1.0, 2.0, 2.5, 3.0, 4.0])
    np.testing.assert_allclose(fuzzy.membership((0.0, 1.0, 2.0, 3.0), values), [0, 0, 0.5, 1, 1, 0.5, 0, 0])
    np.testing.assert_allclose(fuzzy.membership((0.0, 0.0, 1.0, 1.0), values), [0, 1, 1, 1, 0, 0, 0, 0])


def test_one_sure_rule_gives_the_centroid_of_its_term() -> None:
    base = fuzzy.rule_base(table(), "here")
    sure = fuzzy.evaluate(base, {"slope": np.array([0.0]), "rough": np.array([0.0])})
    # Right triangle from 0.5 up to 1: centroid at two thirds of its base.
    np.testing.assert_allclose(sure, [5 / 6], atol=2e-3)


def test_strengths_worked_by_hand() -> None:
    base = fuzzy.rule_base(table(), "here")
    inputs = {"slope": np.array([13.0]), "rough": np.array([0.4])}  # flat 0.7, steep 0.3; low 0.6, high 0.4
    np.testing.assert_allclose(fuzzy.rule_strengths(base, inputs), [[0.6, 0.4, 0.3]])
    product = fuzzy.rule_base({**table(), "norm": "product"}, "here")
    np.testing.assert_allclose(fuzzy.rule_strengths(product, inputs), [[0.42, 0.28, 0.8 * 0.3 * 0.6]])


def test_values_beyond_the_range_count_as_its_ends() -> None:
    base = fuzzy.rule_base(table(), "here")
    far, end = ({"slope": np.array([slope]), "rough": np.array([0.2])} for slope in (90.0, 40.0))
    np.testing.assert_array_equal(fuzzy.evaluate(base, far), fuzzy.evaluate(base, end))


def test_no_rule_no_answer() -> None:
    silent = {**table(), "rule": [{"if": {"slope": "steep"}, "then": "poor"}]}
    answer = fuzzy.evaluate(fuzzy.rule_base(silent, "here"), {"slope": np.zeros(1), "rough": np.zeros(1)})
    assert np.isnan(answer).all()


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(0.1, 39.9), st.floats(0.01, 0.99)), min_size=1, max_size=5))
def test_agrees_with_scikit_fuzzy(samples: list[tuple[float, float]]) -> None:
    import skfuzzy as sk

    base = fuzzy.rule_base(table(), "here")
    slope, rough = np.array(samples).T
    ours = fuzzy.evaluate(base, {"slope": slope, "rough": rough})
    grid = np.linspace(0.0, 1.0, 2001)
    low, high = 1 - rough, rough
    flat = sk.trapmf(slope, [0, 0, 10, 20])
    steep = sk.trapmf(slope, [10, 20, 40, 40])
    poor, fair, good = (sk.trimf(grid, corners) for corners in ([0, 0, 0.5], [0, 0.5, 1], [0.5, 1, 1]))
    for index in range(len(samples)):
        combined = np.maximum.reduce(
            [
                np.fmin(min(0.8, steep[index], max(low[index], high[index])), poor),
                np.fmin(min(flat[index], high[index]), fair),
                np.fmin(min(flat[index], low[index]), good),
            ]
        )
        assert ours[index] == pytest.approx(sk.defuzz(grid, combined, "centroid"), abs=3e-3)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"norm": "mean"}, "norm is 'mean'"),
        ({"rules": []}, "unknown key 'rules'"),
        ({"rule": []}, "rule is empty"),
        ({"rule": [{"if": {"slop": "flat"}, "then": "good"}]}, "unknown input 'slop'"),
        ({"rule": [{"if": {"slope": "level"}, "then": "good"}]}, "if.slope is 'level'; allowed are flat, steep"),
        ({"rule": [{"if": {"slope": "flat"}, "then": "great"}]}, "then is 'great'"),
        ({"rule": [{"if": {"slope": "flat"}, "then": "good", "weight": 2}]}, "weight is 2;"),
        ({"input": {"slope": {"range": [1, 0], "flat": [0, 1, 2]}}}, "input.slope.range is"),
        ({"input": {"slope": {"range": [0, 1], "flat": [0, 2, 1]}}}, "input.slope.flat is"),
        ({"output": {}}, "2 inputs and 0 outputs"),
    ],
)
def test_a_wrong_table_is_told_in_one_line(change: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match="here") as caught:
        fuzzy.rule_base({**table(), **change}, "here")
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)
