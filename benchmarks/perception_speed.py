"""Milliseconds of processor time a frame: all of perception, its stages, and its peers on the same picture.

    OMP_NUM_THREADS=1 uv run python benchmarks/perception_speed.py [PICTURE] [--repeat 60]

Without a picture a rendered one is taken; twice its size is measured too. Peers do the texture and the fuzzy part
only: scikit-image or mahotas co-occurrence of all windows, scikit-fuzzy's simulation of the terrain rules window by
window. Those that are not installed are named. A blur of the same picture is the floor to compare machines by.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np

from perception.class_definition import WINDOW_PX
from perception.knowledge_base import Knowledge, load_knowledge
from perception.pipeline import (
    View,
    classify_blobs,
    examine,
    on_ground,
    perceive,
    prepare,
    rock_pixels,
    working_picture,
)
from perception.rock_geometry import outlines
from perception.terrain_class import classify
from perception.texture import window_texture
from perception.window_features import window_features
from rover_sim.learning.rendered_views import make_world, rendered_views
from worlds.geometry import camera_pose, quaternion_from_euler
from worlds.types import ByteArray, CameraModel, Frame, GroundPlane, Pose

WARM_UP_S = 0.5
Work = Callable[[], object]


def median_ms(work: Work, repeat: int) -> float:
    """Median processor time of ``work`` in milliseconds, after one call to compile and half a second to warm up."""
    work()
    begin = time.process_time()
    while time.process_time() - begin < WARM_UP_S:
        work()
    times = []
    for _ in range(repeat):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return 1e3 * float(np.median(times))


def once_ms(work: Work) -> float:
    """Processor time of one call in milliseconds: scikit-fuzzy remembers answers, so a second one would be cheaper."""
    start = time.process_time()
    work()
    return 1e3 * (time.process_time() - start)


def sample_frame(picture: Path | None) -> Frame:
    """A frame of a picture file, or a rendered one."""
    if picture is None:
        return next(rendered_views(make_world(200, 0.0), 1)).frame
    loaded = cv2.imread(str(picture))
    if loaded is None:
        raise SystemExit(f"{picture}: cannot be read")
    camera = CameraModel(320, 240, 207.8, (0.3, 0.0, 1.1), np.deg2rad(25.0))
    pose = camera_pose(Pose(np.zeros(3), quaternion_from_euler(0.0, 0.0, 0.0)), camera)
    image = working_picture(np.asarray(loaded[..., ::-1], dtype=np.uint8))
    return Frame(0.0, image, camera, pose, GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0])))


def twice(frame: Frame) -> Frame:
    """The same view in twice the size."""
    camera = frame.camera
    double = CameraModel(
        2 * camera.width_px, 2 * camera.height_px, 2 * camera.focal_px, camera.position_b, camera.pitch_rad
    )
    image = cv2.resize(frame.image, (double.width_px, double.height_px), interpolation=cv2.INTER_CUBIC)
    return Frame(0.0, np.asarray(image, dtype=np.uint8), double, frame.camera_pose, frame.ground)


def stages(frame: Frame, know: Knowledge) -> dict[str, Work]:
    """The pipeline cut in pieces, in order."""
    assert frame.camera_pose is not None
    assert frame.ground is not None
    view, picture = View(frame.camera, frame.camera_pose, frame.ground), frame.image
    ready = prepare(picture, know, view)
    _, _, found = rock_pixels(ready, know)
    blobs, _ = classify_blobs(ready.grey, ready.even, found, ready.hidden, know)
    seen = examine(picture, know, view)
    names, least = know.terrain_rules.input_names, know.terrain.min_certainty
    features = window_features(seen.windows, names)
    return {
        "low-pass, colour, horizon, soil": lambda: prepare(picture, know, view),
        "rock pixels": lambda: rock_pixels(ready, know),
        "blobs, certainty, geometry": lambda: outlines(
            classify_blobs(ready.grey, ready.even, found, ready.hidden, know)[0], know.rock.round_ratio
        ),
        "classes": lambda: classify(window_features(seen.windows, names), know.terrain_rules, least),
        "  of which rules": lambda: classify(features, know.terrain_rules, least),
        "on the ground": lambda: on_ground(seen, view, 0.0, know),
        f"(co-occurrence of all windows; {len(blobs)} rocks)": lambda: window_texture(ready.grey, WINDOW_PX),
    }  # fmt: skip


def peers(grey: ByteArray, know: Knowledge) -> dict[str, Work]:
    """Texture and fuzzy rules by other packages, where they are installed."""
    windows = [
        np.ascontiguousarray(grey[row : row + WINDOW_PX, column : column + WINDOW_PX] >> 3)
        for row in range(0, grey.shape[0], WINDOW_PX)
        for column in range(0, grey.shape[1], WINDOW_PX)
    ]
    found: dict[str, Work] = {}
    if find_spec("skimage"):
        found["scikit-image co-occurrence, 3 measures"] = lambda: [_skimage(window) for window in windows]
    if find_spec("mahotas"):
        from mahotas.features import haralick  # type: ignore[import-not-found]

        found["mahotas Haralick"] = lambda: [haralick(window) for window in windows]
    if find_spec("skfuzzy"):
        found["scikit-fuzzy, terrain rules of 192 windows"] = _skfuzzy(know)
    return found


def _skimage(window: ByteArray) -> list[object]:
    from skimage.feature import graycomatrix, graycoprops

    angles = [0.0, np.pi / 4, np.pi / 2, 3 * np.pi / 4]
    matrix = graycomatrix(window, [1], angles, levels=32, symmetric=True, normed=True)  # type: ignore[no-untyped-call]
    return [graycoprops(matrix, name) for name in ("contrast", "ASM", "homogeneity")]  # type: ignore[no-untyped-call]


def _skfuzzy(know: Knowledge) -> Work:
    from perception.fuzzy import compute, to_skfuzzy

    simulation, base = to_skfuzzy(know.terrain_rules), know.terrain_rules
    rng = np.random.default_rng(0)
    samples = [{v.name: float(rng.uniform(v.low, v.high)) for v in base.inputs} for _ in range(192)]
    return lambda: [compute(simulation, base, sample) for sample in samples]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Milliseconds of processor time a frame.")
    parser.add_argument("picture", type=Path, nargs="?")
    parser.add_argument("--repeat", type=int, default=60)
    parser.add_argument("--knowledge", default="rendered")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)  # else processor time would add up over threads
    know, frame = load_knowledge(arguments.knowledge), sample_frame(arguments.picture)
    large, grey = twice(frame), np.asarray(cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    single = frame.image.astype(np.float32)
    table: dict[str, Work] = {
        "whole frame, 320 x 240": lambda: perceive(frame, know),
        "whole frame, 640 x 480": lambda: perceive(large, know),
        "floor: Gaussian blur of the picture, sigma 2, single precision": lambda: cv2.GaussianBlur(single, (0, 0), 2.0),
        **stages(frame, know),
    }
    for name, work in table.items():
        print(f"{median_ms(work, arguments.repeat):9.2f} ms  {name}", flush=True)
    for name, work in peers(grey, know).items():
        print(f"{once_ms(work):9.2f} ms  peer: {name}", flush=True)
    for package in ("skimage", "mahotas", "skfuzzy"):
        if not find_spec(package):
            print(f"             peer: {package} is not installed")


if __name__ == "__main__":
    main()
