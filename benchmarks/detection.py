"""Warm `detect` on 20,000 points against one kd-tree pass (build and one nearest-neighbour query of all points)."""

import time
from collections.abc import Callable, Iterator

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.metric import Metric
from experiments.objects.built_symmetry import names, specimen
from experiments.objects.damage import hole
from experiments.objects.poses import Pose
from experiments.objects.shapes import SHAPES, box, join, sample
from symrefine.detection.story import detect
from symrefine.geometry import Array
from symrefine.moments.moments import central_moments
from symrefine.propose.spectrum import Spectrum, mirror_candidates, whitened

POINTS = 20000
# What the project set itself, in passes: of a whole object without noise, with it, and where much of one is missing.
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
    """Clouds in a random pose, and the passes that they may cost.

    They have a b-plane, a plane, a revolution or none, and there is a cube, on which every n-tuple vanishes. Surfaces
    that are open follow, or that noise makes look so.
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
# Of all objects, shapes and household first, each so many-th.
EVERY = 8
CASES = (
    ("table", 0.0),
    ("table", 0.01),
    ("mug", 0.0),
    ("mug", 0.01),
    ("stool8", 0.005),
    ("bottle", 0.0),
    ("asymmetric", 0.0),
)


def every_so_many(noise: float) -> Iterator[Array]:
    """Clouds of every eighth object of all families that are here, each in a pose of its own."""
    rng = np.random.default_rng(8)
    every = [(family, name) for family in ("shape", "household", "catalogue") for name in names(family)]
    for family, name in every[::EVERY]:
        yield Pose.random(rng).of(sample(specimen(family, name)[0], POINTS, noise, rng))


def kd_pass(cloud: Array) -> None:
    """The primitive that speed is measured by."""
    cKDTree(cloud).query(cloud)


def passes_of(cloud: Array, repeats: int = REPEATS) -> float:
    """What a detection costs, in passes over the same points."""
    return best_of(lambda: detect(cloud), repeats) / best_of(lambda: kd_pass(cloud), repeats)


def metrics() -> Iterator[Metric]:
    """One figure for each cloud, those of many objects, and the spectrum after the moments."""
    for name, cloud, target in clouds():
        yield Metric(key=f"detect {name}", value=passes_of(cloud), unit="kd-tree passes", target=target)
    for noise, target in ((0.0, CLEAN), (0.005, NOISY)):
        found = [passes_of(cloud, repeats=2) for cloud in every_so_many(noise)]
        for name, value in (("median", np.median(found)), ("worst", max(found))):
            key = f"detect {100 * noise:g} % noise, {name} of {len(found)} objects"
            yield Metric(key=key, value=float(value), unit="kd-tree passes", target=target)
    moments = central_moments(cloud, np.ones(len(cloud)), 8)
    took = 1e3 * best_of(lambda: mirror_candidates(*map(Spectrum.of_moments, (whitened(moments), moments))))
    yield Metric(key="mirror candidates after the moments", value=took, unit="ms", target=10.0)
