"""How a decision comes about: a shape measured, its candidates fitted and judged, and joined to a chain of groups."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from symrefine.clock import Clock
from symrefine.decide.chain import chain
from symrefine.decide.explore import explore
from symrefine.decide.looks import few_motions, unmet_by
from symrefine.decide.pool import Pool
from symrefine.decide.posterior import ALIKE, EVEN, least_told
from symrefine.detection.examined import Examined
from symrefine.detection.measure import Outliers, by_vertices, doubt, floor_under, gather, measure
from symrefine.detection.sketch import Sample, Sketch, is_large, sampled, set_apart, sketched
from symrefine.geometry import Array, Mask, check_tolerance, images
from symrefine.samples import COUNT, FOLLOWED, LOOK
from symrefine.shape import Index, Shape
from symrefine.surface.clumps import CLUMP, COUNTERPART, Clump, clump_among
from symrefine.surface.floor import Floor
from symrefine.surface.misses import SHARES, TOLERANCE
from symrefine.surface.tree import Tree


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
    found = _as_atoms(shape, floor, found, tolerance, ladder, seed, clock) or found
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

    Sparse parts of a surface that look strewn are parts of it, where larger groups say so. What seems to be a part may
    be a clump by the axis of a larger group all the same, and then hides that.
    """
    points = (shape.sample if isinstance(shape, Sketch) else shape).points
    found = examine(apart=True)
    if outliers and (native := _carried(found, points, tolerance)).size:
        fuller = partial(examine, native=native)
        told = fuller(apart=True)
        if _reading(told, tolerance) <= _reading(found, tolerance):
            found, examine = told, fuller
    own, others = _told_apart(found, tolerance)
    apart, hides = not own, False
    if own:
        without, found = found, examine(apart=False, foreign=others)
        hides = without.size(tolerance) > found.size(tolerance)
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


def _as_atoms(
    shape: Shape | Sketch,
    floor: Floor | None,
    found: Examined,
    tolerance: float,
    ladder: Sequence[float],
    seed: int,
    clock: Clock,
) -> Examined | None:
    """What points show that stand for themselves, where they are too few of a surface to be told; None if nothing.

    No samples of a surface are carried onto one another, one by one. They are asked where they lie farther apart than
    the tolerance, so that it does not happen by chance; and as they may have been made of samples, they tell no more
    than what is there at least.
    """
    measured, surface = found.measured, found.surface
    if not isinstance(shape, Shape) or shape.atoms or shape.faces is not None or measured.views or measured.flaw:
        return None
    if shape.isolated is not None or shape.weights is not None or not found.doubt(tolerance):
        return None
    if least_told(surface.floor) <= tolerance or surface.cloud.spacing <= tolerance * surface.diagonal:
        return None
    alone = replace(shape.without(np.concatenate(measured.apart)), isolated=True)
    read = _examined(alone, floor, False, tolerance, ladder, seed, clock, apart=False)
    if read.doubt(tolerance) or not read.decided(tolerance).index:
        return None
    return replace(read, outliers=found.outliers, outlier_share=found.outlier_share, sparse=True)


def _reading(found: Examined, tolerance: float) -> tuple[float, float, float]:
    """By what one of several readings of the same points is chosen, the least: the larger group is least by chance.

    Where they agree on it, as undetermined does with C1, none is surer than the other lets it be.
    """
    order, continuous = max(found.size(tolerance), (1.0, 1.0))
    decision = found.decided(tolerance)
    sure = 0.0 if found.doubt(tolerance) else decision.probabilities[decision.index]
    return -order, -continuous, sure


def _carried(found: Examined, points: Array, tolerance: float) -> Index:
    """Of points [N, 3] the strays that larger groups carry onto the surface, if they are as many as details may be.

    Where a surface is sampled sparsely between dense parts its points look like strays. But strays are far from the
    surface, and of a hundred of them one or two are carried onto it.
    """
    surface, strays = found.surface, found.measured.strays
    if surface.skin is None or found.measured.views or len(strays) <= SHARES[-1] * found.measured.count:
        return strays[:0]
    local, carried = found.measured.moments.normalised(points[strays]), np.zeros(len(strays), dtype=bool)
    for rival in [r for r in found.rivals(tolerance) if r.group.order > 1][:FOLLOWED]:
        motions = few_motions(rival.placed)
        met = surface.meets(images(motions, local))
        carried |= met.reshape(len(motions), -1).mean(axis=0) > 0.5
    enough = max(SHARES[-1] * found.measured.count, SHARES[0] * len(strays))
    return strays[carried] if carried.sum() > enough else strays[:0]


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
    native: Index | None = None,
) -> Examined:
    sketch = given if isinstance(given, Sketch) else None
    shape = given.sample if isinstance(given, Sketch) else given
    with clock("moments", len(shape.points)):
        whole = sketch.moments if sketch is not None and sketch.seen else None
        measured = measure(
            shape,
            outliers=outliers,
            apart=apart,
            foreign=foreign,
            native=native,
            floor=floor,
            whole=whole,
            seed=seed,
        )
        out, share = set_apart(measured, sketch, outliers=outliers)
    with clock("local_planes"):
        evidence, surface = gather(measured, np.random.default_rng(seed), tolerance)
    exact = proof = None
    # Masses and densities of points are no part of what is mapped; those of faces are.
    if measured.shape.faces is not None or measured.shape.weights is None:
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
        # Of other tolerances groups are told that they call more likely than not.
        links = chain(surface, pool, max(ALIKE * least, EVEN * max(ladder, default=0.0)))
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
    cloud, points = found.surface.of_one_class, found.measured.moments.normalised(blob)
    link = found.link(tolerance)
    motions = [m for element in link.elements for m in element.motions]
    if not motions or found.doubt(tolerance):
        return False
    moved = images(motions, points)
    own = (Tree(points).nearest(cloud.points)[0] <= 2.0 * cloud.reach)[cloud.nearest(moved, None)[1]]
    if not link.group.is_polar and own.reshape(len(motions), -1).mean(axis=1).min() > 0.5:
        return True
    others = moved[~own]
    return 2 * len(others) > len(moved) and bool(found.surface.meets(others).mean() > 0.5)


def _replaces(found: Examined, clump: Array, tolerance: float) -> bool:
    """Whether about as much of the surface has its image under points set apart as these are: a part out of place."""
    own, there, hidden = found.surface.cloud.points, Clump.of(found.measured.moments.normalised(clump)), [0.0]
    for element in found.link(tolerance).elements:
        for motion in element.motions:
            moved = motion.apply(own)
            under = moved[there.covers(moved)]
            hidden.append(float((~found.surface.meets(under)).sum()) if len(under) else 0.0)
    return max(hidden) * found.measured.count >= COUNTERPART * len(clump) * len(own)


def _belongs(found: Examined, clump: Array, tolerance: float) -> bool:
    """Whether points apart from the body are a part of it: many elements carry most of them to where they may be.

    That is onto the surface, onto themselves or, where cameras are known, to where they could not see. Of many mirrors
    one passes through any clump by chance; a part of the object is carried by a third of the elements and more.
    """
    surface, points = found.surface, found.measured.moments.normalised(clump)
    beside = ~surface.meets(points)
    points = points[beside] if beside.any() else points  # what lies in the surface is carried with it
    own, carried = Tree(points), []
    for element in found.link(tolerance).elements:
        moved = images(element.motions, points)
        off = ~surface.meets(moved) & (own.nearest(moved)[0] > surface.margin)
        for camera in () if surface.openings is None else surface.openings.cameras:
            off &= camera.sees_through(moved, surface.margin)
        carried.append(off.mean() < 0.5)
    return 3 * sum(carried) > len(carried)
