"""Directional spectrum: from the moments alone, how far every direction is from a mirror, an axis, a rotoreflection.

With the harmonic moments turned so that a direction n becomes the z axis (method.md, section 5), the energy of the
coefficients that an operation about n would flip is that operation's miss: l + m odd for the mirror normal to n,
m not 0 mod k for a k-fold axis, l odd for the inversion. Candidates are the local minima over the sphere; geometry
judges them.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from symrefine.geometry import Array, frame_with_z, read_only, unit
from symrefine.groups.standard import GOLDEN
from symrefine.moments.harmonics import harmonic_moments, to_polar_axis
from symrefine.moments.moments import Moments, transformed
from symrefine.rounding import START_ERROR
from symrefine.shape import Index
from symrefine.surface.tree import Tree

# Directions on the half sphere: 3.7 degrees apart, against 11 degrees that order 8 can resolve.
DIRECTIONS = 1500
# Eigenvalues of the covariance are bounded from below by this fraction of the largest before whitening.
THIN = 1e-3


@lru_cache(maxsize=1)
def half_sphere() -> Array:
    """Even directions [DIRECTIONS, 3] on the half sphere z > 0 (Fibonacci lattice)."""
    index = np.arange(DIRECTIONS) + 0.5
    z = 1.0 - index / DIRECTIONS
    azimuth = 2.0 * np.pi * GOLDEN * index
    radius = np.sqrt(1.0 - z * z)
    return read_only(np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z], axis=1))


@lru_cache(maxsize=32)
def _table(l: int) -> Array:
    return read_only(to_polar_axis(l, half_sphere()))


@lru_cache(maxsize=1)
def _neighbours() -> Index:
    """The eight nearest directions of each, n ~ -n; [DIRECTIONS, 8]."""
    both = np.concatenate([half_sphere(), -half_sphere()])
    return Tree(both).query(half_sphere(), 8, skip=1)[1] % DIRECTIONS


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spectrum:
    """The energy of each order m about every direction, {l: [DIRECTIONS, 2l+1]}."""

    energies: dict[int, Array]

    @classmethod
    def of(cls, by_degree: dict[int, Array]) -> "Spectrum":
        """That of harmonic coefficients {l: [n_l, 2l+1]}."""
        turned = {l: _table(l).reshape(-1, 2 * l + 1) @ c.T for l, c in by_degree.items()}  # one product each
        return cls(energies={l: np.einsum("kn,kn->k", c, c).reshape(DIRECTIONS, -1) for l, c in turned.items()})

    @classmethod
    def of_moments(cls, moments: Moments) -> "Spectrum":
        """That of the harmonic moments, to their order."""
        return cls.of({l: c[0] for l, c in harmonic_moments(moments).items()})

    def mirror_misses(self) -> Array:
        """Fraction of the energy that the mirror normal to each direction flips, [DIRECTIONS]."""
        return self._share(lambda l, m: (l + m) % 2 == 1)

    def axis_misses(self, order: int) -> Array:
        """Fraction of the energy that a rotation by 2 pi / order about each direction does not keep, [DIRECTIONS]."""
        return self._share(lambda _, m: m % order != 0)

    def _share(self, flipped: Callable[[int, Index], NDArray[np.bool_]]) -> Array:
        lost, total = np.zeros(DIRECTIONS), 0.0
        for l, energy in self.energies.items():
            lost += energy[:, flipped(l, np.arange(-l, l + 1))].sum(axis=1)
            total += float(energy[0].sum())  # turning keeps it
        return lost / max(total, 1e-300)


def local_minima(misses: Array, *, count: int) -> tuple[Array, Array]:
    """Directions [C, 3] of the deepest local minima over the sphere, `count` at most, and what is missed there [C].

    Each is moved to the vertex of a fitted paraboloid.
    """
    lowest = np.flatnonzero(misses <= misses[_neighbours()].min(axis=1))
    lowest = lowest[np.argsort(misses[lowest], kind="stable")][:count]
    return _vertices(misses, lowest), misses[lowest]


def _vertices(misses: Array, lowest: Index) -> Array:
    """Directions [C, 3] of the vertices of paraboloids through the surroundings of some of the directions."""
    here, ring = half_sphere()[lowest], half_sphere()[_neighbours()[lowest]]
    frames = np.array([frame_with_z(u) for u in here]).reshape(-1, 3, 3)
    signs = np.sign(np.einsum("cki,ci->ck", ring, here))
    a, b = np.einsum("cpi,cki,ck->pck", frames[:, :2], ring, signs)
    a, b = (np.pad(v, [(0, 0), (0, 1)]) for v in (a, b))  # the direction itself is the origin
    design = np.stack([np.ones_like(a), a, b, a * a, a * b, b * b], axis=2)
    values = np.append(misses[_neighbours()[lowest]], misses[lowest][:, None], axis=1)
    fit = np.einsum("cik,ck->ic", np.linalg.pinv(design), values)
    hessian = np.stack([2.0 * fit[3], fit[4], fit[4], 2.0 * fit[5]], axis=1).reshape(-1, 2, 2)
    valley = np.linalg.eigvalsh(hessian)[:, 0] > 0.0
    hessian[~valley] = np.eye(2)
    move = -np.linalg.solve(hessian, fit[1:3].T[:, :, None])[:, :, 0]
    move *= np.where(valley, np.minimum(1.0, 0.06 / np.maximum(np.linalg.norm(move, axis=1), 1e-12)), 0.0)[:, None]
    return unit(here + np.einsum("cp,cpi->ci", move, frames[:, :2]))


def whitening(covariance: Array) -> Array:
    """C^(-1/2) up to a factor, [3, 3]: every symmetry of an object commutes with its covariance C, so none is lost, and
    elongated shapes no longer drown what lies around their long axis (method.md, section 5)."""
    values, vectors = np.linalg.eigh(covariance)
    values = np.maximum(values, THIN * values[-1])
    return np.asarray((vectors / np.sqrt(3.0 * values)) @ vectors.T)


def whitened(moments: Moments) -> Moments:
    """Moments of the whitened object; see `whitening`."""
    return transformed(moments, whitening(moments.covariance))


def mirror_candidates(*spectra: Spectrum) -> list[Array]:
    """Normals of candidate mirror planes through the centre by several spectra together, least miss first."""
    count = 16
    found = [local_minima(spectrum.mirror_misses(), count=count) for spectrum in spectra]
    directions, misses = (np.concatenate(part) for part in zip(*found, strict=True))
    return apart(directions[np.argsort(misses, kind="stable")], np.radians(5.0))[:count]


def apart(directions: Iterable[Array], angle_rad: float = START_ERROR) -> list[Array]:
    """The directions without those within an angle of an earlier one."""
    kept: list[Array] = []
    for d in directions:
        if all(abs(d @ k) < np.cos(angle_rad) for k in kept):
            kept.append(d)
    return kept
