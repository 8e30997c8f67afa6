"""Hyperplanes of symmetry of points in any dimension: points that stand for themselves, or samples; their group."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from symrefine.clock import Clock
from symrefine.decide.doubts import on_a_line, set_by_strays
from symrefine.decide.posterior import NEAR
from symrefine.errors import InputError
from symrefine.geometry import Array, Plane, ReadOnly, check_tolerance, positive
from symrefine.moments.moments import PARTS, shape_moments
from symrefine.ndim import sampled as samples
from symrefine.ndim.matched import Points
from symrefine.ndim.search import Search, among_points, among_samples
from symrefine.ntuples.contract import PAPER_ORDERS, ntuples
from symrefine.ntuples.rank import FLOOR, FixedSubspace, fixed_subspace
from symrefine.shape import Shape
from symrefine.surface.misses import TOLERANCE
from symrefine.threads import one_thread

# Dimensions up to which moments of order 5 are few enough.
LARGEST_DIM = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hyperplane:
    """A candidate for a hyperplane of symmetry.

    Attributes:
        plane: in input units.
        asymmetry: what the moments of orders 2 to 4 have against it, as a fraction of the whole.
        noise: what sampling alone would leave of that; 0 for points that stand for themselves.
        miss: of those, the largest distance from a reflected point to its nearest neighbour, over the diameter; NaN for
            samples, whose neighbours say nothing in high dimensions.
    """

    plane: Plane
    asymmetry: float
    noise: float
    miss: float


@dataclass(frozen=True, kw_only=True, eq=False)
class SubspaceDetection(ReadOnly):
    """What `detect_nd` found.

    Attributes:
        fixed: rank and singular values of the n-tuples.
        center: [n] the point that every symmetry leaves in place.
        hyperplanes: of symmetry, best first.
        rejected: candidates turned down, best first.
        diameter: twice the largest distance of a point from the centre.
        undetermined: why the data support no decision; empty when they do.
        incomplete: why there may be hyperplanes that are not listed; empty when there are none.
        reflection_group_order: of the group that the reflections listed generate, 1 if there are none; None if they
            generate more reflections than hold, or nothing is decided.
        timings: seconds by stage.
    """

    fixed: FixedSubspace
    center: Array
    hyperplanes: tuple[Hyperplane, ...]
    rejected: tuple[Hyperplane, ...]
    diameter: float
    undetermined: str
    incomplete: str
    reflection_group_order: int | None
    timings: dict[str, float] = field(default_factory=dict)


@one_thread()
def detect_nd(
    shape: Shape | ArrayLike, *, tolerance: float = TOLERANCE, sampled: bool | None = None, seed: int = 0
) -> SubspaceDetection:
    """Hyperplanes of symmetry of points in n-space, 2 <= n <= 8, the group they generate, and the rank of the n-tuples.

    Of points that stand for themselves all hyperplanes are found: the differences of pairs name them (`matched`). Of
    samples, normals are turned until the moments of orders 2 to 4 are closest to their images, from the eigenvectors of
    the second moments and, where these coincide, from random starts (`sampled`). Images of hyperplanes in one another
    are looked at as well. Everything listed has been held against the points. Turns are not looked for.

    Args:
        shape: a cloud, or points [N, n].
        tolerance: what still counts as symmetric: points that stand for themselves may miss by this fraction of the
            diameter; the moments of samples, and n-tuples, by a tenth of it.
        sampled: whether the points are random samples of the object, whose noise hides what is smaller, or the object
            itself; what the shape says if None.
        seed: of the random starts.

    Raises:
        InputError: other dimensions, or a mesh.
        DegenerateShapeError: the points do not spread.
    """
    shape = shape if isinstance(shape, Shape) else Shape.of(shape)
    check_tolerance(tolerance)
    if not 2 <= shape.dim <= LARGEST_DIM or shape.faces is not None:
        what = "a mesh" if shape.faces is not None else f"{shape.dim} coordinates"
        rows = "; a row is a point, transpose them?" if len(shape.points) <= LARGEST_DIM < shape.dim else ""
        raise InputError(f"{shape.source}: {what}; expected points of 2 to {LARGEST_DIM} coordinates{rows}")
    sampled = not shape.atoms if sampled is None else sampled
    clock = Clock()
    with clock("moments"):
        moments = shape_moments(shape, 5, parts=PARTS if sampled else 0)
        fixed = fixed_subspace(ntuples(moments, PAPER_ORDERS), floor=FLOOR * tolerance / TOLERANCE)
    masses = shape.masses
    kept = masses > 0
    points, masses = moments.normalised(shape.points[kept]), masses[kept]
    diameter = 2.0 * float(np.linalg.norm(points, axis=1).max())
    cloud = Points(points=points, masses=masses, diameter=diameter)
    low = samples.block(moments, samples.LOW)
    known = [fixed.directions[-1], *np.linalg.eigh(moments.covariance)[1].T]
    flaw = set_by_strays(points, few=not sampled) or on_a_line(moments.covariance)
    with clock("search"):
        if flaw:
            search = Search(holds=[], rejected=[], incomplete=[], order=None, undetermined=flaw)
        elif sampled:
            rng = np.random.default_rng(seed)
            # Masses that differ make up for a density that does.
            neighbours = samples.Neighbours(points, diameter, rng) if np.ptp(masses) == 0.0 else None
            search = among_samples(shape, low, known, tolerance, neighbours, rng)
        else:
            search = among_points(cloud, known, tolerance)

    def hyperplane(normal: Array) -> Hyperplane:
        asymmetry, noise = low.against(normal)
        normal = positive(normal)
        plane = Plane(normal=normal, offset=float(normal @ moments.center))
        return Hyperplane(
            plane=plane, asymmetry=asymmetry, noise=noise, miss=math.nan if sampled else cloud.miss(normal)
        )

    def listed(normals: list[Array]) -> tuple[Hyperplane, ...]:
        return tuple(sorted(map(hyperplane, normals), key=lambda h: h.asymmetry))

    return SubspaceDetection(
        fixed=fixed,
        center=moments.center,
        hyperplanes=listed(search.holds),
        rejected=listed(search.rejected)[:NEAR],
        diameter=diameter * moments.scale,
        undetermined=search.undetermined,
        incomplete="; ".join(search.incomplete),
        reflection_group_order=search.order,
        timings=clock.seconds,
    )
