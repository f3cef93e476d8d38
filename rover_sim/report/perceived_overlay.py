"""The picture with what was perceived in it: class tints with a legend, rock outlines with certainty, paths."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from perception.pipeline import Perception
from rover_sim.verdict import Verdict
from worlds.types import BoolArray, ByteArray, FloatArray

Colour = tuple[int, int, int]

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
VERDICT_COLOURS = {
    Verdict.VERIFIED: (60, 235, 60),
    Verdict.UNSEEN: (255, 190, 0),
    Verdict.FAILED: (255, 45, 45),
}
VERDICT_NAMES = {
    Verdict.VERIFIED: "verified by driving",
    Verdict.UNSEEN: "driven, in part unseen",
    Verdict.FAILED: "failed when driven",
}
READABLE_PX = 960  # a narrower picture is enlarged by a whole factor; in a wider one letters and lines grow
MOST_PX = 1920  # of the height of a picture that is enlarged
TINT = 0.28
_OUTLINE, _BEST_PATH, _OTHER_PATH, _HORIZON = (255, 255, 255), (0, 255, 255), (0, 140, 160), (255, 140, 0)
_BLACK = (0, 0, 0)
_LABELLED_PX = 500  # area at the readable width from which a rock's certainty is written into it
_GRID_LETTERS_PX = 18  # windows narrower than this get no letter


def draw_overlay(
    image: ByteArray, found: Perception, paths_px: Sequence[FloatArray], verdicts: Sequence[Verdict] = ()
) -> ByteArray:
    """RGB overlay of ``image`` (H, W[, 3]) at its size with a legend below; ``paths_px`` in its pixels, best first.

    A picture narrower than 960 px is enlarged by a whole factor. ``verdicts`` say what became of each path in
    simulation; empty where none was driven.
    """
    colour = image if image.ndim == 3 else np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2RGB), dtype=np.uint8)
    zoom = enlargement(image.shape[1], image.shape[0])
    size = (image.shape[1] * zoom, image.shape[0] * zoom)
    canvas = np.asarray(cv2.resize(colour, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
    unit = size[0] / READABLE_PX
    canvas = _tint(canvas, found, unit)
    _draw_horizon(canvas, found.hidden, unit)
    _draw_rocks(canvas, found, unit)
    colours = path_colours(len(paths_px), verdicts)
    for index in range(len(paths_px) - 1, -1, -1):
        _draw_path(canvas, paths_px[index] * zoom, colours[index], unit, number=index + 1)
    return np.concatenate([canvas, _legend(size[0], unit, found, colours)])


def enlargement(width_px: int, height_px: int) -> int:
    """Whole factor by which a picture is drawn larger."""
    return max(1, min(-(-READABLE_PX // width_px), MOST_PX // height_px))


def path_colours(count: int, verdicts: Sequence[Verdict]) -> list[Colour]:
    """Colour of each path, best first."""
    if verdicts:
        return [VERDICT_COLOURS[verdict] for verdict in verdicts]
    return [_BEST_PATH if index == 0 else _OTHER_PATH for index in range(count)]


def _tint(canvas: ByteArray, found: Perception, unit: float) -> ByteArray:
    """The canvas with each window in the colour of its class, and its letter."""
    height, width = canvas.shape[:2]
    rows, columns = found.classes.shape
    grid = np.array([[CLASS_COLOURS[letter] for letter in row] for row in found.classes.tolist()], dtype=np.uint8)
    tint = cv2.resize(grid, (width, height), interpolation=cv2.INTER_NEAREST)
    mixed = np.asarray(cv2.addWeighted(canvas, 1.0 - TINT, tint, TINT, 0.0), dtype=np.uint8)
    if width / columns < _GRID_LETTERS_PX:
        return mixed
    for row in range(rows):
        for column in range(columns):
            place = (round((column + 0.06) * width / columns), round((row + 0.28) * height / rows))
            letter = str(found.classes[row, column])
            _text(mixed, letter, place, 0.45 * unit, CLASS_COLOURS[letter])
    return mixed


def _draw_horizon(canvas: ByteArray, hidden: BoolArray, unit: float) -> None:
    """Where the ground that is judged ends: horizon, sky, missing data."""
    layer = np.zeros(canvas.shape[:2], dtype=np.uint8)
    for contour in _contours(hidden, canvas):
        closed = np.round(np.vstack([contour, contour[:1]])).astype(np.int32)
        cv2.polylines(layer, [closed.reshape(-1, 1, 2)], isClosed=False, color=255, thickness=max(1, round(2 * unit)))
    rim = max(2, round(3 * unit))
    drawn = layer[rim:-rim, rim:-rim] > 0  # the picture's own border is no horizon
    canvas[rim:-rim, rim:-rim][drawn] = _HORIZON


def _contours(mask: BoolArray, canvas: ByteArray) -> list[FloatArray]:
    """Outlines (N, 2) of a working mask in canvas pixels, smooth rather than in steps."""
    scale = np.array([canvas.shape[1] / mask.shape[1], canvas.shape[0] / mask.shape[0]])
    found, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    edge = np.array(mask.shape[1::-1]) - 1.0
    # Pixel centres stand for their pixels, but an outline on the border belongs on the border.
    return [np.where(c[:, 0] >= edge, c[:, 0] + 1.0, c[:, 0] + 0.5 * (c[:, 0] > 0)) * scale for c in found]


def _draw_rocks(canvas: ByteArray, found: Perception, unit: float) -> None:
    per_pixel = np.array([canvas.shape[1] / found.labels.shape[1], canvas.shape[0] / found.labels.shape[0]])
    for rock in found.rocks:
        for contour in _contours(np.asarray(found.labels == rock.id), canvas):
            closed = np.vstack([contour, contour[:1]])
            _line(canvas, closed, _BLACK, unit, 3.0)
            _line(canvas, closed, _OUTLINE, unit, 1.4)
    for rock in found.rocks:
        if rock.area_px * per_pixel.prod() > _LABELLED_PX * unit**2:
            x, y = np.array(rock.centroid_px) * per_pixel
            _text(canvas, f"{rock.certainty:.2f}", (round(x - 14 * unit), round(y + 5 * unit)), 0.42 * unit, _OUTLINE)


def _draw_path(canvas: ByteArray, points: FloatArray, colour: Colour, unit: float, *, number: int) -> None:
    best = number == 1
    _line(canvas, points, _BLACK, unit, 6.0 if best else 3.5)
    _line(canvas, points, colour, unit, 3.5 if best else 1.8)
    if best:
        for x, y in np.round(points).astype(int).tolist():
            cv2.circle(canvas, (x, y), max(2, round(6 * unit)), _BLACK, -1, cv2.LINE_AA)
            cv2.circle(canvas, (x, y), max(1, round(4.5 * unit)), colour, -1, cv2.LINE_AA)
    end = points[-1] + (10 * unit, -4 * unit)
    _text(canvas, str(number), (round(end[0]), round(end[1])), 0.6 * unit, colour)


def _line(canvas: ByteArray, points: FloatArray, colour: Colour, unit: float, thickness: float) -> None:
    corners = np.round(points).astype(np.int32).reshape(-1, 1, 2)
    width = max(1, round(thickness * unit))
    cv2.polylines(canvas, [corners], isClosed=False, color=colour, thickness=width, lineType=cv2.LINE_AA)


def _legend(width: int, unit: float, found: Perception, paths: Sequence[Colour]) -> ByteArray:
    """Two rows: the classes with their share of the windows, and the lines."""
    share = {letter: float((found.classes == letter).mean()) for letter in CLASS_NAMES}
    classes = [
        (CLASS_COLOURS[letter], f"{letter} {name} {100 * share[letter]:.0f} %") for letter, name in CLASS_NAMES.items()
    ]
    lines: list[tuple[Colour, str]] = [(_OUTLINE, f"rock, certainty ({len(found.rocks)})")]
    names = {
        _BEST_PATH: "best path",
        _OTHER_PATH: "other paths",
        **{VERDICT_COLOURS[verdict]: f"path {name}" for verdict, name in VERDICT_NAMES.items()},
    }
    lines += [(colour, names[colour]) for colour in dict.fromkeys(paths)] or [(_BLACK, "no free path")]
    if found.hidden.any():
        lines.append((_HORIZON, "nothing is judged beyond"))
    return np.concatenate([_legend_row(width, unit, row, 6 if row is classes else 4) for row in (classes, lines)])


def _legend_row(width: int, unit: float, entries: Sequence[tuple[Colour, str]], columns: int) -> ByteArray:
    strip = np.full((max(1, round(26 * unit)), width, 3), 32, dtype=np.uint8)
    step = width / columns
    for index, (colour, text) in enumerate(entries):
        x = round(index * step + 6 * unit)
        box = (x, round(7 * unit)), (x + round(12 * unit), round(19 * unit))
        cv2.rectangle(strip, *box, colour, -1)
        _text(strip, text, (x + round(17 * unit), round(18 * unit)), 0.40 * unit, (235, 235, 235))
    return strip


def _text(canvas: ByteArray, text: str, place: tuple[int, int], scale: float, colour: Colour) -> None:
    """Text with a dark rim, readable on any ground."""
    thickness, rim = max(1, round(2.2 * scale)), max(1, round(2.2 * scale))
    # Thicker letters would be wider too, so the rim is the text itself, moved.
    for x, y in ((-rim, 0), (rim, 0), (0, -rim), (0, rim), (0, 0)):
        at, shade = (place[0] + x, place[1] + y), _BLACK if x or y else colour
        cv2.putText(canvas, text, at, cv2.FONT_HERSHEY_SIMPLEX, scale, shade, thickness, cv2.LINE_AA)
