from __future__ import annotations

import numpy as np
import pytest

from perception.knowledge_base import load_knowledge
from perception.terrain_class import classify, window_features, window_share
from perception.ttam import ttam

KNOW = load_knowledge("mars")


def letter(fine: float, coarse: float, cover: float = 0.0, big: float = 0.0, unseen: float = 0.0) -> str:
    values = {"fine": np.log10(fine), "coarse": np.log10(coarse), "cover": cover, "big": big, "unseen": unseen}
    return str(classify({k: np.array([[v]]) for k, v in values.items()}, KNOW.terrain_rules)[0, 0])


@pytest.mark.parametrize(
    ("expected", "measures"),
    [
        ("S", {"fine": 5.0, "coarse": 4.0}),
        ("V", {"fine": 20.0, "coarse": 4.0}),
        ("m", {"fine": 20.0, "coarse": 15.0}),
        ("M", {"fine": 30.0, "coarse": 20.0, "cover": 0.8}),
        ("B", {"fine": 30.0, "coarse": 20.0, "cover": 0.8, "big": 0.75}),
        ("U", {"fine": 30.0, "coarse": 20.0, "cover": 0.8, "big": 0.75, "unseen": 0.8}),
    ],
)
def test_each_class_has_its_rule(expected: str, measures: dict[str, float]) -> None:
    assert letter(**measures) == expected


def test_window_share_counts_pixels() -> None:
    mask = np.zeros((40, 60), dtype=bool)
    mask[0:10, 0:20] = True
    mask[20:40, 40:60] = True
    assert window_share(mask).tolist() == pytest.approx(np.array([[0.5, 0, 0], [0, 0, 1]]))


def test_a_window_without_any_variation_is_unseen() -> None:
    grey = np.full((40, 40), 90, dtype=np.uint8)
    grey[:20, :20] += np.random.default_rng(0).integers(0, 3, (20, 20), dtype=np.uint8)
    none = np.zeros((40, 40), dtype=bool)
    assert window_features(grey, none, none, none)["unseen"].tolist() == [[0.0, 1.0], [1.0, 1.0]]


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
