"""Whether what was seen of an object tells that a group holds, and that it stands where it was put.

Of what cameras did not see nothing contradicts. A mirror that carries all there is behind it holds as well farther
back, and one through the axis of a round cup that carries its handle there turned about that axis.
"""

import math
from collections.abc import Sequence

import numpy as np

from symrefine.decide.looks import GLANCED, exact_need, few_motions, start_error
from symrefine.decide.posterior import EVEN, Link, meant
from symrefine.fit.matching import match
from symrefine.fit.placed import Operations, Placed, elements, joined
from symrefine.fit.refine import Framed, pair_gram
from symrefine.fit.residual import SIZE, design_rows, frame_model, gram
from symrefine.fit.vertices import ROUNDED
from symrefine.geometry import Array, Isometry, Mask, rotation
from symrefine.groups import is_subgroup
from symrefine.groups.names import MAX_FOLD
from symrefine.samples import COUNT, GLANCE, LOOK
from symrefine.shape import Index
from symrefine.surface.misses import DISCS
from symrefine.surface.skin import LocalPlanes
from symrefine.surface.surface import Surface

# Share of a surface that has to be carried onto itself for anything to be said of an operation.
SUPPORTED = 0.15
# Times that an interval is halved in which a group stands: to 3 % of how far starts are off.
HALVED = 5


def least_elsewhere(surface: Surface, placed: Placed, enough: float = 0.0) -> float:
    """What a group needs at least where it is moved as far as starts may be off, or something up to `enough`.

    It says nothing of the object unless something would contradict it elsewhere: moved to either side, in the ways that
    change what it is and that the surface tells least of, until its images lie as far aside as those of a mirror that
    is off so much. Turns go no farther than a quarter of a wedge.
    """
    state, ways = _ways(surface, placed)
    least = math.inf
    for way in ways:  # it needs least where least is told, most often
        least = min(least, float(_needs(surface, placed, state, np.stack([-way, way]), most=least).min()))
        if least <= enough:
            break
    return least


def nowhere(surface: Surface) -> float:
    """The need up to which a group, elsewhere, holds there as likely as not: then nothing says where it stands."""
    return EVEN * surface.tolerance


def slack(surface: Surface, placed: Placed) -> Array:
    """Covariance [6, 6] of turn and shift, along the axes of space, of a group where nothing that was seen says where.

    To either side, in each of the same ways, it may be moved until it needs more than noise explains; in between it
    stands anywhere.
    """
    state, ways = _ways(surface, placed)
    every = np.concatenate([-ways, ways])
    most = max(float(_needs(surface, placed, state, np.zeros((1, 6)), rough=True)[0]), exact_need(surface.floor))
    step = 0.5**HALVED
    low, high = np.zeros(len(every)), np.ones(len(every))
    free = _needs(surface, placed, state, step * every, rough=True) <= most
    low[free] = step
    for _ in range(HALVED if free.any() else 0):
        middle = 0.5 * (low + high)
        holds = free.copy()
        holds[free] = _needs(surface, placed, state, middle[free, None] * every[free], rough=True) <= most
        low, high = np.where(holds, middle, low), np.where(holds, high, middle)
    # Evenly spread over an interval, about where it was put: its second moment there.
    down, up = np.split(low, 2)
    space = np.kron(np.eye(2), state.frame)
    along = ways @ space
    return np.einsum("w,wi,wj->ij", (down**2 - down * up + up**2) / 3.0, along, along)


def told_apart(surface: Surface, placed: Placed, need: float) -> float:
    """How likely it is that atoms have a group, which needs so much, by more than standing densely; 1 of a surface.

    Wherever images come to lie, some atom is near. So what a group needs counts beside what it needs elsewhere as it
    does beside the tolerance, and the share of atoms that are no image of any beside 1 / e, that of maps at random. A
    continuous group carries each atom along a curve, and so leaves it where it is; but for atoms that follow one
    another so closely about its axes that no fold there has a name.
    """
    cloud = surface.cloud
    if cloud.body != "atoms" or need <= 0.0:
        return 1.0
    some = np.arange(0, len(cloud.points), surface.stride(COUNT))
    if placed.group.is_finite:
        elsewhere = least_elsewhere(surface, placed)
        missed = max(1.0 - _met(cloud, m, some).mean() for m in few_motions(placed))
        return meant(Link(need=missed), 1.0 / math.e) * meant(Link(need=need), elsewhere) if elsewhere > 0.0 else 0.0
    axes = [part for part in elements(placed.group) if math.isinf(part.order)]
    still = min(float(_stays(cloud, m, some).mean()) for part in axes for m in part.motions(placed.center))
    least = (Isometry.about(placed.center, rotation(part.direction, math.pi / MAX_FOLD)) for part in axes)
    return max(still, *(1.0 - float(_stays(cloud, m, some).mean()) for m in least))


def _stays(cloud: LocalPlanes, motion: Isometry, some: Index) -> Mask:
    """Which of some atoms are the nearest to their own images."""
    return np.asarray(cloud.place[_nearest(cloud, motion, some)] == cloud.place[some])


def _met(cloud: LocalPlanes, motion: Isometry, some: Index) -> Mask:
    """Which of some atoms are the nearest to the image of another: of one of the few that come nearest to them."""
    back = motion.inverse.apply(cloud.points[some])
    sources = cloud.around(back, cloud.classes(some), min(DISCS, len(cloud.points)))[1]
    there = cloud.place[_nearest(cloud, motion, sources.ravel())].reshape(sources.shape)
    return np.asarray((there == cloud.place[some][:, None]).any(axis=1))


def _nearest(cloud: LocalPlanes, motion: Isometry, some: Index) -> Index:
    """The atom nearest to the image of each."""
    return cloud.nearest(motion.apply(cloud.points[some]), cloud.classes(some))[1]


def _ways(surface: Surface, placed: Placed) -> tuple[Framed, Array]:
    """The frame of a group, and motions [p, 6] of it as far as starts may be off, the least told ones first."""
    frame, fold = placed.group.frame, placed.group.symbol.fold
    standard = np.stack([frame @ m.matrix @ frame.T for m in few_motions(placed)])
    state = Framed(standard=standard, frame=frame, center=placed.center)
    wedge = 2.0 * math.pi / (fold if 0 < fold < math.inf else 1)
    # Turned about its centre, the group of a ball is the same.
    ways = freest(surface.cloud, state, turns=placed.group.name != "Kh", stride=surface.stride(LOOK))
    turns = np.maximum(np.linalg.norm(ways[:, :3], axis=1), 1e-300)
    return state, ways * np.minimum(2.0 * start_error(surface), 0.25 * wedge / turns)[:, None]


def freest(cloud: LocalPlanes, state: Framed, *, turns: bool = True, stride: int = 1) -> Array:
    """Motions [p, 6] of a frame (rotation about and shift along its axes), what pairs of local planes tell least first.

    Those that change no operation are not among them, as a turn about the normal of a lone mirror; without `turns` no
    turn is. What the pairs of each changes is weighed against how far images move, which is 1 in the mean square over
    all operations.
    """
    first = 0 if turns else 3
    points = cloud.points[::stride]
    every, none, ones = np.ones(len(points)) / len(points), np.zeros_like(points), np.ones((len(points), 1))
    moves = sum((gram(design_rows(points, none, ones * axis), every) for axis in np.eye(3)), np.zeros((SIZE, SIZE)))
    grams = np.stack([pair_gram(cloud, p) for p in match(cloud, state.motions, 0.0, stride=stride)])
    told, moved = (
        frame_model(g, state.standard, state.frame, state.center, np.zeros(6)).hessian[first:, first:]
        for g in (grams, np.broadcast_to(moves / len(grams), grams.shape))
    )
    lengths, ways = np.linalg.eigh(moved)
    some = lengths > ROUNDED * lengths[-1]
    ways = ways[:, some] / np.sqrt(lengths[some])
    found = (ways @ np.linalg.eigh(ways.T @ told @ ways)[1]).T
    return np.pad(found, ((0, 0), (first, 0)))


def _needs(
    surface: Surface, placed: Placed, state: Framed, ways: Array, *, most: float = math.inf, rough: bool = False
) -> Array:
    """What a group needs [W] where it is moved by each of some ways [W, 6], from `most` on a lower bound.

    Or `rough`ly, if that is little or much.
    """
    motions = [few_motions(placed.moved(state.moved(way))) for way in ways]
    every = [m for part in motions for m in part]
    if rough:
        needs = surface.needs(every, sources=GLANCE, most=surface.tolerance, discs=1, tests=GLANCED)
    else:
        needs = surface.needs(every, sources=LOOK, most=most, tests=GLANCED)
    return needs.reshape(len(ways), -1).max(axis=1)


def is_told(placed: Placed, parts: Sequence[tuple[Operations, float]]) -> bool:
    """Whether elements that enough speaks for generate a group, given the share of a surface that supports each.

    For a continuous axis speaks that nothing contradicts any of its turns.
    """
    evident = [m for m, share in parts if share >= SUPPORTED or math.isinf(m.order)]
    whole = joined([m.alone(placed.center) for m in evident]) if evident else None
    return whole is not None and is_subgroup(placed.group, whole.group)
