from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from perception.knowledge_base import load_knowledge
from perception.learn_terrain import LETTERS, learn_additive, learn_paper_rules, learned_base, rules_toml
from perception.terrain_class import certainty, classify
from perception.ttam import confusion, ttam
from worlds.fuzzy import RuleBase, rule_base, term_strengths
from worlds.types import FloatArray


def two_classes(aggregation: str = "sum") -> RuleBase:
    """Rough speaks for M, smooth for S."""
    table: dict[str, Any] = {
        "aggregation": aggregation,
        "input": {"rough": {"range": [0, 1], "no": [0, 0, 1], "yes": [0, 1, 1]}},
        "output": {"class": {"range": [0, 2], "S": [0, 0.5, 1], "M": [1, 1.5, 2]}},
        "rule": [
            {"if": {"rough": "no"}, "then": {"S": 1.0, "M": 0.25}},
            {"if": {"rough": "yes"}, "then": {"M": 1.0}},
        ],
    }
    return rule_base(table, "here")


def windows(*values: float) -> dict[str, FloatArray]:
    """A row of windows with that roughness, none blank."""
    return {"rough": np.array([values]), "blank": np.zeros((1, len(values)))}


def test_evidence_adds_up_and_its_logistic_is_the_certainty() -> None:
    base = two_classes()
    strengths = term_strengths(base, {"rough": np.array([0.25])})
    assert strengths.tolist() == [pytest.approx([0.75, 0.25 * 0.75 + 0.25])]
    # exp(0.75) over exp(0.75) + exp(0.4375)
    assert certainty(strengths, base)[0] == pytest.approx(1 / (1 + np.exp(0.4375 - 0.75)))
    assert "".join(classify(windows(0.0, 0.45, 1.0), base, 0.0)[0]) == "SMM"


def test_what_the_rules_do_not_know_and_blank_windows_are_uncertain() -> None:
    base = two_classes()
    assert "".join(classify(windows(0.0, 0.3, 1.0), base, 0.6)[0]) == "SUM"
    blank = {**windows(0.0, 0.0), "blank": np.array([[0.0, 1.0]])}
    assert "".join(classify(blank, base, 0.0)[0]) == "SU"


def test_of_other_rules_the_strongest_speaks() -> None:
    base = two_classes("maximum")
    strengths = term_strengths(base, {"rough": np.array([0.4])})
    assert strengths.tolist() == [pytest.approx([0.6, 0.4])]
    assert certainty(strengths, base)[0] == pytest.approx(0.6)


def labelled(count: int, seed: int) -> tuple[dict[str, FloatArray], list[str]]:
    """Windows whose class is what their coarseness says, B where the middle of an unordered feature says so."""
    rng = np.random.default_rng(seed)
    coarse, hump, idle = rng.uniform(0, 4, count), rng.uniform(-1, 1, count), rng.uniform(0, 1, count)
    letters = ["B" if abs(h) < 0.3 else "SVmM"[int(c)] for c, h in zip(coarse, hump, strict=True)]
    return {"coarse": coarse, "hump": hump, "idle": idle}, letters


def test_additive_rules_learn_order_and_hump_and_repeat() -> None:
    features, letters = labelled(1500, 1)
    table = learn_additive(features, letters)
    assert table == learn_additive(features, letters)
    unseen, truth = labelled(800, 2)
    strengths = term_strengths(learned_base(table), unseen)
    found = np.array(LETTERS)[np.argmax(strengths, axis=1)]
    assert (found == np.array(truth)).mean() > 0.85
    assert all(value > 0 for rule in table["rule"] for value in rule["then"].values())
    # An idle feature brings little evidence beside the one that decides.
    most = {name: max(max(r["then"].values()) for r in table["rule"] if name in r["if"]) for name in features}
    assert most["idle"] < 0.5 * most["coarse"]


def test_emphasis_finds_more_of_a_class() -> None:
    rng = np.random.default_rng(3)
    values = np.concatenate([rng.normal(0, 1, 900), rng.normal(1.5, 1, 100)])
    letters = ["m"] * 900 + ["M"] * 100
    found = []
    for emphasis in ({}, {"M": 4.0}):
        strengths = term_strengths(learned_base(learn_additive({"x": values}, letters, emphasis)), {"x": values})
        found.append(int((np.argmax(strengths, axis=1)[900:] == LETTERS.index("M")).sum()))
    assert found[1] > found[0] + 20


def test_paper_rules_ask_for_all_features_and_know_only_what_they_saw() -> None:
    features = {"a": np.array([0.0, 0.0, 1.0, 1.0, 0.5]), "b": np.array([0.0, 0.0, 1.0, 1.0, 0.5])}
    table = learn_paper_rules(features, ["S", "S", "B", "M", "V"])
    assert all(set(rule["if"]) == {"a", "b"} for rule in table["rule"])
    assert len(table["rule"]) == 3
    both = next(rule for rule in table["rule"] if rule["if"] == {"a": "high", "b": "high"})
    assert both["then"] == {"B": pytest.approx(1.5 / 2.8, abs=0.01)}
    corner = {"a": np.array([[0.0]]), "b": np.array([[1.0]]), "blank": np.zeros((1, 1))}
    assert classify(corner, learned_base(table), 0.0).tolist() == [["U"]]


def test_learned_tables_survive_their_text() -> None:
    import tomllib

    features, letters = labelled(300, 4)
    for table in (learn_additive(features, letters), learn_paper_rules(features, letters)):
        read = tomllib.loads(rules_toml("terrain_rules", table))["terrain_rules"]
        assert rule_base(read, "text") == learned_base(table)


@pytest.mark.parametrize("name", ["mars", "rendered"])
def test_shipped_rules_are_as_readable_as_promised(name: str) -> None:
    know = load_knowledge(name)
    assert know.terrain_rules.aggregation == "sum"
    assert all(len(rule.conditions) == 1 and len(rule.conditions[0][1]) == 1 for rule in know.terrain_rules.rules)
    # Terms sum to one everywhere: evidence is a broken line, not a sum of bumps.
    for variable in know.terrain_rules.inputs:
        tops = [corners[1] for _, corners in variable.terms]
        assert [c[2] for _, c in variable.terms] == tops
        assert [c[3] for _, c in variable.terms[:-1]] == tops[1:]
    assert know.paper_rules.input_names == ("contrast", "energy", "variance", "area")


def test_confusion_counts_true_by_row() -> None:
    counts = confusion(np.array([["S", "S"], ["U", "B"]]), np.array([["S", "V"], ["U", "M"]]))
    assert counts[0].tolist() == [1, 1, 0, 0, 0, 0]
    assert (counts[5, 5], counts[4, 3], counts.sum()) == (1, 1, 4)


def test_ttam_worked_by_hand() -> None:
    true = np.array([["S", "V", "m"], ["M", "B", "U"]])
    found = np.array([["S", "S", "m"], ["M", "m", "U"]])
    # Right: S 1.0, m 1.2, M 1.3 of 1 + 1 + 1.2 + 1.3 + 1.5 = 6.0; with U at weight 1, 4.5 of 7.
    assert ttam(true, found, None) == pytest.approx(100 * 3.5 / 6.0)
    assert ttam(true, found) == pytest.approx(100 * 4.5 / 7.0)
    assert ttam(true, true) == 100.0
    assert np.isnan(ttam(np.array([["U"]]), np.array([["S"]]), None))


def test_ttam_refuses_what_it_cannot_weigh() -> None:
    with pytest.raises(ValueError, match="differ"):
        ttam(np.array([["S"]]), np.array([["S", "S"]]))
    with pytest.raises(ValueError, match="'Q'"):
        ttam(np.array([["Q"]]), np.array([["S"]]))
