"""Milliseconds of processor time a frame: all of perception and its parts, scikit-image's co-occurrence beside ours.

OMP_NUM_THREADS=1 uv run python benchmarks/perception_speed.py PICTURE [--repeat 50]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from skimage.feature import graycomatrix, graycoprops

from perception.binarize import binarize
from perception.knowledge_base import load_knowledge
from perception.pipeline import classify_blobs, perceive, smoothed, working_picture
from perception.rock_geometry import outlines
from perception.soil_reference import soil_reference
from perception.terrain_class import classify
from perception.texture import window_texture
from perception.window_features import WINDOW_PX, window_features
from worlds.geometry import camera_pose, quaternion_from_euler
from worlds.types import ByteArray, CameraModel, Frame, GroundPlane, Pose


def median_ms(work: Callable[[], object], repeat: int) -> float:
    """Median processor time of ``work`` in milliseconds, after one call to compile and warm up."""
    work()
    times = []
    for _ in range(repeat):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return 1e3 * float(np.median(times))


def skimage_windows(grey: ByteArray) -> None:
    """Contrast, energy and homogeneity of all windows by scikit-image, for comparison."""
    angles = [0.0, np.pi / 4, np.pi / 2, 3 * np.pi / 4]
    for row in range(0, grey.shape[0], WINDOW_PX):
        for column in range(0, grey.shape[1], WINDOW_PX):
            window = grey[row : row + WINDOW_PX, column : column + WINDOW_PX] >> 3
            matrix = graycomatrix(window, [1], angles, levels=32, symmetric=True, normed=True)  # type: ignore[no-untyped-call]
            for name in ("contrast", "ASM", "homogeneity"):
                graycoprops(matrix, name)  # type: ignore[no-untyped-call]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Milliseconds a frame.")
    parser.add_argument("picture", type=Path)
    parser.add_argument("--repeat", type=int, default=50)
    parser.add_argument("--knowledge", default="mars")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)  # else processor time would add up over threads
    knowledge = load_knowledge(arguments.knowledge)
    loaded = cv2.imread(str(arguments.picture))
    if loaded is None:
        raise SystemExit(f"{arguments.picture}: cannot be read")
    picture = working_picture(np.asarray(loaded[..., ::-1], dtype=np.uint8))
    grey = np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    camera = CameraModel(320, 240, 207.8, (0.3, 0.0, 1.1), np.deg2rad(25.0))
    pose = camera_pose(Pose(np.zeros(3), quaternion_from_euler(0.0, 0.0, 0.0)), camera)
    frame = Frame(0.0, picture, camera, pose, GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0])))
    lab, soft = smoothed(picture, 1.0)
    hidden = np.zeros(grey.shape, dtype=bool)
    soil = soil_reference(lab, hidden, knowledge.soil)
    found = binarize(lab, soft, soil, hidden, knowledge)
    blobs, _ = classify_blobs(grey, found, hidden, knowledge)
    windows, names = perceive(frame, knowledge).windows, knowledge.terrain_rules.input_names
    features = window_features(windows, names)
    parts: dict[str, Callable[[], object]] = {
        "whole frame": lambda: perceive(frame, knowledge),
        "low-pass and colour": lambda: smoothed(picture, 1.0),
        "soil reference": lambda: soil_reference(lab, hidden, knowledge.soil),
        "binarize": lambda: binarize(lab, soft, soil, hidden, knowledge),
        "blobs and certainty": lambda: classify_blobs(grey, found, hidden, knowledge),
        "outlines": lambda: outlines(blobs, 1.25),
        "window features": lambda: window_features(windows, names),
        "terrain rules": lambda: classify(features, knowledge.terrain_rules, knowledge.terrain.min_certainty),
        "co-occurrence, ours": lambda: window_texture(grey, WINDOW_PX),
        "co-occurrence, ours, 1 and 3 px": lambda: window_texture(grey, WINDOW_PX, (1, 3)),
        "co-occurrence, scikit-image": lambda: skimage_windows(grey),
    }
    print(f"{arguments.picture.name}: {len(blobs)} rocks")
    for name, work in parts.items():
        print(f"{median_ms(work, arguments.repeat):8.2f} ms  {name}")


if __name__ == "__main__":
    main()
