"""What became of a planned path that was driven in simulation."""

from __future__ import annotations

from enum import StrEnum


class Verdict(StrEnum):
    """Of one path; the values are those of the JSON file."""

    VERIFIED = "verified"  # driven safely, beside all rocks too high to climb, over ground that the picture shows
    UNSEEN = "unseen"  # driven safely, but partly where the picture shows no ground that it can judge
    FAILED = "failed"
