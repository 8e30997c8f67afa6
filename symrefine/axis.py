"""From moments to an axis, its fold b and the start angles in closed form, then to a frame polished on the moments."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from symrefine.geometry import Array, frame_with_z, read_only, rotation
from symrefine.harmonics import generators, to_polar_axis, turn
from symrefine.ntuples.contract import NTuples

TupleKind = Literal["none", "plane", "axis", "vanish"]

# A singular value speaks when it exceeds what sampling noise alone gives by this factor.
SIGNIFICANT = 3.0
# ... and, for exact moments, twice this fraction of the bound |v| <= 1: below it the miss is a matter of the tolerance.
FLOOR = 2e-3
MAX_FOLD = 36
# Points that are enough for the azimuthal spectrum.
AZIMUTHS = 10000
# A step shorter than this (radians) ends the polish: the points take over from there.
POLISHED = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TupleClass:
    """What the singular values of the n-tuples say: the dimension of the subspace the symmetry group fixes.

    Attributes:
        kind: "none" (rank 3, C1), "plane" (rank 2, Cs), "axis" (rank 1, Cn or Cnv), "vanish" (rank 0, all else).
        singular_values: [3] of the scaled tuples.
        significance: [3] each divided by its standard deviation under sampling noise (inf where moments are exact).
        directions: [3, 3] right singular vectors as rows: the first spans the axis, the last is the plane's normal.
    """

    kind: TupleKind
    singular_values: Array
    significance: Array
    directions: Array

    def __post_init__(self) -> None:
        for name in ("singular_values", "significance", "directions"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


def classify(tuples: NTuples) -> TupleClass:
    """Rank of the n-tuples against the sampling noise of their singular values (method.md, section 3).

    Tuples are weighted by their own noise first, so that no noisy high order drowns a precise low one.
    """
    noise = tuples.noise
    weights = 1.0 / np.sqrt(noise**2 + FLOOR**2)
    weighted = tuples.vectors * weights[:, None]
    _, values, directions = np.linalg.svd(weighted, full_matrices=True)
    values = np.pad(values, (0, 3 - len(values)))
    sigma = tuples.noise_along(directions, weights)
    significance = values / np.hypot(sigma, np.sqrt(len(weighted)) * FLOOR * weights.min() / 1.5)
    rank = int((significance > SIGNIFICANT).sum())
    kinds: tuple[TupleKind, ...] = ("vanish", "axis", "plane", "none")
    return TupleClass(
        kind=kinds[rank],
        singular_values=np.linalg.svd(tuples.vectors, compute_uv=False)[:3],
        significance=significance,
        directions=directions,
    )


def azimuthal_spectrum(points: Array, weights: Array, axis: Array, max_fold: int = MAX_FOLD) -> tuple[Array, Array]:
    """Azimuthal coefficients about an axis through the origin.

    `c_kq = sum w f_q(rho, h) e^(i k phi)` with the slowly varying f = rho * (1, h, h^2, rho): bounded in k, unlike
    the polynomial rho^k, so that high folds (gears) stay above the noise of the outermost points.

    Returns: c [max_fold + 1, 4] complex, and the standard deviation [4] of each if the azimuths were random.
    """
    thin = -(-len(points) // AZIMUTHS)
    points, weights = points[::thin], weights[::thin]
    x, y, h = frame_with_z(axis) @ points.T
    rho = np.hypot(x, y)
    phase = np.divide(x + 1j * y, rho, out=np.zeros(len(rho), complex), where=rho > 0)
    radial = weights[:, None] * rho[:, None] * np.stack([np.ones_like(h), h, h * h, rho], axis=1)
    powers = np.empty((max_fold + 1, len(rho)), complex)
    powers[0] = 1.0
    for k in range(max_fold):
        np.multiply(powers[k], phase, out=powers[k + 1])
    return powers.real @ radial + 1j * (powers.imag @ radial), np.sqrt((radial**2).sum(axis=0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoldCandidate:
    """A fold b with the frame (rows p0, p1, u) whose mirror planes contain u and stand at multiples of pi/b from p0."""

    fold: int
    frame: Array
    leak: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "frame", read_only(self.frame))


def fold_candidates(points: Array, weights: Array, axis: Array, *, leak_max: float = 0.35) -> list[FoldCandidate]:
    """Folds b >= 2 whose multiples carry the azimuthal energy beyond the noise, the least leaking first.

    For C_b only k = 0 mod b survives; for C_bv all phases arg(c_k)/k agree on the mirrors (method.md, section 4).
    An empty list means a surface of revolution as far as the azimuthal spectrum can tell, or no axis at all.
    """
    c, sigma = azimuthal_spectrum(points, weights, axis)
    energy = _energy_over_noise(c, sigma)
    energy[0] = 0.0
    k = np.arange(len(energy))
    if energy.max() < 12.0:
        return []
    total = energy.sum()
    found = []
    for b in range(2, len(energy) // 2 + 1):
        leak = 1.0 - energy[(k % b == 0)].sum() / total
        if leak < leak_max and energy[b] > 6.0:
            best = int(np.argmax(np.abs(c[b]) / sigma))
            phase = rotation([0, 0, 1], -np.angle(c[b, best]) / b)
            found.append(FoldCandidate(fold=b, frame=phase @ frame_with_z(axis), leak=float(leak)))
    # A divisor of the true fold leaks no more than it: prefer the largest fold among equals.
    return sorted(found, key=lambda f: (round(f.leak, 1), -f.fold))


def fold_energy(points: Array, weights: Array, axis: Array, fold: int) -> float:
    """Azimuthal energy at one order about an axis through the origin, over what random azimuths would show."""
    return float(_energy_over_noise(*azimuthal_spectrum(points, weights, axis, fold))[fold])


def _energy_over_noise(c: Array, sigma: Array) -> Array:
    sigma = np.where(sigma > 0, sigma, np.inf)  # a flat object has no height to weigh azimuths with
    return np.clip(np.abs(c) ** 2 / sigma**2 - 1.0, 0.0, None).sum(axis=1)


def polish_frame(harmonics: dict[int, Array], frame: Array, fold: int, *, steps: int = 6) -> Array:
    """Turn a C_bv frame until the moments that break the group vanish: Gauss-Newton on SO(3), noise-weighted.

    In the frame, the invariant coefficients are cos(m phi) with b | m; every other one is a residual whose derivative
    under a small rotation is the generator applied to the coefficients. For fold 1 the group is Cs with normal p1.

    Args:
        harmonics: c[p,l,m] with jackknife replicates, about the centre the axis passes through.
        frame: rows (p0, p1, u).
        fold: b.

    Returns: the polished frame, rows (p0, p1, u).
    """
    turned = {l: _in_frame(c[0], l, frame) for l, c in harmonics.items()}
    weights = {l: _weights(c) for l, c in harmonics.items()}
    for _ in range(steps):
        hessian, gradient = np.zeros((3, 3)), np.zeros(3)
        for l, c in turned.items():
            m = np.arange(-l, l + 1)
            breaking = (m < 0) | (m % fold != 0)
            jacobian = (c @ generators(l).transpose(0, 2, 1))[:, :, breaking]
            weighted = (jacobian * weights[l]).reshape(3, -1)
            hessian += weighted @ jacobian.reshape(3, -1).T
            gradient += weighted @ c[:, breaking].ravel()
        hessian += 1e-9 * np.trace(hessian) * np.eye(3)
        step = -np.linalg.solve(hessian, gradient)
        step *= min(1.0, 0.15 / max(float(np.linalg.norm(step)), 1e-12))
        turned = {l: c @ _small_turn(l, step).T for l, c in turned.items()}
        frame = _small_rotation(step) @ frame
        if np.linalg.norm(step) < POLISHED:
            break
    return frame


def _in_frame(c: Array, l: int, frame: Array) -> Array:
    to_pole = to_polar_axis(l, frame[2])
    spin = frame @ to_polar_axis_rotation(frame[2]).T
    angle = np.arctan2(spin[1, 0], spin[0, 0])
    return c @ (turn(l, 2, np.array(angle)) @ to_pole).T


def to_polar_axis_rotation(direction: Array) -> Array:
    """The rotation R_y(-theta) R_z(-phi) that `to_polar_axis` represents."""
    theta = np.arctan2(np.hypot(direction[0], direction[1]), direction[2])
    phi = np.arctan2(direction[1], direction[0])
    return rotation([0, 1, 0], -theta) @ rotation([0, 0, 1], -phi)


def _weights(c: Array) -> Array:
    """Inverse variance [n_p, 1] of the coefficients of each order, from the replicates; ones where they are exact.

    The mean over m does not change when the frame turns.
    """
    parts = len(c) - 1
    if parts == 0:
        return np.ones((c.shape[1], 1))
    return 1.0 / ((parts - 1) * c[1:].var(axis=0).mean(axis=1, keepdims=True) + 1e-8)


def _small_rotation(step: Array) -> Array:
    return rotation([1, 0, 0], step[0]) @ rotation([0, 1, 0], step[1]) @ rotation([0, 0, 1], step[2])


def _small_turn(l: int, step: Array) -> Array:
    return turn(l, 0, np.array(step[0])) @ turn(l, 1, np.array(step[1])) @ turn(l, 2, np.array(step[2]))
