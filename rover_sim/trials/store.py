"""``results.sqlite``: a row a trial, written as it comes."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from rover_sim import __version__
from rover_sim.errors import InputError
from rover_sim.trials.trial import Row

NAME = "results.sqlite"
_COLUMNS = "key, suite, cell, seed, success, reason, metrics, error, wall_time_s, version"
_TABLE = """
CREATE TABLE IF NOT EXISTS trials(
    key TEXT PRIMARY KEY, suite TEXT, cell TEXT, seed INTEGER, success INTEGER, reason TEXT,
    metrics TEXT, error TEXT, wall_time_s REAL, version TEXT
)
"""


class Store:
    """The table of one folder; each row is on disk when `add` returns."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def add(self, row: Row) -> None:
        """Write a row; an earlier one of the same key gives way."""
        values = (
            row.key,
            row.suite,
            json.dumps(row.cell),
            row.seed,
            int(row.success),
            row.reason,
            json.dumps(row.metrics),
            row.error,
            row.wall_time_s,
            row.version,
        )
        with self._connection:
            self._connection.execute(f"INSERT OR REPLACE INTO trials({_COLUMNS}) VALUES(?,?,?,?,?,?,?,?,?,?)", values)

    def rows(self) -> list[Row]:
        """All rows, by key."""
        found = self._connection.execute(f"SELECT {_COLUMNS} FROM trials ORDER BY rowid")  # noqa: S608 - constants
        return [
            Row(key, suite, json.loads(cell), seed, bool(success), reason, json.loads(metrics), error, wall, version)
            for key, suite, cell, seed, success, reason, metrics, error, wall, version in found
        ]


@contextmanager
def open_store(folder: Path, *, resume: bool) -> Iterator[Store]:
    """The table in ``folder``; raises InputError for one that is not ours, or that exists without ``resume``."""
    path = folder / NAME
    if path.exists() and not resume:
        raise InputError(f"{path}: holds trials already; go on with --resume, or give another --out")
    with closing(sqlite3.connect(path)) as connection:
        try:
            connection.execute(_TABLE)
            _check(connection, path)
        except sqlite3.DatabaseError as error:
            raise InputError(f"{path}: not a table of trials ({error}); give another --out") from error
        yield Store(connection)


def _check(connection: sqlite3.Connection, path: Path) -> None:
    columns = [row[1] for row in connection.execute("PRAGMA table_info(trials)")]
    if columns != _COLUMNS.split(", "):
        raise InputError(f"{path}: its table has other columns, {', '.join(columns)}; give another --out")
    others = [row[0] for row in connection.execute("SELECT DISTINCT version FROM trials") if row[0] != __version__]
    if others:
        raise InputError(f"{path}: holds trials of version {others[0]}, this is {__version__}; give another --out")
