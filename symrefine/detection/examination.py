"""What a decision is made from: a shape measured, its candidates fitted and judged, and joined to a chain of groups."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from symrefine.clock import Clock
from symrefine.decide.chain import chain
from symrefine.decide.explore import explore
from symrefine.decide.hypotheses import SAME_RAD, Hypothesis
from symrefine.decide.looks import exact_need, unmet_by
from symrefine.decide.pool import Pool
from symrefine.decide.posterior import ALIKE, Alternative, Decision, Link, decide, least_told, meant, odd
from symrefine.detection.measure import Measured, Outliers, by_vertices, doubt, floor_under, gather, measure
from symrefine.detection.sketch import Sample, Sketch, is_large, sampled, set_apart, sketched
from symrefine.fit.placed import SAMPLED
from symrefine.fit.vertices import OnVertices, on_vertices
from symrefine.geometry import Array, Mask, check_tolerance
from symrefine.groups import PointGroup, is_subgroup
from symrefine.samples import COUNT, FOLLOWED, LOOK
from symrefine.shape import Index, Shape
from symrefine.surface.clumps import CLUMP, COUNTERPART, Clump, clump_among
from symrefine.surface.floor import Floor
from symrefine.surface.misses import SHARES, TOLERANCE, disc_distances
from symrefine.surface.surface import Surface
from symrefine.surface.tree import Tree


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Examined:
    """What a decision is made from: the table of needs as a chain of groups, each inside the next, C1 first.

    Attributes:
        measured: the shape, or the sample that stands for it.
        surface: what judges.
        pool: everything that was tried.
        links: of the chain.
        outliers: indices of the points that are no part of the object, ascending.
        outlier_share: of all points.
        sample: how many points stand for how many, if they stand for more than themselves.
        exact: the group that maps the vertices of a mesh onto one another, where they put it, if that can be told; of
            points of a cloud, where noise leaves nothing else to be told. `proof` is what of it maps the faces, too.
        no_floor: whether it was told that it stands on one, and none was found.
        denied: if points were taken for a clump because they alone speak against it, the group that they leave.
        hides: whether points that were not, as they seem to be a part of it, alone speak against a larger group.
    """

    measured: Measured
    surface: Surface
    pool: Pool
    links: tuple[Hypothesis, ...]
    outliers: Index
    outlier_share: float
    sample: Sample | None
    exact: OnVertices | None
    proof: OnVertices | None
    no_floor: bool = False
    denied: Hypothesis | None = None
    hides: bool = False

    def among(self, left: Mask) -> "Examined":
        """The same of all points, of which those of the floor, that others are left of [N], are outliers, too."""
        own, apart = np.flatnonzero(left), float(1.0 - left.mean())
        outliers = np.union1d(np.flatnonzero(~left), own[self.outliers])
        return replace(self, outliers=outliers, outlier_share=apart + (1.0 - apart) * self.outlier_share)

    @property
    def has_strays_left(self) -> bool:
        """Whether so many strays are left beside the surface that what they deny is no evidence.

        More than the share that details may have is lonely, and as many were set apart: thin parts are lonely, too.
        """
        found = len(self.measured.strays) / self.measured.count
        return min(found, float(self.surface.cloud.lonely.mean())) > SHARES[-1]

    def vertices_of(self, found: Hypothesis) -> OnVertices | None:
        """Where the vertices of a mesh put a group of the chain, if it maps them onto one another.

        Those of a cloud, if they were asked.
        """
        known, group = self.exact, found.group
        same = next((k for k in (self.proof, known) if k is not None and k.group.name == group.name), None)
        if same is not None or group.name == "C1" or (known is None and self.measured.shape.faces is None):
            return same
        if known is not None and not group.is_finite:
            return known.rounded(group) if is_subgroup(known.group, group, SAME_RAD) else None
        # What corners prove may be less than what all vertices have, where a hole makes corners of a few.
        moments = self.measured.moments
        center, diagonal = moments.restored(found.placed.center), moments.scale * self.surface.diagonal
        return on_vertices(self.measured.shape, group, center, diagonal=diagonal)

    def exact_part(self, found: Hypothesis) -> OnVertices | None:
        """What of a group of the chain maps the vertices of a mesh onto one another, where not all of it does."""
        known, group = self.exact, found.group
        if known is None or known.group.name == "C1" or not group.is_finite:
            return None
        return known if is_subgroup(known.group, group, SAME_RAD) else None

    def decided(self, tolerance: float, *, shown: bool = False) -> Decision:
        """The likeliest group of the chain at a tolerance; with `shown` as if what no camera saw kept to the rest."""
        missing = 0.0 if shown else self.surface.unclosed
        # What holds at no tolerance that can be told holds at no smaller one.
        return decide(self.known(tolerance), max(tolerance, self.least), self.surface.floor, unclosed=missing)

    @property
    def proven(self) -> Hypothesis | None:
        """The largest group of the chain that holds by what was not measured, if there is one."""
        return next((h for h in self.links if h.proven), None)

    @property
    def least(self) -> float:
        """The smallest tolerance at which that is read which was measured, if some is proven anyway; else 0."""
        return 0.0 if self.proven is None else least_told(self.surface.floor)

    def known(self, tolerance: float) -> list[Link]:
        """The groups beyond C1 as the decision sees them at a tolerance."""
        needs = [*(h.need for h in self.links), math.inf]
        return [self._link(h, beyond, tolerance) for h, beyond in zip(self.links, needs[1:], strict=True)][1:]

    def _link(self, found: Hypothesis, beyond: float, tolerance: float) -> Link:
        """A group of the chain, where the next one needs so much."""
        proof = self.proof if self.proven is not None and self.proven.holds(found.placed) else None
        if proof is not None:
            sure = meant(Link(need=proof.miss), tolerance)
        else:
            # At the tolerance that was asked for, so that a larger one takes no group away that a smaller one tells.
            elsewhere = meant(Link(need=found.elsewhere), self.surface.tolerance, self.surface.floor)
            sure = (1.0 - elsewhere) * self._foreign(found) * found.named
        return Link.of(found.group, found.need, beyond, believed=found.believed, placed=sure, proven=proof is not None)

    def _foreign(self, found: Hypothesis) -> float:
        """How likely it is that no part of the object was taken for a clump, if that alone speaks against a group."""
        return 1.0 if self.denied is None or self.denied.holds(found.placed) else 1.0 - odd(found.group)

    def link(self, tolerance: float) -> Hypothesis:
        """The likeliest group of the chain at a tolerance, where it stands."""
        return self.links[self.decided(tolerance).index]

    def choices(self, tolerance: float) -> tuple[Alternative, ...]:
        """Every group of the chain, C1 first, as likely as at a tolerance."""
        found = zip(self.links, self.decided(tolerance).probabilities, strict=True)
        return tuple(Alternative(point_group=h.group.name, probability=p, forgiven=h.need) for h, p in found)

    def size(self, tolerance: float) -> tuple[float, float]:
        """Order of the group that is decided, and of what stands for it if that is infinite; 0 if none is."""
        if self.doubt(tolerance):
            return 0.0, 0.0
        return _size(self.link(tolerance).group)

    def rivals(self, tolerance: float) -> list[Hypothesis]:
        """Larger groups than the one that is decided, the ones that need least first."""
        order = self.size(tolerance)
        every = (*self.links, *self.pool.small, *self.pool.failed, *self.pool.turned_down())
        return sorted((h for h in every if _size(h.group) > order), key=lambda h: h.need)

    def doubt(self, tolerance: float) -> str:
        """Why the data support no decision at a tolerance, or nothing if they do."""
        reason = doubt(self.measured, self.surface, tolerance)
        if self.least > tolerance and not self.measured.flaw:
            index = self.decided(tolerance).index
            if index and self.known(tolerance)[index - 1].proven:  # which asks for nothing that was measured
                larger = [h.group.name for h in self.links[index + 1 :] if h.need <= exact_need(self.surface.floor)]
                points = "points" if self.measured.shape.faces is None else "vertices"
                proven = f"its {points} prove {self.links[index].group.name}"
                return f"{reason}; {proven}, and {' or '.join(larger)} may hold as well" if larger else ""
        return reason or self._nothing_carries(tolerance)

    def _nothing_carries(self, tolerance: float) -> str:
        """The groups between which it stands, where even the likeliest is more likely wrong than right."""
        probabilities = self.decided(tolerance, shown=True).probabilities
        if max(probabilities) >= 0.5:
            return ""
        by = sorted(zip(probabilities, self.links, strict=True), key=lambda k: -k[0])
        told = ", ".join(f"{h.group.name} ({100 * p:.0f} %)" for p, h in by[:3])
        return f"no group is more likely than not: {told}"


def _size(group: PointGroup) -> tuple[float, float]:
    return group.order, group.sampled(SAMPLED).order


def examined(
    shape: Shape | Sketch,
    *,
    outliers: Outliers = "auto",
    tolerance: float = TOLERANCE,
    ladder: Sequence[float] = (),
    seed: int = 0,
    clock: Clock,
) -> Examined:
    """Everything before the decision: what the moments propose, fitted, judged and put into a chain.

    Args and errors as of `detect`.
    """
    for t in (tolerance, *ladder):
        check_tolerance(t)
    shape, floor, left = _without_floor(shape, outliers)
    if isinstance(shape, Shape) and is_large(shape):
        with clock("pass"):
            shape = sketched(shape, seed)
    examine = partial(_examined, shape, floor, outliers != "none", tolerance, ladder, seed, clock)
    found = _likeliest(shape, examine, tolerance, outliers=outliers != "none")
    if left is None:
        return replace(found, no_floor=outliers == "floor")
    return found.among(left)


def _without_floor(shape: Shape | Sketch, outliers: Outliers) -> tuple[Shape | Sketch, Floor | None, Mask | None]:
    """A shape without what it stands on, where that was asked for and found, that, and which of its points are left."""
    if isinstance(shape, Sketch) and shape.whole is not None and outliers == "floor":
        shape = shape.whole
    some = shape.sample if isinstance(shape, Sketch) else shape
    floor = floor_under(sampled(some) if is_large(some) else some, outliers)
    if floor is None:
        return shape, None, None
    left = ~floor.covers(some.points)
    rest = some.chosen(np.flatnonzero(left))
    if isinstance(shape, Sketch):
        return replace(shape, sample=rest, picked=shape.picked[left], moments=None), floor, left
    return rest, floor, left


def _likeliest(
    shape: Shape | Sketch, examine: Callable[..., Examined], tolerance: float, *, outliers: bool
) -> Examined:
    """What is found where that is set apart which alone hides a symmetry, and where no part of the object is.

    What seems to be a part may be a clump by the axis of a larger group all the same, and then hides that.
    """
    found = examine(apart=True)
    own, others = _told_apart(found, tolerance)
    apart, hides = not own, False
    if own:
        without, found = found, examine(apart=False, foreign=others)
        hides = without.size(tolerance) > found.size(tolerance)
    points = (shape.sample if isinstance(shape, Sketch) else shape).points
    for suspects in (_suspects, _strangers) if outliers else ():
        # What fills a volume beside a surface is taken for a clump only where it alone hides a symmetry.
        if not (foreign := suspects(found, points, tolerance)):
            continue
        without = examine(apart=apart, foreign=foreign)
        if without.size(tolerance) <= found.size(tolerance):
            continue
        own, others = _told_apart(without, tolerance)
        hides = hides or bool(own)
        if own and others:
            without = examine(apart=False, foreign=others)
            own, _ = _told_apart(without, tolerance)
        if not own and without.size(tolerance) > found.size(tolerance):
            return replace(without, denied=found.link(tolerance))
    return replace(found, hides=hides)


def _suspects(found: Examined, _: Array, tolerance: float) -> tuple[Index, ...]:
    """Groups of points that fill a volume beside the body, unless each is a part of it."""
    blobs = found.measured.blobs
    own = all(_is_part(found, points, tolerance) for _, points in blobs)
    return () if own else tuple(indices for indices, _ in blobs)


def _strangers(found: Examined, points: Array, tolerance: float) -> tuple[Index, ...]:
    """Of points [N, 3] those that fill a volume and are all that speaks against a larger group, if there are any."""
    surface, measured = found.surface, found.measured
    if surface.skin is None or measured.views or found.doubt(tolerance):
        return ()
    if not (rivals := found.rivals(tolerance)[:FOLLOWED]):
        return ()
    few = [r for r in rivals if 0.0 < unmet_by(surface, r.placed, LOOK).mean() <= CLUMP]
    if not few:
        return ()
    own = np.setdiff1d(np.arange(len(points)), np.concatenate(measured.apart), assume_unique=True)
    local = measured.moments.normalised(points[own])
    nearest = Tree(surface.cloud.points[:: surface.stride(COUNT)]).nearest(local)[1]
    for rival in few:
        unmet = unmet_by(surface, rival.placed, COUNT)
        if (group := clump_among(local, unmet[nearest])).size:
            return (own[group],)
    return ()


def _told_apart(found: Examined, tolerance: float) -> tuple[list[Index], list[Index]]:
    """Indices of each group of what was set apart that seems to be a part of the object, and of each that does not."""
    own, others = list[Index](), list[Index]()
    for indices, points in found.measured.clumps:
        is_part = _belongs(found, points, tolerance) or _replaces(found, points, tolerance)
        (own if is_part else others).append(indices)
    return own, others


def _examined(
    given: Shape | Sketch,
    floor: Floor | None,
    outliers: bool,
    tolerance: float,
    ladder: Sequence[float],
    seed: int,
    clock: Clock,
    *,
    apart: bool,
    foreign: Sequence[Index] = (),
) -> Examined:
    sketch = given if isinstance(given, Sketch) else None
    shape = given.sample if isinstance(given, Sketch) else given
    with clock("moments", len(shape.points)):
        whole = sketch.moments if sketch is not None and sketch.seen else None
        measured = measure(shape, outliers=outliers, apart=apart, foreign=foreign, floor=floor, whole=whole, seed=seed)
        out, share = set_apart(measured, sketch, outliers=outliers)
    with clock("local_planes"):
        evidence, surface = gather(measured, np.random.default_rng(seed), tolerance)
    exact = proof = None
    if measured.shape.faces is not None or (least_told(surface.floor) > tolerance and measured.shape.weights is None):
        with clock("vertices"):
            exact, proof, evidence = by_vertices(measured, surface.diagonal, evidence)
    # What is proven holds at any tolerance; what else there may be is read from the first that can be.
    least = max(tolerance, least_told(surface.floor)) if proof is not None else tolerance
    surface = replace(surface, tolerance=least)
    with clock("search"):
        # Where the tolerance asked for is too small to decide anything, the ladder is told from the first that is not.
        every = sorted({max(t, least) for t in (tolerance, *ladder) if t >= tolerance})
        steps = [t for t in every if not doubt(measured, surface, t)]
        pool = explore(surface, evidence, steps[0], min(tolerance, *ladder, 1.0)) if steps else Pool()
        links = chain(surface, pool, ALIKE * max((least, *ladder)))
    return Examined(
        measured=measured,
        surface=surface,
        pool=pool,
        links=links,
        outliers=out,
        outlier_share=share,
        sample=None if sketch is None else Sample(points=len(sketch.picked), of=sketch.count),
        exact=exact,
        proof=proof,
    )


def _is_part(found: Examined, blob: Array, tolerance: float) -> bool:
    """Whether points that fill a volume beside the body are a part of it, or hide nothing of it.

    A part is carried as others are to where it has counterparts. Most of the images have to leave the points and their
    rim, lest a mirror passes through by chance, and to meet the body. What every operation keeps that leaves a single
    point of space in place lies about that point, as all larger groups of the rest do, which a clump there, round as it
    is, would not break.
    """
    cloud, points = found.surface.cloud.of_one_class(), found.measured.moments.normalised(blob)
    link = found.link(tolerance)
    motions = [m for element in link.elements for m in element.motions]
    if not motions or found.doubt(tolerance):
        return False
    moved = np.concatenate([m.apply(points) for m in motions])
    own = (Tree(points).nearest(cloud.points)[0] <= 2.0 * cloud.reach)[cloud.nearest(moved, None)[1]]
    if not link.group.is_polar and own.reshape(len(motions), -1).mean(axis=1).min() > 0.5:
        return True
    others = moved[~own]
    met = disc_distances(cloud, others) <= found.surface.margin
    return 2 * len(others) > len(moved) and bool(met.mean() > 0.5)


def _replaces(found: Examined, clump: Array, tolerance: float) -> bool:
    """Whether about as much of the surface has its image under points set apart as these are: a part out of place."""
    cloud, there = found.surface.cloud.of_one_class(), Clump.of(found.measured.moments.normalised(clump))
    own, hidden = cloud.points, [0.0]
    for element in found.link(tolerance).elements:
        for motion in element.motions:
            moved = motion.apply(own)
            under = moved[there.covers(moved)]
            hidden.append(float((disc_distances(cloud, under) > found.surface.margin).sum()) if len(under) else 0.0)
    return max(hidden) * found.measured.count >= COUNTERPART * len(clump) * len(own)


def _belongs(found: Examined, clump: Array, tolerance: float) -> bool:
    """Whether points apart from the body are a part of it: many elements carry most of them to where they may be.

    That is onto the surface, onto themselves or, where cameras are known, to where they could not see. Of many mirrors
    one passes through any clump by chance; a part of the object is carried by a third of the elements and more.
    """
    surface, cloud = found.surface, found.surface.cloud.of_one_class()
    points, margin = found.measured.moments.normalised(clump), surface.margin
    beside = disc_distances(cloud, points) > margin
    points = points[beside] if beside.any() else points  # what lies in the surface is carried with it
    own, carried = Tree(points), []
    for element in found.link(tolerance).elements:
        moved = np.concatenate([m.apply(points) for m in element.motions])
        off = (disc_distances(cloud, moved) > margin) & (own.nearest(moved)[0] > margin)
        for camera in () if surface.openings is None else surface.openings.cameras:
            off &= camera.sees_through(moved, margin)
        carried.append(off.mean() < 0.5)
    return 3 * sum(carried) > len(carried)
