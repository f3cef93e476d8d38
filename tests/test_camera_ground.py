"""The three ground textures, and the truth about their pebbles."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from rover_sim.scoring import true_classes
from rover_sim.sim.clasts import clast_ids, pebble_map, strength_of
from rover_sim.sim.ground_textures import GROUND_SIZE_PX, GROUND_TILE_M, RIPPLE_CYCLES, Pebbles, ground_look
from rover_sim.sim.renderer import RenderedImage, make_renderer
from rover_sim.sim.textures import make_pyramid
from tests.camera_factory import field, lens, look, world
from worlds.scenario import GroundTexture
from worlds.types import FloatArray

KINDS: tuple[GroundTexture, ...] = get_args(GroundTexture)


def seen(texture: GroundTexture, seed: int = 1) -> FloatArray:
    """Grey picture of level ground with that texture, from above."""
    camera = lens(pitch_deg=60.0)
    made = make_renderer(world(field(30.0, 0.5), cfa=0.05, texture=texture, seed=seed))
    return np.asarray(made.render(camera, look(camera, 0.0, 0.0, 1.2)).image.mean(axis=2))


def test_the_textures_look_different_and_repeat_with_their_seed() -> None:
    pictures = {kind: seen(kind) for kind in KINDS}
    np.testing.assert_array_equal(seen("ripples"), pictures["ripples"])
    assert (seen("gravel", seed=2) != pictures["gravel"]).any()
    assert pictures["gravel"].std() > 1.5 * pictures["sand"].std()


def test_only_ripples_are_waves() -> None:
    shares = {}
    for kind in KINDS:
        data = ground_look(kind, 0.05, np.random.default_rng(6)).pyramid.finest()[..., 1]
        power = np.abs(np.fft.fft2(data)) ** 2
        y, x = np.meshgrid(*[np.fft.fftfreq(GROUND_SIZE_PX, 1 / GROUND_SIZE_PX)] * 2, indexing="ij")
        near = np.hypot(np.abs(x) - RIPPLE_CYCLES[0], np.abs(y) - RIPPLE_CYCLES[1]) < 10
        shares[kind] = float(power[near].sum() / power.sum())
    assert shares["ripples"] > 0.5, shares
    assert max(shares["sand"], shares["gravel"]) < 0.1, shares


def test_pebbles_cover_what_each_texture_promises() -> None:
    share = {kind: ground_look(kind, 0.05, np.random.default_rng(4)).pebbles.share.mean() for kind in KINDS}
    assert share["ripples"] < 0.015 < share["sand"] < 0.05
    assert share["gravel"] > 0.12
    bare = {kind: ground_look(kind, 0.0, np.random.default_rng(4)).pebbles.share.max() for kind in KINDS}
    assert bare["sand"] == bare["ripples"] == 0.0
    assert bare["gravel"] > 0.0


def one_pebble(radius_px: int) -> Pebbles:
    """A tile with one round pebble around its middle, at x = y = 2 m."""
    n, middle = GROUND_SIZE_PX, GROUND_SIZE_PX // 2
    y, x = np.indices((n, n)) - middle
    inside = np.hypot(x, y) <= radius_px
    area = float(inside.sum()) * (GROUND_TILE_M / n) ** 2
    share = inside.astype(np.float64)
    return Pebbles(0.01 * share, share, np.where(inside, 0, -1).astype(np.int32), np.array([area]))


@pytest.mark.parametrize(("radius_px", "strength", "shown"), [(8, 1.0, True), (1, 1.0, False), (8, 0.4, False)])
def test_a_pebble_counts_where_it_covers_a_pixel_and_the_texture_shows(
    radius_px: int, strength: float, shown: bool
) -> None:
    # Straight down from 3 m over the pebble: a pixel is 3 m / 207.8 = 1.44 cm wide, a texel 3.9 mm.
    camera = lens(pitch_deg=90.0)
    pose = look(camera, 2.0, 2.0, 3.0)
    flat = np.zeros((240, 320), dtype=np.int32)
    flat[:20, :20] = 7  # a rock stays what it is
    picture = RenderedImage(np.zeros((240, 320, 3), np.uint8), np.full((240, 320), 3.0, np.float32), flat)
    drift = make_pyramid(np.full((256, 256, 4), strength), 23.0)
    ids = clast_ids(picture, camera, pose, pebble_map(one_pebble(radius_px)), strength_of(drift), 8)
    assert (ids[:20, :20] == 7).all()
    found = ids == 8
    assert bool(found.any()) == shown
    assert ids.max() == (8 if shown else 7)
    if shown:  # 8 texels of radius are 2.17 pixels: about 15 of area, around the picture's middle
        assert 10 <= found.sum() <= 20
        assert np.abs(np.argwhere(found).mean(axis=0) - [119.5, 159.5]).max() < 1.0


def test_what_is_drawn_darker_is_where_the_truth_has_pebbles() -> None:
    camera = lens(pitch_deg=60.0)
    renderer = make_renderer(world(field(30.0, 0.5), texture="gravel"))
    pose = look(camera, 0.0, 0.0, 1.0)
    picture = renderer.render(camera, pose)
    pebble = renderer.clasts(camera, pose, picture) > 0
    assert 0.03 < pebble.mean() < 0.3
    colour = picture.image.astype(float)
    redness = colour[..., 0] / colour[..., 2]  # pebbles are greyer than sand, whatever the light on them
    assert redness[pebble].mean() < 0.92 * redness[~pebble].mean()
    assert set(true_classes(np.where(pebble, 1, 0).astype(np.int32), picture.depth_m).ravel()) != {"S"}
