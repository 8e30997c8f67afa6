"""Local planes of a cloud, and which of them a mirrored point meets."""

import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from symrefine.geometry import Array, Mask, ReadOnly, rows
from symrefine.rounding import SINGLE
from symrefine.samples import GLANCE
from symrefine.shape import Index
from symrefine.surface.neighbourhoods import (
    NEIGHBOURS,
    Neighbourhoods,
    across_wires,
    are_wires,
    choose_neighbours,
    connected_parts,
    fit_planes,
    flatness_of,
)
from symrefine.surface.tree import Tree, pairs_within, with_class

# Points whose distances tell the spacing and the reach of discs, the first of them the point itself.
AROUND = 6

Body = Literal["surface", "atoms", "volume"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Planes(ReadOnly):
    """Planes that stand for a surface, or points that stand for themselves.

    Attributes:
        points: [M, 3] a point of each plane.
        normals: [M, 3] unit normals, any sign; zero where points stand for themselves.
        thickness: [M] standard deviation of the neighbours across the plane.
        flatness: [M] thickness over the smaller width: 0 for a plane, 1 for a blob.
    """

    points: Array
    normals: Array
    thickness: Array
    flatness: Array

    def chosen(self, index: Index | NDArray[np.bool_] | slice) -> "Planes":
        """Some of the planes."""
        return Planes(
            points=rows(self.points, index),
            normals=rows(self.normals, index),
            thickness=self.thickness[index],
            flatness=self.flatness[index],
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Patches(Planes):
    """Points projected on the planes fitted to their neighbours: what moves, while another surface is met.

    Attributes:
        redundancy: how many of the local planes each point of the cloud takes part in; >= 1.
        labels: [M] class of each point, which only meets points of its own class; None where all are of one.
    """

    redundancy: float
    labels: Index | None = None

    def classes(self, chosen: Index | slice) -> Index | None:
        """Classes of some of the points."""
        return None if self.labels is None else self.labels[chosen]

    @cached_property
    def surface(self) -> "LocalPlanes":
        """The same as a surface that others meet."""
        tree = Tree(self.points)
        distance, _ = tree.query(self.points, min(AROUND, len(self.points)))
        return LocalPlanes(
            **_all_of(self),
            reach=distance[:, -1],
            spacing=_spacing(distance),
            tree=tree if self.labels is None else Tree(with_class(self.points, self.labels)),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class LocalPlanes(Patches):
    """Local planes that stand for the surface around them.

    Attributes:
        reach: [M] radius of the disc each local plane stands for: the distance to its fifth neighbour among these M.
        spacing: median distance from a point to the nearest other one of these M.
        tree: kd-tree over `points`, with the class as a fourth coordinate where there are classes.
        body: what the points are: samples of a surface, atoms that stand for themselves, or samples of a volume.
        eyes: [c, 3] where it was seen from, so that the normals point out of the body; None if that is not known.
    """

    reach: Array
    spacing: float
    tree: Tree
    body: Body = "surface"
    eyes: Array | None = None

    @property
    def surface(self) -> "LocalPlanes":
        """Itself."""
        return self

    @cached_property
    def beside(self) -> float:
        """How far off a place is that still lies beside a local plane: twice as far as they usually reach."""
        return 2.0 * float(np.median(self.reach))

    @cached_property
    def lonely(self) -> Mask:
        """[M] which reach farther: as far as at the corner of a sheet, with a quarter disc."""
        return np.asarray(self.reach > self.beside)

    @property
    def isolated(self) -> bool:
        """Whether points meet points: there are no normals and no discs."""
        return self.body != "surface"

    @cached_property
    def offsets(self) -> Array:
        """[M] where each plane lies along its normal."""
        return np.einsum("ij,ij->i", self.points, self.normals)

    @cached_property
    def place(self) -> Index:
        """[M] number of the place that each point stands at: a file may tell an atom twice."""
        size = float(np.ptp(self.points, axis=0).max())
        one, other = pairs_within(with_class(self.points, self.labels), SINGLE * size).T
        return connected_parts(one, other, len(self.points))

    def faced(self, points: Array, normals: Array) -> Mask:
        """Which surfaces at points [..., 3], with normals [..., 3] out of the body, turn to where it was seen from."""
        assert self.eyes is not None
        found = np.zeros(points.shape[:-1], dtype=bool)
        for eye in self.eyes:
            if not (others := ~found).any():
                break
            found[others] = np.einsum("ni,ni->n", normals[others], eye - points[others]) > 0.0
        return found

    def of_one_class(self) -> "LocalPlanes":
        """The same surface, where any point may meet any other."""
        return self if self.labels is None else replace(self, tree=Tree(self.points), labels=None)

    def nearest(self, queries: Array, classes: Index | None, *, bound: float = math.inf) -> tuple[Array, Index]:
        """Distance and index, both [Q], of the point nearest to each query [Q, 3] of the classes [Q]; see `Tree`."""
        return self.tree.nearest(with_class(queries, classes), bound=bound)

    def around(
        self, queries: Array, classes: Index | None, count: int, *, skip: int = 0, bound: float = math.inf
    ) -> tuple[Array, Index]:
        """The same, both [Q, count], of several; see `Tree.query`."""
        return self.tree.query(with_class(queries, classes), count, skip=skip, bound=bound)

    def with_copies(self, points: Array, normals: Array) -> "LocalPlanes":
        """The same surface, and behind it as many of its planes again elsewhere, [M, 3] and [M, 3]."""
        labels = None if self.labels is None else np.tile(self.labels, 2)
        every = np.concatenate([self.points, points])
        return replace(
            self,
            points=every,
            normals=np.concatenate([self.normals, normals]),
            thickness=np.tile(self.thickness, 2),
            flatness=np.tile(self.flatness, 2),
            reach=np.tile(self.reach, 2),
            redundancy=2.0 * self.redundancy,
            tree=Tree(with_class(every, labels)),
            labels=labels,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Skin:
    """A surface known by points [N, 3] that are too many to fit planes to all of them: planes are fitted where met.

    Attributes:
        points: [N, 3].
        normals: [N, 3] unit normals that are known, any sign, or None.
        neighbours: points to a plane; 1 where points and normals are exact.
        given: kd-tree over `points`, if there is one already.
        labels: [N] class of each point; None where all are of one.
    """

    points: Array
    normals: Array | None
    neighbours: int
    given: Tree | None = None
    labels: Index | None = None

    @property
    def isolated(self) -> bool:
        """Whether points meet points."""
        return False

    @property
    def noisy(self) -> bool:
        """Whether the smallest neighbourhoods do not look like planes."""
        return self.neighbours > NEIGHBOURS[0]

    @cached_property
    def tree(self) -> Tree:
        """kd-tree over `points`."""
        return Tree(self.points) if self.given is None else self.given

    @cached_property
    def spread(self) -> tuple[Array, Array]:
        """Mean [3] and covariance [3, 3] of the points."""
        return self.points.mean(axis=0), np.cov(self.points.T, bias=True)

    @cached_property
    def spacing(self) -> float:
        """Median distance from a point to the nearest other one."""
        return _spacing(self.tree.query(self._probes, AROUND)[0])

    @cached_property
    def width(self) -> float:
        """Radius of the neighbourhoods that planes are fitted to; 0 where points and normals are exact."""
        if self.neighbours == 1:
            return 0.0
        return float(np.median(self.tree.query(self._probes, 1, skip=self.neighbours - 1)[0]))

    @property
    def _probes(self) -> Array:
        return self.points[:: max(1, len(self.points) // GLANCE)]

    @cached_property
    def neighbourhoods(self) -> Neighbourhoods:
        """What planes are fitted to."""
        return Neighbourhoods.of(self.points, self.tree, self.neighbours)

    def half(self, some: Index) -> "Skin":
        """The skin that half of the points make, with neighbourhoods as wide, which hold half as many.

        They blur edges and bends as those of the whole do; see `noise_distances`.
        """
        return replace(
            self,
            points=self.points[some],
            normals=None if self.normals is None else self.normals[some],
            neighbours=max(self.neighbours // 2, 1),
            given=None,
            labels=None if self.labels is None else self.labels[some],
        )

    def shared_by(self, count: int) -> float:
        """How many of the planes at `count` of the points each point takes part in; at least 1."""
        return max(1.0, self.neighbours * count / len(self.points)) if self.neighbours > 1 else 1.0

    def denoised(self, pick: Index, near: Index | None = None) -> Planes:
        """Some of the points, each moved onto the plane of its neighbours (`near`, if known), and these planes."""
        points = rows(self.points, pick)
        fitted = self.planes_at(points, pick, near)
        if self.neighbours == 1:
            return fitted
        across = np.einsum("ij,ij->i", fitted.normals, points - fitted.points)
        return replace(fitted, points=points - fitted.normals * across[:, None])

    def near(self, pick: Index, most: int, *, scattered: bool = False) -> Index | None:
        """The neighbours [M, most] of some of the points, or None where planes are made of other things or more.

        `scattered` as of `Tree.query`.
        """
        if not 1 < self.neighbours <= most:
            return None
        return self.tree.query(rows(self.points, pick), most, scattered=scattered)[1]

    def planes_at(self, queries: Array, nearest: Index, near: Index | None = None) -> Planes:
        """The planes where queries [Q, 3] meet the surface, given the points nearest to them [Q]; `near` if known."""
        normals = None if self.normals is None else rows(self.normals, nearest)
        if self.neighbours == 1 and normals is not None:
            none = np.zeros(len(nearest))
            return Planes(points=rows(self.points, nearest), normals=normals, thickness=none, flatness=none)
        sums = self.neighbourhoods.around(queries, near)
        mean, normals, values = fit_planes(sums, normals)
        # In the plane there is but one way across.
        if self.normals is None and queries.shape[1] == 3 and are_wires(values).mean() > 0.5:
            normals = across_wires(sums)
        return Planes(points=mean, normals=normals, thickness=np.sqrt(values[:, 0]), flatness=flatness_of(values))

    def patches(self, pick: Index, labels: Index | None = None, near: Index | None = None) -> Patches:
        """The planes of some of the points.

        `labels` [N] are the classes of all points, those of the skin if None; `near` as of `denoised`.
        """
        planes, labels = self.denoised(pick, near), self.labels if labels is None else labels
        classes = None if labels is None else labels[pick]
        return Patches(**_all_of(planes), redundancy=self.shared_by(len(pick)), labels=classes)

    def local_planes(self, pick: Index, labels: Index | None = None, near: Index | None = None) -> LocalPlanes:
        """The same as a surface of their own."""
        return self.patches(pick, labels, near).surface


def _all_of(planes: Planes) -> dict[str, Any]:
    """What is known of planes, to say more of them."""
    return {field.name: getattr(planes, field.name) for field in fields(planes)}


def _spacing(away: Array) -> float:
    """Median distance to the nearest other place, from those [M, k] to the nearest points: repeated ones are one."""
    nearest = np.where(away > 0.0, away, np.inf).min(axis=1)
    apart = nearest[np.isfinite(nearest)]
    return float(np.median(apart)) if apart.size else 0.0


def local_planes(points: Array, count: int, rng: np.random.Generator) -> LocalPlanes:
    """Local planes at `count` of the points [N, 3], from neighbourhoods among all of them."""
    pick = drawn(len(points), count, rng)
    return make_skin(points, rng).local_planes(pick)


def drawn(size: int, count: int, rng: np.random.Generator, weights: Array | None = None) -> Index:
    """Indices, ascending, of `count` points of `size`, or of all; each is drawn as often as its weight [size] says."""
    chance = None if weights is None else weights / weights.sum()
    return np.sort(rng.choice(size, min(count, size), replace=False, p=chance))


def make_skin(
    points: Array,
    rng: np.random.Generator,
    *,
    normals: Array | None = None,
    labels: Index | None = None,
    exact: bool = False,
    thin: float = 0.0,
    tree: Tree | None = None,
) -> Skin:
    """The skin of points [N, 3], with neighbourhoods as large as their noise asks for.

    Args:
        points: [N, 3].
        rng: of the points that are asked for their noise.
        normals: [N, 3] unit normals to use instead of fitted ones, any sign.
        labels: [N] classes; they do not matter to the fits.
        exact: points and normals are free of noise (samples of a mesh) and are taken as they are.
        thin: as of `choose_neighbours`.
        tree: kd-tree over `points`, if there is one already.
    """
    if exact and normals is not None:
        return Skin(points=points, normals=normals, neighbours=1, given=tree, labels=labels)
    tree = Tree(points) if tree is None else tree
    size = choose_neighbours(points, tree, rng, thin=thin)
    return Skin(points=points, normals=normals, neighbours=size, given=tree, labels=labels)


def isolated_points(points: Array, labels: Index | None = None, *, body: Body = "atoms") -> LocalPlanes:
    """Points [M, 3] that meet points: few that stand for themselves ("atoms"), or samples of a "volume"."""
    tree = Tree(points)
    distance, _ = tree.query(points, 2)
    none = np.zeros(len(points))
    return LocalPlanes(
        points=points,
        normals=np.zeros_like(points),
        thickness=none,
        flatness=none,
        reach=none,
        spacing=float(np.median(distance[:, 1])),
        redundancy=1.0,
        tree=tree if labels is None else Tree(with_class(points, labels)),
        body=body,
        labels=labels,
    )
