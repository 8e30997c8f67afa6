"""The search for hyperplanes of symmetry through the centre: those that hold, and why there may be more."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from symrefine.geometry import Array
from symrefine.groups.elements import DIRECTION_ERROR_RAD
from symrefine.moments.moments import shape_moments
from symrefine.ndim import sampled as samples
from symrefine.ndim.matched import Points, distinct
from symrefine.ndim.roots import MOST, closed_under_reflection, reflection_group_order
from symrefine.ntuples.rank import SIGNIFICANT
from symrefine.shape import Shape

# Sampling noise, in tolerances, beyond which moments of orders 2 to 4 decide nothing.
ALLOWED = 0.5
# Moments of orders 5 and 6 are not made in more dimensions: they are too many.
HIGH_DIM = 6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Search:
    """Unit normals of the hyperplanes through the centre that hold, and of others; the rest as `SubspaceDetection`."""

    holds: list[Array]
    rejected: list[Array]
    incomplete: list[str]
    order: int | None
    undetermined: str = ""


def among_points(cloud: Points, known: list[Array], tolerance: float) -> Search:
    """Search points that stand for themselves; `known` are normals to try besides the differences of pairs."""
    same = _same(tolerance)
    candidates, all_there = cloud.candidates(tolerance, same)
    tried = sorted(((cloud.miss(n), k, n) for k, n in enumerate(map(cloud.refined, [*candidates, *known]))))
    found, _ = distinct([n for _, _, n in tried], same, len(tried))
    incomplete = [] if all_there else [f"only the best {len(candidates)} candidates were looked at"]
    free = cloud.free
    if len(free) > 1:
        # Every hyperplane across these directions takes each point to itself.
        found = [n for n in found if np.linalg.norm(free @ n) < 0.5]
        incomplete.append(
            f"the points span {len(free)} dimensions less than the space, so that every hyperplane that holds them all "
            "is one; none of these is listed"
        )
    holds, rejected = _parted(found, lambda n: cloud.miss(n) <= tolerance)

    def confirmed(image: Array) -> Array | None:
        normal = cloud.refined(image)
        return normal if cloud.miss(normal) <= tolerance else None

    search = _closed(holds, rejected, confirmed, same, incomplete)
    return search if len(free) < 2 else replace(search, order=None)


def among_samples(
    shape: Shape,
    low: samples.Block,
    known: list[Array],
    tolerance: float,
    neighbours: samples.Neighbours | None,
    rng: np.random.Generator,
) -> Search:
    """Search random samples.

    Args:
        shape: the samples.
        low: their moments of orders 2 to 4.
        known: normals to start from besides the eigenvectors of the second moments and random ones.
        tolerance: see `detect_nd`.
        neighbours: ask these, too; None where the density of the points is not that of the object.
        rng: of the random starts.
    """
    random, shared = samples.starts(low, tolerance, rng)
    begin = [*known, *random]
    blocks, orders = [low], "2 to 4"
    fixed, loose, rejected, noise = _sorted(blocks, begin, tolerance, ALLOWED * tolerance)
    if noise > ALLOWED * tolerance:
        doubt = _hidden(noise, tolerance, "give")
        return Search(holds=[], rejected=[*rejected, *fixed], incomplete=[], order=None, undetermined=doubt)
    incomplete = []
    if loose and low.whole[0].shape[0] <= HIGH_DIM:
        high = samples.block(shape_moments(shape, max(samples.HIGH), parts=len(low.changes)), samples.HIGH)
        finer = _sorted([low, high], [*begin, *fixed], tolerance, tolerance)
        if finer[3] > tolerance:
            incomplete.append(f"of orders 5 and 6 {_hidden(finer[3], tolerance, 'to look closer, give')}")
        else:
            blocks, orders = [low, high], "2 to 6"
            fixed, loose, rejected, _ = finer
    if loose:
        spread = np.linalg.svd(np.concatenate(loose), compute_uv=False)
        incomplete.append(
            f"as far as moments of orders {orders} tell, a hyperplane can turn and still hold, with normals in "
            f"{np.count_nonzero(spread > 0.2 * spread[0])} dimensions; none of these is listed"
        )
    elif shared:
        incomplete.append(
            f"second moments coincide in {shared} dimensions, where normals were looked for from {len(random)} starts"
        )

    def true(normal: Array, sigmas: float) -> bool:
        moments = all(samples.holds(b, normal, tolerance, sigmas) for b in blocks)
        return moments and (neighbours is None or not neighbours.contradict(normal, tolerance))

    def confirmed(image: Array) -> Array | None:
        (normal,) = samples.minima(blocks, [image])
        return normal if true(normal, SIGNIFICANT) else None

    holds, untrue = _parted(fixed, lambda n: true(n, samples.FOUND))
    search = _closed(holds, [*rejected, *untrue], confirmed, 3.0 * _same(tolerance), incomplete)
    return replace(search, order=None) if loose else search


def _parted(normals: list[Array], test: Callable[[Array], bool]) -> tuple[list[Array], list[Array]]:
    """Those that pass a test, and those that do not."""
    passed = [(n, test(n)) for n in normals]
    return [n for n, good in passed if good], [n for n, good in passed if not good]


def _sorted(
    blocks: list[samples.Block], begin: list[Array], tolerance: float, allowed: float
) -> tuple[list[Array], list[Array], list[Array], float]:
    """Normals that hold where they are, bases [k, n] of what others turn in and hold, those that do not; most noise."""
    found, _ = distinct(samples.minima(blocks, begin), _same(tolerance), MOST)
    holds, rejected = _parted(found, lambda n: all(samples.holds(b, n, tolerance) for b in blocks))
    noise = max((b.against(n)[1] for n in holds for b in blocks), default=0.0)
    if noise > allowed:
        return holds, [], rejected, noise
    fixed, loose = list[Array](), list[Array]()
    for normal in holds:
        if _turned_to(normal, loose):
            continue
        turning = samples.free_turns(blocks, normal, tolerance)
        if turning:
            loose.append(np.array([normal, *turning]))
        else:
            fixed.append(normal)
    # Noise may hold one in its place where others, a little beside it, turn.
    fixed = [n for n in fixed if not _turned_to(n, loose)]
    return fixed, loose, rejected, noise


def _turned_to(normal: Array, loose: list[Array]) -> bool:
    """Whether a normal lies in a subspace that others turn in."""
    return any(np.linalg.norm(basis @ normal) > math.cos(samples.TURN_RAD) for basis in loose)


def _same(tolerance: float) -> float:
    """Angle within which two normals are one [rad].

    A hyperplane that turns by the tolerance about the centre moves the farthest image by the tolerance; each of the two
    may be off by as much.
    """
    return max(DIRECTION_ERROR_RAD, 2.0 * tolerance)


def _closed(
    holds: list[Array],
    rejected: list[Array],
    confirmed: Callable[[Array], Array | None],
    same: float,
    incomplete: list[str],
) -> Search:
    """Normals that hold with their images in one another, and the group, if these hold too."""
    normals, closed = closed_under_reflection(holds, confirmed, same)
    order = reflection_group_order(normals) if closed else None
    open_ = "the reflections listed take one another to others that do not hold, or that are too many"
    told = incomplete if order else [*incomplete, open_]
    return Search(holds=normals, rejected=rejected, incomplete=told, order=order)


def _hidden(noise: float, tolerance: float, give: str) -> str:
    hides = f"the noise of the samples, {noise:.1%} of the moments, hides asymmetries of {tolerance:.1%}"
    return f"{hides}; {give} more points"
