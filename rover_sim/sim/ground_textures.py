"""What the ground looks like close by: one of three seeded textures, periodic over a tile of a few metres.

``sand``: grains, and pebbles as many as the rocks' share of area promises. ``ripples``: wind ripples of a decimetre
with few pebbles. ``gravel``: pebbles lying together in patches on coarse soil, also where there are no rocks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rover_sim.sim.textures import Pyramid, make_pyramid, slopes_of, spectral_noise
from worlds.scenario import GroundTexture
from worlds.types import FloatArray, IntArray

GROUND_SIZE_PX, GROUND_TILE_M = 1024, 4.0
PEBBLE_COVER = (0.8, 0.10)  # on sand pebbles cover this many times the rocks' share of area, at most so much
RIPPLE_PEBBLES = 0.25  # share of those that ripples leave in sight
GRAVEL_COVER = 0.16  # that gravel has beside those
RIPPLE_CYCLES = (31, 13)  # of the ripples' phase over a tile, along x and y: crests 0.119 m apart
RIPPLE_HEIGHT_M = 0.0045  # of a crest over the mean; about a thirteenth of the wavelength from trough to crest
STEEPEST = 1.2  # beyond it a slope would only show the coarseness of the texels
_SHAPE = (GROUND_SIZE_PX, GROUND_SIZE_PX)


class Pebbles(NamedTuple):
    """Pebbles on a ground tile, (N, N) each but the last."""

    height_m: FloatArray  # above the soil
    share: FloatArray  # 0..1 of a texel
    owner: IntArray  # which pebble is topmost, -1 = none
    area_m2: FloatArray  # (P,) seen from above


class GroundLook(NamedTuple):
    """A ground texture - brightness, slope x, slope y, pebble share - and the pebbles in it."""

    pyramid: Pyramid
    pebbles: Pebbles


def ground_look(kind: GroundTexture, cfa: float, rng: np.random.Generator) -> GroundLook:
    """The ground of a world whose rocks cover the share ``cfa`` of it."""
    return _KINDS[kind](min(PEBBLE_COVER[0] * cfa, PEBBLE_COVER[1]), rng)


def _sand(cover: float, rng: np.random.Generator) -> GroundLook:
    grain = spectral_noise(_SHAPE, GROUND_TILE_M, (0.008, 0.12), 0.6, rng)
    swell = spectral_noise(_SHAPE, GROUND_TILE_M, (0.05, 1.5), 1.8, rng)
    stain = spectral_noise(_SHAPE, GROUND_TILE_M, (0.02, 2.0), 1.2, rng)
    strewn = pebbles(cover, rng)
    height = 0.00045 * grain + 0.004 * swell + strewn.height_m
    return _look(height, 1 + 0.026 * grain + 0.030 * stain, strewn, rng)


def _ripples(cover: float, rng: np.random.Generator) -> GroundLook:
    """Ridges whose phase and height wander, steeper on one side (Bagnold, The Physics of Blown Sand, 1941)."""
    grain = spectral_noise(_SHAPE, GROUND_TILE_M, (0.008, 0.05), 0.4, rng)
    wander = spectral_noise(_SHAPE, GROUND_TILE_M, (0.4, 2.0), 1.2, rng)
    tall = np.clip(1.0 + 0.35 * spectral_noise(_SHAPE, GROUND_TILE_M, (0.3, 2.0), 1.0, rng), 0.2, 1.8)
    turn = np.arange(GROUND_SIZE_PX) * (2 * np.pi / GROUND_SIZE_PX)
    phase = RIPPLE_CYCLES[0] * turn[None, :] + RIPPLE_CYCLES[1] * turn[:, None] + 1.3 * wander
    ridge = np.sin(phase + 0.4 * np.sin(phase))
    strewn = pebbles(RIPPLE_PEBBLES * cover, rng)
    height = RIPPLE_HEIGHT_M * tall * ridge + 0.0003 * grain + strewn.height_m
    return _look(height, 1 + 0.02 * grain - 0.03 * ridge * tall, strewn, rng)


def _gravel(cover: float, rng: np.random.Generator) -> GroundLook:
    grain = spectral_noise(_SHAPE, GROUND_TILE_M, (0.008, 0.2), 0.8, rng)
    swell = spectral_noise(_SHAPE, GROUND_TILE_M, (0.05, 1.0), 1.5, rng)
    stain = spectral_noise(_SHAPE, GROUND_TILE_M, (0.02, 1.0), 1.0, rng)
    together = spectral_noise(_SHAPE, GROUND_TILE_M, (0.25, 2.0), 1.5, rng)
    strewn = pebbles(cover + GRAVEL_COVER, rng, np.clip(0.5 + 0.35 * together, 0.05, 1.0))
    height = 0.0007 * grain + 0.005 * swell + strewn.height_m
    return _look(height, 0.95 + 0.035 * grain + 0.04 * stain, strewn, rng)


_KINDS: dict[GroundTexture, Callable[[float, np.random.Generator], GroundLook]] = {
    "sand": _sand,
    "ripples": _ripples,
    "gravel": _gravel,
}


def _look(height_m: FloatArray, brightness: FloatArray, strewn: Pebbles, rng: np.random.Generator) -> GroundLook:
    mottled = 0.10 * strewn.share * spectral_noise(_SHAPE, GROUND_TILE_M, (0.02, 0.2), 0.5, rng)
    slopes = (np.clip(slope, -STEEPEST, STEEPEST) for slope in slopes_of(height_m, GROUND_TILE_M))
    texture = np.stack([brightness + mottled, *slopes, strewn.share], -1)
    return GroundLook(make_pyramid(texture, GROUND_TILE_M), strewn)


def pebbles(cover: float, rng: np.random.Generator, odds: FloatArray | None = None) -> Pebbles:
    """Half-buried ellipsoids of 1-6 cm strewn over a ground tile on a share ``cover`` of it.

    Diameters follow a power law of cumulative number, exponent -2.2, the small end of the size-frequency law of
    Golombek and Rapp (J. Geophys. Res. 102, 1997, 4117) continued below what is drawn as a mesh. ``odds`` (N, N) is
    the chance 0..1 that a pebble thrown there stays; None: all stay.
    """
    n, step = GROUND_SIZE_PX, GROUND_TILE_M / GROUND_SIZE_PX
    height, share, owner = np.zeros((n, n)), np.zeros((n, n)), np.full((n, n), -1, dtype=np.int32)
    areas: list[float] = []
    covered = 0.0
    while covered < cover * GROUND_TILE_M**2:
        # Inverse of the cumulative law between the two ends.
        diameter = (rng.uniform(0.06**-2.2, 0.010**-2.2)) ** (-1 / 2.2)
        aspect, angle = rng.uniform(0.55, 1.0), rng.uniform(0.0, np.pi)
        centre = rng.uniform(0.0, n, 2)
        if odds is not None and rng.uniform() > odds[int(centre[0]), int(centre[1])]:
            continue
        reach = int(np.ceil(diameter / 2 / step)) + 1
        rows, columns = (np.arange(int(c) - reach, int(c) + reach + 1) for c in centre)
        dy, dx = (rows[:, None] + 0.5 - centre[0]) * step, (columns[None, :] + 0.5 - centre[1]) * step
        along, across = dx * np.cos(angle) + dy * np.sin(angle), dy * np.cos(angle) - dx * np.sin(angle)
        radius = np.hypot(along, across / aspect) / (diameter / 2)
        dome = diameter * rng.uniform(0.25, 0.45) * np.sqrt(np.clip(1 - radius**2, 0.0, 1.0))
        place = np.ix_(rows % n, columns % n)
        owner[place] = np.where((dome > height[place]) & (radius < 1), len(areas), owner[place])
        height[place] = np.maximum(height[place], dome)
        # A soft rim of one texel instead of steps.
        share[place] = np.maximum(share[place], np.clip((1 - radius) * diameter / 2 / step + 0.5, 0.0, 1.0))
        areas.append(np.pi / 4 * diameter**2 * aspect)
        covered += areas[-1]
    return Pebbles(height, share, owner, np.array(areas))
