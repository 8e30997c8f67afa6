"""Orthogonal maps between two objects from all their harmonic moments: candidates over O(3), and Gauss-Newton on it.

Under x -> R x the harmonic moments of degree l turn by the orthogonal D_l(R) (`harmonics`), reflections included with
D_l(-R) = (-1)^l D_l(R). Which R explains the pair is the least squares problem

    cost(R) = sum_(l,p) w_lp |D_l(R) a_lp - b_lp|^2 = const - 2 sum_l tr(D_l(R) K_l'),   K_l = sum_p w_lp b_lp a_lp',

with weights from the sampling noise of both sides. The second form is linear in D_l, so a table of D_l over an even
grid of rotations gives the whole landscape, both determinants at once, in one matrix product.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrefine.geometry import Array, read_only
from symrefine.moments.harmonics import generators, harmonic_moments, turn
from symrefine.moments.moments import Moments, exponents
from symrefine.propose.spectrum import whitened
from symrefine.shape import Index

# Rotations of the grid: 11 degrees to the nearest one at worst, against hills 30 degrees wide at degree 6.
GRID = 6000
GRID_DEGREE = 6
# Maxima nearer than this are the same hill.
APART_RAD = 0.35
# Variance of a coefficient that no sample takes away: two files of one model differ by as much.
FLOOR = 1e-8
# Added to the strength of a row of coefficients before it is divided by it: weak rows are noise.
WEAK = 1e-3
# Entries of a generator below this are rounding; those that are not are 1 at least.
NOTHING = 1e-9
# Longest step of the Gauss-Newton, radians. It ends with a step of 1e-7, after which quadratic convergence leaves 1e-14
# where the moments agree to rounding, or where the costs stand still because they do not.
STEP = 0.3
SETTLED, STANDSTILL = 1e-7, 1e-5


# Degree l of each row of coefficients, in their order along a flat array: rows of 2l+1, m = -l..l in each.
Rows = tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HarmonicPair:
    """Coefficients of both objects that D(R) should map onto each other, all degrees side by side.

    Attributes:
        source: [1 + B, C], the whole first, then its jackknife replicates.
        target: [1 + B', C].
        weights: [C] inverse variances of the difference of the two, alike along a row.
        rows: degree of each row.
    """

    source: Array
    target: Array
    weights: Array
    rows: Rows

    @property
    def size(self) -> int:
        """Number of coefficients compared."""
        return len(self.weights)

    def of_degree(self, l: int) -> slice:
        """Where the coefficients of a degree stand."""
        start = sum(2 * k + 1 for k in self.rows if k < l)
        return slice(start, start + (2 * l + 1) * self.rows.count(l))


def harmonic_pair(source: Moments, target: Moments) -> HarmonicPair:
    """All harmonic moments of both objects, weighted by the jackknife variances of both sides."""
    by_degree = harmonic_moments(source), harmonic_moments(target)
    a, b = (np.concatenate([c.reshape(len(c), -1) for c in side.values()], axis=1) for side in by_degree)
    rows = tuple(l for l, c in by_degree[0].items() for _ in range(c.shape[1]))
    return HarmonicPair(source=a, target=b, weights=1.0 / (_variance(a, rows) + _variance(b, rows) + FLOOR), rows=rows)


def _variance(c: Array, rows: Rows) -> Array:
    """Sampling variance [C] of a component of each row of coefficients; zero where the moments are exact."""
    parts = len(c) - 1
    if parts == 0:
        return np.zeros(c.shape[1])
    lengths = 2 * np.array(rows) + 1
    sums = np.add.reduceat((parts - 1) * c[1:].var(axis=0), np.cumsum(lengths) - lengths)
    return np.repeat(sums / lengths, lengths)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Layout:
    """Flat coefficients: |m| and l of each, where its partner -m stands, and the sign with which a turn mixes it in.

    `tip` [C, C] is D of the quarter turn about x, transposed, between which R_y(b) is R_z(b); `generators` [3C, C] are
    the three of them on top of one another, of four entries a row at most.
    """

    m: Index
    l: Index
    partner: Index
    sign: Array
    tip: Array
    generators: Any

    def turned(self, c: Array) -> Array:
        """Changes [K, 3, C] of coefficients [K, C] under small turns about x, y and z."""
        return np.asarray((self.generators @ c.T).T.reshape(len(c), 3, -1))


@lru_cache(maxsize=32)
def _layout(rows: Rows) -> _Layout:
    from scipy.linalg import block_diag
    from scipy.sparse import csr_array

    stacked = np.concatenate([block_diag(*(generators(l)[k] for l in rows)) for k in range(3)])
    m = np.concatenate([np.arange(-l, l + 1) for l in rows])
    l = np.repeat(rows, [2 * l + 1 for l in rows])
    return _Layout(
        m=np.abs(m),
        l=l,
        partner=np.arange(len(m)) - 2 * m,
        sign=-np.sign(m).astype(np.float64),
        tip=read_only(block_diag(*(turn(l, 0, np.array(np.pi / 2)).T for l in rows))),
        generators=csr_array(np.where(np.abs(stacked) > NOTHING, stacked, 0.0)),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Turner:
    """D(R) of K orthogonal matrices, applied to coefficients without ever being formed.

    R = det(R) R_z(a) R_y(b) R_z(c): a turn about z mixes m with -m only, and a constant quarter turn takes y to z.
    """

    signs: Array
    phases: tuple[tuple[Array, Array], ...]

    @classmethod
    def of(cls, matrices: Array, degree: int) -> "Turner":
        """For orthogonal matrices [K, 3, 3] and all l <= `degree`."""
        signs = np.sign(np.linalg.det(matrices))
        m = np.arange(degree + 1)
        angles = [np.multiply.outer(angle, m) for angle in euler_zyz(matrices * signs[:, None, None])]
        return cls(signs=signs, phases=tuple((np.cos(a), np.sin(a)) for a in angles))

    def __call__(self, c: Array, rows: Rows) -> Array:
        """D(R) c, [K, P, C], for flat coefficients [P, C] whose rows have these degrees."""
        layout, (first, second, third) = _layout(rows), self.phases
        out = _spin(_spin(_spin(c, third, layout) @ layout.tip, second, layout) @ layout.tip.T, first, layout)
        parity = np.where(layout.l % 2, self.signs[:, None], 1.0)
        return np.asarray(out * parity[:, None])


def _spin(c: Array, phase: tuple[Array, Array], layout: _Layout) -> Array:
    """D of turns about z by K angles, given as cos and sin of m times each [K, degree + 1], on c [P or K, P, C]."""
    cosine, sine = (values[:, None, layout.m] for values in phase)
    return np.asarray(cosine * c + (layout.sign * sine) * c[..., layout.partner])


def euler_zyz(rotations: Array) -> tuple[Array, Array, Array]:
    """Angles (a, b, c) [K] with R = R_z(a) R_y(b) R_z(c), accurate where b vanishes too."""
    r = rotations
    a = np.arctan2(r[:, 1, 2], r[:, 0, 2])
    b = np.arctan2(np.hypot(r[:, 0, 2], r[:, 1, 2]), r[:, 2, 2])
    # The second row of R_z(-a) R is (sin c, cos c, 0) whatever b is.
    row = np.cos(a)[:, None] * r[:, 1, :2] - np.sin(a)[:, None] * r[:, 0, :2]
    return a, b, np.arctan2(row[:, 0], row[:, 1])


@lru_cache(maxsize=1)
def grid_rotations() -> Array:
    """Even rotations [GRID, 3, 3] (super-Fibonacci spirals; Alexa 2022)."""
    i = np.arange(GRID) + 0.5
    low, high = np.sqrt(i / GRID), np.sqrt(1.0 - i / GRID)
    alpha, beta = 2.0 * np.pi * i / np.sqrt(2.0), 2.0 * np.pi * i / 1.533751168755204288118041
    x, y, z, w = low * np.sin(alpha), low * np.cos(alpha), high * np.sin(beta), high * np.cos(beta)
    half = [
        [-y * y - z * z, x * y - z * w, x * z + y * w],
        [x * y + z * w, -x * x - z * z, y * z - x * w],
        [x * z - y * w, y * z + x * w, -x * x - y * y],
    ]
    return read_only(np.eye(3) + 2.0 * np.array(half).transpose(2, 0, 1))


@lru_cache(maxsize=GRID_DEGREE)
def _grid_table(l: int) -> "np.ndarray[tuple[int, int], np.dtype[np.float32]]":
    """D_l over the grid, [GRID, (2l+1)^2], transposed and in single precision: it only ranks."""
    turned = Turner.of(grid_rotations(), l)(np.eye(2 * l + 1), (l,))
    return turned.reshape(GRID, -1).astype(np.float32)


def _up_to(moments: Moments, order: int) -> Moments:
    """The moments of the lower orders; replicates are left behind."""
    count = len(exponents(moments.dim, order))
    return replace(moments, order=order, values=moments.values[:count], replicates=np.empty((0, count)))


def landscape(source: Moments, target: Moments, pair: HarmonicPair) -> tuple[Array, Array]:
    """Correlation of the two objects under every rotation R of the grid, and under -R: [GRID] each.

    The objects are whitened first (`spectrum.whitened`): every orthogonal map between them maps their whitened forms as
    well, and what lies around a long axis counts as much as the axis. The covariance joins as one more row of l = 2.
    """
    low_a, low_b = (_up_to(m, min(GRID_DEGREE, m.order)) for m in (source, target))
    white_a, white_b = harmonic_moments(whitened(low_a)), harmonic_moments(whitened(low_b))
    even, odd = np.zeros(GRID), np.zeros(GRID)
    for l in range(1, min(GRID_DEGREE, source.order) + 1):
        here = pair.of_degree(l)
        a, b = white_a[l][0], white_b[l][0]
        noise = (2 * l + 1) / pair.weights[here][:: 2 * l + 1][: len(a)]
        if l == 2:  # whitening has emptied the first row
            a[0], b[0] = pair.source[0, here][:5], pair.target[0, here][:5]
        strength = np.sqrt((a**2).sum(axis=1) * (b**2).sum(axis=1))
        kernel = (a / (strength + noise + WEAK)[:, None]).T @ b
        (odd if l % 2 else even)[:] += _grid_table(l) @ kernel.ravel().astype(np.float32)
    return even + odd, even - odd


def hills(scores: Array, det: int, *, count: int) -> Array:
    """The `count` highest hills of one of the two landscapes, as matrices [count, 3, 3] of determinant `det`."""
    rest = scores.copy()
    flat = grid_rotations().reshape(GRID, 9)
    chosen: list[int] = []
    for _ in range(count):
        chosen.append(int(np.argmax(rest)))
        rest[flat @ flat[chosen[-1]] > 1.0 + 2.0 * np.cos(APART_RAD)] = -np.inf
    return np.asarray(det * grid_rotations()[chosen])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HarmonicFit:
    """Orthogonal matrices [K, 3, 3] by rising cost [K], with their Gauss-Newton matrices [K, 3, 3]."""

    matrices: Array
    costs: Array
    hessians: Array

    def __getitem__(self, index: slice | NDArray[Any]) -> "HarmonicFit":
        return HarmonicFit(matrices=self.matrices[index], costs=self.costs[index], hessians=self.hessians[index])


def fit(pair: HarmonicPair, starts: Array, *, steps: int = 10) -> HarmonicFit:
    """Gauss-Newton on O(3) over all harmonic moments from each start [K, 3, 3]; the determinants stay.

    A small rotation w in the target's axes changes D_l(R) a by (w.J) D_l(R) a with the generators J, so the Jacobian
    costs no more than the residual.
    """
    matrices = np.array(starts, dtype=np.float64)
    costs, gradients, hessians = _linearised(pair, matrices)
    for _ in range(steps):
        ridge = 1e-12 * np.trace(hessians, axis1=1, axis2=2) + 1e-300
        step = -np.linalg.solve(hessians + ridge[:, None, None] * np.eye(3), gradients[:, :, None])[:, :, 0]
        length = np.linalg.norm(step, axis=1)
        step *= np.minimum(1.0, STEP / np.maximum(length, STEP))[:, None]
        trial = _rotations(step) @ matrices
        there = _linearised(pair, trial)
        better = there[0] <= costs
        still = bool(np.all(better & (costs - there[0] < STANDSTILL * there[0])))
        costs = np.where(better, there[0], costs)
        matrices = np.where(better[:, None, None], trial, matrices)
        # A step that does not descend is halved.
        gradients = np.where(better[:, None], there[1], 0.5 * gradients)
        hessians = np.where(better[:, None, None], there[2], hessians)
        if still or length.max() < SETTLED:
            break
    u, _, vt = np.linalg.svd(matrices)
    order = np.argsort(costs, kind="stable")
    return HarmonicFit(matrices=(u @ vt)[order], costs=costs[order], hessians=hessians[order])


def _linearised(pair: HarmonicPair, matrices: Array) -> tuple[Array, Array, Array]:
    """Costs [K], gradients [K, 3] and Gauss-Newton matrices [K, 3, 3]."""
    root = np.sqrt(pair.weights)
    here = (Turner.of(matrices, max(pair.rows))(pair.source[:1], pair.rows) * root)[:, 0]
    r = here - pair.target[0] * root
    j = _layout(pair.rows).turned(here)
    return np.einsum("ki,ki->k", r, r), (j @ r[:, :, None])[:, :, 0], j @ j.transpose(0, 2, 1)


def _rotations(vectors: Array) -> Array:
    """Rotations [K, 3, 3] by rotation vectors [K, 3] (Rodrigues, with sin x / x for small angles)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = vectors.T
    o = np.zeros_like(x)
    k = np.array([[o, -z, y], [z, o, -x], [-y, x, o]]).transpose(2, 0, 1)
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * k + 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2 * (k @ k))


def mismatch(pair: HarmonicPair, matrices: Array) -> Array:
    """Largest difference [K] between any coefficient of the target and of the source, moved: rounding, or not."""
    turned = Turner.of(matrices, max(pair.rows))(pair.source[:1], pair.rows)[:, 0]
    return np.asarray(np.abs(turned - pair.target[0]).max(axis=1))


def rotation_covariance(pair: HarmonicPair, matrix: Array, hessian: Array) -> Array:
    """Jackknife covariance [3, 3] of the fitted rotation (target axes) from the replicates of both sides.

    The coefficients of one object share their points, so their errors are correlated and the inverse of the
    Gauss-Newton matrix is too small by up to a factor of fifty; re-fitting the replicates, by one step, is not.
    """
    turner = Turner.of(matrix[None], max(pair.rows))
    inverse = np.linalg.pinv(hessian, rcond=1e-12, hermitian=True)
    moved = _layout(pair.rows).turned(turner(pair.source[:1], pair.rows)[0] * pair.weights)[0]
    return inverse @ _projected_covariance(pair, turner, moved) @ inverse


def _projected_covariance(pair: HarmonicPair, turner: Turner, directions: Array) -> Array:
    """Jackknife covariance [A, A] of the residual `D(R) a - b` along directions [A, C]."""
    total: Array = np.zeros((len(directions), len(directions)))
    for side in (pair.source, pair.target):
        parts = len(side) - 1
        if not parts:
            continue
        spread = side[1:] - side[1:].mean(axis=0)
        if side is pair.source:
            spread = turner(spread, pair.rows)[0]
        along = spread @ directions.T
        total += (parts - 1) / parts * along.T @ along
    return total


def preference(pair: HarmonicPair, better: Array, other: Array) -> float:
    """By how many standard deviations of sampling noise the moments prefer one matrix [3, 3] to another.

    With d = D(R) a - D(R') a the difference of the costs is linear in the residual r = D(R) a - b, namely
    `|d|^2 - 2 d.r`; its noise is that of 2 d.r. Unlike the costs themselves, whose many coefficients err together, this
    tells chiral objects (3.6 and more on 10,000 points) from mirror-symmetric ones (below 2.5, nearly symmetric ones
    below 4.2).
    """
    both = Turner.of(np.stack([better, other]), max(pair.rows))(pair.source[:1], pair.rows)[:, 0]
    here, there = both
    direction = pair.weights * (here - there)
    difference = float(pair.weights @ ((there - pair.target[0]) ** 2 - (here - pair.target[0]) ** 2))
    turner = Turner.of(better[None], max(pair.rows))
    variance = float(_projected_covariance(pair, turner, direction[None])[0, 0] + FLOOR * direction @ direction)
    return difference / (2.0 * float(np.sqrt(variance)) + 1e-300)
