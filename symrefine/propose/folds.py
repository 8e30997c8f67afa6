"""From moments to an axis, its fold b and the start angles in closed form, then to a frame polished on the moments."""

from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, ReadOnly, frame_with_z, rotation
from symrefine.groups.names import CLOSED_FOLD
from symrefine.rounding import DOUBLE

# Bins of the circle for each order: what a bin blurs is then below a hundredth, and is put right.
BINS_PER_ORDER = 16
# Share of the azimuthal energy that may be no multiple of a fold.
LEAK = 0.35
# Share of surfaces of revolution that may show a fold by chance: the squares are exponential, so their largest is told.
CHANCE = 0.01


def azimuthal_spectrum(points: Array, weights: Array, axis: Array) -> tuple[Array, Array]:
    """Azimuthal coefficients about an axis through the origin.

    `c_kq = sum w f_q(rho, h) e^(i k phi)` with the slowly varying f = rho * (1, h, h^2, rho): bounded in k, unlike
    the polynomial rho^k, so that high folds (gears) stay above the noise of the outermost points.

    Returns: c [CLOSED_FOLD + 1, 4] complex, and the standard deviation [4] of each if the azimuths were random.
    """
    radial, azimuths, sigma = _around(points, weights, axis)
    bins = BINS_PER_ORDER * CLOSED_FOLD
    place = np.floor(azimuths * (bins / (2.0 * np.pi))).astype(np.int64) % bins
    binned = np.stack([np.bincount(place, weights=r, minlength=bins) for r in radial])
    k = np.arange(CLOSED_FOLD + 1)
    middle = np.exp(1j * np.pi * k / bins) / np.sinc(k / bins)
    return (np.conj(np.fft.rfft(binned))[:, : CLOSED_FOLD + 1] * middle).T, sigma


def _around(points: Array, weights: Array, axis: Array) -> tuple[Array, Array, Array]:
    """The weighted f_q [4, N] of points [N, 3], their azimuths [N], and the norms [4] of f_q; 0 for mere rounding."""
    x, y, h = frame_with_z(axis) @ points.T
    rho = np.hypot(x, y)
    radial = weights * rho * np.stack([np.ones_like(h), h, h * h, rho])
    norms = np.sqrt((radial**2).sum(axis=1))
    # A flat object has no height to weigh azimuths with, but for what rounding leaves of it.
    return radial, np.arctan2(y, x), np.where(norms > DOUBLE * norms.max(), norms, 0.0)


def _over(c: Array, sigma: Array) -> Array:
    """How far coefficients [4] stand out of chance; 0 of a ring that nothing is on, which has neither."""
    return np.divide(np.abs(c), sigma, out=np.zeros_like(sigma), where=sigma > 0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoldCandidate(ReadOnly):
    """A fold b with the frame (rows p0, p1, u) whose mirror planes contain u and stand at multiples of pi/b from p0."""

    fold: int
    frame: Array
    leak: float


def folds_of(spectrum: tuple[Array, Array], axis: Array) -> list[FoldCandidate]:
    """Folds b >= 2 whose multiples carry the azimuthal energy about an axis beyond the noise, the least leaking first.

    For C_b only k = 0 mod b survives; for C_bv all phases arg(c_k)/k agree on the mirrors (method.md, section 4).
    An empty list means a surface of revolution as far as the azimuthal spectrum can tell, or no axis at all.
    """
    c, sigma = spectrum
    energy = _energy_over_noise(c, sigma)
    energy[0] = 0.0
    k = np.arange(len(energy))
    total = energy.sum()
    if total == 0.0:
        return []
    found = []
    for b in range(2, len(energy) // 2 + 1):
        leak = 1.0 - energy[(k % b == 0)].sum() / total
        if leak < LEAK and energy[b] > 0.0:
            phase = rotation([0, 0, 1], -np.angle(c[b, np.argmax(_over(c[b], sigma))]) / b)
            found.append(FoldCandidate(fold=b, frame=phase @ frame_with_z(axis), leak=float(leak)))
    # A divisor of the true fold leaks no more than it: prefer the largest fold among equals.
    return sorted(found, key=lambda f: (round(f.leak, 1), -f.fold))


def mirror_through(spectrum: tuple[Array, Array], axis: Array) -> Array | None:
    """Normal [3] of the mirror through an axis that azimuths tell best, whatever else repeats; None if they tell none.

    A mirror at azimuth a makes every c_k e^(-i k a) real, so that the sum of the real parts of c_k^2 e^(-2 i k a) is
    largest there, of those c_k that stand out of chance.
    """
    c, sigma = spectrum
    told = (c / np.where(sigma > 0.0, sigma, np.inf)) ** 2
    told[np.abs(told) < np.log(c.size / CHANCE)] = 0.0
    told[0] = 0.0
    if not told.any():
        return None
    count = BINS_PER_ORDER * len(c)
    azimuth = np.pi / count * int(np.fft.fft(told.sum(axis=1), count).real.argmax())
    return np.asarray(rotation([0, 0, 1], -azimuth)[1] @ frame_with_z(axis))


def frames_across(points: Array, weights: Array, axis: Array, fold: int) -> list[Array]:
    """Frames (rows p0, p1, u) about an axis u of known fold, in which a half turn about p0 would turn it over.

    Such a turn at azimuth a takes (rho, phi, h) to (rho, 2 a - phi, -h). So the phase of `c_k` is k a modulo pi where f
    is even in h, as for a mirror through the axis, and k a + pi/2 where it is odd; one frame by each kind.
    """
    radial, azimuths, sigma = _around(points, weights, axis)
    c = radial @ np.exp(1j * fold * azimuths)
    even = np.argmax(_over(c, sigma) * [1.0, 0.0, 1.0, 1.0])
    phases = (np.angle(c[even]), np.angle(c[1]) - 0.5 * np.pi)
    return [rotation([0, 0, 1], -phase / fold) @ frame_with_z(axis) for phase in phases]


def _energy_over_noise(c: Array, sigma: Array) -> Array:
    """Energy by order beyond what the largest of so many coefficients of random azimuths shows in 99 % of draws."""
    sigma = np.where(sigma > 0, sigma, np.inf)
    return np.clip(np.abs(c) ** 2 / sigma**2 - np.log(c.size / CHANCE), 0.0, None).sum(axis=1)
