"""Pictures drawn at random and files damaged at random: an answer or one line, never a crash."""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
from pathlib import Path

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_sim.cli import main
from worlds.types import ByteArray

KINDS = ("noise", "constant", "stripes", "ramp", "blots")
SUFFIXES = (".png", ".jpg", ".tiff", ".webp", ".bmp")


def drawn(kind: str, shape: tuple[int, int], channels: int, bits: int, seed: int) -> np.ndarray:
    """(H, W) or (H, W, C) of 8 or 16 bits, extremes included."""
    rng = np.random.default_rng(seed)
    full = 2**bits - 1
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    plane = {
        "noise": rng.integers(0, full + 1, shape),
        "constant": np.full(shape, rng.choice([0, 1, full // 2, full])),
        "stripes": (rows // int(rng.integers(1, 40)) % 2) * full,
        "ramp": (rows * 3 + columns * int(rng.integers(0, 5))) % (full + 1),
        "blots": (rng.random(shape) < 0.01) * full,
    }[kind]
    if channels == 1:
        return np.asarray(plane, dtype=f"uint{bits}")
    tints = rng.random(channels) if kind != "constant" else np.ones(channels)
    return np.asarray(plane[..., None] * tints, dtype=f"uint{bits}")


def looked_at(data: bytes, suffix: str) -> tuple[int, str, str | None]:
    """Exit code, what was told as an error, and the answer's text if there is one."""
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stderr(io.StringIO()) as told:
        path = Path(folder) / f"a{suffix}"
        path.write_bytes(data)
        with contextlib.redirect_stdout(io.StringIO()):
            code = main(["perceive", str(path), "--out", f"{folder}/out", "--workers", "1"])
        answer = Path(folder) / "out" / "a.json"
        return code, told.getvalue(), answer.read_text(encoding="utf-8") if answer.exists() else None


@given(
    kind=st.sampled_from(KINDS),
    shape=st.tuples(st.integers(1, 400), st.integers(1, 500)),
    channels=st.sampled_from([1, 3, 4]),
    bits=st.sampled_from([8, 16]),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=25, deadline=None, derandomize=True)
def test_any_picture_has_an_answer(kind: str, shape: tuple[int, int], channels: int, bits: int, seed: int) -> None:
    data = cv2.imencode(".png", drawn(kind, shape, channels, bits, seed))[1].tobytes()
    code, told, answer = looked_at(data, ".png")
    assert (code, told) == (0, "")
    assert answer is not None
    table = json.loads(answer)
    assert set("".join(table["classes"])) <= set("SVmMBU")
    assert all(np.isfinite(rock["centroid_px"]).all() for rock in table["rocks"])


@given(data=st.data(), suffix=st.sampled_from(SUFFIXES), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None, derandomize=True)
def test_any_damage_to_a_file_is_an_answer_or_one_line(data: st.DataObject, suffix: str, seed: int) -> None:
    picture: ByteArray = drawn("noise", (60, 80), 3, 8, seed)
    whole = bytearray(cv2.imencode(suffix, picture)[1].tobytes())
    for _ in range(data.draw(st.integers(1, 6))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    kept = data.draw(st.integers(0, len(whole)))
    code, told, answer = looked_at(bytes(whole[: max(kept, 1)] if data.draw(st.booleans()) else whole), suffix)
    assert (code == 0) == (answer is not None)
    assert code in {0, 2}
    assert len(told.splitlines()) == (code == 2)
