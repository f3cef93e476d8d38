"""The tables of docs/sensors.md against the code."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from worlds.fault_events import Event
from worlds.sensor_tables import Actuator, Barometer, Encoder, Gnss, Imu, Magnetometer

TEXT = (Path(__file__).parent.parent / "docs" / "sensors.md").read_text(encoding="utf-8")


def shown(value: object) -> str:
    if value is None:
        return "not set"
    if isinstance(value, str):
        return f'"{value}"'
    return str(list(value)) if isinstance(value, tuple) else str(value)


@pytest.mark.parametrize("table", [Imu(), Magnetometer(), Barometer(), Gnss(), Encoder(), Actuator()])
def test_every_key_is_told_with_its_default(table: msgspec.Struct) -> None:
    name = type(table).__name__.lower()
    prefix = f"{name}." if name in ("encoder", "actuator") else ""
    begin = 0 if prefix else TEXT.index(f"### `[{name}]`")
    for key in table.__struct_fields__:
        assert f"| `{prefix}{key}` | {shown(getattr(table, key))} |" in TEXT[begin:], key


def test_every_detail_of_an_event_is_told() -> None:
    for key in Event.__struct_fields__:
        assert key in TEXT, key
