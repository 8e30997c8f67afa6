"""Triangles and discs to pixels: fragments, of which the nearest in each pixel is kept."""

from collections.abc import Iterator

import numpy as np

from symrefine.geometry import Array
from symrefine.shape import Index

# Depth is kept in 31 bits above the number of what is seen, so that one minimum decides both.
_LEVELS = 2**31 - 1
_NOTHING = np.iinfo(np.int64).max
# Fragments made at a time.
_CHUNK = 2_000_000


class Raster:
    """What is seen in each of height x width pixels: the number of the nearest thing and its depth."""

    def __init__(self, width: int, height: int, near: float, far: float) -> None:
        self.width, self.height = width, height
        self._near, self._step = near, max(far - near, 1e-300) / _LEVELS
        self._keys = np.full(width * height, _NOTHING)

    def add(self, pixels: Index, depths: Array, numbers: Index) -> None:
        """Keep fragments that are nearer than what their pixels hold."""
        level = np.clip((depths - self._near) / self._step, 0, _LEVELS - 1).astype(np.int64)
        np.minimum.at(self._keys, pixels, (level << 32) | numbers)

    def depth(self) -> Array:
        """[H, W] depth, infinite where there is nothing."""
        depth = self._near + self._step * (self._keys >> 32)
        return np.where(self._keys == _NOTHING, np.inf, depth).reshape(self.height, self.width)

    def numbers(self) -> Index:
        """[H, W] number of what is seen, 0 where there is nothing."""
        return np.where(self._keys == _NOTHING, 0, self._keys & 0xFFFFFFFF).reshape(self.height, self.width)

    def discs(self, xy: Array, depth: Array, radius: Array, numbers: Index, *, bulge: Array | None = None) -> None:
        """Discs [N] around pixel coordinates; `bulge` [N] brings their middle that much nearer, as balls."""
        reach = int(np.ceil(radius.max(initial=0.0)))
        corner = np.floor(xy).astype(np.int64)
        for dy in range(-reach, reach + 1):
            for dx in range(-reach, reach + 1):
                x, y = corner[:, 0] + dx, corner[:, 1] + dy
                away2 = (x + 0.5 - xy[:, 0]) ** 2 + (y + 0.5 - xy[:, 1]) ** 2
                keep = (away2 <= radius**2) & (x >= 0) & (x < self.width) & (y >= 0) & (y < self.height)
                at = depth[keep]
                if bulge is not None:
                    at = at - bulge[keep] * np.sqrt(1.0 - away2[keep] / radius[keep] ** 2)
                self.add(y[keep] * self.width + x[keep], at, numbers[keep])

    def triangles(self, xy: Array, depth: Array, faces: Index) -> None:
        """Triangles `faces` [F, 3] of vertices at pixel coordinates [N, 2], numbered in their order.

        A triangle with a vertex behind the eye is left out.
        """
        corners, inverse = xy[faces], 1.0 / depth[faces]
        gradient = _gradients(corners, inverse)
        nearest, farthest = inverse.max(axis=1), inverse.min(axis=1)
        top, bottom = (self._first(edge(corners[:, :, 1], axis=1), self.height) for edge in (np.min, np.max))
        bottom = np.where(farthest > 0, bottom, top)
        for face, y in _runs(top, bottom - top, np.arange(len(faces))):
            start, stop = self._span(corners[face], y + 0.5)
            for span, x in _runs(start, np.maximum(stop - start, 0), np.arange(len(face))):
                number = face[span]
                g = gradient[number]
                at = g[:, 0] + g[:, 1] * (x + 0.5) + g[:, 2] * (y[span] + 0.5)
                self.add(y[span] * self.width + x, 1.0 / np.clip(at, farthest[number], nearest[number]), number)

    def _span(self, corners: Array, y: Array) -> tuple[Index, Index]:
        """First pixel and the one after the last that rows at heights y [S] share with triangles [S, 3, 2]."""
        a, b = corners, np.roll(corners, -1, axis=1)
        rise = b[:, :, 1] - a[:, :, 1]
        crosses = (np.minimum(a[:, :, 1], b[:, :, 1]) <= y[:, None]) & (
            y[:, None] <= np.maximum(a[:, :, 1], b[:, :, 1])
        )
        share = np.divide(y[:, None] - a[:, :, 1], rise, out=np.zeros_like(rise), where=rise != 0)
        x = a[:, :, 0] + share * (b[:, :, 0] - a[:, :, 0])
        left = np.where(crosses, x, np.inf).min(axis=1)
        right = np.where(crosses, x, -np.inf).max(axis=1)
        return self._first(left, self.width), self._first(right, self.width)

    @staticmethod
    def _first(edge: Array, size: int) -> Index:
        """The first of `size` pixels whose middle is not before an edge."""
        return np.asarray(np.clip(np.ceil(edge - 0.5), 0, size), dtype=np.int64)


def _gradients(corners: Array, values: Array) -> Array:
    """[F, 3] of value = g0 + g1 x + g2 y on each triangle; constant where it has no area."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    u, v = b - a, c - a
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    du, dv = values[:, 1] - values[:, 0], values[:, 2] - values[:, 0]
    flat = np.abs(area) < 1e-9
    area = np.where(flat, 1.0, area)
    gx = np.where(flat, 0.0, (du * v[:, 1] - dv * u[:, 1]) / area)
    gy = np.where(flat, 0.0, (dv * u[:, 0] - du * v[:, 0]) / area)
    return np.stack([values[:, 0] - gx * a[:, 0] - gy * a[:, 1], gx, gy], axis=1)


def _runs(start: Index, length: Index, owner: Index) -> Iterator[tuple[Index, Index]]:
    """Chunks of (owner, position) for every position of the runs start, start + 1, ... start + length - 1."""
    total = np.cumsum(length)
    first = 0
    while first < len(length):
        before = total[first - 1] if first else 0
        last = max(first + 1, int(np.searchsorted(total, before + _CHUNK, side="right")))
        n = length[first:last]
        offset = np.arange(int(n.sum())) - np.repeat(np.cumsum(n) - n, n)
        yield np.repeat(owner[first:last], n), np.repeat(start[first:last], n) + offset
        first = last
