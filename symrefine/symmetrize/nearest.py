"""The nearest exactly symmetric shape: each point becomes the mean of what the group says about its place.

For a point p and an operation g about the centre, the shape has a counterpart c(g p) to the image g p: the point that
corresponds to it, or else the closest point of the surface. The mean over the group of g^-1 c(g p) is where p belongs
(the least-squares answer where points correspond). This map of space commutes with the group, so that orbits stay
orbits: what it makes of them is symmetric to rounding, not to a tolerance.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from symrefine.errors import DegenerateShapeError, InputError
from symrefine.fit.action import generators, mean_back
from symrefine.fit.distinct import Distinct
from symrefine.fit.finite import finite_group
from symrefine.fit.placed import Placed, fitted_matrices
from symrefine.fit.vertices import NEAR, on_vertices, settled, towards
from symrefine.geometry import Array, ReadOnly, tight_diagonal, unit
from symrefine.groups import PointGroup
from symrefine.groups.names import TURNS
from symrefine.rounding import TOLERANCE
from symrefine.shape import Index, Shape
from symrefine.symmetrize.counterparts import Action, act, with_leftovers
from symrefine.symmetrize.surface import Closest, closest_on
from symrefine.threads import one_thread

# Counterparts are looked for up to so many tolerances away. Where points are many they must miss by no more than so
# much of the usual distance between points (RMS, and the worst), and in a mesh some of whose vertices have none each by
# no more than so much of the distance to the next vertex: chance finds a nearest vertex for everything.
REACH, SPACED, WORST, OWN = 3.0, 0.5, 1.5, 0.25
# Times that counterparts are looked for, each about a better place, as long as that many have one.
MATCHINGS, FEWEST = 4, 4
# Points that the group's place is fitted to on a surface.
FITTED = 2000
# Copies of a point this near (of the diagonal) are one point.
_SAME = 1e-9
# A copied sector keeps at least so many points, and there are so many of them at least.
SECTOR, FEWEST_TURNS = 30, 8
# No operation of any group fixes this direction: it marks the sector that is copied.
_GENERIC = (0.8123, 0.2877, 0.5072)

Method = Literal["vertices", "orbits", "surface"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Symmetrized(ReadOnly):
    """A shape made symmetric.

    Attributes:
        shape: the result, in the units of the input.
        group: the finite group it has: a part of the continuous one where that was asked for.
        center: [3] where the operations meet.
        method: "vertices": each operation permutes the points, none is added or lost. "orbits": a cloud without such
            counterparts; the points of one sector, moved onto the symmetric surface, and their copies. "surface": a
            mesh some of whose vertices have no counterpart; vertices lie where the symmetric surface is, the triangles
            between them are as they were.
        paired: fraction of the points that have exact counterparts.
        largest: largest distance a point was moved by, as a fraction of the diagonal.
        rms: root mean square of it, as a fraction of the diagonal.
        residual: by how much the result misses itself, as a fraction of the diagonal: distance of images to the
            nearest point, or to the surface for "surface".
        diagonal: of the smallest bounding box over all orientations, input units.
    """

    shape: Shape
    group: PointGroup
    center: Array
    method: Method
    paired: float
    largest: float
    rms: float
    residual: float
    diagonal: float


@one_thread()
def symmetrize(
    shape: Shape, group: PointGroup, center: Array, *, tolerance: float = TOLERANCE, seed: int = 0
) -> Symmetrized:
    """The symmetric shape nearest to a shape that nearly has a group about a centre.

    The group's place is fitted once more, so that what is symmetric already stays where it is.

    Args:
        shape: a mesh or cloud in 3-space; colours, texture and the like are not part of it.
        group: where `detect` found it; the placement may be off by the tolerance.
        center: [3] the point that the operations leave in place.
        tolerance: by what fraction of the diagonal the shape may miss the symmetry.
        seed: of the random samples of a surface.

    Raises:
        InputError: not a 3-D shape, or the trivial group.
        DegenerateShapeError: a few points, of which some have no counterpart.
    """
    if shape.dim != 3:
        raise InputError(f"{shape.source}: symmetrize takes 3-D shapes; these points have {shape.dim} coordinates")
    if group.name == "C1":
        raise InputError(f"{shape.source}: C1 has no operation but the identity: there is nothing to make symmetric")
    work = _start(shape, center, group, copied=shape.faces is None, seed=seed)
    work, action = _counterparts(work, REACH * tolerance)
    few = shape.faces is None and shape.chosen(work.own.rows).atoms
    if _corresponds(work.own.points, action, few):
        return work.by_vertices(action)
    if few:
        raise DegenerateShapeError(
            f"{shape.source}: {int((~action.closed).sum())} of {len(work.own.rows)} points have no counterpart under "
            f"{work.place.group.name}; they stand for themselves, not for a surface: choose a subgroup "
            "(--group)"
        )
    return work.by_orbits() if shape.faces is None else work.by_surface(action)


def exact_place(shape: Shape, group: PointGroup, center: Array) -> tuple[PointGroup, Array]:
    """Where the group of a shape stands exactly, if its points or vertices nearly have it; else what was given.

    Detection has looked already where they have it to rounding (see `symrefine.fit.vertices`): that changes nothing.

    Args:
        group: as found in the shape.
        center: [3] as found, input units.
    """
    found = on_vertices(shape, group, center, within=NEAR)
    return (group, center) if found is None else (found.group, found.center)


def _corresponds(points: Array, action: Action, few: bool) -> bool:
    """Whether every point has its counterparts, and not by chance."""
    if few or not action.closed.all():
        return bool(action.closed.all())
    spacing = float(np.median(cKDTree(points).query(points, k=2)[0][:, 1]))
    return bool(np.sqrt(np.mean(action.miss**2)) <= SPACED * spacing and action.miss.max() <= WORST * spacing)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Work:
    """What every method starts from: its own distinct points, in units of the diagonal about the given centre."""

    shape: Shape
    center: Array
    diagonal: float
    own: Distinct
    place: Placed
    rng: np.random.Generator

    def by_vertices(self, action: Action) -> Symmetrized:
        """Points that correspond: means over orbits, about the place that moves them least."""
        place = settled(self.own.points, action.images, self.place)
        wanted = self._means(action, place)
        made = replace(
            self.shape,
            points=wanted[self.own.back],
            weights=self._even_weights(action),
            normals=self._mean_normals(action, place),
        )
        return self._made(made, place, "vertices", wanted, paired=1.0, residual=_miss(wanted, place))

    def by_orbits(self) -> Symmetrized:
        """A cloud of a surface: its points on the symmetric surface, of which one sector is copied to the others."""
        place, wanted = self._onto_surface()
        rows = _sector(wanted - place.center, place.group)
        operations, owners = place.group.operations(), self.own.rows[rows]
        copies = _turned(operations, wanted[rows] - place.center)
        weights, normals, labels = self.shape.weights, self.shape.normals, self.shape.labels
        keep = _once(copies, np.tile(owners, len(operations)) if labels is not None else None)
        made = Shape(
            points=place.center + copies[keep],
            weights=None if weights is None else np.tile(weights[owners], len(operations))[keep],
            normals=None if normals is None else _turned(operations, normals[owners])[keep],
            labels=None if labels is None else np.tile(labels[owners], len(operations))[keep],
            source=self.shape.source,
        )
        return self._made(made, place, "orbits", wanted, paired=0.0, residual=_miss(made.points, place))

    def by_surface(self, action: Action) -> Symmetrized:
        """A mesh: vertices with counterparts go to their means, the others onto the symmetric surface."""
        place, wanted = self._onto_surface()
        own = action.miss < OWN * cKDTree(self.own.points).query(self.own.points, k=2)[0][:, 1]
        paired = action.closed & own & own[action.images].all(axis=0)
        wanted[paired] = self._means(action, place)[paired]
        made = replace(self.shape, points=wanted[self.own.back])
        residual = _miss(wanted, place, closest_on(made, self.rng))
        share = float(paired[self.own.back].mean())
        return self._made(made, place, "surface", wanted, paired=share, residual=residual)

    def _made(
        self, shape: Shape, place: Placed, method: Method, wanted: Array, *, paired: float, residual: float
    ) -> Symmetrized:
        """The result in the units of the input; `wanted` [M, 3] is where the distinct points belong."""
        moved = np.linalg.norm(wanted - self.own.points, axis=1)
        return Symmetrized(
            shape=replace(shape, points=self.center + self.diagonal * shape.points),
            group=place.group,
            center=self.center + self.diagonal * place.center,
            method=method,
            paired=paired,
            largest=float(moved.max()),
            rms=float(np.sqrt(np.mean(moved**2))),
            residual=residual,
            diagonal=self.diagonal,
        )

    def _means(self, action: Action, place: Placed) -> Array:
        return place.center + action.mean(self.own.points - place.center, place.group.operations())

    def _onto_surface(self) -> tuple[Placed, Array]:
        """The group's place, fitted to where some of the points belong, and where all of them do."""
        closest = closest_on(replace(self.shape, points=self.own.points[self.own.back]), self.rng)
        place = self.place
        some = self.own.points[:: max(1, len(self.own.points) // FITTED)]
        for _ in range(4):
            # Where a group stands some of its operations tell as well as all.
            told = np.stack(fitted_matrices(place.group))
            place, _ = towards(place, some, _on_symmetric_surface(some, place, told, closest))
        return place, _on_symmetric_surface(self.own.points, place, place.group.operations(), closest)

    def _even_weights(self, action: Action) -> Array | None:
        """Weights that are equal over each orbit, their sum kept; copies of one point share its mean."""
        if self.shape.weights is None:
            return None
        mass = np.bincount(self.own.back, weights=self.shape.weights, minlength=len(self.own.rows))
        even = np.mean([mass[image] for image in action.images], axis=0)
        return np.asarray((even / np.bincount(self.own.back))[self.own.back])

    def _mean_normals(self, action: Action, place: Placed) -> Array | None:
        """Normals averaged like the points, each with the sign of the normal that it joins."""
        if self.shape.normals is None:
            return None
        own = self.shape.normals[self.own.rows]
        joined = [own[image] @ g for g, image in zip(place.group.operations(), action.images, strict=True)]
        total = sum(n * np.where(np.sum(n * own, axis=1) < 0.0, -1.0, 1.0)[:, None] for n in joined)
        return unit(total)[self.own.back]


def _start(shape: Shape, center: Array, group: PointGroup, *, copied: bool, seed: int) -> _Work:
    """The distinct points (and labels) of a shape, in units of the diagonal about the centre of its group."""
    diagonal = tight_diagonal(shape.points)
    own, turns = Distinct.of(shape, center, diagonal), TURNS
    if copied and not group.is_finite:
        sectors = len(group.sampled(1).operations())
        turns = min(TURNS, max(FEWEST_TURNS, len(own.points) // (SECTOR * sectors) // 2 * 2))
    return _Work(
        shape=shape,
        center=center,
        diagonal=diagonal,
        own=own,
        place=Placed(group=finite_group(group, own.points, turns), center=np.zeros(3)),
        rng=np.random.default_rng(seed),
    )


def _counterparts(work: _Work, reach: float) -> tuple[_Work, Action]:
    """Counterparts about the place that those found so far point to, since a misplaced group pairs fewer points."""
    points, place = work.own.points, work.place
    for _ in range(MATCHINGS):
        operations = place.group.operations()
        action = act(points - place.center, operations, work.own.labels, reach)
        if action.closed.all() or action.closed.sum() < FEWEST:
            break
        wanted = place.center + action.mean(points - place.center, operations)
        place, _ = towards(place, points[action.closed], wanted[action.closed])
    action = with_leftovers(points - place.center, place.group.operations(), action, work.own.labels, reach)
    return replace(work, place=place), action


def _turned(operations: Array, vectors: Array) -> Array:
    """All vectors [N, 3] under each operation [K, 3, 3], one operation after the other: [K N, 3]."""
    return np.asarray(np.einsum("kij,nj->kni", operations, vectors).reshape(-1, 3))


def _on_symmetric_surface(points: Array, place: Placed, operations: Array, closest: Closest) -> Array:
    """Means [N, 3] over operations of g^-1 (closest point to g p): over all a map of space that commutes with them."""
    local = points - place.center
    found = (closest(place.center + local @ g.T) - place.center for g in operations)
    return np.asarray(place.center + mean_back(found, operations))


def _sector(points: Array, group: PointGroup) -> Index:
    """Rows of the points that are at least as near to a generic direction as to each of its images."""
    generic = unit(_GENERIC) @ group.frame
    images = group.operations() @ generic
    return np.flatnonzero(points @ generic >= (points @ images.T).max(axis=1) - 1e-12)


def _once(points: Array, owners: Index | None) -> Index:
    """Rows of the points but for later copies of one place (of the same owner if owners are told apart)."""
    pairs = cKDTree(points).query_pairs(_SAME, output_type="ndarray")
    if owners is not None and len(pairs):
        pairs = pairs[owners[pairs[:, 0]] == owners[pairs[:, 1]]]
    keep = np.ones(len(points), dtype=bool)
    keep[pairs.max(axis=1) if len(pairs) else pairs.ravel()] = False
    return np.flatnonzero(keep)


def _miss(points: Array, place: Placed, closest: Closest | None = None) -> float:
    """Largest distance of an image under a generator to the surface, or else to the nearest point."""
    local, operations = points - place.center, place.group.operations()
    images = [local @ operations[h].T for h, _ in generators(operations)]
    if closest is None:
        tree = cKDTree(local)
        return max(float(tree.query(image)[0].max()) for image in images)
    there = [place.center + image for image in images]
    return max(float(np.linalg.norm(closest(at) - at, axis=1).max()) for at in there)
