"""What `detect` costs on damaged clouds, over as many points of the same objects without damage, in another pose.

    python -m benchmarks.damage [--every N] [--seed N]

Each is timed between two of the other kind; the median over the objects, and the worst one.
"""

import argparse
import statistics
import time
from collections.abc import Iterator

import numpy as np

from benchmarks.metric import Metric, report
from experiments.studies.damaged import Case, cases, damaged
from symrefine.detection.story import detect
from symrefine.shape import Shape

# Damage, as in `experiments.objects.damage`, and what it may cost; nothing was asked of what is missing.
TARGETS = {
    ("outliers", 0.02): 2.0,
    ("outliers", 0.2): 2.0,
    ("uneven", 10.0): 2.0,
    ("views", 1.0): 4.0,
    ("views", 2.0): 4.0,
    ("rough views", 1.0): 4.0,
    ("hole", 0.15): np.inf,
    ("cut", 0.2): np.inf,
    ("clump", 0.05): np.inf,
}


def _seconds(shape: Shape) -> float:
    start = time.process_time()
    detect(shape)
    return time.process_time() - start


def _over_clean(case: Case, whole: Case) -> float:
    made, points = damaged(case)[0], damaged(whole)[0].points
    some = np.random.default_rng(case.seed).permutation(len(points))[: len(made.points)]
    clean = Shape(points=points[some])
    before, cost, after = map(_seconds, (clean, Shape(points=made.points, viewpoint=made.viewpoint), clean))
    return 2.0 * cost / (before + after)


def metrics(*, every: int = 6, seed: int = 5150) -> Iterator[Metric]:
    """The median over the objects for each damage, and the worst."""
    whole = {c.name: c for c in list(cases(["clean"], [], seed))[::every]}
    for (kind, strength), target in TARGETS.items():
        some = [c for c in cases([kind], list(whole), seed) if c.strength == strength]
        ratios = [_over_clean(c, whole[c.name]) for c in some]
        key = f"detect with {kind} {strength:g}"
        yield Metric(key=key, value=statistics.median(ratios), unit="times as many clean points", target=target)
        yield Metric(key=f"{key}, worst", value=max(ratios), unit="times as many clean points", target=np.inf)


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--every", type=int, default=6, help="each so many-th object (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=5150, help="of damage and poses (default: %(default)s)")
    options = parser.parse_args()
    report(metrics(every=options.every, seed=options.seed))


if __name__ == "__main__":
    main()
