"""Rock pixels against human outlines: IoU per picture, pooled and mean.

    uv run python benchmarks/rock_iou.py DATA/mars/rocks DATA/mars/rocks_all [--knowledge mars]

Each folder holds pictures and, beside each, ``NAME_mask.png`` with 255 = rock. Note that the shipped ``mars``
knowledge has its evidence from these very pictures: the figure says how well it fits, not how well it will do.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

from perception.knowledge_base import Knowledge, load_knowledge
from perception.pipeline import perceive
from worlds.types import BoolArray, ByteArray, CameraModel, Frame


def labelled_pictures(folder: Path) -> list[tuple[str, ByteArray, BoolArray]]:
    """Name, RGB picture and rock mask of every labelled picture in ``folder``."""
    found = []
    for mask_path in sorted(folder.glob("*_mask.png")):
        name = mask_path.name.removesuffix("_mask.png")
        path = next(p for p in (folder / f"{name}.png", folder / f"{name}.jpg") if p.is_file())
        picture, mask = cv2.imread(str(path)), cv2.imread(str(mask_path), cv2.IMREAD_GRAYSCALE)
        if picture is None or mask is None:
            raise SystemExit(f"{path}: cannot be read")
        found.append((name, np.asarray(picture[..., ::-1], dtype=np.uint8), np.asarray(mask > 127)))
    return found


def counts(picture: ByteArray, truth: BoolArray, knowledge: Knowledge) -> tuple[int, int, int]:
    """Pixels in both, only found, only true."""
    camera = CameraModel(picture.shape[1], picture.shape[0], float(picture.shape[1]))
    found = perceive(Frame(0.0, picture, camera), knowledge).mask
    return int((found & truth).sum()), int((found & ~truth).sum()), int((truth & ~found).sum())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Rock IoU against masks.")
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--knowledge", default="mars")
    parser.add_argument("--grey", action="store_true", help="take the colour away first")
    arguments = parser.parse_args()
    knowledge = load_knowledge(arguments.knowledge)
    for folder in arguments.folders:
        rows = []
        for name, picture, truth in labelled_pictures(folder):
            seen = np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), dtype=np.uint8) if arguments.grey else picture
            both, extra, missed = counts(seen, truth, knowledge)
            rows.append((both, extra, missed))
            print(f"{both / max(both + extra + missed, 1):.3f}  {name}")
        both, extra, missed = np.array(rows).sum(axis=0)
        mean = float(np.mean([b / max(b + e + m, 1) for b, e, m in rows]))
        print(
            f"{folder.name}: {len(rows)} pictures, pooled IoU {both / (both + extra + missed):.3f}, mean {mean:.3f}, "
            f"precision {both / (both + extra):.3f}, recall {both / (both + missed):.3f}"
        )


if __name__ == "__main__":
    main()
