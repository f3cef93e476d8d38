"""What the depths of a second camera add to a look: whole rocks, their places, and what only stands out by depth."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
from msgspec import structs

from perception.depth_rocks import filled_out, placed_blobs, standing_blobs
from perception.knowledge_base import Knowledge
from perception.perceived import Perception, image_rocks
from perception.rejoining import rejoined
from perception.rock_geometry import RockOutlines, outlines
from perception.stereo import StereoView, measured_ground, on_measured, pixels_by_label
from perception.stereo_rocks import refined
from worlds.types import FloatArray


def with_whole_rocks(found: Perception, depth_m: FloatArray, eyes: StereoView, knowledge: Knowledge) -> Perception:
    """The same with parts of one rock, by the depths (H, W), put together; a rock is as certain as its surest part."""
    labels = filled_out(found.labels, depth_m, found.hidden, eyes)
    blobs, owner = rejoined(labels, len(found.rocks), depth_m)
    certainty = np.zeros(len(blobs))
    np.maximum.at(certainty, owner[: len(found.rocks)], [rock.certainty for rock in found.rocks])
    shape = outlines(blobs, knowledge.rock.round_ratio)
    rocks = image_rocks(blobs, shape, certainty)
    return replace(found, labels=blobs.labels, mask=blobs.labels > 0, rocks=rocks, outlines=shape)


def with_second_eye(found: Perception, depth_m: FloatArray, eyes: StereoView, knowledge: Knowledge) -> Perception:
    """The same with its placed rocks moved to where the depths (H, W) of a second camera say."""
    assert found.observation is not None
    ground = measured_ground(depth_m, found.labels, found.hidden, eyes)
    shown = pixels_by_label(found.labels, len(found.rocks))
    rocks = tuple(
        structs.replace(rock, placed=refined(rock.placed, depth_m, shown[rock.id - 1], ground, eyes, knowledge.ground))
        if rock.placed
        else rock
        for rock in found.rocks
    )
    observed = replace(found.observation, class_centre_w=on_measured(found.observation.class_centre_w, ground, eyes))
    return with_standing(replace(found, rocks=rocks, observation=observed), depth_m, eyes, knowledge)


def with_standing(found: Perception, depth_m: FloatArray, eyes: StereoView, knowledge: Knowledge) -> Perception:
    """The same with what stands out of the ground by depth alone as further rocks, after those of texture."""
    assert found.observation is not None
    blobs, height = standing_blobs(depth_m, found.labels, found.hidden, eyes)
    shape = outlines(blobs, knowledge.rock.round_ratio)
    placed = placed_blobs(blobs, shape, depth_m, height, eyes)
    more = image_rocks(blobs, shape, np.array([rock.certainty for rock in placed]))
    first = len(found.rocks)
    rocks = (
        *found.rocks,
        *(structs.replace(rock, id=first + rock.id, placed=place) for rock, place in zip(more, placed, strict=True)),
    )
    labels = np.where(blobs.labels > 0, blobs.labels + np.int32(first), found.labels).astype(np.int32)
    joined = RockOutlines(
        **{f.name: np.concatenate([getattr(found.outlines, f.name), getattr(shape, f.name)]) for f in fields(shape)}
    )
    observed = replace(found.observation, rocks=tuple(rock.placed for rock in rocks if rock.placed is not None))
    return replace(found, rocks=rocks, labels=labels, mask=labels > 0, outlines=joined, observation=observed)
