"""What is due so often a second."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor


@dataclass
class Ticker:
    """Says when something is due, on whole periods since time zero."""

    rate_hz: float
    next: int = 0

    def due(self, time_s: float) -> bool:
        """Whether it is due; at most once a call, and missed periods are left out."""
        periods = floor(time_s * self.rate_hz + 1e-6)
        if periods < self.next:
            return False
        self.next = periods + 1
        return True
