"""Frame to Perception: the ten steps of the 2004 paper (Table 1, steps 1 to 8) in order, and nowhere else.

Low-pass, binarise, blobs, texture, fuzzy rock certainty, moments, geometry, place on the ground; and the six-class
grid of the windows. Steps 9 and 10, the paths, belong to the planner.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from perception.binarize import Binarized, SingleArray, clean, rock_mask, rock_score
from perception.blobs import Blobs, find_blobs, select
from perception.class_definition import WINDOW_PX
from perception.clasts import clast_chance, redness
from perception.ground import beyond_horizon, footprint, window_centres, window_ranges
from perception.knowledge_base import Knowledge, load_knowledge
from perception.perceived import ImageRock, Perception, image_rocks
from perception.rock_classifier import blob_features, rock_certainty
from perception.rock_geometry import outlines
from perception.rock_parting import part_rocks
from perception.rock_placement import View, place_rocks
from perception.shadow_height import with_shadows
from perception.sky import sky_mask
from perception.soil_reference import SoilReference, even_light, soil_reference
from perception.stereo import StereoView, depth_picture
from perception.terrain_class import classify
from perception.two_eyes import with_second_eye, with_whole_rocks
from perception.window_features import WindowSource, window_features
from worlds.types import BoolArray, ByteArray, FloatArray, Frame, Observation

__all__ = ["ImageRock", "Knowledge", "Perception", "View", "examine", "load_knowledge", "on_ground", "perceive"]

WORKING_SIZE_PX = (320, 240)  # width, height; the paper's picture
SKYLINE_RATIO = 5.0  # length over thickness; no rock is so flat
_BLACK = 2  # grey levels up to which a pixel is missing data

# glibc gives each large block back to the system when it is freed, until one larger still was; new ones then come page
# by page, a thousand faults a frame. From here on it keeps what a frame needs, up to twice as much (mallopt(3)).
np.empty(16 << 20, dtype=np.uint8)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A working picture with what the search for rocks needs of it, (H, W) each where not said otherwise."""

    picture: ByteArray  # grey, or RGB (H, W, 3)
    grey: ByteArray
    soft: SingleArray  # low-passed, RGB (H, W, 3) in 0..1
    lab: SingleArray  # (H, W, 3) of the low-passed picture
    hidden: BoolArray
    soil: SoilReference
    even: SingleArray  # (H, W, 3): lab with even light

    @cached_property
    def soft_grey(self) -> ByteArray:
        """The low-passed picture (H, W) in grey levels, for what asks for it."""
        return grey_levels(self.soft)

    @cached_property
    def red(self) -> SingleArray:
        """Redness of the picture (H, W), for what asks for it."""
        return redness(self.picture, self.hidden)


def perceive(frame: Frame, knowledge: Knowledge, covered: BoolArray | None = None) -> Perception:
    """Rocks and terrain classes of one frame; without camera pose and ground there is no observation.

    ``covered`` (H, W) marks what else is no ground: things taller than the camera.
    """
    if frame.camera_pose is None or frame.ground is None:
        return examine(frame.image, knowledge)
    view = View(frame.camera, frame.camera_pose, frame.ground, frame.to_sun_w)
    found = examine(frame.image, knowledge, view, covered)
    if frame.right is None:
        return on_ground(found, view, frame.time_s, knowledge)
    return by_two_eyes(found, view, (frame.image, frame.right), frame.baseline_m, frame.time_s, knowledge)


def examine(
    image: ByteArray, knowledge: Knowledge, view: View | None = None, covered: BoolArray | None = None
) -> Perception:
    """All that one picture, grey (H, W) or RGB (H, W, 3), shows; ``view`` only tells where the horizon is."""
    scale = (image.shape[1] / WORKING_SIZE_PX[0], image.shape[0] / WORKING_SIZE_PX[1])
    ready = prepare(working_picture(image), knowledge, view, covered)
    score, chance, found = rock_pixels(ready, knowledge)
    blobs, certainty = classify_blobs(ready.grey, ready.even, found, ready.hidden, knowledge)
    shape = outlines(blobs, knowledge.rock.round_ratio)
    windows = WindowSource(
        ready.picture, ready.grey, ready.lab, ready.soil, score, blobs.labels, blobs.area_px, ready.hidden, chance,
        _ranges(view), None if chance is None else ready.red,
    )  # fmt: skip
    features = window_features(windows, knowledge.terrain_rules.input_names)
    classes = classify(features, knowledge.terrain_rules, knowledge.terrain.min_certainty)
    rocks = image_rocks(blobs, shape, certainty)
    mask = blobs.labels > 0
    return Perception(scale, found.score, mask, blobs.labels, ready.hidden, rocks, shape, classes, windows, None)


def prepare(
    picture: ByteArray, know: Knowledge, view: View | None = None, covered: BoolArray | None = None
) -> Prepared:
    """A working picture, grey (240, 320) or RGB (240, 320, 3), ready for the search; arguments as of `examine`."""
    lab, soft = smoothed(picture, know.binarization.blur_px)
    grey = picture if picture.ndim == 2 else np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    hidden = hidden_mask(grey, lab, view, know)
    if covered is not None:
        hidden = hidden | (working_picture(covered.astype(np.uint8)) > 0)
    soil = soil_reference(lab, hidden, know.soil)
    return Prepared(picture, grey, soft, lab, hidden, soil, even_light(lab, soil))


def rock_pixels(ready: Prepared, know: Knowledge) -> tuple[SingleArray, SingleArray | None, Binarized]:
    """Evidence of rock (H, W); the chance of clasts (H, W) where the knowledge has it; and the pixels of rocks.

    Rocks are made of the pixels that show a clast, of evidence alone where there is no such chance or no colour.
    """
    score, how = rock_score(ready.even, ready.soil, ready.hidden, know), know.binarization
    if know.clasts is None:
        return score, None, Binarized(score, rock_mask(score, ready.soft_grey, how))
    chance = clast_chance(ready.red, ready.grey, score, ready.hidden, know.clasts)
    if not ready.soil.coloured:
        return score, chance, Binarized(score, rock_mask(score, ready.soft_grey, how))
    return score, chance, Binarized(chance, clean(chance > know.clasts.rock_cut, how))


def on_ground(found: Perception, view: View, time_s: float, knowledge: Knowledge) -> Perception:
    """The same with its rocks and windows placed on the ground that ``view`` looks at."""
    certainty = np.array([rock.certainty for rock in found.rocks])
    cut = np.array([rock.touches_border for rock in found.rocks], dtype=bool)
    placed = place_rocks(view, found.outlines, certainty, cut, found.scale, knowledge.ground)
    area = np.array([rock.area_px for rock in found.rocks], dtype=np.int32)
    placed = with_shadows(placed, area, found.labels, found.windows.grey, view, found.scale)
    reach = knowledge.ground.max_range_m
    shape = (found.classes.shape[0], found.classes.shape[1])
    observation = Observation(
        time_s,
        tuple(rock for rock in placed if rock is not None),
        found.classes,
        window_centres(view.camera, view.pose, view.plane, shape, reach),
        footprint(view.camera, view.pose, view.plane, reach),
        view.plane,
    )
    rocks = tuple(structs.replace(rock, placed=place) for rock, place in zip(found.rocks, placed, strict=True))
    return replace(found, rocks=rocks, observation=observation)


def by_two_eyes(
    found: Perception,
    view: View,
    pair: tuple[ByteArray, ByteArray],
    baseline_m: float,
    time_s: float,
    knowledge: Knowledge,
) -> Perception:
    """What the left picture of a ``pair`` showed, whole and placed on the ground by the depths of both."""
    left, right = (working_picture(picture) for picture in pair)
    depth = depth_picture(left, right, view.camera, found.scale, baseline_m, found.labels)
    eyes = StereoView(view, found.scale, view.camera.focal_px / found.scale[0] * baseline_m)
    placed = on_ground(with_whole_rocks(found, depth, eyes, knowledge), view, time_s, knowledge)
    return with_second_eye(placed, depth, eyes, knowledge)


def working_picture(image: ByteArray) -> ByteArray:
    """``image``, grey (H, W) or RGB (H, W, 3), at the working size."""
    if (image.shape[1], image.shape[0]) == WORKING_SIZE_PX:
        return np.ascontiguousarray(image)
    larger = image.shape[1] >= WORKING_SIZE_PX[0] and image.shape[0] >= WORKING_SIZE_PX[1]
    how = cv2.INTER_AREA if larger else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, WORKING_SIZE_PX, interpolation=how), dtype=np.uint8)


def smoothed(picture: ByteArray, blur_px: float) -> tuple[SingleArray, SingleArray]:
    """CIE Lab (H, W, 3) and RGB (H, W, 3) in 0..1 of the low-passed picture."""
    colour = picture if picture.ndim == 3 else cv2.cvtColor(picture, cv2.COLOR_GRAY2RGB)
    single = cv2.GaussianBlur(colour.astype(np.float32) * np.float32(1.0 / 255.0), (0, 0), blur_px)
    lab = cv2.cvtColor(single, cv2.COLOR_RGB2LAB)
    return np.asarray(lab, dtype=np.float32), np.asarray(single, dtype=np.float32)


def grey_levels(colour: SingleArray) -> ByteArray:
    """8-bit grey (H, W) of a picture, RGB (H, W, 3) in 0..1."""
    return np.asarray(cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY) * np.float32(255.0), dtype=np.uint8)


def hidden_mask(grey: ByteArray, lab: SingleArray, view: View | None, know: Knowledge) -> BoolArray:
    """Pixels (H, W) that show no ground near enough to judge: black, sky, or above the (dipped) horizon."""
    hidden = missing_data(grey)
    if view is None:
        return np.asarray(hidden | sky_mask(lab, hidden, know.sky))
    dip = float(np.deg2rad(know.ground.horizon_dip_deg))
    shape = (hidden.shape[0], hidden.shape[1])
    return np.asarray(hidden | beyond_horizon(view.camera, view.pose, view.plane, shape, dip))


def missing_data(grey: ByteArray) -> BoolArray:
    """Pixels (H, W) that carry no picture: black."""
    return np.asarray(grey <= _BLACK)


def classify_blobs(
    grey: ByteArray, even: SingleArray, found: Binarized, hidden: BoolArray, know: Knowledge
) -> tuple[Blobs, NDArray[np.float64]]:
    """Blobs that pass for rocks, largest first, and their certainty (R,); ``even`` (H, W, 3) has even light."""
    least_px = know.binarization.min_area_px
    blobs = find_blobs(found.mask, least_px, know.binarization.neck_ratio)
    if know.parting is not None:
        blobs = part_rocks(blobs, even, found.score, know.parting, least_px)
    certainty = rock_certainty(blob_features(grey, found.score, blobs), know.rock_rules)
    sure = (certainty >= know.rock.min_certainty) & ~skyline_bands(blobs, hidden)
    return select(blobs, sure), certainty[sure]


def skyline_bands(blobs: Blobs, hidden: BoolArray) -> BoolArray:
    """Which blobs (R,) are strips of far ground under the skyline: they hang on hidden pixels, long and thin."""
    below = np.zeros_like(hidden)
    below[1:] = hidden[:-1] & ~hidden[1:]
    hangs = np.bincount(blobs.labels[below], minlength=len(blobs) + 1)[1:] > 0
    return np.asarray(hangs & (blobs.variance_px2[:, 0] > SKYLINE_RATIO**2 * blobs.variance_px2[:, 1]))


def _ranges(view: View | None) -> FloatArray | None:
    """Ground distance (12, 16) of the windows, m; None for a picture from anywhere."""
    if view is None:
        return None
    shape = (WORKING_SIZE_PX[1] // WINDOW_PX, WORKING_SIZE_PX[0] // WINDOW_PX)
    return window_ranges(view.camera, view.pose, view.plane, shape)
