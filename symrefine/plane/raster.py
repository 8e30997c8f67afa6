"""Pixels among points: the grid that weighted points stand on, and the outlines of what they show."""

from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, ReadOnly
from symrefine.samples import COUNT
from symrefine.shape import Index
from symrefine.surface.tree import Tree

# Points that make a grid, and the share of their weight that must have a neighbour one step away.
FEWEST, JOINED = 64, 0.9
# Cells of the grid for each point, at most: points rounded to a few digits stand on a grid too, an empty one.
SPARSE = 50
# Deviation from the grid, in steps.
_OFF = 0.02


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Raster(ReadOnly):
    """Weights [H, W] on a square grid; the cell (row, column) is centred at `origin + column * step + row * turned`,
    where `turned` is `step` turned by +90 degrees."""

    values: Array
    origin: Array
    step: Array

    @property
    def pitch(self) -> float:
        """Side of a cell."""
        return float(np.hypot(*self.step))

    def place(self, row: Array, column: Array) -> Array:
        """Points [N, 2] of space at fractional rows and columns [N]."""
        turned = np.array([-self.step[1], self.step[0]])
        return self.origin + np.multiply.outer(column, self.step) + np.multiply.outer(row, turned)


def raster_of(points: Array, weights: Array | None) -> Raster | None:
    """The grid that points [N, 2] stand on, upright or turned, or None: they are samples or stand for themselves."""
    if len(points) < FEWEST:
        return None
    steps = (step for find in (_upright_step, _turned_step) if (step := find(points)) is not None)
    found = next((grid for step in steps if (grid := _on_grid(points, step)) is not None), None)
    if found is None:
        return None
    row, column, origin, step = found
    values = np.zeros((row.max() + 1, column.max() + 1))
    np.add.at(values, (row, column), 1.0 if weights is None else weights)
    return Raster(values=values, origin=origin, step=step) if _is_joined(values) else None


def _upright_step(points: Array) -> Array | None:
    steps = [np.diff(np.unique(points[:, axis])) for axis in (0, 1)]
    gaps = np.concatenate([s[s > 1e-9 * np.ptp(points)] for s in steps])
    return np.array([float(gaps.min()), 0.0]) if gaps.size else None


def _turned_step(points: Array) -> Array | None:
    """The step whose direction and length the nearest neighbours agree on."""
    some = points[:: max(1, len(points) // COUNT)]
    distance, near = (column[:, 0] for column in Tree(points).query(some, 1, skip=1))
    pitch = float(np.median(distance))
    close = np.abs(distance - pitch) < _OFF * pitch
    if pitch == 0.0 or close.mean() < JOINED:
        return None
    apart = (points[near] - some)[close] @ np.array([1.0, 1j])
    fourfold = complex(np.mean((apart / np.abs(apart)) ** 4))
    if abs(fourfold) < 1.0 - _OFF:
        return None
    along = pitch * np.exp(0.25j * np.angle(fourfold))
    return np.array([along.real, along.imag])


def _on_grid(points: Array, step: Array) -> tuple[Index, Index, Array, Array] | None:
    """Row and column of each point, origin and the step fitted to all of them; None if one point is off the grid."""
    start = points[len(points) // 2]
    z = (points - start) @ np.array([1.0, 1j]) / complex(*step)
    if max(np.ptp(z.real), np.ptp(z.imag)) > 1e6:
        return None
    cell = np.round(z.real) + 1j * np.round(z.imag)
    if np.abs(z - cell).max() > 0.4:
        return None
    centred = cell - cell.mean()
    scale = np.vdot(centred, z) / max(float(np.vdot(centred, centred).real), 1e-300)
    shift = z.mean() - scale * cell.mean()
    if np.abs(z - scale * cell - shift).max() > _OFF or abs(scale - 1.0) > _OFF:
        return None
    column, row = cell.real.astype(np.int64), cell.imag.astype(np.int64)
    corner = complex(column.min(), row.min())
    column, row = column - column.min(), row - row.min()
    if (float(column.max()) + 1.0) * (float(row.max()) + 1.0) > SPARSE * len(points) + 4096:
        return None
    along = complex(*step) * scale
    first = complex(*step) * (scale * corner + shift)
    return row, column, start + np.array([first.real, first.imag]), np.array([along.real, along.imag])


def _is_joined(values: Array) -> bool:
    padded = np.pad(values > 0, 1)
    beside = padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
    return bool(np.average(beside, weights=values) >= JOINED)


def coarser(raster: Raster, longest: int) -> Raster:
    """The raster with blocks of cells averaged until no side is longer than `longest`."""
    by = -(-max(raster.values.shape) // longest)
    if by == 1:
        return raster
    rows, columns = (-(-n // by) for n in raster.values.shape)
    padded = np.zeros((rows * by, columns * by))
    padded[: raster.values.shape[0], : raster.values.shape[1]] = raster.values
    blocks = padded.reshape(rows, by, columns, by).mean(axis=(1, 3))
    middle = np.array(0.5 * (by - 1))
    return Raster(values=blocks, origin=raster.place(middle, middle), step=by * raster.step)


def between(raster: Raster) -> Raster:
    """What pixels half a step aside would show: the means of four neighbours, at the corners that they share."""
    padded = np.pad(raster.values, 1)
    means = 0.25 * (padded[1:, 1:] + padded[:-1, 1:] + padded[1:, :-1] + padded[:-1, :-1])
    corner = np.array(-0.5)
    return Raster(values=means, origin=raster.place(corner, corner), step=raster.step)


def outlines(raster: Raster, levels: Array) -> list[Array]:
    """Points [M, 2] where neighbouring cells lie on both sides of a level, interpolated; for each level."""
    padded = np.pad(raster.values, 1)
    found = []
    for level in levels:
        row, column = _crossings(padded, level)
        down, along = _crossings(padded.T, level)
        rows, columns = np.concatenate([row, along]), np.concatenate([column, down])
        found.append(raster.place(rows - 1.0, columns - 1.0))
    return found


def _crossings(values: Array, level: float) -> tuple[Array, Array]:
    """Where horizontal neighbours lie on both sides of the level."""
    inside = values >= level
    row, column = np.nonzero(inside[:, 1:] != inside[:, :-1])
    left, right = values[row, column], values[row, column + 1]
    return row.astype(np.float64), column + (level - left) / (right - left)
