"""Kinds of arguments that several commands take; each raises the argparse error that says what is allowed."""

from __future__ import annotations

import argparse
from math import isfinite, nan


def seed(text: str) -> int:
    """A seed of worlds and noise."""
    if not text.isdecimal() or int(text) >= 2**32:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 0 to 4294967295")
    return int(text)


def sun_deg(text: str) -> tuple[float, float]:
    """Elevation and azimuth of the sun in degrees."""
    try:
        elevation, azimuth = (float(part) for part in text.split(","))
    except ValueError:
        elevation = azimuth = nan
    if not (2.0 <= elevation <= 90.0 and -360.0 <= azimuth <= 360.0):
        raise argparse.ArgumentTypeError(f"{text!r} is not ELEVATION,AZIMUTH in degrees: 2 to 90, -360 to 360")
    return elevation, azimuth


def worker_count(text: str) -> int:
    """A number of processes."""
    if not text.isdecimal() or not 1 <= int(text) <= 256:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 to 256")
    return int(text)


def seconds(text: str) -> float:
    """A time to wait."""
    try:
        value = float(text)
    except ValueError:
        value = nan
    if not (isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds above 0")
    return value


def factor(text: str) -> float:
    """A speed in multiples of the wall clock's."""
    try:
        value = float(text)
    except ValueError:
        value = nan
    if not 0.1 <= value <= 20.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from 0.1 to 20")
    return value
