"""The picture with what was perceived in it: class tints with a legend, rock outlines with certainty, paths."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from perception.pipeline import Perception
from worlds.types import ByteArray, FloatArray

CLASS_NAMES = {
    "S": "sandy",
    "V": "very small rocks",
    "m": "rough",
    "M": "very rough",
    "B": "big rock",
    "U": "uncertain",
}
# Red, green, blue; ordered like the danger, grey for what is not known.
CLASS_COLOURS = {
    "S": (240, 220, 130),
    "V": (120, 200, 90),
    "m": (60, 150, 230),
    "M": (170, 90, 220),
    "B": (230, 60, 50),
    "U": (130, 130, 130),
}
LEAST_WIDTH_PX = 960
TINT = 0.28
_OUTLINE, _BEST_PATH, _OTHER_PATH = (255, 255, 255), (0, 255, 255), (0, 140, 160)
_LEGEND_PX = 34


def draw_overlay(image: ByteArray, found: Perception, paths_px: Sequence[FloatArray]) -> ByteArray:
    """RGB overlay of ``image`` (H, W[, 3]), enlarged to a readable size; ``paths_px`` in its pixels, best first."""
    colour = image if image.ndim == 3 else np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2RGB), dtype=np.uint8)
    zoom = max(1.0, LEAST_WIDTH_PX / image.shape[1])
    width, height = round(image.shape[1] * zoom), max(1, round(image.shape[0] * zoom))
    canvas = np.asarray(cv2.resize(colour, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
    canvas = _tint(canvas, found)
    _draw_rocks(canvas, found)
    for index in range(len(paths_px) - 1, -1, -1):
        _draw_path(canvas, paths_px[index] * zoom, best=index == 0)
    return np.concatenate([canvas, _legend(width)])


def _tint(canvas: ByteArray, found: Perception) -> ByteArray:
    """The canvas with each window in the colour of its class, its letter and a thin grid."""
    height, width = canvas.shape[:2]
    rows, columns = found.classes.shape
    grid = np.array([[CLASS_COLOURS[letter] for letter in row] for row in found.classes.tolist()], dtype=np.uint8)
    tint = cv2.resize(grid, (width, height), interpolation=cv2.INTER_NEAREST)
    mixed = np.asarray(cv2.addWeighted(canvas, 1.0 - TINT, tint, TINT, 0.0), dtype=np.uint8)
    scale = max(0.3, width / columns / 130.0)
    for row in range(rows):
        for column in range(columns):
            place = (round((column + 0.06) * width / columns), round((row + 0.28) * height / rows))
            letter = str(found.classes[row, column])
            _text(mixed, letter, place, scale, CLASS_COLOURS[letter])
    return mixed


def _draw_rocks(canvas: ByteArray, found: Perception) -> None:
    height, width = canvas.shape[:2]
    labels = cv2.resize(found.labels.astype(np.float32), (width, height), interpolation=cv2.INTER_NEAREST).astype(
        np.int32
    )
    per_pixel = width / found.labels.shape[1]
    for rock in found.rocks:
        contours, _ = cv2.findContours((labels == rock.id).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        cv2.drawContours(canvas, contours, -1, _OUTLINE, 1, cv2.LINE_AA)
        if rock.area_px * per_pixel**2 > 900:
            x, y = rock.centroid_px
            place = (round(x * per_pixel) - 14, round(y * height / found.labels.shape[0]) + 5)
            _text(canvas, f"{rock.certainty:.2f}", place, 0.42, _OUTLINE)


def _draw_path(canvas: ByteArray, points: FloatArray, *, best: bool) -> None:
    colour = _BEST_PATH if best else _OTHER_PATH
    corners = np.round(points).astype(np.int32).reshape(-1, 1, 2)
    cv2.polylines(canvas, [corners], isClosed=False, color=colour, thickness=3 if best else 1, lineType=cv2.LINE_AA)
    if best:
        for x, y in corners[:, 0].tolist():
            cv2.circle(canvas, (x, y), 6, (0, 0, 0), 2, cv2.LINE_AA)
            cv2.circle(canvas, (x, y), 5, colour, -1, cv2.LINE_AA)


def _legend(width: int) -> ByteArray:
    strip = np.full((_LEGEND_PX, width, 3), 32, dtype=np.uint8)
    entries = [(CLASS_COLOURS[letter], f"{letter} {name}") for letter, name in CLASS_NAMES.items()]
    entries += [(_OUTLINE, "rock, certainty"), (_BEST_PATH, "best path")]
    step = width / len(entries)
    for index, (colour, text) in enumerate(entries):
        x = round(index * step) + 6
        cv2.rectangle(strip, (x, 11), (x + 12, 23), colour, -1)
        _text(strip, text, (x + 17, 22), min(0.40, step / 290.0), (235, 235, 235))
    return strip


def _text(canvas: ByteArray, text: str, place: tuple[int, int], scale: float, colour: tuple[int, int, int]) -> None:
    """Text with a dark rim, readable on any ground."""
    for shade, thickness in (((0, 0, 0), 2), (colour, 1)):
        cv2.putText(canvas, text, place, cv2.FONT_HERSHEY_SIMPLEX, scale, shade, thickness, cv2.LINE_AA)
