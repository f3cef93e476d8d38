from __future__ import annotations

import numpy as np
import pytest
from skimage.feature import graycomatrix, graycoprops

from perception.texture import region_texture, window_texture
from worlds.types import ByteArray


def noise(seed: int, shape: tuple[int, int] = (40, 60)) -> ByteArray:
    return np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)


def test_hand_computed_four_by_four() -> None:
    # Two columns of level 0, two of level 3 (grey 24): worked on paper.
    picture = np.zeros((4, 4), dtype=np.uint8)
    picture[:, 2:] = 24
    labels = np.ones((4, 4), dtype=np.int32)
    found = region_texture(picture, labels, np.array([[0, 0, 4, 4]], dtype=np.int32))
    # East: 12 pairs, 4 of them (0, 3): contrast 9/3 = 3. Diagonals: 9 pairs, 3 of them: 3. South: none: 0.
    assert found.contrast[0] == pytest.approx((3.0 + 3.0 + 0.0 + 3.0) / 4)
    # East and diagonals: P = 1/3, 1/3 on the diagonal, 1/6 twice beside it; south: 1/2, 1/2.
    third = 2 / 9 + 2 / 36
    assert found.energy[0] == pytest.approx((3 * third + 0.5) / 4)
    entropy = -(2 / 3 * np.log(1 / 3) + 1 / 3 * np.log(1 / 6))
    assert found.entropy[0] == pytest.approx((3 * entropy + np.log(2)) / 4)
    assert found.homogeneity[0] == pytest.approx((3 * (2 / 3 + 1 / 3 / 10) + 1) / 4)
    assert found.variance[0] == pytest.approx(144.0)


def scikit_image(window: ByteArray, distance: int, angle: float, name: str) -> float:
    """A measure of one direction; scikit-image goes round(d cos a) and round(d sin a), so diagonals need d sqrt 2."""
    step = distance * (np.sqrt(2.0) if angle % (np.pi / 2) else 1.0)
    matrix = graycomatrix(window >> 3, [step], [angle], levels=32, symmetric=True, normed=True)  # type: ignore[no-untyped-call]
    return float(graycoprops(matrix, name)[0, 0])  # type: ignore[no-untyped-call]


@pytest.mark.parametrize("distances", [(1,), (2,), (1, 3)])
def test_equal_to_scikit_image(distances: tuple[int, ...]) -> None:
    grey = noise(1)
    found = window_texture(grey, 20, distances)
    angles = [0, np.pi / 4, np.pi / 2, 3 * np.pi / 4]
    for index in range(6):
        row, column = divmod(index, 3)
        window = grey[20 * row : 20 * row + 20, 20 * column : 20 * column + 20]
        for name, ours in (
            ("contrast", found.contrast),
            ("ASM", found.energy),
            ("homogeneity", found.homogeneity),
            ("entropy", found.entropy),
        ):
            theirs = np.mean([scikit_image(window, d, a, name) for d in distances for a in angles])
            assert ours[index] == pytest.approx(theirs, rel=1e-9)
        assert found.variance[index] == pytest.approx(window.var(), rel=1e-9)


def test_only_pairs_inside_a_region_count() -> None:
    grey = noise(2, (20, 20))
    labels = np.zeros((20, 20), dtype=np.int32)
    labels[5:12, 3:17] = 1
    box = np.array([[3, 5, 14, 7]], dtype=np.int32)
    before = region_texture(grey, labels, box)
    grey[labels == 0] = 255
    after = region_texture(grey, labels, box)
    assert before.contrast == after.contrast
    assert before.energy == after.energy


def test_a_single_pixel_has_no_texture() -> None:
    labels = np.zeros((5, 5), dtype=np.int32)
    labels[2, 2] = 1
    found = region_texture(noise(3, (5, 5)), labels, np.array([[2, 2, 1, 1]], dtype=np.int32))
    measures = (found.contrast, found.energy, found.variance, found.entropy, found.homogeneity)
    assert tuple(float(m[0]) for m in measures) == (0.0, 1.0, 0.0, 0.0, 1.0)
