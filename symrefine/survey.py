"""What a shape is before any symmetry is looked for: size, parts, how it was sampled, what may go wrong."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from symrefine.detection.masses import heavy
from symrefine.detection.measure import floor_under
from symrefine.detection.sketch import is_large, sampled
from symrefine.errors import DegenerateShapeError
from symrefine.geometry import Array, ReadOnly
from symrefine.lengths import object_diagonal
from symrefine.moments.moments import shape_moments
from symrefine.moments.quadrature import triangle_areas_and_normals
from symrefine.rounding import SINGLE
from symrefine.shape import FEW, Index, Shape
from symrefine.surface.clumps import parts_among
from symrefine.surface.misses import SHARES
from symrefine.surface.neighbourhoods import connected_parts, fills_volume
from symrefine.surface.sampling import sampling
from symrefine.surface.surroundings import AROUND, around_some
from symrefine.surface.tree import Tree

# Points below which the answer for a cloud is often `undetermined` (see README, boundary cases).
SPARSE = 2000
# Points below which one for points that fill a volume is.
SPARSE_VOLUME = 20_000
# Steps of float32 at the place of the object, as a fraction of its diagonal, that a surface should not be made of.
COARSE = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class Mesh:
    """The faces of a mesh, equal vertices taken as one.

    Attributes:
        faces: triangles.
        area: of all of them, in squares of the input units.
        open_edges: that one face has.
        crowded_edges: that three faces or more have.
        turned_edges: whose two faces are oriented against one another.
        parts: that share no vertex.
        solid: whether `measure="solid"` takes it; edges that meet without sharing vertices are no matter.
    """

    faces: int
    area: float
    open_edges: int
    crowded_edges: int
    turned_edges: int
    parts: int
    solid: bool

    @property
    def closed(self) -> bool:
        """Whether every edge has two faces, oriented alike."""
        return not (self.open_edges or self.crowded_edges or self.turned_edges)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cloud:
    """How a cloud was sampled.

    Attributes:
        strays: points far from all others and in no plane with them.
        clumps: points of each group that stands apart and has no counterpart.
        floor: points of a plane that all others stand on and that reaches beyond them; 0 if there is none.
        parts: that hang together, without strays and clumps.
        even: whether the density does not fall off.
        volume: whether the points fill a volume instead of a surface.
    """

    strays: int
    clumps: tuple[int, ...]
    floor: int
    parts: int
    even: bool
    volume: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Survey(ReadOnly):
    """Everything that is known of a shape before any symmetry, in input units.

    Attributes:
        kind: "mesh", "cloud" (a sample of a surface or volume), or "points" (few, or not in space: as they are).
        points: how many; the vertices of a mesh.
        low: [n] the least of each coordinate.
        high: [n] the largest of each coordinate.
        diagonal: of the smallest box over all orientations; None for more than three coordinates.
        repeated: points that stand where another one does.
        spread: [n] standard deviations along the principal directions, largest first.
        mesh: of a mesh.
        cloud: of a cloud in space.
        classes: how many points (faces, of a mesh) are in each class of the labels; None without labels.
        viewpoints: [K, 3] places of cameras; none if they are not known.
        normals: whether points have normals.
        weighted: whether weights differ.
    """

    kind: Literal["mesh", "cloud", "points"]
    points: int
    low: Array
    high: Array
    diagonal: float | None
    repeated: int
    spread: Array
    mesh: Mesh | None
    cloud: Cloud | None
    classes: tuple[int, ...] | None
    viewpoints: Array
    normals: bool
    weighted: bool


def survey(shape: Shape) -> Survey:
    """Look over a shape in any dimension.

    Raises:
        DegenerateShapeError: the points do not spread.
    """
    kind: Literal["mesh", "cloud", "points"] = "mesh" if shape.faces is not None else "cloud"
    if kind == "cloud" and (shape.dim != 3 or shape.atoms):
        kind = "points"
    places = np.unique(shape.points, axis=0)
    return Survey(
        kind=kind,
        points=len(shape.points),
        low=shape.points.min(axis=0),
        high=shape.points.max(axis=0),
        diagonal=object_diagonal(shape) if shape.dim <= 3 else None,
        repeated=len(shape.points) - len(places),
        spread=_spread(shape),
        mesh=None if shape.faces is None else _mesh(shape, shape.faces),
        cloud=_cloud(shape) if kind == "cloud" else None,
        classes=None if shape.labels is None else tuple(np.unique(shape.labels, return_counts=True)[1].tolist()),
        viewpoints=np.empty((0, 3)) if shape.viewpoint is None else np.unique(shape.viewpoint, axis=0),
        normals=shape.normals is not None,
        weighted=shape.weights is not None and bool(np.ptp(shape.weights)),
    )


def _spread(shape: Shape) -> Array:
    """Standard deviations [n] along the principal directions, largest first."""
    moments = shape_moments(replace(shape, measure="surface") if shape.faces is not None else shape, 2)
    return moments.scale * np.sqrt(np.maximum(np.linalg.eigvalsh(moments.covariance)[::-1], 0.0))


def _mesh(shape: Shape, faces: Index) -> Mesh:
    welded = np.unique(shape.points, axis=0, return_inverse=True)[1].reshape(-1)[faces]
    edges = welded[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    ways, uses = np.unique(edges.min(axis=1) * len(shape.points) + edges.max(axis=1), return_inverse=True)
    count = np.bincount(uses)
    # Two faces that are oriented alike run along their edge in opposite directions.
    forth = np.bincount(uses, weights=edges[:, 0] < edges[:, 1], minlength=len(ways))
    parts = connected_parts(edges[:, 0], edges[:, 1], len(shape.points))
    return Mesh(
        faces=len(faces),
        area=float(triangle_areas_and_normals(shape.points, faces)[0].sum()),
        open_edges=int((count == 1).sum()),
        crowded_edges=int((count > 2).sum()),
        turned_edges=int(((count == 2) & (forth != 1)).sum()),
        parts=len(np.unique(parts[edges[:, 0]])),
        solid=_is_solid(shape),
    )


def _is_solid(shape: Shape) -> bool:
    """Whether a mesh bounds a solid whose moments can be told."""
    try:
        shape_moments(replace(shape, measure="solid"), 2)
    except DegenerateShapeError:
        return False
    return True


def _cloud(shape: Shape) -> Cloud:
    """How a cloud was sampled; of very many points a sample tells, in numbers of all."""
    some = sampled(shape) if is_large(shape) else shape
    points, each = heavy(some).points, len(shape.points) / len(some.points)
    found = sampling(points, np.random.default_rng(0), outliers=True)
    kept = points[found.kept]
    kept = (kept - kept.mean(axis=0)) / kept.std()
    return Cloud(
        strays=round(each * len(found.strays)),
        clumps=tuple(round(each * len(clump)) for clump in found.clumps),
        floor=points_of_floor(shape),
        parts=_count_parts(kept, np.random.default_rng(0)),
        even=found.shares is None,
        volume=found.solid and fills_volume(kept, Tree(kept)),
    )


def _count_parts(points: Array, rng: np.random.Generator) -> int:
    """How many parts points [N, 3] have, strays left out, that hang together and are so large that they count."""
    if len(points) <= AROUND:
        return 1
    sizes = np.bincount(parts_among(around_some(points, rng)))
    return max(int((sizes > max(SHARES[-1] * sizes.sum(), AROUND)).sum()), 1)


def points_of_floor(shape: Shape) -> int:
    """How many points of a cloud lie in a plane that all others stand on, as on a floor; 0 if there is none."""
    floor = floor_under(sampled(shape) if is_large(shape) else shape, "floor")
    return 0 if floor is None else int(np.count_nonzero(floor.covers(shape.points)))


def doubts(found: Survey) -> Iterator[str]:
    """What may go wrong with a detection, and what to do about it, a sentence each."""
    if found.mesh is not None:
        yield from _doubts_of_mesh(found.mesh)
    if found.cloud is not None:
        yield from _doubts_of_cloud(found.cloud, found.points)
    if found.repeated and found.kind != "mesh":
        said = "they count once" if found.kind == "cloud" and not found.weighted else "these places weigh more"
        yield f"{found.repeated:,} points stand where others do: {said}"
    if found.kind == "points" and len(found.spread) == 3 and found.points <= FEW:
        yield "so few points stand for themselves, as atoms do; of a surface give more than 250"
    flat = int((found.spread**2 < SINGLE**2 * found.spread[0] ** 2).sum())
    if flat:
        left = {1: "a line", 2: "a plane"}.get(len(found.spread) - flat, f"{len(found.spread) - flat} dimensions")
        yield f"all points lie in {left}" if left != "a line" else "all points lie on a line"
    far = max(float(np.abs(found.low).max()), float(np.abs(found.high).max()))
    step = float(np.spacing(np.float32(far))) if far < np.finfo(np.float32).max else np.inf
    if step > COARSE * float(np.linalg.norm(found.high - found.low)):
        yield f"so far from the origin numbers of 32 bits are {step:.2g} apart: written so, details are lost"


def _doubts_of_mesh(mesh: Mesh) -> Iterator[str]:
    if mesh.open_edges:
        yield f"{mesh.open_edges:,} edges have one face: the surface is open, a mesh is judged as if that were all"
    if mesh.crowded_edges:
        yield f"{mesh.crowded_edges:,} edges have three faces or more: surfaces touch, or are there twice"
    if mesh.turned_edges:
        yield f"at {mesh.turned_edges:,} edges the faces are oriented against one another"
    if not mesh.solid:
        yield "it bounds no solid: --measure solid is refused"


def _doubts_of_cloud(cloud: Cloud, count: int) -> Iterator[str]:
    if cloud.strays:
        yield f"{cloud.strays:,} points lie far from all others and are taken as outliers, unless --outliers none"
    if cloud.clumps:
        sizes = ", ".join(f"{size:,}" for size in cloud.clumps)
        yield f"clumps of {sizes} points stand apart without a counterpart and may be taken as outliers"
    if cloud.floor:
        yield f"{cloud.floor:,} points lie in a plane that all others stand on: if it is a floor, say --outliers floor"
    if not cloud.even:
        yield "the density differs from place to place: points are drawn more evenly, and weighted"
    if cloud.volume:
        yield "the points fill a volume: only its outline and spread can be compared"
    least = SPARSE_VOLUME if cloud.volume else SPARSE
    if count < least:
        yield f"{count:,} points are few: the answer may be undetermined, {least:,} and more tell better"
