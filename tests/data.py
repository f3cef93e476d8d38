"""Where the real pictures and maps are; tests that need them skip, and say so, where they are not."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

_BESIDE_THE_REPOSITORY = Path(__file__).resolve().parents[2] / "shared" / "data"


def data_path(*parts: str) -> Path:
    """The file or folder of those parts; skips the test where it is missing (set ROVER_SIM_DATA to its root)."""
    path = Path(os.environ.get("ROVER_SIM_DATA", _BESIDE_THE_REPOSITORY)).joinpath(*parts)
    if not path.exists():
        pytest.skip(f"needs {Path(*parts)} of the data collection; set ROVER_SIM_DATA to its folder")
    return path
