"""Volumes, .nii .nrrd .mrc and .map: intensities on a grid, as a surface in space or as weighted voxels.

Frame and unit are those that the header gives: every voxel stands where its affine map puts it, by its middle.
Grey values run from 0, the lowest intensity, to 1, the highest. What carries the mass is chosen as it is of a mesh:

- `surface`, as a rule: where the grey value crosses the threshold (Otsu's, if none is given), points on the lines
  between neighbouring voxels, with the gradient as normal. Lines of a direction u meet a surface of normal n in numbers
  that go as |u.n|; the weights take that back, so that each point stands for the area around it.
- `solid`: voxels weigh as much as they differ from the background, as pixels of pictures do; all the same, if a
  threshold makes them so.

Where that would be more than `ENOUGH` points, blocks of voxels become one, by their mean: nothing is left out.
"""

import logging
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.load.content import Content, Wanted
from symrefine.load.image import otsu, pixel_weights

_LOG = logging.getLogger(__name__)

# 512^3, a large tomogram; its intensities take half a gigabyte.
LARGEST = 2**27
# Points: symmetries are decided by fewer.
ENOUGH = 200_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Volume:
    """Intensities on a grid, and where it lies.

    Args:
        values: [A, B, C] intensities.
        axes: [3, 3] steps from one voxel to the next along each axis of the grid, as columns.
        origin: [3] the middle of the first voxel.
    """

    values: NDArray[np.float32]
    axes: Array
    origin: Array


def check_size(shape: tuple[int, ...]) -> None:
    """Refuse a grid that is none, or too large, before memory is taken for it."""
    told = " x ".join(map(str, shape))
    if len(shape) != 3 or min(shape, default=0) < 2:
        raise InputError(f"has {told or 'no'} voxels; expected a grid of three axes, each of two voxels or more")
    if np.prod(shape, dtype=np.float64) > LARGEST:
        raise InputError(f"has {told} voxels; at most {LARGEST:,} in all: scale it down")


def volume_content(volume: Volume, wanted: Wanted) -> Content:
    """Points of the surface in a volume, with normals and weights, or its voxels with weights.

    Raises:
        InputError: intensities that are not finite, or all the same; axes that span no space; a threshold at which
            nothing begins; `invert` for a surface, which would be the same.
    """
    if not (np.isfinite(volume.origin).all() and _spans_space(volume.axes)):
        raise InputError(f"the axes of the grid are {volume.axes.T.tolist()}; expected three that span space")
    if wanted.measure == "solid":
        return _solid(_grey(volume.values), volume, wanted)
    if wanted.invert:
        raise InputError(
            "invert leaves a surface as it is; take measure 'solid' to weigh the background, or leave it out"
        )
    return _surface(_grey(volume.values), volume, wanted)


def _grey(values: NDArray[np.float32]) -> NDArray[np.float32]:
    low, high = float(values.min()), float(values.max())
    if not (np.isfinite(low) and np.isfinite(high)):
        bad = ~np.isfinite(values)
        raise InputError(
            f"voxel {np.argwhere(bad)[0].tolist()} is {values[bad][0]} ({int(bad.sum())} such of {values.size}); "
            "intensities must be finite: put the background there"
        )
    if low == high:
        raise InputError(f"all {values.size} voxels have the same intensity {low:g}: there is no object")
    grey: NDArray[np.float32] = values - np.float32(low)
    grey /= np.float32(high - low)  # in place: a second copy of a large volume would be a gigabyte
    return grey


def _spans_space(axes: Array) -> bool:
    """Whether the axes of a grid are three in space, in numbers whose products can be told."""
    longest = float(np.abs(axes).max())
    return 0.0 < longest < np.inf and float(np.linalg.det(axes / longest)) != 0.0


def _surface(grey: NDArray[np.float32], volume: Volume, wanted: Wanted) -> Content:
    level = wanted.threshold if isinstance(wanted.threshold, float | int) else otsu(grey)
    steps = np.ones(3, dtype=np.int64)
    while (crossings := sum(int(_crossed(grey, axis, level).sum()) for axis in range(3))) > ENOUGH:
        wider = _wider(volume.axes, steps, (crossings / ENOUGH) ** 0.5)
        del grey  # or a large volume would be held once more
        grey, steps = _averaged(_grey(volume.values), wider), wider
    if not crossings:
        raise InputError(f"no grey value crosses the threshold {level:.3g}; choose another from 0 to 1")
    places, normals = (np.concatenate(parts) for parts in zip(*(_met(grey, a, level) for a in range(3)), strict=True))
    axes = volume.axes * steps
    _tell(steps, crossings)
    # Gradients are covectors; an area grows by the determinant times the length of its covector.
    covectors = normals @ np.linalg.inv(axes)
    lengths = np.linalg.norm(covectors, axis=1)
    return Content(
        points=volume.origin + (places * steps + 0.5 * (steps - 1)) @ volume.axes.T,
        normals=covectors / lengths[:, None],
        weights=abs(np.linalg.det(axes)) * lengths / np.abs(normals).sum(axis=1),
    )


def _crossed(grey: NDArray[np.float32], axis: int, level: float) -> NDArray[np.bool_]:
    """Whether the level lies between each voxel and its next neighbour along an axis."""
    above = np.moveaxis(grey >= level, axis, 0)
    return np.moveaxis(above[:-1] != above[1:], 0, axis)


def _met(grey: NDArray[np.float32], axis: int, level: float) -> tuple[Array, Array]:
    """Where lines along an axis of the grid meet the level, [N, 3] in voxels, and the gradient there."""
    first = np.argwhere(_crossed(grey, axis, level))
    second = first + np.eye(3, dtype=np.int64)[axis]
    low, high = (grey[tuple(voxels.T)].astype(np.float64) for voxels in (first, second))
    share = ((level - low) / (high - low))[:, None]
    gradient = (1.0 - share) * _gradient(grey, first) + share * _gradient(grey, second)
    # Central differences may vanish or turn round in sheets of one voxel; the difference across the level does not.
    across = high - low
    thin = gradient[:, axis] * across <= 0.0
    gradient[thin, axis] = across[thin]
    return first + share * (second - first), gradient


def _gradient(grey: NDArray[np.float32], voxels: NDArray[np.int64]) -> Array:
    """Differences between the neighbours of voxels [N, 3], a step of the grid being the unit."""
    gradient = np.empty(voxels.shape)
    for axis, step in enumerate(np.eye(3, dtype=np.int64)):
        before, after = np.maximum(voxels - step, 0), np.minimum(voxels + step, np.array(grey.shape) - 1)
        rise = grey[tuple(after.T)].astype(np.float64) - grey[tuple(before.T)]
        gradient[:, axis] = rise / (after - before)[:, axis]
    return gradient


def _solid(grey: NDArray[np.float32], volume: Volume, wanted: Wanted) -> Content:
    weights = pixel_weights(grey, threshold=wanted.threshold, invert=wanted.invert)
    if not weights.any() or np.ptp(weights) == 0.0:
        raise InputError("nothing stands out from the background; choose a threshold from 0 to 1")
    steps = np.ones(3, dtype=np.int64)
    while (heavy := int(np.count_nonzero(_blocks(weights, steps).any(axis=(1, 3, 5))))) > ENOUGH:
        steps = _wider(volume.axes, steps, (heavy / ENOUGH) ** (1 / 3))
    _tell(steps, heavy)
    masses, places = _centres(_blocks(weights, steps))
    return Content(points=volume.origin + places @ volume.axes.T, weights=masses)


def _centres(blocks: NDArray[Any]) -> tuple[Array, Array]:
    """What each block that weighs anything weighs, [N], and the centre of that, [N, 3] in voxels.

    Its centre and not its middle: moments of order one stay what they are.
    """
    masses = blocks.sum(axis=(1, 3, 5), dtype=np.float64)
    heavy = np.nonzero(masses)
    places = np.empty((len(heavy[0]), 3))
    for k in range(3):
        inside = 2 * k + 1
        others = tuple(axis for axis in (1, 3, 5) if axis != inside)
        # Sums over the other axes first leave one axis of the block, behind the axes of blocks up to its own.
        layers = np.moveaxis(blocks.sum(axis=others, dtype=np.float64), k + 1, -1)
        size = blocks.shape[inside]
        places[:, k] = heavy[k] * size + (layers @ np.arange(size))[heavy] / masses[heavy]
    return masses[heavy], places


def _wider(axes: Array, steps: NDArray[np.int64], factor: float) -> NDArray[np.int64]:
    """Voxels of larger blocks, about as long along each axis of the grid, `factor` times as large or a little more."""
    lengths = np.linalg.norm(axes, axis=0)
    edge = factor * float((steps * lengths).min())
    wider = np.maximum(np.rint(edge / lengths), 1).astype(np.int64)
    return wider if (wider > steps).any() else steps + (steps * lengths == (steps * lengths).min())


def _averaged(grey: NDArray[np.float32], steps: NDArray[np.int64]) -> NDArray[np.float32]:
    """Means over blocks; the last ones go on with what the edge of the grid has."""
    return np.asarray(_blocks(grey, steps, mode="edge").mean(axis=(1, 3, 5), dtype=np.float32))


def _blocks(
    values: NDArray[Any], steps: NDArray[np.int64], mode: Literal["constant", "edge"] = "constant"
) -> NDArray[Any]:
    """A grid as [A, a, B, b, C, c]: blocks of a x b x c voxels, the last ones filled up with zeros or the edge."""
    rest = [(0, int(-size % step)) for size, step in zip(values.shape, steps, strict=True)]
    padded = np.pad(values, rest, mode=mode) if any(more for _, more in rest) else values
    (a, b, c), (u, v, w) = padded.shape, map(int, steps)
    return padded.reshape(a // u, u, b // v, v, c // w, w)


def _tell(steps: NDArray[np.int64], points: int) -> None:
    if (steps > 1).any():
        _LOG.info("blocks of %s voxels became one, by their mean; %d points", " x ".join(map(str, steps)), points)
