"""The finite point groups in their standard placement: all operations, and the elements a chemist lists.

The main axis is z. Vertical mirrors of Cnv and Dnh include the xz plane (normal y); two-fold axes of Dn, Dnh and Dnd
include x. T, Td, Th, O, Oh have the cube axes along x, y, z; I and Ih have three two-fold axes there and five-fold axes
along (0, 1, golden ratio) and its cyclic permutations.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from symrefine.geometry import Array, read_only, rotation
from symrefine.groups.names import Symbol
from symrefine.groups.orthogonal import Index, about_z, axes_and_angles, determinants, unique_lines
from symrefine.rounding import SINGLE

OrderedAxis = tuple[Array, float]
# The golden section, in which icosahedra are cut.
GOLDEN = (1.0 + np.sqrt(5.0)) / 2.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Elements:
    """Symmetry elements of one group: unit normals [m, 3], (direction, order) pairs, and whether -1 belongs to it."""

    mirrors: Array
    axes: tuple[OrderedAxis, ...]
    improper: tuple[OrderedAxis, ...]
    inversion: bool


@lru_cache(maxsize=512)
def standard_operations(symbol: Symbol) -> Array:
    """All matrices [order, 3, 3] of a finite group, read-only, proper ones (determinant +1) first."""
    operations = _polyhedral(symbol.family) if symbol.fold == 0 else _axial(symbol.family, int(symbol.fold))
    operations = np.where(np.abs(operations) < 1e-15, 0.0, operations)
    return read_only(operations[np.argsort(-determinants(operations), kind="stable")])


def _axial(family: str, fold: int) -> Array:
    """Cosets of the rotations about z, each by what it does to z and across it, and the steps that it turns by."""
    turn, through, across, flip = (1, 1, 0.0), (1, -1, 0.0), (-1, 1, 0.0), (-1, -1, 0.0)
    cosets = {
        "C": [turn],
        "Cv": [turn, through],
        "Ch": [turn, across],
        "S": [turn, (-1, 1, 0.5)],
        "D": [turn, flip],
        "Dh": [turn, flip, across, through],
        "Dd": [turn, flip, (-1, 1, 0.5), (1, -1, 0.5)],
    }
    ends, dets, steps = np.repeat(cosets[family], fold, axis=0).T
    steps = steps + dets * np.tile(np.arange(fold), len(cosets[family]))
    return about_z(ends, dets, 2.0 * np.pi * steps / fold)


def _polyhedral(family: str) -> Array:
    """Signed permutation matrices for the cube groups; I is T times the five rotations about one five-fold axis."""
    signed = np.array(
        [np.diag(s) @ np.eye(3)[list(p)] for p in permutations(range(3)) for s in product((1, -1), repeat=3)]
    )
    det, sign = determinants(signed), signed.sum(axis=2).prod(axis=1)
    even = det == sign  # the permutation part alone is a rotation
    keep = {"T": even & (det > 0), "Th": even, "Td": sign > 0, "O": det > 0, "Oh": det != 0}
    if family in keep:
        return np.asarray(signed[keep[family]])
    fifths = [rotation([0.0, 1.0, GOLDEN], 2.0 * np.pi * k / 5) for k in range(5)]
    rotations = np.concatenate([fifth @ signed[keep["T"]] for fifth in fifths])
    return rotations if family == "I" else np.concatenate([rotations, -rotations])


@lru_cache(maxsize=512)
def standard_elements(symbol: Symbol) -> Elements:
    """Mirrors, rotation axes and improper axes of a finite group.

    An axis carries its highest order. An improper axis is listed as S_k with k = n if a mirror lies across the n-fold
    axis (as in Cnh, Dnh) and k = 2n otherwise (as in S2n, Dnd, Td), and only for k >= 3: S1 is a mirror and S2 the
    inversion.
    """
    operations = standard_operations(symbol)
    det = determinants(operations)
    axes, angles = axes_and_angles(operations)
    turns = angles > SINGLE
    lines, counts = unique_lines(axes[turns & (det > 0)])
    mirrors, _ = unique_lines(axes[(det < 0) & (angles > np.pi - SINGLE)])
    improper, _ = unique_lines(axes[turns & (det < 0)])
    folds = 1 + _same_line(improper, lines) @ counts
    orders = np.where(_same_line(improper, mirrors).any(axis=1), folds, 2 * folds)
    return Elements(
        mirrors=read_only(mirrors),
        axes=_by_order(lines, counts + 1),
        improper=_by_order(improper[orders >= 3], orders[orders >= 3]),
        inversion=bool(np.any((det < 0) & ~turns)),
    )


def _same_line(a: Array, b: Array) -> NDArray[np.bool_]:
    """Whether direction a_i and direction b_j span the same line."""
    return np.asarray(np.abs(a @ b.T) > 1.0 - 1e-9)


def _by_order(directions: Array, orders: Index) -> tuple[OrderedAxis, ...]:
    return tuple((read_only(directions[i]), int(orders[i])) for i in np.argsort(-orders, kind="stable"))
