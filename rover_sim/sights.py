"""What the camera saw during a traverse: one telling picture, and the video if it was asked for."""

from __future__ import annotations

from pathlib import Path
from typing import Self

import cv2

from perception.pipeline import View
from rover_sim.errors import InputError
from rover_sim.files import atomic_path
from rover_sim.onboard import Sight
from rover_sim.picture_paths import in_picture
from rover_sim.report.perceived_overlay import draw_overlay
from worlds.types import ByteArray


def overlay(sight: Sight) -> ByteArray:
    """The picture (RGB) with rocks, terrain classes, the chosen way and the other candidates drawn in."""
    frame, decision = sight.frame, sight.decision
    if frame.camera_pose is None or frame.ground is None:
        return draw_overlay(frame.image, sight.perception, ())
    view = View(frame.camera, frame.camera_pose, frame.ground)
    ways = [decision.waypoints_w, *(candidate.waypoints_w for candidate in decision.candidates)]
    paths = [path.points_px for way in ways if len(way) > 1 and (path := in_picture(way, 0.0, view)) is not None]
    return draw_overlay(frame.image, sight.perception, paths)


class Sights:
    """Takes every sight of a traverse; a context manager, as the video must be finished."""

    def __init__(self, half_way_s: float, video: Path | None, rate_hz: float) -> None:
        self._half_way_s = half_way_s
        self._video, self._rate_hz = video, rate_hz
        self._writer: cv2.VideoWriter | None = None
        self._telling: Sight | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._writer is not None:
            self._writer.release()

    def take(self, sight: Sight) -> None:
        """Look at one sight."""
        kept = self._telling
        # The last picture of a drive before half way tells most; any other is better than none.
        if kept is None or (sight.decision.kind == "drive" and sight.frame.time_s <= self._half_way_s):
            self._telling = sight
        if self._video is not None:
            self._write(overlay(sight), self._video)

    def save(self, path: Path) -> None:
        """Write the telling picture as a PNG, atomically; nothing where no picture was taken."""
        if self._telling is not None:
            with atomic_path(path) as temporary:
                cv2.imwrite(str(temporary), overlay(self._telling)[..., ::-1])

    def _write(self, picture: ByteArray, video: Path) -> None:
        if self._writer is None:
            size = picture.shape[1], picture.shape[0]
            self._writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"mp4v"), self._rate_hz, size)
            if not self._writer.isOpened():
                raise InputError(f"--record-video: {video} cannot be written as MP4 by this OpenCV build")
        self._writer.write(picture[..., ::-1])
