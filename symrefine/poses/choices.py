"""The best operation for a few vertices: of finitely many, or of all turns about an axis.

About an axis through the centre with the unit direction u, let y be where the one pose has the vertex x, in the
coordinates of the other. With x turned by the angle theta about the axis,

    |y - x(theta)|^2 = |y - x|^2 + 2 p (1 - cos theta) - 2 q sin theta,  p = y.x - (y.u)(x.u),  q = y.(u x x),

so that in space the distances are waves of one frequency, and the least value of the largest is at the bottom of one of
them or where two of them cross: with t = tan(theta / 2) at a root of a quadratic.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, batches
from symrefine.groups.names import MAX_FOLD
from symrefine.groups.orthogonal import Index, about_z
from symrefine.groups.standard import GOLDEN
from symrefine.poses.symmetry import Symmetry
from symrefine.rounding import DOUBLE


@dataclass(frozen=True, slots=True)
class Choices:
    """What the operations of a symmetry offer, and what sees the vertices: a camera [3, 3], or None in space.

    All of finitely many operations are tried, and all turns about an axis, for Dinf also those after a half turn across
    it. Of a sphere there is nothing to choose: with the nearest rotation only the centre is out of place. In space that
    is the best of all, since the centre lies among the vertices: no other turn brings all of them closer.
    """

    symmetry: Symmetry
    camera: Array | None

    @property
    def count(self) -> int:
        """Operations that are tried at once; none where the nearest turn is taken."""
        group = self.symmetry.group
        if group.is_finite:
            return int(group.order)
        return 0 if group.symbol.family == "K" else MAX_FOLD

    def best(self, a: Array, b: Array, vertices: Array) -> tuple[Array, Array]:
        """The least largest distance [n] of vertices [n, m, 3] in poses a and b S [n, 4, 4], and those b S."""
        group = self.symmetry.group
        if group.is_finite:
            poses = self.symmetry.turned(b[:, None], group.operations())
            low, best = self._least(a, poses, vertices)
            return low, poses[np.arange(len(a)), best]
        about_axis = self._by_waves if self.camera is None else self._by_search
        bases = [b, self._about_axis(b, np.zeros(len(b)), -1.0)] if group.symbol.family == "D" else [b]
        found = [about_axis(a, base, vertices) for base in bases]
        low = np.array([value for value, _ in found])
        chosen = low.argmin(axis=0), np.arange(len(a))
        turned = np.array([self._about_axis(base, angles) for base, (_, angles) in zip(bases, found, strict=True)])
        return low[chosen], turned[chosen]

    def _least(self, a: Array, poses: Array, vertices: Array) -> tuple[Array, Index]:
        """Of poses [n, k, 4, 4] those [n] with the least largest distance, and it [n]."""
        low, best = np.empty(len(a)), np.empty(len(a), dtype=np.intp)
        for batch in batches(len(a), 12 * poses.shape[1] * vertices.shape[1]):
            seen = image(a[batch], vertices[batch], self.camera)
            misses = largest(seen[:, None], poses[batch], vertices[batch, None], self.camera)
            low[batch], best[batch] = misses.min(axis=1), misses.argmin(axis=1)
        return low, best

    def _about_axis(self, poses: Array, angles_rad: Array, over: float = 1.0) -> Array:
        """Poses [..., 4, 4] turned by angles [...] about the axis, after a half turn across it where `over` is -1."""
        frame = self.symmetry.group.frame
        turns = about_z(over, over, angles_rad.ravel()).reshape(*angles_rad.shape, 3, 3)
        return self.symmetry.turned(poses, frame.T @ turns @ frame)

    def _by_waves(self, a: Array, b: Array, vertices: Array) -> tuple[Array, Array]:
        """The least largest distance [n] over turns of b about the axis, and their angles [n]: in closed form."""
        low, angles = np.empty(len(a)), np.empty(len(a))
        for batch in batches(len(a), 4 * vertices.shape[1] ** 3):
            low[batch], angles[batch] = _lowest(*self._waves(a[batch], b[batch], vertices[batch]))
        return low, angles

    def _waves(self, a: Array, b: Array, vertices: Array) -> tuple[Array, Array, Array]:
        """|y - x|^2, p and q [n, m] of each vertex."""
        frame, center = self.symmetry.group.frame, self.symmetry.center
        x = (vertices - center) @ frame.T
        y = (image(a, vertices, None) - self.symmetry.places(b)[:, None]) @ b[:, :3, :3] @ frame.T
        apart = y - x
        p = (y * x)[..., :2].sum(axis=-1)
        q = x[..., 0] * apart[..., 1] - x[..., 1] * apart[..., 0]
        return (apart**2).sum(axis=-1), p, q

    def _by_search(self, a: Array, b: Array, vertices: Array) -> tuple[Array, Array]:
        """The same of images: the best of many turns, then the bottom beside it by a golden section."""
        # Turns that a search looks at before it goes closer: nobody tells them from all (BOP evaluates 315).
        step = 2.0 * np.pi / MAX_FOLD
        turns = step * np.arange(MAX_FOLD)
        seen = image(a, vertices, self.camera)

        def at(angles: Array) -> Array:
            return largest(seen, self._about_axis(b, angles), vertices, self.camera)

        first, best = self._least(a, self._about_axis(b[:, None], np.tile(turns, (len(b), 1))), vertices)
        angles = _golden(at, turns[best] - step, turns[best] + step)
        last = at(angles)
        return np.minimum(first, last), np.where(last < first, angles, turns[best])


def _lowest(e: Array, p: Array, q: Array) -> tuple[Array, Array]:
    """The least largest distance [n] of vertices with e, p, q [n, m] as above, and the angle [n] of the turn."""
    i, j = np.triu_indices(e.shape[1], 1)
    de, dp, dq = (wave[:, i] - wave[:, j] for wave in (e, p, q))
    # (de + 4 dp) t^2 - 4 dq t + de = 0; where there is no crossing, any angle may be tried.
    square, root = de + 4.0 * dp, np.sqrt(np.maximum(4.0 * dq**2 - de * (de + 4.0 * dp), 0.0))
    both = 2.0 * dq + np.copysign(root, dq)
    crossings = 2.0 * np.arctan2(both, square), 2.0 * np.arctan2(de, both)
    angles = np.concatenate([np.arctan2(q, p), *crossings], axis=1)
    t = angles[..., None]
    squares = (e[:, None] + 4.0 * p[:, None] * np.sin(0.5 * t) ** 2 - 2.0 * q[:, None] * np.sin(t)).max(axis=2)
    rows, best = np.arange(len(e)), squares.argmin(axis=1)
    return np.sqrt(np.maximum(squares[rows, best], 0.0)), angles[rows, best]


def _golden(at: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Where functions [n] of one variable are lowest between low and high [n], if each has one bottom there."""
    inner, outer = high - (high - low) / GOLDEN, low + (high - low) / GOLDEN
    left, right = at(inner), at(outer)
    while (high - low > DOUBLE).any():
        down = left < right
        low, high = np.where(down, low, inner), np.where(down, outer, high)
        inner, outer = high - (high - low) / GOLDEN, low + (high - low) / GOLDEN
        left, right = at(inner), at(outer)
    return 0.5 * (low + high)


def image(poses: Array, vertices: Array, camera: Array | None) -> Array:
    """Vertices [..., m, 3] in poses [..., 4, 4], or their images [..., m, 2]; infinity behind the camera."""
    moved = vertices @ poses[..., :3, :3].swapaxes(-1, -2) + poses[..., None, :3, 3]
    if camera is None:
        return np.asarray(moved)
    ahead = moved[..., 2:] > 0.0
    seen = moved @ camera.T
    return np.where(ahead, seen[..., :2] / np.where(ahead, moved[..., 2:], 1.0), np.inf)


def largest(seen: Array, poses: Array, vertices: Array, camera: Array | None) -> Array:
    """The largest distance [...] of what poses [..., 4, 4] make of vertices [..., m, 3] from what is seen of them."""
    return np.asarray(np.linalg.norm(seen - image(poses, vertices, camera), axis=-1).max(axis=-1))
