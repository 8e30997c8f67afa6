"""What is known of a shape before any symmetry is looked for: moments, n-tuples, and a surface to judge by."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, cast, get_args

import numpy as np

from symrefine.decide.doubts import on_a_line, set_by_strays
from symrefine.decide.posterior import least_told
from symrefine.detection.masses import class_moments, classes_of, heavy
from symrefine.errors import InputError
from symrefine.fit.placed import Placed
from symrefine.fit.vertices import OnVertices, exact_symmetry
from symrefine.geometry import Array, tight_diagonal
from symrefine.moments.moments import PARTS, Moments
from symrefine.moments.quadrature import sample_surface
from symrefine.ntuples.contract import NTuples, ntuples
from symrefine.ntuples.rank import FixedSubspace, fixed_subspace
from symrefine.propose.candidates import Evidence
from symrefine.samples import COUNT
from symrefine.shape import FEW, Index, Shape
from symrefine.surface.cameras import Camera, cameras, outwards
from symrefine.surface.clumps import Clump
from symrefine.surface.drift import Drift
from symrefine.surface.floor import Floor, floor_of
from symrefine.surface.misses import TOLERANCE, disc_distances, noise_distances
from symrefine.surface.neighbourhoods import fills_volume
from symrefine.surface.openings import NEIGHBOURS, openings
from symrefine.surface.ordered import distinct
from symrefine.surface.sampling import Sampling, face_densities, sampling
from symrefine.surface.skin import LocalPlanes, drawn, isolated_points, make_skin
from symrefine.surface.surface import Surface
from symrefine.surface.tree import Tree, morton_order

Outliers = Literal["auto", "floor", "none"]
# Local planes of a cloud; points that a volume is known by, and planes of a mesh, whose normals are exact.
PLANES, SAMPLES = 8000, 20000
# Share of the points of a scan that others hide from the cameras given, from which on these are wrong: of true views,
# rough ones too, up to 0.027 seem to be; of whole objects, half of which is hidden, 0.12 to 0.22 are found to be. Half
# way between the two, as ratios go.
HIDDEN = 0.06


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """A shape with the classes of its points or faces, its moments and its n-tuples.

    Attributes:
        shape: without what was taken as outliers, and of a density that differs a more even sample.
        count: of its points, with those that were too many in dense parts.
        scan: all of these with where they were seen from, if that is known.
        floor: what it stands on, where that was set apart.
        strays: indices of the points that were for being far from all others.
        clumps: of each group of points that was for standing apart from the body, or filling a volume beside it, and
            where they are.
        blobs: the same of each group of points still in it that fills a volume beside the body.
        solid: whether some of its points show no surface at any width, so that all may fill a volume.
        classes: of its points or faces, that must match.
        samples: of a mesh: points of its surface, their normals and faces.
        density: how much surface an area of each face stands for; None where that makes no odds.
        moments: to order 8.
        vectors: the n-tuples of them.
    """

    shape: Shape
    count: int
    scan: Shape | None
    floor: Floor | None
    strays: Index
    clumps: tuple[tuple[Index, Array], ...]
    blobs: tuple[tuple[Index, Array], ...]
    solid: bool
    classes: Index | None
    samples: tuple[Array, Array, Index] | None
    density: Array | None
    moments: Moments
    vectors: NTuples

    @property
    def apart(self) -> list[Index]:
        """Indices of the strays, and of each clump."""
        return [self.strays, *(indices for indices, _ in self.clumps)]

    @property
    def is_thinned(self) -> bool:
        """Whether the points are a more even sample of those that were kept, and weigh what each stands for."""
        return len(self.shape.points) < self.count

    @cached_property
    def flaw(self) -> str:
        """Why the shape supports no decision at any tolerance, or nothing if it does."""
        return _few_decide(self) or _on_a_line(self) or _not_seen_from(self.views)

    @cached_property
    def views(self) -> tuple[Camera, ...]:
        """What saw a scan, in normalised units; none if nothing is known of it."""
        if self.scan is None or self.scan.viewpoint is None:
            return ()
        return cameras(*map(self.moments.normalised, (self.scan.points, self.scan.viewpoint)))

    @cached_property
    def tuples(self) -> FixedSubspace:
        """What the singular values of the n-tuples say."""
        return fixed_subspace(self.vectors)


def measure(
    shape: Shape,
    *,
    outliers: bool = True,
    apart: bool = True,
    foreign: Sequence[Index] = (),
    native: Index | None = None,
    floor: Floor | None = None,
    whole: Moments | None = None,
    seed: int = 0,
) -> Measured:
    """Moments to order 8 and the n-tuples of them, of the points that belong to the object.

    Args:
        shape: of which only some points may belong to the object.
        outliers: whether any are set apart.
        apart: whether clumps apart from the body count as outliers.
        foreign: indices of each group of points that is known to be no part of the object.
        native: indices of points that are known to be part of it, however far they are from others.
        floor: what it stands on, where that was set apart.
        whole: moments of all the points that `shape` is a sample of; they count where no point is set apart.
        seed: of the samples of a mesh.
    """
    massive = np.arange(len(shape.points))
    if shape.faces is None and shape.weights is not None and not shape.weights.all():
        massive = np.flatnonzero(shape.weights > 0)
        shape = shape.chosen(massive)  # points of no mass are no part of the object
    every, own = shape, cast(Index, np.arange(len(shape.points)))
    if shape.faces is None and shape.weights is None and not shape.atoms:
        some, own = distinct(shape.points, shape.labels)
        shape = shape.chosen(some) if len(some) < len(own) else shape
    as_given = shape.faces is not None or shape.atoms
    seen = Sampling.as_given(len(shape.points))
    if not as_given:
        # What stands in front parts what a camera sees, and hides its counterparts.
        groups, rng = shape.viewpoint is None, np.random.default_rng(0)

        def given(group: Index) -> Index:
            return np.unique(own[np.isin(massive, group)])

        known, sure = [given(group) for group in foreign], None if native is None else given(native)
        seen = sampling(shape.points, rng, outliers=outliers, groups=groups, apart=apart, foreign=known, native=sure)
    clumps, blobs = (
        tuple((massive[np.isin(own, g)], shape.points[g]) for g in parts) for parts in (seen.clumps, seen.blobs)
    )
    scan = None if as_given or shape.viewpoint is None else shape.chosen(seen.kept)
    # So few points as would stand for themselves are no even sample of a surface.
    if shape.weights is None and seen.shares is not None and len(seen.even) > FEW:
        shape = replace(shape.chosen(seen.even), weights=seen.shares)
    elif len(seen.kept) < len(shape.points):
        shape = shape.chosen(seen.kept)
    classes = classes_of(shape)
    samples = density = None
    if shape.faces is not None:
        samples = sample_surface(shape, 2 * SAMPLES, np.random.default_rng(seed))
        density = face_densities(shape, samples[0], samples[2]) if shape.measure == "surface" else None
    if whole is not None and shape is every:
        moments = whole
    else:
        parts = 0 if shape.atoms or shape.faces is not None else PARTS
        moments = class_moments(shape, classes, parts=parts, density=density)
    vectors = ntuples(moments)
    return Measured(
        shape=shape,
        count=len(seen.kept),
        scan=scan,
        floor=floor,
        strays=massive[np.isin(own, seen.strays)],
        clumps=clumps,
        blobs=blobs,
        solid=seen.solid,
        classes=classes,
        samples=samples,
        density=density,
        moments=moments,
        vectors=vectors,
    )


def floor_under(shape: Shape, outliers: Outliers) -> Floor | None:
    """What the points of a shape stand on, where that was asked for; None if nothing is found, or hardly more is there.

    Raises:
        InputError: another word for outliers, or a floor asked for of what is no cloud of a surface.
    """
    if outliers not in get_args(Outliers):
        raise InputError(f"outliers is {outliers!r}; expected one of {list(get_args(Outliers))}")
    if outliers != "floor":
        return None
    if shape.faces is not None or shape.atoms:
        what = "a mesh" if shape.faces is not None else f"{len(shape.points)} that stand for themselves"
        raise InputError(
            f"{shape.source}: outliers is 'floor', for a cloud of what stands on one, of more than {FEW} points; "
            f"{'this is' if shape.faces is not None else 'these are'} {what}, leave it out"
        )
    own = heavy(shape)  # of these without strays, which lie on both sides of any plane, and beside what stands on it
    kept = sampling(own.points, np.random.default_rng(0), outliers=True, groups=False).kept
    found = floor_of(own.points[kept], None if own.viewpoint is None else own.viewpoint[kept])
    return None if found is None or np.count_nonzero(~found.covers(own.points)) <= FEW else found


def doubt(measured: Measured, surface: Surface, tolerance: float) -> str:
    """Why a shape supports no decision at this tolerance, or nothing if it does."""
    return measured.flaw or _hidden(surface, tolerance, is_mesh=measured.shape.faces is not None)


def _on_a_line(measured: Measured) -> str:
    """Points on a line; but atoms there are a molecule."""
    if measured.shape.atoms and measured.shape.labels is not None:
        return ""
    said = on_a_line(measured.moments.covariance)
    return said and f"{said}; label them if they are the atoms of a molecule"


def _few_decide(measured: Measured) -> str:
    """A stray point that sets the scale, or weights that leave all to a few points."""
    shape = measured.shape
    if shape.faces is not None:
        return ""
    strays = set_by_strays(shape.points, few=shape.atoms)
    if strays or shape.atoms or shape.weights is None or measured.is_thinned:
        return strays
    count = float(shape.weights.sum() / shape.weights.max())
    if count > FEW:
        return ""
    return f"the largest weight is as much as one of {count:.3g} points; so few support no decision"


def _not_seen_from(views: tuple[Camera, ...]) -> str:
    """Cameras that cannot have seen what they are said to."""
    hidden = np.concatenate([view.hidden for view in views]) if views else np.zeros(1)
    if hidden.mean() <= HIDDEN:
        return ""
    return (
        f"{hidden.mean():.0%} of the points cannot have been seen from the viewpoint given: others stand in front of "
        "them; give the place of the camera, of each point where there were several, or none"
    )


def _hidden(surface: Surface, tolerance: float, *, is_mesh: bool) -> str:
    """Noise that makes an exact symmetry more likely broken than not."""
    least = least_told(surface.floor)
    if least <= tolerance:
        return ""
    hidden, asked = (f"{100.0 * part:.2g} %" for part in (float(np.quantile(surface.noise, 0.95)), tolerance))
    ask = f"a tolerance of {asked} is asked; ask for {_above(100 * least)} % or more"
    if is_mesh:  # of flat faces most samples miss nothing, those at edges do
        return f"the mesh is known by samples, which tell nothing below {_above(100 * least)} % of the diagonal; {ask}"
    return (
        f"the cloud does not even agree with itself: 5 % of one half of it misses the other by {hidden} of the "
        f"diagonal or more, and {ask}, or give more points, or less noise"
    )


def _above(value: float) -> str:
    """A number to two significant digits, rounded up."""
    digit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / digit) * digit:.2g}"


def gather(measured: Measured, rng: np.random.Generator, tolerance: float = TOLERANCE) -> tuple[Evidence, Surface]:
    """What proposals are made of, and the surface that judges them."""
    shape, moments = measured.shape, measured.moments
    points, normals, weights, labels = _cloud(measured)
    local = moments.normalised(points)
    evidence = Evidence(
        moments=moments,
        tuples=measured.tuples,
        points=local,
        weights=weights / weights.sum(),
        atoms=shape.atoms,
    )
    if shape.atoms:
        return evidence, Surface(cloud=isolated_points(local, labels), diagonal=tight_diagonal(local))
    if measured.solid and normals is None and fills_volume(local, Tree(local)):
        return evidence, _volume(local, labels, tolerance, rng)
    return evidence, _surface(measured, local, tolerance, rng)


def _surface(measured: Measured, local: Array, tolerance: float, rng: np.random.Generator) -> Surface:
    """Local planes with what noise alone shows, and what is hidden of them."""
    _, normals, weights, labels = _cloud(measured)
    moments, views, exact = measured.moments, measured.views, measured.shape.faces is not None
    tree = None if exact else Tree(local)
    uneven = None if exact or np.ptp(weights) == 0.0 else weights
    whole = make_skin(local, rng, normals=normals, labels=labels, exact=exact, tree=tree)

    def half(some: Index) -> LocalPlanes:
        pick = drawn(len(some), PLANES // 2, rng, None if uneven is None else uneven[some])
        return whole.half(some).local_planes(pick)

    pick = drawn(len(local), SAMPLES if exact else PLANES, rng, uneven)
    # Neighbours stand together in memory, and any stride takes an even part of the surface.
    pick = pick[morton_order(local[pick])]
    near = whole.near(pick, NEIGHBOURS) if len(local) >= NEIGHBOURS else None
    cloud = whole.local_planes(pick, near=near)
    if views:
        eyes = np.array([view.eye for view in views])
        cloud = replace(cloud, normals=outwards(views, cloud.points, cloud.normals), eyes=eyes)
    diagonal = tight_diagonal(cloud.points)
    if exact:
        others = np.delete(np.arange(len(local)), pick)
        others = others[:: max(1, len(others) // (2 * COUNT))]
        # Samples that are free of noise differ by no more from the surface that the others make than an image does.
        noise = disc_distances(cloud, local[others], None if labels is None else labels[others])
    else:
        noise = noise_distances(len(local), half, rng)
    skin = None if exact else whole
    surface = Surface(cloud=cloud, diagonal=diagonal, noise=noise / diagonal, skin=skin, tolerance=tolerance)
    if tree is not None:
        found = openings(
            cloud,
            local,
            tree,
            views,
            near,
            clumps=tuple(Clump.of(moments.normalised(p)) for _, p in measured.clumps),
            floor=None if measured.floor is None else measured.floor.normalised(moments.center, moments.scale),
            strays=len(measured.strays) > 0,
            blurred=surface.floor >= tolerance,
        )
        surface = replace(surface, openings=found)
    # Where density differs, as between what cameras saw from far and near or where a clump adds to it, a window and its
    # image hold more of chance than one window and itself.
    if whole.noisy and uneven is None and not (views or measured.clumps):
        surface = replace(surface, drift=Drift.of(local, whole.tree, COUNT, rng))
    return surface


def _volume(points: Array, labels: Index | None, tolerance: float, rng: np.random.Generator) -> Surface:
    # All of them: to leave some out is noise. Any stride takes an even part then, while files order voxels by rows.
    order = morton_order(points)
    points, labels = points[order], None if labels is None else labels[order]

    def some_of(some: Index) -> LocalPlanes:
        return isolated_points(points[some], None if labels is None else labels[some], body="volume")

    diagonal = tight_diagonal(points)
    noise = noise_distances(len(points), some_of, rng)
    cloud = some_of(np.arange(len(points)))
    drift = Drift.of(points, Tree(points) if labels is not None else cloud.tree, COUNT, rng)
    return Surface(cloud=cloud, diagonal=diagonal, noise=noise / diagonal, drift=drift, tolerance=tolerance)


def _cloud(measured: Measured) -> tuple[Array, Array | None, Array, Index | None]:
    """Points, normals, weights and classes: samples with exact normals for a mesh, else the points themselves."""
    shape, classes, density = measured.shape, measured.classes, measured.density
    if measured.samples is None:
        return shape.points, shape.normals, shape.masses, classes
    points, normals, face = measured.samples
    weights = np.ones(len(points)) if density is None else density[face]
    return points, normals, weights, None if classes is None else classes[face]


def by_vertices(
    measured: Measured, diagonal: float, evidence: Evidence
) -> tuple[OnVertices | None, OnVertices | None, Evidence]:
    """The group that vertices of a mesh, or points of a cloud, have, what of it faces prove, and the evidence.

    It is exact, whatever is sampled of the shape.
    """
    moments = measured.moments
    exact, proof = exact_symmetry(measured.shape, moments.scale * diagonal)
    if exact is None or exact.group.name == "C1":
        # That every point is mapped onto itself says nothing of a cloud.
        return exact if measured.shape.faces is not None else None, None, evidence
    found = [None if known is None else known.beside(moments.center) for known in (exact, proof)]
    placed = [None if k is None else Placed(group=k.group, center=moments.normalised(k.center)) for k in found]
    return found[0], found[1], replace(evidence, vertices=placed[0], proven=placed[1])
