"""Which label belongs to which picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from rover_sim.errors import InputError

ENDINGS = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".ppm", ".webp"})


def label_pairs(
    images: Path | Sequence[Path], labels: Path, label_of: Callable[[Path, Path], Path]
) -> list[tuple[Path, Path]]:
    """Pictures of the folder or folders ``images`` that have a label, with it, in the order of their names.

    ``label_of`` tells the label's path from the picture's and the folder of labels. Raises InputError for a missing
    folder and where no picture has a label.
    """
    folders = [images] if isinstance(images, Path) else list(images)
    for option, folder in (*(("--images", folder) for folder in folders), ("--labels", labels)):
        if not folder.is_dir():
            raise InputError(f"{option} {folder}: no such folder; give one with pictures and one with their labels")
    pictures = sorted(
        (path for folder in folders for path in folder.iterdir() if path.suffix.lower() in ENDINGS),
        key=lambda path: path.name,
    )
    pairs = [(path, label_of(path, labels)) for path in pictures]
    found = [(path, label) for path, label in pairs if label.is_file() and label != path]
    if not found:
        example = f"; {pairs[0][0].name} would have {pairs[0][1].name}" if pairs else ""
        names = ", ".join(map(str, folders))
        raise InputError(f"--images {names}: none of its {len(pairs)} pictures has a label in {labels}{example}")
    return found
