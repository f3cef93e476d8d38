from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from perception.fuzzy import activations, compute, to_skfuzzy
from perception.knowledge_base import Knowledge, load_knowledge
from worlds.errors import InputError
from worlds.fuzzy import evaluate, rule_base, term_strengths


@pytest.mark.parametrize("name", ["mars", "rendered"])
def test_vectorised_certainty_agrees_with_scikit_fuzzy(name: str) -> None:
    base = load_knowledge(name).rock_rules
    rng = np.random.default_rng(7)
    samples = {v.name: rng.uniform(v.low, v.high, 12) for v in base.inputs}
    ours = evaluate(base, samples)
    simulation = to_skfuzzy(base)
    for i in range(12):
        if np.isnan(ours[i]):
            continue
        theirs = compute(simulation, base, {key: values[i] for key, values in samples.items()})
        span = base.output.high - base.output.low
        assert ours[i] == pytest.approx(theirs, abs=0.005 * span)


@pytest.mark.parametrize("name", ["mars", "rendered"])
def test_evidence_of_classes_agrees_with_scikit_fuzzy(name: str) -> None:
    base = load_knowledge(name).terrain_rules
    assert base.aggregation == "sum"
    rng = np.random.default_rng(8)
    samples = {v.name: rng.uniform(v.low, v.high, 4) for v in base.inputs}
    ours = term_strengths(base, samples)
    simulation = to_skfuzzy(base)
    for i in range(4):
        theirs = activations(simulation, base, {key: values[i] for key, values in samples.items()})
        np.testing.assert_allclose(ours[i], theirs, atol=1e-9)


def test_paper_rules_agree_with_scikit_fuzzy() -> None:
    # scikit-fuzzy multiplies a rule by its weight where ours, as a minimum, caps it: compared with equal weights.
    shipped = load_knowledge("mars").paper_rules
    base = replace(shipped, rules=tuple(replace(rule, weight=1.0) for rule in shipped.rules))
    rng = np.random.default_rng(9)
    samples = {v.name: rng.uniform(v.low, v.high, 4) for v in base.inputs}
    ours = term_strengths(base, samples)
    simulation = to_skfuzzy(base)
    for i in range(4):
        if not ours[i].any():
            continue  # scikit-fuzzy raises where no rule fires
        theirs = activations(simulation, base, {key: values[i] for key, values in samples.items()})
        np.testing.assert_allclose(ours[i], theirs, atol=1e-9)


def test_a_product_norm_cannot_be_checked() -> None:
    table = {
        "norm": "product",
        "input": {"x": {"range": [0, 1], "all": [0, 0, 1, 1]}},
        "output": {"y": {"range": [0, 1], "one": [0, 1, 1]}},
        "rule": [{"if": {"x": "all"}, "then": "one"}],
    }
    with pytest.raises(ValueError, match="product"):
        to_skfuzzy(rule_base(table, "here"))


@pytest.mark.parametrize("name", ["mars", "rendered"])
def test_every_sample_of_features_gets_a_class_and_a_certainty(name: str) -> None:
    rng = np.random.default_rng(3)
    know = load_knowledge(name)
    certain = evaluate(know.rock_rules, {v.name: rng.uniform(v.low, v.high, 3000) for v in know.rock_rules.inputs})
    assert np.isfinite(certain).all()
    rules = know.terrain_rules
    assert (
        (term_strengths(rules, {v.name: rng.uniform(v.low, v.high, 3000) for v in rules.inputs}) > 0).any(axis=1).all()
    )


@pytest.mark.parametrize("name", ["mars", "rendered"])
def test_stronger_blobs_are_no_less_certain(name: str) -> None:
    base = load_knowledge(name).rock_rules
    strength = np.linspace(0.0, 1.0, 41)
    for contrast, variance in ((0.5, 2.5), (-1.0, 1.0)):
        fixed = {"contrast": contrast, "variance": variance, "energy": 0.1, "area": 2.5}
        certainty = evaluate(base, {"strength": strength, **{k: np.full(41, v) for k, v in fixed.items()}})
        # A few thousandths are the wobble of minimum inference where terms cross.
        assert certainty[-1] > certainty[0] or np.ptp(certainty) < 0.2
        assert np.all(np.diff(certainty[strength > 0.45]) > -0.02)


def edited(tmp_path: Path, old: str, new: str) -> Path:
    shipped = Path(__file__).parents[1] / "perception" / "knowledge" / "mars.toml"
    text = shipped.read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path


def test_own_files_load(tmp_path: Path) -> None:
    mine: Knowledge = load_knowledge(edited(tmp_path, "min_area_px = 80", "min_area_px = 90"))
    assert mine.binarization.min_area_px == 90


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("min_area_px = 80", "min_aera_px = 80", "min_aera_px"),
        ("min_area_px = 80", "min_area_px = 0", "binarization.min_area_px = 0"),
        ("lightness = { value = [", "lightness = { value = [99.0, ", "cues.lightness: value must rise"),
        ('strength = "strong"', 'strength = "mighty"', "mighty"),
        ("[rock_rules.input.energy]", "[rock_rules.input.enery]", "enery"),
        ('name = "mars"', "name = ", "not valid TOML"),
    ],
)
def test_a_wrong_file_is_told_in_one_line(tmp_path: Path, old: str, new: str, told: str) -> None:
    with pytest.raises(InputError, match=r"mine\.toml") as caught:
        load_knowledge(edited(tmp_path, old, new))
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["venus", "nowhere/file.toml"])
def test_a_missing_knowledge_is_told(name: str) -> None:
    with pytest.raises(InputError, match=name):
        load_knowledge(name)
