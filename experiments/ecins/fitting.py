"""Refinement of one free plane: nearest partners, point to plane, Levenberg-Marquardt as in MINPACK, until it stays.

With fixed partners the residual `(x_s - R(x_t)).R n_t = (R x_s - x_t).n_t` is linear in the thirteen numbers of
`fit.residual`, so its squared norm is that of thirteen numbers `S phi` with `S'S` the Gram matrix of all pairs.
Levenberg-Marquardt sees nothing of its residual but norms and products, so it takes the same steps on the thirteen as
on the thousands, and one pass over the pairs does for the 40 to 50 evaluations of an outer iteration.
"""

from dataclasses import dataclass

import numpy as np

from experiments.ecins.clouds import LEAST_POINTS, Clouds
from experiments.ecins.levenberg import least_squares
from experiments.ecins.settings import Settings
from experiments.ecins.starts import best_of_each
from symrefine.fit.residual import SIZE, design_rows, gram
from symrefine.geometry import Array, Plane, line_angle_rad
from symrefine.shape import Index


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """One start and what became of it, in the units of the clouds.

    Attributes:
        planes: the start and the plane after each outer iteration.
        evaluations: residual evaluations of the inner iterations, those for the finite differences included.
        converged: whether the last iteration left the plane where it was.
    """

    planes: tuple[Plane, ...]
    evaluations: int
    converged: bool

    @property
    def iterations(self) -> int:
        """Outer iterations done."""
        return len(self.planes) - 1


def refine_plane(clouds: Clouds, start: Plane, settings: Settings) -> Fit:
    """Pair, minimise, repeat. Fewer pairs than unknowns leave the plane where it is."""
    planes, evaluations = [start], 0
    for _ in range(settings.max_outer):
        before = planes[-1]
        source, target = partners(clouds, before, settings)
        after = before
        if len(source) >= LEAST_POINTS:
            rows = design_rows(clouds.queries[source], clouds.points[target], clouds.normals[target])
            after, count = inner_minimum(gram(rows, np.ones(len(rows))), before, settings)
            evaluations += count
        planes.append(after)
        if _at_rest(before, after, settings):
            return Fit(planes=tuple(planes), evaluations=evaluations, converged=True)
    return Fit(planes=tuple(planes), evaluations=evaluations, converged=False)


def _at_rest(before: Plane, after: Plane, settings: Settings) -> bool:
    turn_deg = np.degrees(line_angle_rad(before.normal, after.normal))
    return bool(turn_deg < settings.turn_deg and centroid_shift(before, after) < settings.move_rel)


def centroid_shift(a: Plane, b: Plane) -> float:
    """Distance between the projections of the centroid, which is the origin, onto two planes."""
    return float(np.linalg.norm(a.offset * a.normal - b.offset * b.normal))


def partners(clouds: Clouds, plane: Plane, settings: Settings) -> tuple[Index, Index]:
    """Queries and the points next to their mirror images, one to one, each the nearest of those that want it."""
    cell = settings.query_voxel_rel
    near, reach = settings.near_plane * cell, settings.refine_reach * cell
    side = plane.signed_distance(clouds.queries)
    # A partner stands at -side +- reach: what cannot be `near` apart need not be looked up.
    source = np.flatnonzero(2.0 * np.abs(side) >= near - reach)
    image = plane.reflect(clouds.queries[source])
    distance, target = clouds.tree.query(image, distance_upper_bound=np.nextafter(reach, np.inf))
    hit = np.isfinite(distance)
    source, target, distance = source[hit], target[hit], distance[hit]
    apart = np.abs(side[source] - plane.signed_distance(clouds.points[target])) >= near
    agree = reflected_cosine(clouds, plane, source, target) >= np.cos(np.radians(settings.refine_gate_deg))
    chosen = best_of_each(target, np.flatnonzero(apart & agree), distance)
    return source[chosen], target[chosen]


def reflected_cosine(clouds: Clouds, plane: Plane, source: Index, target: Index) -> Array:
    """Cosine of the angle between reflected normals of queries and normals of points, both [P]."""
    n, m = clouds.query_normals[source], clouds.normals[target]
    return np.einsum("ij,ij->i", n, m) - 2.0 * (n @ plane.normal) * (m @ plane.normal)


def mirror_coordinates(unknowns: Array) -> Array:
    """`phi` [..., 13] (see `fit.residual`) of reflections across planes of an origin and a normal [..., 6]."""
    origin, normal = unknowns[..., :3], unknowns[..., 3:]
    m = normal / np.sqrt((normal * normal).sum(axis=-1, keepdims=True))
    phi = np.empty((*unknowns.shape[:-1], SIZE))
    twice = 2.0 * m
    phi[..., :9] = -(twice[..., :, None] * m[..., None, :]).reshape(*unknowns.shape[:-1], 9)
    phi[..., :9:4] += 1.0
    phi[..., 9:12] = (twice * origin).sum(axis=-1, keepdims=True) * m
    phi[..., 12] = 1.0
    return phi


def inner_minimum(gram13: Array, start: Plane, settings: Settings) -> tuple[Plane, int]:
    """The plane at which MINPACK's iteration stops, and how often it evaluates the residual.

    Unknowns are an origin and a normal, six for three: the length of the normal and the origin's place in the plane
    change nothing, as in the original. Differences are forward, their step that of single precision.
    """
    values, vectors = np.linalg.eigh(gram13)
    root = np.sqrt(np.clip(values, 0.0, None))[:, None] * vectors.T
    x, evaluations = least_squares(
        # No matrix product: its last bits depend on how many rows there are.
        lambda unknowns: (mirror_coordinates(unknowns)[:, None, :] * root).sum(axis=-1),
        np.concatenate([start.offset * start.normal, start.normal]),
        tolerance=settings.tolerance,
        max_evaluations=settings.max_evaluations,
        step_bound=settings.step_bound,
    )
    normal = x[3:] / np.linalg.norm(x[3:])
    return Plane(normal=normal, offset=float(normal @ x[:3])), evaluations
