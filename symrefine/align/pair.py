"""The two objects of an alignment in 3-space, and what is known of them: each part worked out when first needed."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from symrefine.align.landscape import harmonic_pair
from symrefine.align.moment_fit import MomentPair
from symrefine.align.polish import Polished, Similarity
from symrefine.align.procrustes import Procrustes, procrustes
from symrefine.detection.masses import density_of
from symrefine.detection.measure import SAMPLES
from symrefine.detection.result import Detection
from symrefine.detection.story import detect
from symrefine.geometry import Array, Isometry, tight_diagonal
from symrefine.moments.moments import Moments, central_moments
from symrefine.moments.quadrature import sample_surface
from symrefine.ntuples.contract import ntuples
from symrefine.propose.folds import azimuthal_spectrum
from symrefine.samples import COUNT, LOOK
from symrefine.shape import Shape
from symrefine.surface.misses import disc_distances, needs
from symrefine.surface.neighbourhoods import NEIGHBOURS
from symrefine.surface.sampling import Sampling, sampling
from symrefine.surface.skin import LocalPlanes, Patches, Skin, isolated_points, make_skin
from symrefine.surface.surface import Surface

# Flatness of thin sheets and edges without noise (0.13 at most at the lower quartile); noise of 0.2 % makes it 0.17.
THIN = 0.15
# Spacings that a plane reaches.
REACH = 3.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Side:
    """One of the two objects: its moments, the weights of its points if it is a cloud, and how these were sampled."""

    shape: Shape
    moments: Moments
    weights: Array
    known: Sampling | None = None

    @property
    def is_mesh(self) -> bool:
        """Whether the points are vertices and the moments exact."""
        return self.shape.faces is not None

    @cached_property
    def sampling(self) -> Sampling:
        """Which of the points of a cloud belong to a surface, and how evenly these were sampled."""
        if self.known is not None:
            return self.known
        return sampling(self.shape.points, np.random.default_rng(0), outliers=True, groups=False)

    def evened(self) -> "Side":
        """The same cloud, each point weighted by the area its neighbours leave it, unless the weights are given."""
        from scipy.spatial import cKDTree

        if self.is_mesh or self.shape.weights is not None:
            return self
        points, reach = self.shape.points, min(NEIGHBOURS[0], len(self.shape.points))
        weights = shares(self.shape, cKDTree(points).query(points, k=[reach])[0][:, 0] ** 2)
        parts = len(self.moments.replicates)
        moments = central_moments(points, weights, self.moments.order, parts=parts)
        return Side(shape=self.shape, moments=moments, weights=weights)

    def cleaned(self) -> "Side":
        """The same cloud without the points that belong to no surface; the side itself where there are none."""
        if self.is_mesh:
            return self
        seen = self.sampling
        if not len(seen.strays):
            return self
        shape = self.shape.chosen(seen.kept)
        weights = self.weights[seen.kept]
        parts = len(self.moments.replicates)
        moments = central_moments(shape.points, weights, self.moments.order, parts=parts)
        return Side(shape=shape, moments=moments, weights=weights / weights.sum(), known=_of_kept(seen))

    def skin(self, unit: float, samples: int, rng: np.random.Generator) -> Skin:
        """The surface about the centre, in units of `unit`: of a mesh, as so many samples show it.

        Where one side is a mesh and the other a cloud, planes of both blur edges and curves alike.
        """
        shape = self.shape
        if self.is_mesh:
            shape = sampled(shape, samples, rng)
        elif len(shape.points) > SAMPLES:
            shape = shape.chosen(rng.choice(len(shape.points), SAMPLES, replace=False))
        local = (shape.points - self.moments.center) / unit
        return make_skin(local, rng, normals=shape.normals, labels=shape.labels, thin=THIN)

    def azimuths(self, frame: Array) -> Array:
        """Azimuthal coefficients [K, 4] about the frame's third axis, scaled by what random azimuths would give."""
        points = self.shape.points
        weights = self.weights
        if self.is_mesh:
            seen = sampled(self.shape, SAMPLES, np.random.default_rng(0))
            points, weights = seen.points, shares(seen, np.ones(len(seen.points)))
        local = (points - self.moments.center) @ frame.T / self.moments.scale
        c, sigma = azimuthal_spectrum(local, weights, np.array([0.0, 0.0, 1.0]))
        return c / sigma


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """Everything an alignment in 3-space may use; each part is worked out when first needed."""

    source: Side
    target: Side
    scale: bool
    tolerance: float
    seed: int

    @cached_property
    def _detections(self) -> dict[Side, Detection]:
        """What was found of the sides so far."""
        return {}

    def detected(self, side: Side) -> Detection:
        """What `detect` finds of one of the sides, however often it is asked."""
        if side not in self._detections:
            self._detections[side] = detect(side.shape, tolerance=self.tolerance, seed=self.seed)
        return self._detections[side]

    @cached_property
    def closed(self) -> Procrustes:
        """Procrustes solution of the n-tuples."""
        return procrustes(ntuples(self.source.moments), ntuples(self.target.moments))

    @cached_property
    def harmonics(self) -> MomentPair:
        """Harmonic moments of both sides."""
        return harmonic_pair(self.source.moments, self.target.moments)

    @property
    def _units(self) -> tuple[float, float]:
        """What the coordinates of source and target are divided by."""
        unit = self.target.moments.scale
        return self.source.moments.scale if self.scale else unit, unit

    @cached_property
    def _skins(self) -> tuple[Skin, Skin]:
        """Source and target as the points show them, each about its own centre."""
        sides = self.source, self.target
        samples = min([SAMPLES if s.is_mesh else len(s.shape.points) for s in sides])
        first, second = (s.skin(unit, samples, self._rng()) for s, unit in zip(sides, self._units, strict=True))
        return first, second

    def _planes(self, index: int, count: int) -> Patches:
        side = (self.source, self.target)[index]
        if few(self.source.shape, self.target.shape):
            local = (side.shape.points - side.moments.center) / self._units[index]
            return isolated_points(local, side.shape.labels)
        skin = self._skins[index]
        pick = self._rng().choice(len(skin.points), min(count, len(skin.points)), replace=False)
        return skin.patches(np.sort(pick))

    @cached_property
    def moving(self) -> Patches:
        """Local planes of the source that are polished and judged, or its points where they stand for themselves."""
        return self._planes(0, LOOK)

    @cached_property
    def _met_back(self) -> LocalPlanes:
        """The source as what comes back from the target is to meet it."""
        return self._planes(0, COUNT).surface

    @cached_property
    def met(self) -> Skin | LocalPlanes:
        """The target, with planes wherever they are asked for."""
        return self._planes(1, 0).surface if few(self.source.shape, self.target.shape) else self._skins[1]

    @cached_property
    def judge(self) -> Surface:
        """The target as a judge of what meets it, by the limits of `detect`.

        Its noise is what sampling alone explains: each surface against itself, and what only one of the two blurs.
        Local planes merge the two faces of a thin sheet, or follow each, as the density of the points has it.
        """
        target = self._planes(1, COUNT).surface
        diagonal = tight_diagonal(target.points)
        own = [disc_distances(s, s.points, s.labels, skip_self=True) for s in (self.moving.surface, target)]
        blurred = abs(float(self.moving.surface.thickness.mean() - target.thickness.mean()))
        return Surface(cloud=target, diagonal=diagonal, noise=(np.concatenate(own) + blurred) / diagonal)

    def misses(self, motion: Isometry) -> Array:
        """Distances from the moved source to what is of its class of the target, fractions of the diagonal.

        They end at the diagonal.
        """
        moved, size = motion.apply(self.moving.surface.points), self.judge.diagonal
        return disc_distances(self.judge.cloud, moved, self.moving.surface.labels, bound=size) / size

    def misses_back(self, motion: Similarity) -> Array:
        """Distances from the target to the moved source, fractions of the diagonal."""
        cloud, size = self.judge.cloud, self.judge.diagonal
        moved, bound = motion.inverse.apply(cloud.points), size / motion.scale
        back = disc_distances(self._met_back, moved, cloud.labels, bound=bound)
        return motion.scale * back / size

    def excess(self, motion: Similarity, *, both: bool = False) -> float:
        """The largest statistic of the miss over its limit; <= 1 if the surfaces agree. Of atoms every one counts.

        Where the scale is open the target has to meet the source as well: a source that is small enough misses nothing.
        Else it may have more than that, unless `both` are to be alike.
        """
        ways = [self.misses(motion), self.misses_back(motion)] if self.scale or both else [self.misses(motion)]
        return max(float(self.judge.needed(misses[None], [motion])[0]) for misses in ways) / self.tolerance

    def own_excess(self, motion: Similarity) -> float:
        """The same of the target as its own image, without the strays that may hide what denies it."""
        clean = self.cleaned() or self
        here, there = self.target.moments, clean.target.moments
        at = motion.apply((there.center - here.center)[None] / here.scale)[0]
        own = Similarity(matrix=motion.matrix, shift=(here.center + here.scale * at - there.center) / there.scale)
        return float(clean.judge.needs([own], most=1.0)[0]) / self.tolerance

    def excess_without_noise(self, done: Polished, enough: float) -> float:
        """The excess after a polish on `met`, of one size, if none of it is noise; infinite if the polish did not end.

        That is told from the planes of the target that the last of its steps met: the judge need not be made for it.
        It is about the most that the judge tells (an eighth less where one side has a thin detail that the other has
        not). At first the objects are taken to be as small as they may be; their sizes are asked for where that is not
        `enough`.
        """
        if not done.converged:
            return math.inf
        contact = done.contact
        off = done.motion.apply(contact.source.points) - contact.target.points
        across = np.abs(np.einsum("ij,ij->i", off, contact.target.normals))
        # A plane reaches as far as the points that it was fitted to; beyond, the point that is nearest counts.
        misses = np.where(contact.away < REACH * self.met.spacing, across, np.maximum(contact.away, across))
        excess = math.inf
        for diagonal in (least_diagonal, tight_diagonal):
            if excess > enough:
                size = min(diagonal(points) for points in (self.moving.points, contact.target.points))
                excess = float(needs(np.minimum(misses / size, 1.0), np.empty(0))) / self.tolerance
        return excess

    def cleaned(self) -> "Evidence | None":
        """The same without points that belong to no surface; None where there are none."""
        sides = self.source.cleaned(), self.target.cleaned()
        if sides == (self.source, self.target):
            return None
        return replace(self, source=sides[0], target=sides[1])

    def _rng(self) -> np.random.Generator:
        return np.random.default_rng(self.seed)

    @property
    def has_points(self) -> bool:
        """Whether both sides can be judged: surfaces, or few points that stand for themselves, but no filled solid."""
        sides = (self.source.shape, self.target.shape)
        return few(*sides) or {s.measure for s in sides} != {"solid", "points"}


def least_diagonal(points: Array) -> float:
    """Distance between two of points [N, 3] that lie far apart: no box around them has a shorter diagonal."""
    centred = points - points.mean(axis=0)
    end = points[np.einsum("ij,ij->i", centred, centred).argmax()]
    return float(np.sqrt(((points - end) ** 2).sum(axis=1).max()))


def _of_kept(seen: Sampling) -> Sampling:
    """How the points that are kept were sampled, if nothing else than strays was set apart."""
    every = np.arange(len(seen.kept))
    even = np.searchsorted(seen.kept, seen.even)
    return Sampling(kept=every, even=even, strays=every[:0], shares=seen.shares, solid=seen.solid)


def shares(shape: Shape, weights: Array) -> Array:
    """What share [N] the points of a cloud have in its moments, given what each stands for; [0] of a mesh."""
    if shape.faces is not None:
        return np.zeros(0)
    weights = weights if shape.labels is None else weights * density_of(shape.labels)
    return np.asarray(weights / weights.sum())


def sampled(mesh: Shape, count: int, rng: np.random.Generator) -> Shape:
    """So many samples of the surface of a mesh, with their classes."""
    points, _, face = sample_surface(mesh, count, rng)
    return Shape(points=points, labels=None if mesh.labels is None else mesh.labels[face], source=mesh.source)


def few(source: Shape, target: Shape) -> bool:
    """Whether both are sets of points that stand for themselves."""
    return source.atoms and target.atoms
