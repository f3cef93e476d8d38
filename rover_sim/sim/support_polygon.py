"""Which wheels span the polygon on which a rover stands."""

from __future__ import annotations

from worlds.types import FloatArray


def outline(points: FloatArray) -> tuple[int, ...]:
    """Places of the corners of the convex hull of ``points`` (n, 2), clockwise (Andrew's monotone chain, 1979)."""
    order = sorted(range(len(points)), key=lambda i: (points[i, 0], points[i, 1]))
    upper, lower = _chain(points, order), _chain(points, order[::-1])
    return (*upper[:-1], *lower[:-1])


def _chain(points: FloatArray, order: list[int]) -> list[int]:
    """Corners that turn right only; a point on a straight side is none."""
    corners: list[int] = []
    for i in order:
        while len(corners) > 1:
            a, b = points[corners[-1]] - points[corners[-2]], points[i] - points[corners[-2]]
            if a[0] * b[1] - a[1] * b[0] < -1e-12:
                break
            corners.pop()
        corners.append(i)
    return corners
