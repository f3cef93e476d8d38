"""Parameters kept over restarts: a text file of one ``NAME VALUE`` a line, as ArduPilot's tools write it."""

from __future__ import annotations

from pathlib import Path

from rover_sim.autopilot.parameters import ParameterTable
from rover_sim.errors import InputError
from rover_sim.files import write_text


def save_parameters(path: Path, table: ParameterTable) -> None:
    """Write all parameters, whole or not at all."""
    write_text(path, "".join(f"{name} {table[name]!r}\n" for name in table.names))


def load_parameters(path: Path, table: ParameterTable) -> None:
    """Set what the file says; raises InputError, and sets nothing, for a line that is wrong."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    values = {}
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        name, _, text = line.replace(",", " ").strip().partition(" ")
        if name not in table:
            raise InputError(f"{path}: line {number}: no parameter is called {name!r}")
        try:
            values[name] = float(text)
        except ValueError:
            values[name] = float("nan")
        if not table.takes(name, values[name]):
            entry = table.describe(name)
            raise InputError(f"{path}: line {number}: {name} = {text!r}; allowed: {entry.low:g} to {entry.high:g}")
    for name, value in values.items():
        table.set(name, value)
