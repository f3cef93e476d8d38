"""Kinds of arguments that several commands take; each raises the argparse error that says what is allowed."""

from __future__ import annotations

import argparse


def seed(text: str) -> int:
    """A seed of worlds and noise."""
    if not text.isdecimal() or int(text) >= 2**32:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 0 to 4294967295")
    return int(text)


def worker_count(text: str) -> int:
    """A number of processes."""
    if not text.isdecimal() or not 1 <= int(text) <= 256:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 to 256")
    return int(text)
