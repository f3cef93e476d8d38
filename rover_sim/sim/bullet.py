"""PyBullet without its greeting: the library writes its build time to standard error when it is loaded."""

from __future__ import annotations

import os
import sys

_saved = os.dup(2)
_nowhere = os.open(os.devnull, os.O_WRONLY)
try:
    sys.stderr.flush()
    os.dup2(_nowhere, 2)
    import pybullet
finally:
    os.dup2(_saved, 2)
    os.close(_saved)
    os.close(_nowhere)

__all__ = ["pybullet"]
