"""Alignment beside its peers in one run, and what n-tuples cost beside the moments: `python -m benchmarks.alignment`.

Chiral objects of `../shared/objects` (not part of the product; whatever is not there is left out), 10,000 independent
points of source and target, rotations and reflections. Processor time over all threads, which other load changes
little; the least of three runs of each method, of Open3D too. The figures of accuracy: `experiments.studies.alignment`.
"""

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks.metric import Metric
from experiments.studies import partial_alignment as partial
from experiments.studies.alignment import CHIRAL, RANDOM, Case, error_deg, estimator, given, mesh, present, sample
from symrefine.align.story import Alignment
from symrefine.moments.moments import central_moments
from symrefine.ntuples.contract import ntuples

REPEATS = 3
# Conditions of which the figures are compared with stored ones; objects that the others are asked of.
COMPARED = ("overlap 65 %", "clutter 50 %")
OTHERS = ("asymmetric", "grinder", "fan3")
PICTURE = Path("out/bench/partial_alignment.png")
METHODS = ("align", "moments", "tuples", "open3d")
# Every vector of moments to order 8 that has an n-tuple: single odd orders, and an even one with an odd one.
ALL_ORDERS = [(p,) for p in (3, 5, 7)] + list(product((2, 4, 6, 8), (3, 5, 7)))


def best_of(work: Callable[[], object], repeats: int = REPEATS) -> float:
    """Least processor time of several runs."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def rows(names: Sequence[str], seeds: int) -> Iterator[tuple[str, str, str, float, bool, float]]:
    """Name, motion, method, error in degrees, whether the determinant is right, seconds."""
    for name, motion, seed, method in product(names, RANDOM, range(seeds), METHODS):
        case = Case(name=name, motion=motion, method=method, seed=seed)
        pair = given(case)
        estimate = estimator(case, pair)

        def work(estimate: Callable[[], object] = estimate) -> object:
            """What a user asks for: whether the map is to be relied upon, too."""
            found = estimate()
            if not isinstance(found, Alignment):
                return found
            assert found.status
            assert found.confidence >= 0.0
            return found.matrix

        matrix = work()
        error, det = error_deg(name, matrix, pair.truth), np.linalg.det(matrix) * np.linalg.det(pair.truth) > 0
        yield name, motion, method, error, bool(det), best_of(work)


def beside_open3d(seeds: int) -> Iterator[Metric]:
    """Accuracy and time, pair by pair."""
    table = list(rows(present(CHIRAL), seeds))
    print("independent samples of 10,000 points: degrees (median, worst), determinants right, processor ms (median)")
    for motion, method in product(RANDOM, METHODS):
        error, det, seconds = _columns(table, motion, method)
        theirs = _columns(table, motion, "open3d")[2]
        print(
            f"    {motion:10s} {method:7s} {np.median(error):7.3f} {error.max():7.3f}  {int(det.sum()):3d}/{len(det)}  "
            f"{1e3 * np.median(seconds):7.1f} ms  {np.median(theirs / seconds):6.1f} times as fast as Open3D"
        )
    error, _, seconds = _columns(table, None, "align")
    theirs = _columns(table, None, "open3d")[2]
    print(f"    all pairs: align {np.median(theirs / seconds):.1f} times as fast as Open3D in the median")
    yield Metric(key="align independent samples, worst", value=float(error.max()), unit="degrees", target=0.5)
    # A fortieth of a RANSAC's time, and milliseconds that a loop of a robot has to spare.
    ratio = float(np.median(seconds / theirs))
    yield Metric(key="align over Open3D, processor time", value=ratio, unit="ratio", target=0.025)
    yield Metric(key="align whole, processor time", value=1e3 * float(np.median(seconds)), unit="ms", target=15.0)


def _columns(
    table: Sequence[tuple[str, str, str, float, bool, float]], motion: str | None, method: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    chosen = [row for row in table if motion in (None, row[1]) and row[2] == method]
    return tuple(np.array(column) for column in list(zip(*chosen, strict=True))[3:])


def evaluation() -> Iterator[Metric]:
    """All n-tuples that moments to order 8 offer, beside the moments of 20,000 points, with noise and covariance."""
    cloud = sample(mesh("asymmetric"), 20000, np.random.default_rng(0))
    ones = np.ones(len(cloud))
    print(f"\n20,000 points, moments to order 8, {len(ALL_ORDERS)} vectors of moments")
    for parts in (0, 16):
        moments = central_moments(cloud, ones, 8, parts=parts)
        count = len(ntuples(moments, ALL_ORDERS).labels)
        first = best_of(lambda p=parts: central_moments(cloud, ones, 8, parts=p), 20)
        second = best_of(lambda m=moments: ntuples(m, ALL_ORDERS), 20)
        third = best_of(lambda m=moments: ntuples(m, ALL_ORDERS).covariance, 20)
        print(
            f"    {parts:2d} replicates: moments {1e3 * first:.2f} ms, {count} n-tuples {1e3 * second:.3f} ms "
            f"({first / second:.0f} times cheaper), with covariance {1e3 * third:.3f} ms"
        )
        if not parts:
            yield Metric(key="n-tuples over their moments", value=second / first, unit="ratio", target=0.1)


def in_part(seeds: int, *, full: bool) -> Iterator[Metric]:
    """Objects that share a part with one another, strays and clutter, beside the peers that are installed.

    The figures that are compared are of those that share 65 %, and of half a scene; with `full` the study as a whole.
    """
    names = partial.objects() if full else OTHERS
    conditions = [c for c in (partial.CONDITIONS if full else partial.QUICK) if c not in COMPARED]
    asked = [(COMPARED, partial.OWN), (conditions, names)]
    methods = partial.METHODS
    parts = [[partial.run(case) for case in partial.cases(methods, some, of, range(seeds))] for some, of in asked]
    rows = [row for part in parts for row in part]
    print("\n" + "\n".join([*partial.table(rows, methods), "", *partial.curves(rows, methods)]))
    PICTURE.parent.mkdir(parents=True, exist_ok=True)
    partial.picture(rows, methods, PICTURE)
    print(f"    drawn in {PICTURE}")
    own = [r for r in parts[0] if r.case.method == partial.OURS]
    wrong, spent = np.mean([not r.right for r in own]), 1e3 * np.mean([r.seconds for r in own])
    yield Metric(key="align in part, wrong of all", value=float(wrong), unit="share", target=0.02)
    yield Metric(key="align in part, processor time", value=float(spent), unit="ms", target=150.0)


def metrics(seeds: int = 1, *, full: bool = False) -> Iterator[Metric]:
    """The figures that are compared with stored ones."""
    yield from evaluation()
    yield from in_part(seeds, full=full)
    if present(CHIRAL):
        yield from beside_open3d(seeds)


def main() -> None:
    """Print every figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=2, help="pairs of each object and determinant")
    parser.add_argument("--full", action="store_true", help="all objects and conditions of the study of parts")
    options = parser.parse_args()
    list(metrics(options.seeds, full=options.full))


if __name__ == "__main__":
    main()
