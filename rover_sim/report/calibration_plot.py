"""Picture of a calibration: where the boards were seen, what errors are left, and how the lens bends."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from perception.calibration import Calibration
from perception.camera import rays_c
from worlds.types import FloatArray

_ARROW = 50.0  # errors are drawn so many times as large


def save_calibration(path: Path, found: Calibration, boards_px: Sequence[FloatArray], names: Sequence[str]) -> None:
    """Save points with enlarged errors, the error of each picture, and the shift by the lens as a PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 4.5), layout="constrained")
    seen, bars, shift = figure.subplots(1, 3)
    camera = found.camera
    for points, residual, use in zip(boards_px, found.residual_px, found.used, strict=True):
        seen.plot(*points.T, ".", color="tab:blue" if use else "tab:red", markersize=2)
        seen.quiver(*points.T, *residual.T, angles="xy", scale_units="xy", scale=1 / _ARROW, width=0.002)
    seen.set(xlim=(0, camera.width_px), ylim=(camera.height_px, 0), aspect="equal", xlabel="px", ylabel="px")
    seen.set_title(f"points seen, errors x {_ARROW:.0f}; red: left out")
    colours = ["tab:blue" if use else "tab:red" for use in found.used]
    bars.barh(np.arange(len(names)), found.error_px, color=colours)
    bars.set_yticks(np.arange(len(names)), [name[:24] for name in names], fontsize=6)
    bars.invert_yaxis()
    bars.set(xlabel="rms error, px", title=f"{found.rms_px:.3f} px rms")
    _draw_shift(shift, found)
    figure.savefig(path, dpi=100)


def _draw_shift(axes: object, found: Calibration) -> None:
    """Contours of how far a pixel lies from where a pinhole of the same focal length would put it."""
    camera = found.camera
    assert camera.lens is not None
    columns, rows = np.linspace(0, camera.width_px, 65), np.linspace(0, camera.height_px, 49)
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1)
    focal = camera.focal_px * np.array([1.0, camera.lens.aspect])
    ideal = rays_c(camera, pixels)[..., :2] * focal + camera.centre_px
    away = np.ma.masked_invalid(np.linalg.norm(ideal - pixels, axis=-1))
    lines = axes.contour(columns, rows, away, levels=8)  # type: ignore[attr-defined]
    axes.clabel(lines, fontsize=7)  # type: ignore[attr-defined]
    axes.set(  # type: ignore[attr-defined]
        xlim=(0, camera.width_px), ylim=(camera.height_px, 0), aspect="equal", title="bent by the lens, px"
    )
