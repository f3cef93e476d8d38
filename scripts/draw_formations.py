"""Draws docs/images/formations.png: each formation from above with its probing lines A0..A8, and the loft they give.

    uv run python scripts/draw_formations.py [OUT.png]

Outlines are the plain shapes of `worlds.rock_shape`, filled as blobs; axis, formation and diameters are then what
`perception.rock_geometry` measures in them, and the solids are lofted from those diameters by `worlds.rock_mesh`.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import cv2
import matplotlib as mpl
import numpy as np

from perception.blobs import Blobs, find_blobs
from perception.rock_geometry import RockOutlines, outlines
from worlds import rock_shape as shapes
from worlds.rock_mesh import PICTURE_LEVELS, rock_meshes
from worlds.types import FloatArray, HeightField, Rock, RockShape, RockTable

mpl.use("Agg")
from matplotlib import pyplot as plt

OUT = Path(__file__).resolve().parents[1] / "docs" / "images" / "formations.png"
SIZE_PX, DIAMETER_PX = 120, 66.0
NAMES = (
    "hemisphere", "ellipsoid", "egg", "wedge", "loaf", "spindle", "waisted", "shouldered", "unequal twins", "bullet",
)  # fmt: skip


def probed(formation: int) -> tuple[Blobs, RockOutlines]:
    """The blob that a formation makes seen from above, its axis in the middle of its sector, and what is measured."""
    length, width = shapes.base_extents(formation, DIAMETER_PX)
    yaw = (formation - 0.5) * shapes.SECTOR_RAD
    base = shapes.outlines(shapes.PROFILES[formation][None], *(np.array([v]) for v in (length, width, yaw)))[0]
    corners = np.column_stack([SIZE_PX / 2 + base[:, 0], SIZE_PX / 2 - base[:, 1]])
    picture = np.zeros((SIZE_PX, SIZE_PX), dtype=np.uint8)
    cv2.fillPoly(picture, [np.rint(corners - 0.5).astype(np.int32)], (1,))
    blobs = find_blobs(picture > 0)
    return blobs, outlines(blobs, 1.25)


def draw_probes(axes: Any, blobs: Blobs, shape: RockOutlines) -> None:
    """Blob, principal axis and the nine chords."""
    axes.imshow(blobs.labels > 0, cmap="copper_r", vmin=-0.1, vmax=2.5, extent=(0, SIZE_PX, SIZE_PX, 0))
    angle, centre = float(blobs.axis_rad[0]), blobs.centre_px[0]
    along, across = np.array([np.cos(angle), -np.sin(angle)]), np.array([np.sin(angle), np.cos(angle)])
    rows, columns = np.nonzero(blobs.labels)
    first = ((np.column_stack([columns, rows]) + 0.5 - centre) @ along).min()
    places = first + np.linspace(0.0, 1.0, 9) * (shape.length_px[0] - 1.0)
    axes.plot(*np.column_stack([centre - 48 * along, centre + 48 * along]), color="0.35", lw=0.8, ls="--")
    for number, (place, diameter) in enumerate(zip(places, shape.sections_px[0], strict=True)):
        middle = centre + place * along
        ends = np.column_stack([middle - across * diameter / 2, middle + across * diameter / 2])
        axes.plot(*ends, color="tab:blue", lw=1.4)
        axes.text(*(middle + across * (diameter / 2 + 6)), f"A{number}", fontsize=5.5, ha="center", va="center")
    axes.axis("off")


def lofted(formation: int, sections: FloatArray, yaw_rad: float) -> tuple[FloatArray, FloatArray]:
    """Vertices (V, 3) and faces (F, 3) of the solid of unit breadth that measured diameters give."""
    ratio = tuple((sections / sections.max()).tolist())
    aspect = 1.0 if formation == 0 else 1.6
    rock = Rock(1, (0.0, 0.0, 0.0), aspect, 1.0, 0.5, yaw_rad, RockShape(formation, ratio))
    flat = HeightField(np.zeros((5, 5)), 1.0, (-2.0, -2.0))
    mesh = rock_meshes(RockTable.of([rock]), flat, PICTURE_LEVELS)
    return mesh.vertices_m, mesh.faces.astype(np.float64)


def draw_loft(axes: Any, vertices: FloatArray, faces: FloatArray) -> None:
    """The solid above the ground, seen obliquely."""
    triangles = vertices[faces.astype(int)]
    triangles[..., 2] = np.maximum(triangles[..., 2], 0.0)
    shown = triangles[triangles[..., 2].max(axis=1) > 0.0]
    axes.plot_trisurf(*shown.reshape(-1, 3).T, triangles=np.arange(3 * len(shown)).reshape(-1, 3), color="#c9a27c",
                      edgecolor="#5b4632", linewidth=0.25, shade=True)  # fmt: skip
    axes.set(xlim=(-0.8, 0.8), ylim=(-0.8, 0.8), zlim=(0.0, 0.8))
    axes.set_box_aspect((1.6, 1.6, 0.8), zoom=1.25)
    axes.view_init(elev=28, azim=-70)
    axes.set_axis_off()


def main() -> None:
    """Draw all ten."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else OUT
    figure = plt.figure(figsize=(11.5, 8.4), dpi=90)
    for formation in range(10):
        blobs, shape = probed(formation)
        row, column = divmod(formation, 5)
        top = figure.add_subplot(4, 5, 10 * row + column + 1)
        draw_probes(top, blobs, shape)
        angle = np.rad2deg(blobs.axis_rad[0])
        label = f"{int(shape.formation[0])}: {NAMES[formation]}"
        top.set_title(label if formation == 0 else f"{label}, axis {angle:.0f}°", fontsize=9)
        solid = figure.add_subplot(4, 5, 10 * row + column + 6, projection="3d")
        draw_loft(solid, *lofted(formation, shape.sections_px[0], float(blobs.axis_rad[0])))
    figure.subplots_adjust(left=0.01, right=0.99, top=0.96, bottom=0.01, wspace=0.02, hspace=0.06)
    out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(out)
    print(f"wrote {out}")


if __name__ == "__main__":
    main()
