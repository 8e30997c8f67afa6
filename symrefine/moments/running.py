"""Moments of more points than memory holds: those of one chunk after the other, each exact in a frame of its own.

Sums about one fixed origin would lose all digits where a scan begins in a corner: its coordinates to the eighth power
cancel when the mean becomes known. So every chunk is set about its own mean first, and two sets of points are joined
about the mean of both (Chan, Golub and LeVeque 1979; for any order Pebay 2008).
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from symrefine.errors import DegenerateShapeError
from symrefine.geometry import Array
from symrefine.moments.moments import Moments, dealt, exponents, raw_moments_of_parts, recentred, shifted


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Sums:
    """Raw moments [P, K] of P parts of some points, of `(x - center) / scale`: about the mean, of RMS radius 1."""

    values: Array
    center: Array
    scale: float
    order: int

    @classmethod
    def of(cls, points: Array, weights: Array, origin: Array, order: int, parts: int) -> "_Sums":
        """The sums of points [N, n] with weights [N], dealt to the parts at random; `center` is told from an origin."""
        mass = weights.sum()
        deal, ends = dealt(len(points), parts)
        # `take` reads rows from memory in any order five times as fast as an index does.
        local, own = np.take(points, deal, axis=0), np.take(weights, deal)
        local -= origin
        center = np.einsum("i,ij->j", own, local) / mass if mass > 0.0 else np.zeros_like(origin)
        local -= center
        scale = _radius(float(np.einsum("i,ij,ij->", own, local, local)), mass)
        local /= scale
        values = raw_moments_of_parts(local, own, order, ends)
        return cls(values=values, center=center, scale=scale, order=order)

    @property
    def mass(self) -> float:
        """Of all points."""
        return float(self.values[:, 0].sum())

    @property
    def squares(self) -> float:
        """Of the distances from the mean, added up."""
        degrees = exponents(len(self.center), self.order)
        second = (degrees == 2).any(axis=1) & (degrees.sum(axis=1) == 2)
        return float(self.values[:, second].sum()) * self.scale**2

    def joined(self, other: "_Sums") -> "_Sums":
        """The sums of both sets of points."""
        mass = self.mass + other.mass
        step = other.center - self.center
        center = self.center + step * (other.mass / mass if mass > 0.0 else 0.0)
        squares = self.squares + other.squares
        between = float(step @ step) * self.mass * other.mass / mass if mass > 0.0 else 0.0
        scale = _radius(squares + between, mass)
        values = self.about(center, scale) + other.about(center, scale)
        return _Sums(values=values, center=center, scale=scale, order=self.order)

    def about(self, center: Array, scale: float) -> Array:
        """The same sums in another frame."""
        origin = np.broadcast_to((center - self.center) / self.scale, (len(self.values), len(center)))
        degree = exponents(len(center), self.order).sum(axis=1)
        return shifted(self.values, origin, self.order) * (self.scale / scale) ** degree


def running_moments(chunks: Iterable[tuple[Array, Array]], order: int, *, parts: int) -> Moments:
    """Normalised central moments of points in chunks, with jackknife replicates, as `central_moments` gives of all.

    Args:
        chunks: points [n, 3] and their weights [n], n > 0, one chunk after the other.
        order: highest total degree.
        parts: parts of each chunk that are left out in turn, at random; at least two.

    Raises:
        DegenerateShapeError: the points do not spread about their mean.
    """
    found: _Sums | None = None
    origin, done = np.zeros(0), 0
    for points, weights in chunks:
        origin = points[0] if found is None else origin
        sums = _Sums.of(points, weights, origin, order, parts)
        # The parts take turns at being the first, so that short chunks fill them all.
        sums = replace(sums, values=np.roll(sums.values, done, axis=0))
        found, done = sums if found is None else found.joined(sums), done + len(points)
    if found is None or not (found.mass > 0.0 and found.squares > 0.0):
        raise DegenerateShapeError(
            "the points do not spread about their mean; a shape needs at least two distinct points"
        )
    dim, total = len(found.center), found.values.sum(axis=0)
    rest = total - found.values
    return Moments(
        dim=dim,
        order=order,
        values=recentred(total / total[0], dim, order),
        replicates=recentred(rest / rest[:, :1], dim, order),
        center=origin + found.center,
        scale=found.scale,
    )


def _radius(squares: float, mass: float) -> float:
    """RMS radius, or 1 where there is none: nothing to be divided."""
    return float(np.sqrt(squares / mass)) if squares > 0.0 and mass > 0.0 else 1.0
