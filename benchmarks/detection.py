"""Warm `detect` on 20,000 points against one kd-tree pass (build and one nearest-neighbour query of all points)."""

import time
from collections.abc import Callable, Iterator

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.metric import Metric
from experiments.objects.built_symmetry import specimen
from experiments.objects.damage import hole
from experiments.objects.poses import Pose
from experiments.objects.shapes import SHAPES, box, join, sample
from symrefine.detection.story import detect
from symrefine.geometry import Array
from symrefine.moments.moments import central_moments
from symrefine.propose.spectrum import mirror_candidates

POINTS = 20000
# Passes at most that are asked for: of a whole object without noise, with it, and where much of the object is missing.
CLEAN, NOISY, MISSING = 5.0, 7.0, 10.0
REPEATS = 7


def best_of(work: Callable[[], object], repeats: int = REPEATS) -> float:
    """Least processor time of several runs, after one that warms up: threads count in full, other load does not."""
    work()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def clouds() -> Iterator[tuple[str, Array, float]]:
    """Clouds in a random pose, and the passes that are asked for: b-plane, plane, revolution, none, and a cube, on which every n-tuple vanishes.

    And surfaces that are open, or that noise makes look so.
    """
    rng = np.random.default_rng(7)
    cases = [(name, SHAPES[name][0](), noise) for name, noise in CASES]
    cases.append(("cube", join([box((0, 0, 0), (1, 1, 1))]), 0.0))
    for name, shape, noise in cases:
        pose = Pose.random(rng)
        points = pose.of(sample(shape, POINTS, noise, rng))
        yield f"{name} {100 * noise:g} % noise", points, NOISY if noise else CLEAN

    for name in HOLED:
        made = hole(specimen("shape", name)[0], HOLE, rng)
        yield f"{name} {100 * HOLE:g} % missing", Pose.random(rng).of(made.points), MISSING


# With a hole of such a share of the surface, and the noise that damaged clouds have.
HOLED, HOLE = ("wheel5", "bottle", "skew_box"), 0.15
CASES = (
    ("table", 0.0),
    ("table", 0.01),
    ("mug", 0.0),
    ("mug", 0.01),
    ("stool8", 0.005),
    ("bottle", 0.0),
    ("asymmetric", 0.0),
)


def kd_pass(cloud: Array) -> None:
    """The primitive that speed is measured by."""
    cKDTree(cloud).query(cloud)


def metrics() -> Iterator[Metric]:
    """One figure for each cloud, and the spectrum after the moments."""
    for name, cloud, target in clouds():
        passes = best_of(lambda c=cloud: detect(c)) / best_of(lambda c=cloud: kd_pass(c))
        yield Metric(key=f"detect {name}", value=passes, unit="kd-tree passes", target=target)
    moments = central_moments(cloud, np.ones(len(cloud)), 8)
    spectrum = 1e3 * best_of(lambda: mirror_candidates(moments))
    yield Metric(key="mirror candidates after the moments", value=spectrum, unit="ms", target=10.0)
