from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.additive_fit import fit_additive, fit_choice, hat_weights, quantile_knots
from perception.rock_score import RockCounts, count_rocks, match_objects
from perception.scenes import scene_groups, sol_of
from worlds.errors import InputError


def test_scenes_chain_neighbouring_sols() -> None:
    names = ["md_cr_2052_2052MR0108", "md_363_0363ML", "md_365_0365MR", "md_368_x", "md_372_x", "md_363_again"]
    assert sol_of(names[0]) == 2052
    assert scene_groups(names).tolist() == [2, 0, 0, 0, 1, 0]
    with pytest.raises(InputError, match="no number"):
        sol_of("rocks")


def test_counts_worked_by_hand() -> None:
    truth = np.zeros((60, 60), dtype=bool)
    truth[5:20, 5:20] = True  # 225 px
    truth[30:50, 30:50] = True  # 400 px
    truth[55, 55] = True  # too small for an object
    found = np.zeros((60, 60), dtype=np.int32)
    found[5:20, 5:18] = 1  # 195 of 225
    found[30:38, 30:50] = 2  # 160 of 400: covers too little
    found[40:50, 0:20] = 3  # 200 px of nothing
    counts = count_rocks(found, truth)
    assert counts == RockCounts(355, 200, 30 + 240 + 1, 1, 2, 1)
    assert counts.iou == pytest.approx(355 / (355 + 200 + 271))
    assert counts.object_f1 == pytest.approx(2 / 5)
    assert (counts + counts).both_px == 710


def test_touching_rocks_merged_match_none() -> None:
    true = np.zeros((40, 80), dtype=np.int32)
    true[10:30, 10:30], true[10:30, 30:50] = 1, 2
    assert match_objects((true > 0).astype(np.int32), true) == (0, 1, 2)
    assert match_objects(true, true) == (2, 0, 0)


def test_nothing_found_where_nothing_is_counts_as_right() -> None:
    empty = count_rocks(np.zeros((4, 4), dtype=np.int32), np.zeros((4, 4), dtype=bool))
    assert (empty.iou, empty.precision, empty.object_f1) == (1.0, 1.0, 1.0)


@given(st.lists(st.floats(-50, 50), min_size=1, max_size=30))
def test_hats_interpolate_and_sum_to_one(values: list[float]) -> None:
    knots = np.array([-10.0, 0.0, 5.0, 20.0])
    weights = hat_weights(np.array(values), knots)
    assert weights.sum(axis=1) == pytest.approx(1.0)
    assert weights @ knots == pytest.approx(np.clip(values, -10.0, 20.0))


def test_a_known_curve_is_learned_back() -> None:
    rng = np.random.default_rng(3)
    first, second = rng.uniform(-4, 4, (2, 40_000))
    logit = -0.5 + np.abs(first) + 0.0 * second  # bends at 0; the second cue says nothing
    rock = rng.random(40_000) < 1 / (1 + np.exp(-logit))
    knots = [np.array([-4.0, -2.0, 0.0, 2.0, 4.0])] * 2
    fit = fit_additive([first, second], rock, knots, 1e-6)
    learned = fit.bias + fit.evidence[0]
    assert learned == pytest.approx([3.5, 1.5, -0.5, 1.5, 3.5], abs=0.25)
    assert np.abs(fit.evidence[1]).max() < 0.15


def test_odds_of_choices_are_learned_back() -> None:
    """Three choices a group, or none: the odds of each are the exponential of a known curve of its cue."""
    rng = np.random.default_rng(4)
    groups, choices = 8_000, 3
    cue = rng.uniform(-4, 4, (groups, choices))
    odds = np.exp(-1.5 + np.abs(cue))
    share = rng.random(groups) * (1 + odds.sum(axis=1))
    taken = np.argmax(share[:, None] < np.cumsum(np.column_stack([odds, np.ones(groups)]), axis=1), axis=1)
    right = np.arange(choices) == taken[:, None]
    group = np.repeat(np.arange(groups), choices)
    knots = [np.array([-4.0, -2.0, 0.0, 2.0, 4.0])]
    fit = fit_choice([cue.ravel()], right.ravel(), group, np.ones(groups), knots, 1e-6)
    assert fit.bias + fit.evidence[0] == pytest.approx([2.5, 0.5, -1.5, 0.5, 2.5], abs=0.2)


def test_groups_without_weight_teach_nothing() -> None:
    cue, group = np.tile([0.0, 1.0], 4), np.repeat(np.arange(4), 2)
    right = np.array([False, True, False, True, True, False, True, False])
    knots = [np.array([0.0, 1.0])]
    fit = fit_choice([cue], right, group, np.array([1.0, 1.0, 0.0, 0.0]), knots, 0.0)
    assert fit.evidence[0][1] > fit.evidence[0][0] + 2


def test_equal_quantiles_are_one_knot() -> None:
    assert quantile_knots(np.zeros(10), (0.1, 0.9)).tolist() == [0.0, 1.0]
    assert quantile_knots(np.arange(101.0), (0.1, 0.5, 0.5)).tolist() == [10.0, 50.0]
