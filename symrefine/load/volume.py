"""Volumes, .nii .nrrd .mrc and .map: intensities on a grid, as a surface in space or as weighted voxels.

Frame and unit are those that the header gives: every voxel stands where its affine map puts it, by its middle.
Grey values run from 0, the lowest intensity, to 1, the highest. What carries the mass is chosen as it is of a mesh:

- `surface`, as a rule: where the grey value crosses the threshold (Otsu's, if none is given), points on the lines
  between neighbouring voxels, with the gradient as normal. Lines of a direction u meet a surface of normal n in numbers
  that go as |u.n|; the weights take that back, so that each point stands for the area around it.
- `solid`: voxels weigh as much as they differ from the background, as pixels of pictures do; all the same, if a
  threshold makes them so.

Where that would be more than `ENOUGH` points, blocks of voxels become one, by their mean: nothing is left out.

Intensities stay as the file has them; grey values are made of a slab of the grid at a time, as often as they are asked
for: beside the file itself a volume takes some 100 MB.
"""

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.load.content import Content, Wanted
from symrefine.load.image import BINS, otsu_of, parted, weighing

_LOG = logging.getLogger(__name__)

# 512^3, a large tomogram; its intensities take half a gigabyte.
LARGEST = 2**27
# Voxels of a slab: 16 MB of grey values, a few times that of what is made of them.
_SLAB = 2**22
_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
# Points: symmetries are decided by fewer.
ENOUGH = 200_000


def as_they_are(values: NDArray[Any]) -> NDArray[Any]:
    """Intensities that a file has as they are."""
    return values


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Volume:
    """Intensities on a grid, and where it lies.

    Args:
        values: [A, B, C] real numbers of any type, as the file has them.
        axes: [3, 3] steps from one voxel to the next along each axis of the grid, as columns.
        origin: [3] the middle of the first voxel.
        scaled: makes intensities of some of the values.
    """

    values: NDArray[Any]
    axes: Array
    origin: Array
    scaled: Callable[[NDArray[Any]], NDArray[Any]] = as_they_are


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Grey:
    """Grey values of a grid, made when they are asked for.

    Args:
        values: [A, B, C] as the file has them.
        scaled: makes intensities of them.
        low: what becomes 0.
        span: what is added to it to become 1.
    """

    values: NDArray[Any]
    scaled: Callable[[NDArray[Any]], NDArray[Any]] = as_they_are
    low: np.float32 = _ZERO
    span: np.float32 = _ONE

    @classmethod
    def of(cls, volume: Volume) -> Self:
        """Those of a volume, from 0, its lowest intensity, to 1, its highest.

        Raises:
            InputError: intensities that are not finite, or all the same.
        """
        plain = cls(values=volume.values, scaled=volume.scaled)
        ends = [(part.min(), part.max()) for part in plain.parts()]
        low, high = (
            float(choose(side)) for choose, side in zip((np.min, np.max), zip(*ends, strict=True), strict=True)
        )
        if not (np.isfinite(low) and np.isfinite(high)):
            raise InputError(_not_finite(plain))
        if low == high:
            raise InputError(f"all {volume.values.size} voxels have the same intensity {low:g}: there is no object")
        if high - low > float(np.finfo(np.float32).max):
            raise InputError(
                f"intensities run from {low:g} to {high:g}, farther than single precision goes: scale them"
            )
        return cls(values=volume.values, scaled=volume.scaled, low=np.float32(low), span=np.float32(high - low))

    @property
    def shape(self) -> tuple[int, ...]:
        return self.values.shape

    @property
    def axis(self) -> int:
        """Along which it is cut into slabs: the longest, and of these the last, which most files have in one piece."""
        return max(range(3), key=lambda k: (self.shape[k], k))

    def slabs(self, step: int = 1) -> Iterator[tuple[int, int]]:
        """Where slabs begin and end, each but the last a multiple of so many planes."""
        planes = self.shape[self.axis]
        thick = max(_SLAB * planes // self.values.size // step * step, step)
        return ((first, min(first + thick, planes)) for first in range(0, planes, thick))

    def part(self, first: int, end: int) -> NDArray[np.float32]:
        """The grey values between two planes."""
        return self._made(self.values[tuple(slice(first, end) if k == self.axis else slice(None) for k in range(3))])

    def parts(self) -> Iterator[NDArray[np.float32]]:
        """All of them, slab by slab."""
        return (self.part(first, end) for first, end in self.slabs())

    def at(self, voxels: NDArray[np.int64]) -> NDArray[np.float32]:
        """The grey values of voxels [N, 3]."""
        return self._made(self.values[tuple(voxels.T)])

    def border(self) -> NDArray[np.float32]:
        """The grey values of the six sides, each voxel once."""
        sides = []
        for k in range(3):
            for end in (0, -1):
                inner = [slice(1, -1) if other < k else slice(None) for other in range(3)]
                inner[k] = slice(end, end + 1 or None)
                sides.append(self._made(self.values[tuple(inner)]).ravel())
        return np.concatenate(sides)

    def _made(self, values: NDArray[Any]) -> NDArray[np.float32]:
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is told
            grey: NDArray[np.float32] = self.scaled(values).astype(np.float32)
            grey -= self.low
        grey /= self.span
        return grey


def _not_finite(plain: _Grey) -> str:
    """Which of the intensities are not."""
    count, first = 0, (plain.shape, 0.0)
    for start, end in plain.slabs():
        part = plain.part(start, end)
        bad = np.argwhere(~np.isfinite(part))
        count += len(bad)
        if len(bad):
            value = float(part[tuple(bad[0])])
            bad[0, plain.axis] += start
            first = min(first, (tuple(map(int, bad[0])), value), key=lambda one: one[0])
    return (
        f"voxel {list(first[0])} is {first[1]} ({count} such of {plain.values.size}); intensities must be finite: put "
        "the background there"
    )


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
        return _solid(_Grey.of(volume), volume, wanted)
    if wanted.invert:
        raise InputError(
            "invert leaves a surface as it is; take measure 'solid' to weigh the background, or leave it out"
        )
    return _surface(_Grey.of(volume), volume, wanted)


def _spans_space(axes: Array) -> bool:
    """Whether the axes of a grid are three in space, in numbers whose products can be told."""
    longest = float(np.abs(axes).max())
    return 0.0 < longest < np.inf and float(np.linalg.det(axes / longest)) != 0.0


def _surface(whole: _Grey, volume: Volume, wanted: Wanted) -> Content:
    level = wanted.threshold if isinstance(wanted.threshold, float | int) else _otsu(whole)
    steps, grey = np.ones(3, dtype=np.int64), whole
    while (crossings := _crossings(grey, level)) > ENOUGH:
        steps = _wider(volume.axes, steps, (crossings / ENOUGH) ** 0.5)
        grey = _Grey(values=_averaged(whole, steps))
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


def _otsu(grey: _Grey) -> float:
    """The grey value that parts a volume, as it does a picture."""
    told = [np.histogram(part, bins=BINS, range=(0.0, 1.0)) for part in grey.parts()]
    return otsu_of(np.sum([counts for counts, _ in told], axis=0), told[0][1])


def _crossings(grey: _Grey, level: float) -> int:
    """How often lines between neighbouring voxels cross the level."""
    return sum(int(crossed.sum()) for axis in range(3) for _, crossed in _crossed(grey, axis, level))


def _crossed(grey: _Grey, axis: int, level: float) -> Iterator[tuple[int, NDArray[np.bool_]]]:
    """The first plane of each slab, and whether the level lies between each voxel there and its next along an axis."""
    for first, end in grey.slabs():
        behind = int(axis == grey.axis)  # the last plane of a slab has its next neighbours in the next one
        above = np.moveaxis(grey.part(first, end + behind) >= level, axis, 0)
        yield first, np.moveaxis(above[:-1] != above[1:], 0, axis)


def _met(grey: _Grey, axis: int, level: float) -> tuple[Array, Array]:
    """Where lines along an axis of the grid meet the level, [N, 3] in voxels, and the gradient there."""
    found = []
    for start, crossed in _crossed(grey, axis, level):
        found.append(np.argwhere(crossed))
        found[-1][:, grey.axis] += start
    first = _in_order(np.concatenate(found), grey.shape)
    second = first + np.eye(3, dtype=np.int64)[axis]
    low, high = (grey.at(voxels).astype(np.float64) for voxels in (first, second))
    share = ((level - low) / (high - low))[:, None]
    gradient = (1.0 - share) * _gradient(grey, first) + share * _gradient(grey, second)
    # Central differences may vanish or turn round in sheets of one voxel; the difference across the level does not.
    across = high - low
    thin = gradient[:, axis] * across <= 0.0
    gradient[thin, axis] = across[thin]
    return first + share * (second - first), gradient


def _in_order(voxels: NDArray[np.int64], shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Voxels [N, 3] as they follow one another in a grid, whose slabs may run along any axis of it."""
    return voxels[np.argsort(np.ravel_multi_index(tuple(voxels.T), shape))]


def _gradient(grey: _Grey, voxels: NDArray[np.int64]) -> Array:
    """Differences between the neighbours of voxels [N, 3], a step of the grid being the unit."""
    gradient = np.empty(voxels.shape)
    for axis, step in enumerate(np.eye(3, dtype=np.int64)):
        before, after = np.maximum(voxels - step, 0), np.minimum(voxels + step, np.array(grey.shape) - 1)
        rise = grey.at(after).astype(np.float64) - grey.at(before)
        gradient[:, axis] = rise / (after - before)[:, axis]
    return gradient


def _solid(grey: _Grey, volume: Volume, wanted: Wanted) -> Content:
    level = _otsu(grey) if wanted.threshold == "otsu" else wanted.threshold

    def shown(part: NDArray[np.float32]) -> Array:
        return part if level is None else parted(part, level)

    weight = weighing(shown(grey.border()), lambda: map(shown, grey.parts()), invert=wanted.invert)

    def weights(step: int = 1) -> Iterator[tuple[int, Array]]:
        return ((first, weight(shown(grey.part(first, end)))) for first, end in grey.slabs(step))

    ends = [(part.min(), part.max()) for _, part in weights()]
    if min(low for low, _ in ends) == max(high for _, high in ends):
        raise InputError("nothing stands out from the background; choose a threshold from 0 to 1")
    steps = np.ones(3, dtype=np.int64)
    while (heavy := sum(_heavy(part, steps) for _, part in weights(int(steps[grey.axis])))) > ENOUGH:
        steps = _wider(volume.axes, steps, (heavy / ENOUGH) ** (1 / 3))
    _tell(steps, heavy)
    masses, places = _centres(weights(int(steps[grey.axis])), grey, steps)
    return Content(points=volume.origin + places @ volume.axes.T, weights=masses)


def _heavy(weights: Array, steps: NDArray[np.int64]) -> int:
    """How many blocks weigh anything."""
    return int(np.count_nonzero(_blocks(weights, steps).any(axis=(1, 3, 5))))


def _centres(slabs: Iterator[tuple[int, Array]], grey: _Grey, steps: NDArray[np.int64]) -> tuple[Array, Array]:
    """What each block that weighs anything weighs, [N], and the centre of that, [N, 3] in voxels.

    Its centre and not its middle: moments of order one stay what they are.
    """
    found = []
    for first, weights in slabs:
        blocks = _blocks(weights, steps)
        masses = blocks.sum(axis=(1, 3, 5), dtype=np.float64)
        heavy = np.nonzero(masses)
        own = [index + (first // steps[k] if k == grey.axis else 0) for k, index in enumerate(heavy)]
        places = np.empty((len(heavy[0]), 3))
        for k in range(3):
            inside = 2 * k + 1
            others = tuple(axis for axis in (1, 3, 5) if axis != inside)
            # Sums over the other axes first leave one axis of the block, behind the axes of blocks up to its own.
            layers = np.moveaxis(blocks.sum(axis=others, dtype=np.float64), k + 1, -1)
            size = blocks.shape[inside]
            places[:, k] = own[k] * size + (layers @ np.arange(size))[heavy] / masses[heavy]
        many = -(-np.array(grey.shape) // steps)
        found.append((np.ravel_multi_index(tuple(own), tuple(many)), masses[heavy], places))
    index, masses, places = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.argsort(index)
    return masses[order], places[order]


def _wider(axes: Array, steps: NDArray[np.int64], factor: float) -> NDArray[np.int64]:
    """Voxels of larger blocks, about as long along each axis of the grid, `factor` times as large or a little more."""
    lengths = np.linalg.norm(axes, axis=0)
    edge = factor * float((steps * lengths).min())
    wider = np.maximum(np.rint(edge / lengths), 1).astype(np.int64)
    return wider if (wider > steps).any() else steps + (steps * lengths == (steps * lengths).min())


def _averaged(grey: _Grey, steps: NDArray[np.int64]) -> NDArray[np.float32]:
    """Means over blocks; the last ones go on with what the edge of the grid has."""
    slabs = (grey.part(first, end) for first, end in grey.slabs(int(steps[grey.axis])))
    means = [_blocks(part, steps, mode="edge").mean(axis=(1, 3, 5), dtype=np.float32) for part in slabs]
    return np.concatenate(means, axis=grey.axis)


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
