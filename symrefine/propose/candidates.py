"""Small groups that the moments propose: mirrors, and what may stand about an axis. Evidence is weighed, never obeyed.

The n-tuples give an axis or a plane where they do not vanish, the directional spectrum what they cannot see, and the
azimuthal spectrum the folds about an axis with their phases. Everything is in normalised units (RMS radius 1).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from symrefine.fit.gauss_newton import Linearisation, minimise
from symrefine.fit.placed import Placed
from symrefine.fit.residual import turn_frame
from symrefine.geometry import Array, frame_with_z
from symrefine.groups import MAX_FOLD, PointGroup, close
from symrefine.groups.identify import POLYHEDRAL
from symrefine.groups.names import CLOSED_FOLD
from symrefine.moments.harmonics import (
    FLOOR,
    Harmonics,
    directional_moments,
    flattened,
    harmonic_moments,
    row_variance,
)
from symrefine.moments.moments import Moments
from symrefine.ntuples.rank import FixedSubspace
from symrefine.propose.folds import azimuthal_spectrum, folds_of, frames_across, mirror_through
from symrefine.propose.maps import WITHIN, maps_onto_itself
from symrefine.propose.spectrum import Spectrum, apart, local_minima, mirror_candidates, whitened, whitening
from symrefine.propose.votes import AGREE_RAD, meeting, mirror_votes, revolution
from symrefine.rounding import DOUBLE, START_ERROR
from symrefine.samples import COUNT, FOLLOWED
from symrefine.surface.skin import LocalPlanes

# Primes whose axes the moments tell.
PRIMES = (2, 3, 5, 7)
# Atoms nearer to an axis than these (RMS radii) may stand on it.
ON_AXIS = (0.03, 0.15)
# Longest step (radians) of a frame that is polished on the moments: what the linear model covers.
LONGEST = 0.15


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """What is known before any point is matched: moments, the class of the n-tuples, and points to take azimuths of.

    `atoms` says that the points stand for themselves, so that they can be counted. `vertices` is the group that maps
    those of a mesh, or the points of a cloud, onto one another, where they put it; `proven` that of
    it which maps the faces, too. `told` is what `azimuths` told, by the bytes of their axes.
    """

    moments: Moments
    tuples: FixedSubspace
    points: Array
    weights: Array
    atoms: bool = False
    vertices: Placed | None = None
    proven: Placed | None = None
    told: dict[bytes, tuple[Array, Array]] = field(default_factory=dict)

    @cached_property
    def harmonics(self) -> dict[int, Array]:
        """Solid-harmonic moments with jackknife replicates."""
        return harmonic_moments(self.moments)

    @cached_property
    def spectra(self) -> tuple[Spectrum, Spectrum]:
        """The directional spectra of the whitened moments and of the moments."""
        own = Spectrum.of({l: c[0] for l, c in self.harmonics.items()})
        return Spectrum.of_moments(whitened(self.moments)), own

    def azimuths(self, axis: Array) -> tuple[Array, Array]:
        """The azimuthal spectrum about an axis, which folds and mirrors are both told by."""
        key = axis.tobytes()
        if key not in self.told:
            self.told[key] = azimuthal_spectrum(self.points, self.weights, axis)
        return self.told[key]


def proposals(evidence: Evidence) -> list[Placed]:
    """What the moments propose first: what may stand about the likeliest axes, mirrors and inversion."""
    around = [start for direction in _likely(evidence) for start in about(evidence, direction)]
    # Of what is nearly round nothing but azimuths about the axis of a revolution tells its own mirror from all others.
    axes = [start.group.frame[2] for start in around if start.group.name == "Cinfv"]
    through = (mirror_through(evidence.azimuths(axis), axis) for axis in axes)
    told = [normal for normal in through if normal is not None]
    normals = [*evidence.tuples.directions[::-1], *_principal(evidence), *mirror_candidates(*evidence.spectra), *told]
    return [*around, placed("Ci", np.eye(3)), *(placed("Cs", frame_with_z(n)) for n in apart(normals))]


def voted_mirrors(planes: LocalPlanes) -> list[Placed]:
    """Mirrors, a revolution and a sphere that the local planes of a surface with parts missing vote for."""
    direction, point = revolution(planes.points, planes.normals)
    ball = placed("Kh", np.eye(3), meeting(planes.points, planes.normals))
    mirrors = mirror_votes(planes.points, planes.normals, np.random.default_rng(0), outwards=planes.eyes is not None)
    found = placed("Cinfv", frame_with_z(direction), point)
    return [ball, found, *(placed("Cs", frame_with_z(n), foot) for n, foot in zip(*mirrors, strict=True))]


def repeated(cloud: LocalPlanes, diagonal: float) -> list[Placed]:
    """What single maps of a surface onto itself generate that its local planes agree upon: mirrors, turns, all else.

    A map that also slides along the axis that it turns about, or along its mirror, is no symmetry of a finite body, nor
    is one about something that the body is all on one side of.
    """
    found = []
    for m in maps_onto_itself(cloud, diagonal, np.random.default_rng(0)):
        still = np.eye(3) - m.matrix
        center = np.linalg.pinv(still, rcond=DOUBLE) @ m.shift
        if np.linalg.norm(m.shift - still @ center) > WITHIN * diagonal or np.linalg.norm(center) > diagonal:
            continue
        group = close(m.matrix[None], 0.5 * AGREE_RAD).group
        found += [Placed(group=group, center=center)] if group.order > 1 else []
    return found


def beside_details(known: Placed, details: Array) -> list[Placed]:
    """What may be left of a group about an axis but for details [N, 3], by their azimuths: a mirror, or several."""
    axis = known.group.frame[2]
    spectrum = azimuthal_spectrum(details - known.center, np.ones(len(details)), axis)
    normal = mirror_through(spectrum, axis)
    found = [] if normal is None else [placed("Cs", frame_with_z(normal), known.center)]
    return [*found, *(placed(f"C{f.fold}v", f.frame, known.center) for f in folds_of(spectrum, axis)[:1])]


def prime_axes(evidence: Evidence) -> list[Placed]:
    """Axes of prime order that the moments propose elsewhere: an axis of any order is one of a prime order too."""
    return _axes(evidence.spectra[0], _likely(evidence))


def fine(evidence: Evidence) -> list[Placed]:
    """Axes and mirrors of what is finer than the moments resolve, if that is most of what tells directions apart.

    Of what is spread evenly, such as the spines of an urchin, the moments see nothing. Harmonics to twice their degree
    do, and are about as fine as the directions of a spectrum can show.
    """
    points, weights = evidence.points @ whitening(evidence.moments.covariance), evidence.weights
    every, degree = max(1, len(points) // COUNT), 2 * max(evidence.harmonics)
    energy = {l: (c**2).sum() for l, c in directional_moments(points[::every], weights[::every], degree).items()}
    if 2.0 * sum(energy[l] for l in evidence.harmonics) > sum(energy.values()):
        return []
    spectrum = Spectrum.of(directional_moments(points, weights, degree))
    return [*_axes(spectrum), *(placed("Cs", frame_with_z(n)) for n in mirror_candidates(spectrum))]


def _axes(spectrum: Spectrum, known: Sequence[Array] = ()) -> list[Placed]:
    """Axes of prime order that a spectrum proposes beside known directions."""
    found = []
    for k in PRIMES:
        minima, _ = local_minima(spectrum.axis_misses(k), count=5)
        found += [placed(f"C{k}", frame_with_z(d)) for d in apart([*known, *minima])[len(known) :]]
    return found


def _likely(evidence: Evidence) -> list[Array]:
    return apart(np.concatenate([evidence.tuples.directions[:1], _principal(evidence)]))


def about(evidence: Evidence, direction: Array) -> list[Placed]:
    """What may stand about a direction: revolution; mirrors at the phases of a fold, or turns alone; turns of primes.

    These whether azimuths tell them or not: small holes in a large disc do not stand out of what chance shows. Of atoms
    their number tells which there may be.
    """
    beyond = max(evidence.harmonics) + 1  # a fold that no moment reaches: only those with m = 0 are invariant
    round_frame = polish_frame(evidence.harmonics, frame_with_z(direction), beyond)
    found = [placed("Cinfv", round_frame)]
    given = frame_with_z(direction)
    anyway = {2, 3, *_counted(evidence.points, direction)} if evidence.atoms else set(PRIMES)
    turns = {(fold, False): given for fold in anyway}
    for axis in apart(np.stack([round_frame[2], direction]), 0.2 * START_ERROR):
        for candidate in folds_of(evidence.azimuths(axis), axis)[:FOLLOWED]:
            frame = polish_frame(evidence.harmonics, candidate.frame, candidate.fold)
            found.append(placed(f"C{candidate.fold}v", frame))
            turns[candidate.fold, False] = given
            if candidate.fold not in anyway and abs(frame[2] @ direction) < np.cos(0.2 * START_ERROR):
                turns.setdefault((candidate.fold, True), frame)  # the axis that told the fold may know it better
    return [*found, *(placed(f"C{fold}", turns[fold, polished]) for fold, polished in sorted(turns, reverse=True))]


def polish_frame(harmonics: dict[int, Array], frame: Array, fold: int) -> Array:
    """Turn a C_bv frame until the moments that break the group vanish: Gauss-Newton on SO(3), noise-weighted.

    No point is matched. In the frame, the invariant coefficients are cos(m phi) with b | m; every other one is a
    residual whose derivative under a small rotation is the generator applied to the coefficients. For fold 1 the group
    is Cs with normal p1.

    Args:
        harmonics: c[p,l,m] with jackknife replicates, about the centre the axis passes through.
        frame: rows (p0, p1, u), determinant +1.
        fold: b.

    Returns: the polished frame, rows (p0, p1, u).
    """
    values, rows = flattened(harmonics)
    action = Harmonics(rows=rows)
    m = np.concatenate([np.arange(-l, l + 1) for l in rows])
    weights = ((m < 0) | (m % fold != 0)) / (row_variance(values[1:], rows) + FLOOR)

    def linearise(turned: Array) -> Linearisation:
        here = action.turned(turned[None], values[:1])[:, 0]
        jacobian = action.tangents(here)[0]
        weighted = jacobian * weights
        return Linearisation(
            cost=float(weights @ here[0] ** 2), gradient=weighted @ here[0], hessian=weighted @ jacobian.T
        )

    return minimise(linearise, frame, move=turn_frame, longest=LONGEST).x


def _counted(points: Array, direction: Array) -> set[int]:
    """Orders that atoms allow about a direction: C_n moves all but those on the axis, so n divides their number."""
    away = np.linalg.norm(frame_with_z(direction)[:2] @ points.T, axis=0)
    counts = {int((away > near).sum()) for near in ON_AXIS}
    return {n for count in counts for n in range(2, min(count, MAX_FOLD) + 1) if count % n == 0}


def turned_over(evidence: Evidence, known: Placed) -> list[Placed]:
    """What turns about an axis with no mirror through it may belong to: Dn, about the centroid."""
    symbol = known.group.symbol
    if symbol.family not in ("C", "Ch") or not 1 < symbol.fold <= CLOSED_FOLD:
        return []
    axis = known.group.frame[2]
    beside_centroid = known.center - (known.center @ axis) * axis
    frames = frames_across(evidence.points - beside_centroid, evidence.weights, axis, int(symbol.fold))
    return [placed(f"D{symbol.fold:.0f}", frame, beside_centroid) for frame in frames]


def beside(known: Placed) -> list[Placed]:
    """What may hold beside a group that holds: multiples of its order, revolution, what turns its axis over."""
    group, center = known.group, known.center
    found = [Placed(group=PointGroup(name="Ci"), center=center)] if not group.has_inversion else []
    if group.name in POLYHEDRAL:
        found.append(placed("Kh", group.frame, center))
    if not group.is_finite:
        mirrored = [placed("Cs", group.frame, center)] if group.name == "Cinfv" else []
        return [*mirrored, placed("Kh", group.frame, center)] if group.name != "Kh" else []
    for u, k in group.rotation_axes()[:1] if group.symbol.fold > 0 else []:
        frame = frame_with_z(u)
        found.append(placed("Cinfv", frame, center))
        found += [placed(f"C{int(p * k)}", frame, center) for p in (2, 3, 5) if 2 * p * k <= CLOSED_FOLD]
        found.append(placed("Cs", frame, center))
        if 4 * k <= CLOSED_FOLD:
            found.append(placed(f"S{int(2 * k)}", group.frame, center))
    if group.name in ("D2", "D2h"):
        # The one pair whose elements do not name all their supergroups: T and Th have the same three.
        found.append(placed("C3", frame_with_z(group.frame.sum(axis=0)), center))
    if group.name == "Cs":
        found.append(placed("C2", group.frame, center))
    return found


def placed(name: str, frame: Array, center: Array | None = None) -> Placed:
    """A group with its frame, about the centroid unless told."""
    return Placed(group=PointGroup(name=name, frame=frame), center=np.zeros(3) if center is None else center)


def _principal(evidence: Evidence) -> Array:
    return np.asarray(np.linalg.eigh(evidence.moments.covariance)[1].T)
