"""Mirrors of random samples: what the moments have against them, and where they have least.

The odd energy of a normal `n` is `|T - R T|^2 / 4`, summed over the moment tensors `T` of several orders, with
`R = 1 - 2 n n^T` applied to every index. Moments of low orders do not see all there is: those of orders 2 to 4 take an
octagon for round, and a 24-cell. Where they leave a mirror free to turn, those of orders 5 and 6 are asked too.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from symrefine.decide.hypotheses import MOVED
from symrefine.geometry import Array
from symrefine.moments.moments import Moments, tensor_index
from symrefine.ntuples.rank import SIGNIFICANT
from symrefine.samples import LOOK
from symrefine.surface.misses import LIMITS
from symrefine.surface.tree import Tree

# Orders of the moments that are asked first, and of those that look closer.
LOW, HIGH = (2, 3, 4), (5, 6)
# What the asymmetry of a mirror that was turned until it fits best may reach, in standard deviations of its sampling
# noise; one that others imply may reach more, as this would lose one in ten.
FOUND = math.sqrt(SIGNIFICANT)
# Random starts for each dimension in which second moments coincide.
STARTS = 16
# A mirror that still holds after a turn by so much is free to turn: halfway between those of a square, and not far from
# there for all folds that moments to order 6 see.
TURN_RAD = math.pi / 8.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Block:
    """Moment tensors of some orders, and what these change by where one of several parts is left out in turn."""

    whole: list[Array]
    changes: list[list[Array]]

    @property
    def size(self) -> float:
        """Energy of all tensors."""
        return math.fsum(float((t**2).sum()) for t in self.whole)

    def asymmetry(self, normal: Array) -> float:
        """What the moments have against a mirror, as a fraction of the whole."""
        return math.sqrt(max(odd(self.whole, normal)[0], 0.0) / self.size)

    def against(self, normal: Array) -> tuple[float, float]:
        """Asymmetry, and what sampling alone would leave of it (jackknife); none where the moments are exact."""
        noise = math.fsum(odd(change, normal)[0] for change in self.changes)
        noise *= 1.0 - 1.0 / max(len(self.changes), 1)
        return self.asymmetry(normal), math.sqrt(max(noise, 0.0) / self.size)


def block(moments: Moments, orders: tuple[int, ...]) -> Block:
    """The tensors of some orders."""
    entries = [tensor_index(moments.dim, order, moments.order) for order in orders]
    changes = moments.replicates - moments.values
    return Block(whole=[moments.values[i] for i in entries], changes=[[c[i] for i in entries] for c in changes])


def odd(tensors: Iterable[Array], normal: Array) -> tuple[float, Array]:
    """Energy of the part of the tensors that a reflection flips, and its gradient [n] with respect to the normal.

    With `G_ab = T_a.. (R..R T)_b..`, all indices but the first reflected and summed over, `<T, R T> = R_ab G_ab`; by
    the symmetry of T each of the p indices contributes `dR_ab G_ab` to its change.
    """
    flip = np.eye(len(normal)) - 2.0 * np.outer(normal, normal)
    energy, slope = 0.0, np.zeros(len(normal))
    for tensor in tensors:
        n, image = len(normal), tensor
        # Each product takes the second axis and appends its image: after p - 1 of them all but the first are reflected.
        for _ in range(tensor.ndim - 1):
            image = np.tensordot(image, flip, (1, 0))
        shared = tensor.reshape(n, -1) @ image.reshape(n, -1).T
        energy += 0.5 * (float((tensor**2).sum()) - float((flip * shared).sum()))
        slope += tensor.ndim * (shared + shared.T) @ normal
    return energy, slope


def minima(blocks: list[Block], starts: list[Array]) -> list[Array]:
    """Normals where the odd energy is least, that of each block over its size, one from each start, best first."""
    from scipy.optimize import minimize

    sizes = [b.size for b in blocks]

    def loss(x: Array) -> tuple[float, Array]:
        length = float(np.linalg.norm(x))
        normal = x / length
        energy, slope = 0.0, np.zeros(len(x))
        for b, size in zip(blocks, sizes, strict=True):
            own, bend = odd(b.whole, normal)
            energy, slope = energy + own / size, slope + bend / size
        return energy, (slope - (slope @ normal) * normal) / length

    found = [minimize(loss, start, jac=True, method="BFGS", options={"gtol": 1e-9, "maxiter": 60}) for start in starts]
    found.sort(key=lambda f: float(f.fun))
    return [f.x / np.linalg.norm(f.x) for f in found]


def limit(noise: float, tolerance: float, sigmas: float = FOUND) -> float:
    """Asymmetry that noise and tolerance explain."""
    return math.hypot(0.1 * tolerance, sigmas * noise)


def holds(found: Block, normal: Array, tolerance: float, sigmas: float = FOUND) -> bool:
    """Whether the moments have nothing against a mirror."""
    asymmetry, noise = found.against(normal)
    return asymmetry <= limit(noise, tolerance, sigmas)


def starts(low: Block, tolerance: float, rng: np.random.Generator) -> tuple[list[Array], int]:
    """Where to look for normals, and in how many dimensions second moments coincide.

    The normal of a mirror is an eigenvector of the second moments: any one in the span of those that share a value.
    """
    values, vectors = np.linalg.eigh(low.whole[0])
    bundles = [[0]]
    for k, (before, after) in enumerate(pairwise(values), start=1):
        halfway = (vectors[:, k - 1] + vectors[:, k]) / math.sqrt(2.0)
        # Energy that the mirror halfway between two eigenvectors has against it, from their values alone.
        apart = (after - before) / math.sqrt(2.0 * low.size)
        close = apart <= 2.0 * limit(low.against(halfway)[1], tolerance)
        bundles = [*bundles[:-1], [*bundles[-1], k]] if close else [*bundles, [k]]
    found, shared = list(vectors.T), 0
    for bundle in (b for b in bundles if len(b) > 1):
        shared += len(bundle)
        random = rng.normal(size=(STARTS * len(bundle), len(bundle))) @ vectors[:, bundle].T
        found += list(random / np.linalg.norm(random, axis=1, keepdims=True))
    return found, shared


def free_turns(blocks: list[Block], normal: Array, tolerance: float) -> list[Array]:
    """Directions at right angles to a normal that it can turn towards and still hold."""
    tensors = [t for b in blocks for t in b.whole]
    tangents = np.linalg.svd(normal[None])[2][1:]
    step = 1e-3

    def slope(direction: Array) -> Array:
        moved = normal + step * direction
        return odd(tensors, moved / np.linalg.norm(moved))[1]

    bend = np.array([(slope(t) - slope(-t)) @ tangents.T for t in tangents])
    directions = np.linalg.eigh(bend + bend.T)[1].T @ tangents

    limits = [limit(b.against(normal)[1], tolerance) for b in blocks]

    def free(direction: Array) -> bool:
        turned = [math.cos(TURN_RAD) * normal + s * math.sin(TURN_RAD) * direction for s in (1.0, -1.0)]
        return all(b.asymmetry(t) <= most for t in turned for b, most in zip(blocks, limits, strict=True))

    return [d for d in directions if free(d)]


class Neighbours:
    """Distances from reflected samples to other samples, against those of the samples as they are."""

    def __init__(self, points: Array, diameter: float, rng: np.random.Generator) -> None:
        """Split points [N, n] about the centre into some to ask about and others to find nearby."""
        order = rng.permutation(len(points))
        asked = min(LOOK, len(points) // 2)
        self.asked = points[order[:asked]]
        self.tree = Tree(points[order[asked : asked + MOVED]])
        self.own = self.tree.nearest(self.asked)[0]
        self.diameter = diameter

    def contradict(self, normal: Array, tolerance: float) -> bool:
        """Whether reflected points lie farther from the others than chance and tolerance explain, in the mean."""
        image = self.asked - 2.0 * np.outer(self.asked @ normal, normal)
        farther = (self.tree.nearest(image)[0] - self.own) / self.diameter
        error = float(farther.std()) / math.sqrt(len(farther))
        return float(farther.mean()) - SIGNIFICANT * error > LIMITS[0] * tolerance
