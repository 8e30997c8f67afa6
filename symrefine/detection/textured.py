"""The group of a shape with its texture: that part of the group of the shape which its colours keep.

The operations are those that were fitted to the shape, so that the group with the texture is inside it. Each is judged
by the colours too, by lengths as the shape is, and the group is decided by the same posterior over a chain of
subgroups.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from symrefine.clock import Clock
from symrefine.decide.hypotheses import MOVED_EACH, NOTHING, Element, Hypothesis, judged
from symrefine.decide.looks import exact_need, few_motions
from symrefine.decide.posterior import ALIKE
from symrefine.decide.subgroups import subgroup_chain
from symrefine.detection.examination import examined
from symrefine.detection.examined import Examined
from symrefine.detection.measure import PLANES, SAMPLES
from symrefine.detection.result import Detection
from symrefine.detection.story import told
from symrefine.fit.placed import Placed
from symrefine.geometry import Array, Isometry, rotation
from symrefine.groups import PointGroup, is_subgroup
from symrefine.moments.quadrature import sample_surface
from symrefine.rounding import START_ERROR
from symrefine.shape import Shape
from symrefine.surface.misses import Deviation
from symrefine.surface.painted import Painted, needed
from symrefine.texture import colour_classes, corner_weights
from symrefine.threads import one_thread

# Operations of the largest group whose subgroups are looked through: those of an icosahedron, and of folds up to 30. Of
# more, as of endless ones, samples that are labelled by their colours tell what is left.
MOST = 120


@one_thread()
def with_texture(found: Detection, shape: Shape, *, ladder: Sequence[float] = (), seed: int = 0) -> Detection:
    """What was detected in a shape, and beside it, as `Detection.textured`, what of that its texture keeps.

    Args:
        found: of the shape, at the same tolerances and with the same seed.
        shape: a mesh with a texture.
        ladder: other tolerances to tell the group at.
        seed: of the samples.
    """
    clock, tolerance = Clock(), found.tolerance
    clock.seconds.update(found.timings)
    limit = max((tolerance, *ladder))
    kept = textured(found.examined, shape, tolerance=tolerance, limit=limit, seed=seed, clock=clock)
    answer = told(kept, tolerance=tolerance, ladder=ladder, clock=clock)
    return replace(found, textured=answer, timings=clock.seconds)


def textured(found: Examined, shape: Shape, *, tolerance: float, limit: float, seed: int, clock: Clock) -> Examined:
    """What a decision on a textured shape is made from, once the shape alone was examined.

    Args:
        found: of the shape.
        shape: a mesh with a texture.
        tolerance: largest miss that counts as symmetric.
        limit: the largest tolerance at which anything is to be told.
        seed: of the samples.
        clock: its stages.
    """
    rng = np.random.default_rng(seed)
    with clock("texture"):
        painted = _painted(found, shape, rng)
        few = [h.placed for h in found.links[1:] if h.group.order <= MOST]
        many = [h.placed for h in found.links[1:] if h.group.order > MOST]
        if found.link(tolerance).group.order > MOST:
            few, marked = _marked(found, painted, shape, many[-1], tolerance, rng)
            many = [*marked, *many]
        links = [NOTHING]
        for placed in [*(_chain(found, painted, few[-1]) if few else []), *many]:
            link = _told(found, painted, placed)
            links.append(replace(link, need=max(link.need, links[-1].need)))
    return replace(found, links=_within(links, ALIKE * limit), pool=replace(found.pool, small=()))


def _painted(found: Examined, shape: Shape, rng: np.random.Generator) -> Painted:
    """Samples of the surface with their colours, normalised units."""
    assert shape.texture is not None
    assert shape.faces is not None
    points, _, face = sample_surface(shape, PLANES, rng)
    moments = found.measured.moments
    local, vertices = map(moments.normalised, (points, shape.points))
    order = rng.permutation(len(points))  # any stride takes an even part
    return Painted.of(local[order], face[order], vertices[shape.faces], shape.texture, found.surface.diagonal)


def _chain(found: Examined, painted: Painted, whole: Placed) -> list[Placed]:
    """Subgroups of a finite group, each inside the next, in the order of what their operations need."""
    motions, shape_needs = zip(*(_known(found, whole, matrix) for matrix in whole.group.operations()), strict=True)
    colour_needs = needed(painted.misses(motions, sources=MOVED_EACH, bound=ALIKE * found.surface.tolerance))
    chain = subgroup_chain(whole.group, np.maximum(shape_needs, colour_needs))
    return [Placed(group=group, center=whole.center) for group, _ in chain]


def _known(found: Examined, whole: Placed, matrix: Array) -> tuple[Isometry, float]:
    """An operation of a group as the first link that has it places it, with what the shape needs there."""
    for link in found.links[1:]:
        if link.group.distance_rad(matrix[None])[0] < START_ERROR:
            if not link.group.is_finite:
                return Isometry.about(whole.center, matrix), link.need
            operations = link.group.operations()
            nearest = operations[np.linalg.norm(operations - matrix, axis=(1, 2)).argmin()]
            return Isometry.about(link.placed.center, nearest), link.need
    return Isometry.about(whole.center, matrix), 0.0


def _told(found: Examined, painted: Painted, placed: Placed) -> Hypothesis:
    """A group with its elements judged by shape and colours."""
    hypothesis = judged(found.surface, placed)
    parts = tuple(_element(painted, e, found.surface.tolerance) for e in hypothesis.elements)
    return replace(hypothesis, elements=parts, need=max(hypothesis.need, *(e.need for e in parts)))


def _element(painted: Painted, element: Element, bound: float) -> Element:
    motions = element.operations.motions(element.center)
    misses = painted.misses(motions, sources=MOVED_EACH, bound=ALIKE * bound)
    deviation = reduce(Deviation.at_least, map(Deviation.of, misses), element.deviation)
    return replace(element, need=max(element.need, float(needed(misses).max())), deviation=deviation)


def _within(links: list[Hypothesis], limit: float) -> tuple[Hypothesis, ...]:
    """The chain up to the first group beyond the limit."""
    last = next((k for k, link in enumerate(links) if link.need > limit), len(links))
    return tuple(links[: last + 1])


def _marked(
    found: Examined, painted: Painted, shape: Shape, whole: Placed, tolerance: float, rng: np.random.Generator
) -> tuple[list[Placed], list[Placed]]:
    """Groups of few and of many operations that colours leave of many: of samples whose labels are their colours."""
    if _told(found, painted, whole).need <= exact_need(found.surface.floor):
        return [], []
    assert shape.texture is not None
    assert shape.faces is not None
    points, normals, face = sample_surface(shape, SAMPLES, rng)
    colours = shape.texture.colours(face, corner_weights(points, shape.points[shape.faces[face]]))
    labels = colour_classes(colours, np.ones(len(colours)))
    seen = examined(Shape(points=points, normals=normals, labels=labels), tolerance=tolerance, clock=Clock())
    here, there = found.measured.moments, seen.measured.moments
    inside = [
        Placed(group=h.group, center=here.normalised(there.restored(h.placed.center)))
        for h in seen.links[1:]
        if is_subgroup(h.group, whole.group, START_ERROR)
    ]
    few = [_turned(painted, p, whole) for p in inside if p.group.order <= MOST]
    return few[-1:], [p for p in inside if p.group.order > MOST]


def _turned(painted: Painted, placed: Placed, whole: Placed) -> Placed:
    """A finite group turned about the axes of an endless one to where colours miss it least: the shape says nothing."""
    best, least = placed, _colour_miss(painted, placed)
    for step in (START_ERROR / 4.0, START_ERROR / 16.0):
        for axis in whole.group.continuous_axes():
            start = best
            for k in range(-4, 5):
                frame = start.group.frame @ rotation(axis, k * step)
                tried = replace(start, group=PointGroup(name=start.group.name, frame=frame))
                miss = _colour_miss(painted, tried)
                best, least = (tried, miss) if miss < least else (best, least)
    return best


def _colour_miss(painted: Painted, placed: Placed) -> float:
    """Mean miss of the colours over some elements of a group."""
    motions = few_motions(placed)
    return float(np.mean([miss.mean() for miss in painted.misses(motions, sources=MOVED_EACH, bound=0.0)]))
