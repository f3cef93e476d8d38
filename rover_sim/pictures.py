"""Pictures of any common kind, read to 8-bit grey or RGB."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rover_sim.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from worlds.types import ByteArray

ALLOWED = "a PNG, JPEG, TIFF, BMP, PGM/PPM or WebP picture of 8 or 16 bits"
_SIXTEEN_BIT_RANGES = (1023, 4095, 16383, 65535)  # 10, 12, 14 and 16 bits in a 16-bit file
_TAIL = 4096  # bytes in which the end mark of a whole file stands


def read_picture(path: Path) -> ByteArray:
    """Grey (H, W) or RGB (H, W, 3) of a picture file; transparent pixels come out black, which means no data.

    16-bit values are divided by the full range of the smallest of 10, 12, 14 and 16 bits that holds their maximum.
    Raises InputError for what is missing, no picture, cut off, or of another kind.
    """
    import cv2
    import numpy as np

    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give {ALLOWED}") from error
    if _cut_off(data):
        raise InputError(f"{path}: the file is cut off; give {ALLOWED}")
    loudness = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # what is wrong is told in one line, here
    try:
        picture = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    except cv2.error as error:
        reason = " ".join(str(error.err).split())
        raise InputError(f"{path}: cannot be decoded ({reason}); give {ALLOWED}") from error
    finally:
        cv2.utils.logging.setLogLevel(loudness)
    if picture is None:
        raise InputError(f"{path}: not a picture that can be decoded; give {ALLOWED}")
    if picture.dtype not in {np.dtype(np.uint8), np.dtype(np.uint16)}:
        raise InputError(f"{path}: has {picture.dtype} values; give {ALLOWED}")
    return _to_rgb(_to_bytes(picture))


def _cut_off(data: bytes) -> bool:
    """Whether a PNG or JPEG lacks its end mark."""
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        return b"IEND" not in data[-_TAIL:]
    return data.startswith(b"\xff\xd8") and b"\xff\xd9" not in data[-_TAIL:]


def _to_bytes(picture: NDArray[Any]) -> ByteArray:
    import numpy as np

    if picture.dtype == np.uint8:
        return np.asarray(picture, dtype=np.uint8)
    brightest = int(picture[..., :3].max()) if picture.ndim == 3 else int(picture.max())
    full = next(limit for limit in _SIXTEEN_BIT_RANGES if brightest <= limit)
    return np.asarray(np.clip(picture.astype(np.float32) * (255.0 / full) + 0.5, 0, 255), dtype=np.uint8)


def _to_rgb(picture: ByteArray) -> ByteArray:
    import numpy as np

    if picture.ndim == 2:
        return picture
    channels = picture.shape[2]
    if channels in {2, 4}:
        picture = np.where(picture[..., -1:] > 0, picture[..., :-1], np.uint8(0)).astype(np.uint8)
    return picture[..., 0] if picture.shape[2] == 1 else np.ascontiguousarray(picture[..., 2::-1])
