"""Angular spectrum: complex moments tell how far each line is from a mirror and each fold from a symmetry.

`c_ks = sum w r^s e^(i k phi)` is the complex moment c_pq = sum w z^p conj(z)^q with p + q = s and p - q = k, continued
to k > s so that high folds (gears) stay bounded. A turn by b multiplies it by e^(i k b): with n-fold turns
only the multiples of n survive. The mirror line at angle a conjugates it and multiplies by e^(2 i k a): all phases
agree on the lines.
"""

from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array

MAX_FOLD = 36
# Two harmonics of the highest fold, and the powers s of the radius.
_HARMONICS = 2 * MAX_FOLD
_POWERS = (1, 2, 4, 6)
# What moments that are exact may differ by, as a fraction of their bound.
FLOOR = 1e-3
# Energy in units of its noise, below which a coefficient says nothing.
_SILENT = 4.0
_ANGLES = 1440
# Misses, as fractions of what a line can miss, beyond which it is not worth a look at the outlines.
HOPELESS_LINE = 0.35
# Energy, in units of the noise, that all harmonics together must have to tell anything: noise alone leaves about 5.
_TELLING = 40.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AngularSpectrum:
    """Coefficients [K + 1, S] over their noise; those within the noise are zero, and so is k = 0."""

    coefficients: Array

    def __post_init__(self) -> None:
        # Not `read_only`, which makes real numbers of them.
        private = np.array(self.coefficients)
        private.flags.writeable = False
        object.__setattr__(self, "coefficients", private)

    @property
    def energy(self) -> Array:
        """[K + 1] of each harmonic."""
        return (np.abs(self.coefficients) ** 2).sum(axis=1)

    def line_misses(self) -> tuple[Array, Array]:
        """Angles [A] in [0, pi) of lines through the centre, and the fraction of the energy that each would flip.

        |c - conj(c) e^(2 i k a)|^2 = 2 |c|^2 - 2 Re(c^2 e^(-2 i k a)): a trigonometric sum in 2 a.
        """
        squares = (self.coefficients**2).sum(axis=1)
        series = np.fft.fft(squares, n=_ANGLES).real
        total = max(float(self.energy.sum()), 1e-300)
        return np.pi * np.arange(_ANGLES) / _ANGLES, 0.5 * (1.0 - series / total)

    def lines(self, count: int) -> Array:
        """Angles of the best candidates for mirror lines, best first: local minima, interpolated."""
        angles, misses = self.line_misses()
        before, after = np.roll(misses, 1), np.roll(misses, -1)
        lowest = np.flatnonzero((misses < before) & (misses <= after) & (misses < HOPELESS_LINE))
        best = lowest[np.argsort(misses[lowest], kind="stable")][:count]
        bend = before[best] + after[best] - 2.0 * misses[best]
        offset = 0.5 * (before[best] - after[best]) / np.maximum(bend, 1e-300)
        return np.asarray(angles[best] + np.clip(offset, -0.5, 0.5) * np.pi / _ANGLES)

    @property
    def tells(self) -> bool:
        """Whether there is more energy than noise makes, so that folds can be ruled out."""
        return float(self.energy.sum()) > _TELLING

    def leak(self, fold: int) -> float:
        """Fraction of the energy beside the multiples of a fold."""
        energy = self.energy
        return 1.0 - float(energy[::fold].sum()) / max(float(energy.sum()), 1e-300)


def angular_spectrum(points: Array, masses: Array, *, sampled: bool, floor: float = FLOOR) -> AngularSpectrum:
    """Spectrum of points [N, 2] about the origin.

    Args:
        points: normalised coordinates.
        masses: [N] with sum 1.
        sampled: whether the points are random samples, so that each coefficient has the noise of their number.
        floor: noise of all coefficients, as a fraction of their bound.
    """
    z = points @ np.array([1.0, 1j])
    radius = np.abs(z)
    phase = np.divide(z, radius, out=np.zeros(len(z), complex), where=radius > 0)
    radial = masses[:, None] * radius[:, None] ** np.array(_POWERS)
    bound = np.maximum(radial.sum(axis=0), 1e-300)
    noise = np.sqrt((radial**2).sum(axis=0)) / bound if sampled else np.zeros(len(_POWERS))
    c = np.zeros((_HARMONICS + 1, len(_POWERS)), complex)
    power = phase.copy()
    for k in range(1, _HARMONICS + 1):
        c[k] = power @ radial
        power *= phase
    c /= bound * np.hypot(noise, floor)
    # Moving the sampled centre to the origin adds to k = 1, for a ring (s + 1) / 2 times the noise of s = 1.
    c[1] /= 0.5 * (1.0 + np.array(_POWERS))
    heard = np.clip(1.0 - _SILENT / np.maximum(np.abs(c) ** 2, _SILENT), 0.0, 1.0)
    return AngularSpectrum(coefficients=c * np.sqrt(heard))
