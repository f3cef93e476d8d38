"""What a user waits for: the help text, and the peak memory and time of the default run.

uv run python benchmarks/start_up.py
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time

PROGRAM = [sys.executable, "-c", "from rover_sim.cli import main; raise SystemExit(main())"]


def seconds(arguments: list[str]) -> float:
    """Wall time of one call of the program."""
    start = time.perf_counter()
    subprocess.run([*PROGRAM, *arguments], check=True, capture_output=True)  # noqa: S603 - our own program
    return time.perf_counter() - start


def main() -> None:
    """Print the figures, and the bare interpreter's start as the floor of the first."""
    start = time.perf_counter()
    for _ in range(5):
        subprocess.run([sys.executable, "-c", "pass"], check=True)
    floor = (time.perf_counter() - start) / 5
    helps = sorted(seconds(["--help"]) for _ in range(7))
    print(f"rover-sim --help: median {helps[3]:.3f} s, bare interpreter {floor:.3f} s")
    with tempfile.TemporaryDirectory() as folder:
        took = seconds(["run", "--out", folder])
    peak_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(f"rover-sim run: {took:.1f} s of wall time, peak memory {peak_mb:.0f} MB")


if __name__ == "__main__":
    main()
