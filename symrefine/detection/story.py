"""Detection on one page: shape -> moments -> proposals -> fits -> one table of misses -> the group, and how sure."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symrefine.clock import Clock
from symrefine.decide.hypotheses import Element, Hypothesis, fitted, judged
from symrefine.decide.looks import COARSE, look_stride, start_error
from symrefine.decide.place import slack
from symrefine.decide.posterior import NEAR, Decision, alternatives
from symrefine.detection.examination import examined
from symrefine.detection.examined import Examined
from symrefine.detection.measure import Measured, Outliers
from symrefine.detection.result import Candidate, Detection, Exact, FoundAxis, FoundPlane, NearMiss, Step
from symrefine.detection.sketch import Sketch
from symrefine.errors import InputError
from symrefine.fit.placed import Placed
from symrefine.fit.refine import answered
from symrefine.fit.vertices import OnVertices
from symrefine.geometry import Array, Axis, Plane, cross_matrix, positive
from symrefine.moments.moments import Moments
from symrefine.samples import FOLLOWED
from symrefine.shape import Shape
from symrefine.surface.misses import TOLERANCE
from symrefine.surface.surface import Surface
from symrefine.threads import one_thread

# Tolerances of the staircase that the command line tells.
LADDER = (0.0025, 0.005, 0.01, 0.02, 0.04, 0.08)


@one_thread()
def detect(
    shape: Shape | Sketch | ArrayLike,
    *,
    outliers: Outliers = "auto",
    tolerance: float = TOLERANCE,
    ladder: Sequence[float] = (),
    seed: int = 0,
) -> Detection:
    """Point group, mirror planes and rotation axes of an object in 3-space, with what it misses each of them by.

    What a texture keeps of them, `detection.textured` tells.

    Args:
        shape: a `Shape`, points [N, 3], or the `Sketch` of a cloud too large to hold; of a cloud of more than 100,000
            points a sketch is made, too. Of points that stand for themselves (`Shape.atoms`) those of different weight
            are different things, which no symmetry exchanges; of others weights are a sampling density.
        outliers: "auto": points of a cloud that belong to no surface are set apart and told as `Detection.outliers`;
            "floor": so is the plane that the object stands on, as `Detection.floor`; "none": all points count.
        tolerance: largest miss that still counts as symmetric, as a fraction of the bounding-box diagonal: 95 % of the
            surface must come within 0.75 of it, 99 % within 1.6, the mean within 0.22 (see `surface.misses`). How sure
            the answer is says how close the object comes to these limits.
        ladder: other tolerances to tell the group at, from the same table of misses; see `Detection.staircase`.
        seed: of the random choices (samples of a mesh, subsets of a cloud).

    Raises:
        InputError: not a 3-D shape, tolerances outside (0, 0.2], another word for outliers, or a floor told of what is
            no cloud of a surface.
        DegenerateShapeError: the points do not spread.
    """
    if not isinstance(shape, Shape | Sketch):
        shape = Shape.of(shape)
    if isinstance(shape, Shape) and shape.dim != 3:
        raise InputError(f"{shape.source}: detect takes 3-D shapes; {_elsewhere(shape.dim)}")
    clock = Clock()
    found = examined(shape, outliers=outliers, tolerance=tolerance, ladder=ladder, seed=seed, clock=clock)
    return told(found, tolerance=tolerance, ladder=ladder, clock=clock)


def told(found: Examined, *, tolerance: float = TOLERANCE, ladder: Sequence[float] = (), clock: Clock) -> Detection:
    """What is decided of an object that was examined, at tolerances not beyond those it was examined for."""
    with clock("decide"):
        decision = found.decided(tolerance)
        steps = tuple(_step(found, t) for t in sorted(ladder))
    reason = found.doubt(tolerance)
    return _report(found, decision, 0 if reason else decision.index, reason, tolerance, steps, clock)


@one_thread()
def chosen(detection: Detection, point_group: str) -> Detection:
    """What is told if a person says that another group of the chain is meant: its elements, where it fits best.

    Args:
        point_group: Schoenflies symbol, one of those in `Detection.choices`.

    Raises:
        InputError: no group of the chain.
    """
    found, tolerance = detection.examined, detection.tolerance
    links = found.links
    names = [link.group.name for link in links]
    if point_group not in names:
        raise InputError(f"point_group is {point_group!r}; expected one of {', '.join(names)}")
    index, decision = names.index(point_group), found.decided(tolerance)
    if links[index].need > found.pool.limit:  # it may have been looked at only
        fit = replace(fitted(found.surface, links[index].placed), need=links[index].need)
        found = replace(found, links=(*links[:index], fit, *links[index + 1 :]))
    told = _report(found, decision, index, "", tolerance, detection.staircase, Clock())
    return replace(told, timings=detection.timings)


def _elsewhere(dim: int) -> str:
    """What is offered for points of another dimension."""
    if dim == 2:
        return "these points have 2 coordinates: use symrefine.plane.detect_planar"
    return (
        f"these points have {dim} coordinates: for 4 and more symrefine.ndim.detect_nd tells the rank of the "
        "n-tuples and the hyperplanes of symmetry, no turns and no groups"
    )


def _step(found: Examined, tolerance: float) -> Step:
    """The group at another tolerance, read from the same table."""
    undetermined = bool(found.doubt(tolerance))
    name = "undetermined" if undetermined else found.link(tolerance).group.name
    return Step(tolerance=tolerance, point_group=name, undetermined=undetermined)


def _report(
    found: Examined,
    decision: Decision,
    index: int,
    reason: str,
    tolerance: float,
    steps: tuple[Step, ...],
    clock: Clock,
) -> Detection:
    """What is told where the group of the chain with that index is the answer, or none is for a reason."""
    measured, surface, links = found.measured, found.surface, found.links
    moments, chosen = measured.moments, links[index]
    names, needs = [h.group.name for h in links], [h.need for h in links]
    told = alternatives(names, needs, decision, -1 if reason else index)
    history, known = chosen.history, _covariance(surface, chosen)
    on = found.vertices_of(chosen)
    exact = on or found.exact_part(chosen)
    chosen = chosen if on is None else _polished(chosen, on, measured)
    with_rivals = found.links_at(tolerance)
    sure = {id(e): _confidence(e, with_rivals, decision) for e in chosen.elements}
    planes = [e for e in chosen.elements if e.operations.kind == "plane"]
    turns = [e for e in chosen.elements if e.operations.kind in ("axis", "improper")]
    turned_down = [] if reason else _turned_down(found, chosen, COARSE * tolerance)
    inversion = next((e for e in chosen.elements if e.operations.kind == "inversion"), None)
    more = not reason and chosen.group.name != "Kh"  # of which there is none
    strewn = found.hides or (found.has_strays_left and not any(e.coverage.unseen for e in chosen.elements))
    # Nobody saw the bottom of what stands on a floor.
    hidden = measured.floor is not None and chosen.group.is_polar
    return Detection(
        point_group="undetermined" if reason else chosen.group.name,
        confidence=0.0 if reason else decision.probabilities[index],
        alternatives=tuple(told) if len(links) > 1 and not reason else (),
        group=chosen.group,
        center=moments.restored(chosen.placed.center) if on is None else on.center,
        planes=tuple(
            FoundPlane(plane=_plane(e, moments), confidence=sure[id(e)], **_as_told(e, known, moments.scale))
            for e in sorted(planes, key=lambda e: e.need)
        ),
        axes=tuple(
            FoundAxis(
                axis=Axis(point=moments.restored(e.center), direction=positive(e.operations.direction)),
                order=e.operations.order,
                improper=e.operations.kind == "improper",
                confidence=sure[id(e)],
                **_as_told(e, known, moments.scale),
            )
            for e in sorted(turns, key=lambda e: (-e.operations.order, e.need))
        ),
        inversion=chosen.group.has_inversion,
        inversion_residual=None if inversion is None else inversion.deviation,
        inversion_confidence=None if inversion is None else sure[id(inversion)],
        near_misses=tuple(
            NearMiss(
                kind=e.operations.kind,
                direction=positive(e.operations.direction),
                point=moments.restored(e.center),
                order=e.operations.order,
                residual=e.deviation,
                # Cameras say what they could not see, which then asks for no belief.
                excess=math.inf if e.coverage.tells_nothing and not surface.viewed else e.need / tolerance,
            )
            for e in turned_down
        ),
        iterations=chosen.iterations,
        tolerance=tolerance,
        diagonal=surface.diagonal * moments.scale,
        undetermined=reason,
        staircase=steps,
        tuples=measured.tuples,
        vectors=measured.vectors,
        history=history,
        points=surface.cloud.points,
        surface=surface,
        candidates=tuple(
            Candidate(
                point_group=start.group.name,
                direction=positive(start.group.frame[2]),
                point=moments.restored(start.center),
                excess=need / tolerance,
            )
            for start, need in sorted((*found.pool.looked, *found.pool.hopeless), key=lambda k: k[1])
        ),
        outliers=found.outliers,
        outlier_share=found.outlier_share,
        at_least=(found.pool.at_least or strewn or hidden or found.sparse) and more,
        strewn=strewn and more,
        sparse=found.sparse,
        floor=measured.floor,
        no_floor=found.no_floor,
        clumps=len(measured.clumps),
        exact=None if exact is None else _exact(exact, measured.shape),
        sample=found.sample,
        even_sample=len(measured.shape.points) if measured.is_thinned else None,
        origin=moments.center,
        scale=moments.scale,
        timings=clock.seconds,
        examined=found,
    )


def _exact(on: OnVertices, shape: Shape) -> Exact:
    return Exact(miss=on.miss, faces=None if shape.faces is None else on.faces, point_group=on.finite.name)


def _polished(chosen: Hypothesis, on: OnVertices, measured: Measured) -> Hypothesis:
    """The group and its elements where the vertices put them, with the misses that decided."""
    center = measured.moments.normalised(on.center)
    turn = on.group.frame.T @ chosen.group.frame

    placed = Placed(group=on.group, center=center)
    turned = (replace(e, center=center, operations=e.operations.turned(turn)) for e in chosen.elements)
    return replace(chosen, placed=placed, elements=tuple(turned))


def _confidence(element: Element, links: Sequence[Hypothesis], decision: Decision) -> float:
    """Probability that an element is meant: that the true group holds the first group of the chain which has it.

    And that it is this one that is meant, if that is the true group, and none of its rivals; one of theirs that a
    larger group has may be the one that is.
    """
    matrix = element.operations.matrices[0][None]

    def has(placed: Placed) -> bool:
        return bool(placed.group.distance_rad(matrix)[0] < math.radians(5.0))

    sure = 0.0
    for link, own, beyond in zip(links, decision.probabilities, [*decision.inside[1:], 0.0], strict=True):
        if link.elements and has(link.placed):
            return sure + own * link.share + beyond
        sure += own * link.share if any(map(has, link.rivals)) else 0.0
    return decision.inside[decision.index]


def _turned_down(found: Examined, chosen: Hypothesis, most: float) -> list[Element]:
    """Elements that were judged and are not in the group, and those that seem to need no more than some, best first.

    Where nothing comes so near, what comes nearest.
    """
    beyond = [e for h in (*found.links, *found.pool.small) for e in h.elements]
    starts = found.pool.turned_down()
    near = [start for start in starts if start.need <= most]
    for start in near if near or beyond else starts[:FOLLOWED]:
        if len(beyond) >= NEAR:
            break
        if not chosen.holds(start.placed):
            beyond += judged(found.surface, start.placed).elements
    beyond, told = sorted(beyond, key=lambda e: e.need), list[Element]()
    matrices = np.array([e.operations.matrices[0] for e in beyond]).reshape(-1, 3, 3)
    away = chosen.group.distance_rad(matrices) if chosen.elements else np.full(len(beyond), math.inf)
    for e, matrix, own in zip(beyond, matrices, away, strict=True):
        others = [float(np.linalg.norm(matrix - o.operations.matrices[0])) for o in told]
        if min([own, *others]) > math.radians(5.0):
            told.append(e)
    return told[:NEAR]


def _covariance(surface: Surface, chosen: Hypothesis) -> Array | None:
    """The covariance [6, 6] of a small turn and a shift of a group, along the axes of space; None if nothing tells it.

    That of the joint refinement, as far as pairs told in noise where the group stands, and what nobody saw.
    """
    loose = slack(surface, chosen.placed) if surface.viewed and chosen.elements else np.zeros((6, 6))
    if len(chosen.history) < 2:
        return loose if loose.any() else None
    end, covariance = chosen.history[-1], chosen.history[-1].covariance
    if surface.is_noisy:
        stride = look_stride(surface, len(end.state.standard))
        covariance = answered(surface.cloud, end, start_error(surface), stride=stride)
    axes = np.kron(np.eye(2), end.state.frame)
    return np.asarray(axes.T @ covariance @ axes + loose)


def _as_told(element: Element, covariance: Array | None, scale: float) -> dict[str, Any]:
    """What is told of a plane and of an axis alike."""
    off_rad, off = _uncertainty(covariance, element)
    return {"residual": element.deviation, "coverage": element.coverage, "sigma_rad": off_rad, "sigma": scale * off}


def _uncertainty(covariance: Array | None, element: Element) -> tuple[float, float]:
    """Standard deviations of an element's direction (radians) and place (RMS radii), each where it is least certain.

    The group turns by a small w: a direction u moves by w x u. It shifts: a plane along its normal, an axis across
    itself.
    """
    if covariance is None:
        return math.nan, math.nan
    u = element.operations.direction
    cross = cross_matrix(u)
    along = np.outer(u, u)
    moves = along if element.operations.kind == "plane" else np.eye(3) - along
    turned, shifted = cross @ covariance[:3, :3] @ cross.T, moves @ covariance[3:, 3:] @ moves
    largest = [max(float(np.linalg.eigvalsh(c)[-1]), 0.0) for c in (turned, shifted)]
    return math.sqrt(largest[0]), math.sqrt(largest[1])


def _plane(element: Element, moments: Moments) -> Plane:
    normal = positive(element.operations.direction)
    return Plane(normal=normal, offset=float(normal @ moments.restored(element.center)))
