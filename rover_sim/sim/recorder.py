"""Columns of numbers that grow row by row and are saved as one array each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_sim.files import atomic_path


class TraceRecorder:
    """Collects rows; every row must have the columns of the first."""

    def __init__(self) -> None:
        self._columns: dict[str, list[ArrayLike]] = {}

    def add(self, **row: ArrayLike) -> None:
        """Append one row of scalars or small arrays; raises ValueError where its columns are not the first row's."""
        if not self._columns:
            self._columns = {name: [] for name in row}
        if row.keys() != self._columns.keys():
            raise ValueError(f"trace columns changed: {sorted(row.keys() ^ self._columns.keys())}")
        for name, value in row.items():
            self._columns[name].append(value)

    def __len__(self) -> int:
        """Rows so far."""
        return len(next(iter(self._columns.values()), []))

    def arrays(self) -> dict[str, NDArray[np.float64]]:
        """One array a column: (rows,) for scalars, (rows, n) for vectors."""
        return {name: np.asarray(values, dtype=np.float64) for name, values in self._columns.items()}

    def save(self, path: Path) -> None:
        """Write all columns as a compressed npz, atomically; equal rows give equal bytes."""
        with atomic_path(path) as temporary:
            columns: dict[str, Any] = dict(self.arrays())  # the stub takes keywords for the option of the same call
            np.savez_compressed(temporary, **columns)
