"""Command line: one parser, each command imported only when it runs."""

from __future__ import annotations


def main() -> int:
    """Run the command line; the return value is the exit code."""
    return 0
