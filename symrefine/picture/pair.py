"""The scene of an alignment: two objects, the ways of laying one on the other, and what each place of either says.

Positions of either side are relative to its own centre, in units of the target, the source in its own axes and at the
size that the map gives it. A `Way` takes the source to the target's side.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from symrefine.align.alignment import Alignment
from symrefine.align.pair import few
from symrefine.align.witnesses import Misses, Witnesses, witnesses
from symrefine.errors import InputError
from symrefine.geometry import Array, ReadOnly, rotation
from symrefine.groups.orthogonal import axes_and_angles
from symrefine.moments.quadrature import sample_surface
from symrefine.picture.atoms import balls
from symrefine.picture.palette import CONTRADICTED, INFERRED, OBJECT, OUTLIER, SOURCE, Colour, shade
from symrefine.picture.scene import Scene, Stage, main_part
from symrefine.picture.surface import MOST_POINTS, Surface, make_surface
from symrefine.picture.words import percent
from symrefine.shape import Shape

# Equivalent maps that are shown; all of them stand in the record.
MOST_WAYS = 24
# Room between the two where they stand side by side, in diagonals of the target.
ROOM = 0.15
# Places farther than this from all that was asked are strays, in misses from which on nothing is met.
STRAY = 2.0
# Points of either side that tell where it is, and the share of them that lie farther out than its edge on each side.
STAGED, EDGE = 10_000, 0.005
# Discs of a mesh that is painted as points are so many times as wide as those of a cloud.
CLOSED = 1.7
# A turn of so little is none, as it is told to a hundredth of a degree.
STILL_RAD = math.radians(0.005)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Way(ReadOnly):
    """A map that lays the source on the target.

    Attributes:
        matrix: [3, 3] orthogonal.
        shift: [3] where it takes the centre of the source.
        transform: [n+1, n+1] the same in input units, scale included.
        axis: [3] that it turns about.
        angle_rad: of the turn; of a determinant of -1 that which goes with the mirror across the axis.
    """

    matrix: Array
    shift: Array
    transform: Array
    axis: Array
    angle_rad: float

    @property
    def determinant(self) -> int:
        """+1 or -1."""
        return round(float(np.linalg.det(self.matrix)))

    @property
    def turns(self) -> bool:
        """Whether it turns by anything that is told."""
        return abs(self.angle_rad) > STILL_RAD

    def part(self, share: float, beside: Array) -> tuple[Array, Array]:
        """Matrix and shift a share of the way from standing `beside` [3], as it came, to the end.

        Of determinant -1 it turns first, then is flattened across the axis and comes out mirrored.
        """
        shift = (1.0 - share) * beside + share * self.shift
        if self.determinant > 0:
            return rotation(self.axis, share * self.angle_rad), shift
        flat = 2.0 * max(0.0, 2.0 * share - 1.0) * np.multiply.outer(self.axis, self.axis)
        return (np.eye(3) - flat) @ rotation(self.axis, min(1.0, 2.0 * share) * self.angle_rad), shift


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shares:
    """Of one side, the shares of the places that meet the other, that contradict, and where nobody looked."""

    met: float
    contradicted: float
    unseen: float

    @classmethod
    def of(cls, misses: Array, far: float) -> "Shares":
        """From the misses [N] of a map, NaN where nobody looked."""
        unseen = np.isnan(misses)
        met = ~unseen & (np.nan_to_num(misses) <= far)
        return cls(met=float(met.mean()), contradicted=float((~met & ~unseen).mean()), unseen=float(unseen.mean()))

    def __str__(self) -> str:
        return f"{percent(self.met)} met, {percent(self.contradicted)} contradicted, {percent(self.unseen)} unseen"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Side(ReadOnly):
    """One of the two objects.

    Attributes:
        index: 0 of the source, 1 of the target.
        name: of where it came from.
        shape: in space, about its centre, in units of the target.
        center: [n] in input units.
        unit: what its own units are in those of the target.
        colour: that it has by itself, and where it meets the other.
        atoms: whether its points stand for themselves.
        outline: [K, 3] some of its points, without those that lie far out.
    """

    index: int
    name: str
    shape: Shape
    center: Array
    unit: float
    colour: Colour
    atoms: bool
    outline: Array

    @property
    def input_dim(self) -> int:
        """Number of coordinates that it came with."""
        return len(self.center)

    def given(self, points: Array) -> Array:
        """Points [N, 3] in the input's own coordinates [N, n]."""
        return np.asarray(points[:, : self.input_dim] / self.unit + self.center)

    def scene(self, diagonal: float) -> Scene:
        """The side alone, in a space of this size."""
        return replace(bare_scene(self.outline, diagonal), balls=balls(self.shape) if self.atoms else None)

    def surface(self, *, dense: bool = False) -> Surface:
        """What is painted of it, in its own colour: a mesh, balls, or points; `dense`: of a mesh points as well."""
        shape = self.shape
        if dense and shape.faces is not None:
            points, normals, _ = sample_surface(shape, MOST_POINTS, np.random.default_rng(0))
            shape = Shape(points=points, normals=normals)
        made = make_surface(shape, self.scene(self.shape.diagonal))
        if shape is not self.shape:  # of known normals: discs that leave no gaps
            made = replace(made, radius=CLOSED * made.radius)
        if self.atoms and self.shape.elements:
            return made
        return replace(made, colours=np.tile(shade(self.colour), (len(made.colours), 1)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Pair:
    """Two objects, what lays one on the other, and what they say of it.

    Attributes:
        source: what moves.
        target: what it is laid upon.
        ways: the map, then the equivalent ones that are shown.
        equivalents: how many there are.
        far: miss from which on a place meets nothing, a fraction of the diagonal.
        tolerance: that was asked for, a fraction of the diagonal.
        diagonal: of the target.
    """

    source: Side
    target: Side
    ways: tuple[Way, ...]
    equivalents: int
    far: float
    tolerance: float
    diagonal: float
    _asked: Witnesses = field(repr=False)
    _misses: tuple[Misses, ...] = field(repr=False)

    @property
    def sides(self) -> tuple[Side, Side]:
        """Source and target."""
        return self.source, self.target

    def shares(self, way: int) -> tuple[Shares, Shares]:
        """What the source, and what the target, says of a way."""
        one, other = (Shares.of(misses, self.far) for misses in self._misses[way])
        return one, other

    def misses(self, side: int, points: Array) -> Array:
        """[W, K] by how much points [K, 3] of a side miss the other under each way; NaN where nobody looked.

        Fractions of the diagonal; -1 for strays, of which nothing is said.
        """
        away, owner = self._asked.nearest(side, self.sides[side].given(points))
        every = np.stack([misses[side][owner] for misses in self._misses])
        every[:, self.sides[side].unit * away > STRAY * self.far * self.diagonal] = -1.0
        return every

    def coloured(self, own: Array, misses: Array) -> Array:
        """Colours [K, 3], 0 to 1, of places with these misses [K]; their own [K, 3] where they meet."""
        colours, told = own.copy(), np.nan_to_num(misses)
        verdicts = ((np.isnan(misses), INFERRED), (told > self.far, CONTRADICTED), (told < 0.0, OUTLIER))
        for which, colour in verdicts:
            colours[which] = shade(colour)
        return colours

    def beside(self, direction: Array) -> Array:
        """[3] where the centre of the source is if it stands beside the target, in a unit direction from there."""
        reach = float((self.target.outline @ direction).max() - (self.source.outline @ direction).min())
        return (reach + ROOM * self.diagonal) * direction

    def stage(self, matrix: Array, shift: Array) -> Scene:
        """What a camera has to have in view, the source being taken somewhere."""
        points = np.concatenate([self.source.outline @ matrix.T + shift, self.target.outline])
        return bare_scene(points, self.diagonal)


def make_pair(found: Alignment, source: Shape, target: Shape, tolerance: float) -> Pair:
    """The scene of an alignment in space or in the plane.

    Args:
        found: what `align` returned for these two.
        source: as given.
        target: as given.
        tolerance: that was asked for, a fraction of the diagonal.

    Raises:
        InputError: points of another number of coordinates, of which there is no picture.
    """
    if target.dim not in (2, 3):
        raise InputError(f"{target.source}: points have {target.dim} coordinates; an alignment is shown of 2 or 3")
    atoms = few(source, target)
    units, colours = (found.scale, 1.0), (SOURCE, OBJECT)
    sides = [
        _side(k, shape, unit, colour, atoms=atoms)
        for k, (shape, unit, colour) in enumerate(zip((source, target), units, colours, strict=True))
    ]
    coset = found.coset
    maps = list(zip(coset.matrices, coset.translations, strict=True))
    shown = maps[:MOST_WAYS]
    asked = witnesses(source, target, scale=found.scale, tolerance=tolerance)
    reach = STRAY * asked.far * target.diagonal
    return Pair(
        source=_without_strays(sides[0], asked, reach),
        target=_without_strays(sides[1], asked, reach),
        ways=tuple(_way(m, t, sides[0], sides[1]) for m, t in shown),
        equivalents=len(maps),
        far=asked.far,
        tolerance=tolerance,
        diagonal=target.diagonal,
        _asked=asked,
        _misses=tuple(asked.misses(m, t) for m, t in shown),
    )


def bare_scene(points: Array, diagonal: float) -> Scene:
    """A scene in which nothing was found, about the origin, upright as it is."""
    stage = Stage(center=np.zeros(3), points=points, frame=np.eye(3), diagonal=diagonal)
    return Scene(stage=stage, planes=(), axes=(), missed_planes=(), missed_axes=())


def _side(index: int, shape: Shape, unit: float, colour: Colour, *, atoms: bool) -> Side:
    low, high = np.quantile(shape.points, [EDGE, 1.0 - EDGE], axis=0)
    center = 0.5 * (low + high)
    points = unit * _in_space(shape.points - center)
    normals = None if shape.normals is None else _in_space(shape.normals)
    labels = shape.labels if atoms else None
    placed = Shape(
        points, shape.faces, normals=normals, labels=labels, elements=atoms and shape.elements, source=shape.source
    )
    return Side(
        index=index,
        name=shape.source,
        shape=placed,
        center=center,
        unit=unit,
        colour=colour,
        atoms=atoms,
        outline=main_part(points[:: max(1, len(points) // STAGED)]),
    )


def _without_strays(side: Side, asked: Witnesses, reach: float) -> Side:
    """A side of whose outline nothing lies farther than so, in units of the target, from all places that were asked."""
    near = side.unit * asked.nearest(side.index, side.given(side.outline))[0] <= reach
    return replace(side, outline=side.outline[near]) if near.any() else side


def _in_space(vectors: Array) -> Array:
    """Vectors [N, 2] or [N, 3] as [N, 3]."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def _way(matrix: Array, translation: Array, source: Side, target: Side) -> Way:
    dim, full = len(matrix), np.eye(3)
    full[:dim, :dim] = matrix
    shift = source.unit * (matrix @ source.center) + translation - target.center
    transform: Array = np.eye(dim + 1)
    transform[:-1, :-1], transform[:-1, -1] = source.unit * matrix, translation
    axes, angles = axes_and_angles(full[None])
    # -1 is the mirror across any axis after a half turn about it.
    angle = float(angles[0]) - (math.pi if np.linalg.det(full) < 0.0 else 0.0)
    return Way(matrix=full, shift=_in_space(shift[None])[0], transform=transform, axis=axes[0], angle_rad=angle)
