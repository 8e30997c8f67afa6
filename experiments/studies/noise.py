"""What halves of a cloud promise of noise, beside what two samples miss one another by.

    python -m experiments.studies.noise [--counts N ...] [--seed N]

Of shapes clean and with 1 % noise, and of bent rods. Told is the smallest tolerance at which either would count as
symmetric: true over promised above 1 is noise taken for a miss, below 1 is a miss taken for noise.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from experiments.objects.curves import Curve
from experiments.objects.rods import BENT, along
from experiments.objects.shapes import SHAPES, sample
from symrefine.detection.measure import PLANES
from symrefine.geometry import Array, tight_diagonal
from symrefine.shape import Index, Shape
from symrefine.surface.misses import disc_distances, halves, needs, noise_distances
from symrefine.surface.skin import LocalPlanes, Skin, drawn, make_skin

COUNTS = (800, 2000, 6000, 20000)
NOISES = (0.0, 0.01)
Sampled = Callable[[int, np.random.Generator], Array]


@dataclass(frozen=True, slots=True, kw_only=True)
class Promise:
    """What noise needs, as a fraction of the diagonal, by two samples and as promised; how its planes were fitted."""

    true: float
    promised: float
    flatness: float
    neighbours: int


def shapes() -> Iterator[tuple[str, Sampled]]:
    """Names, and what draws so many points."""
    for name, (build, *_) in SHAPES.items():
        shape = build()
        for noise in NOISES:
            yield f"{name} {100 * noise:g} %", partial(_of_shape, shape, noise)
    for name, (curve, *_) in BENT.items():
        yield f"rod {name}", partial(_of_rod, curve)


def promise(points: Array, another: Array, rng: np.random.Generator) -> Promise:
    """That of two samples [N, 3] of one surface, as they stand."""
    middle, size = points.mean(axis=0), points.std()
    points, another = ((p - middle) / size for p in (points, another))
    whole = make_skin(points, rng)
    other = replace(make_skin(another, rng), neighbours=whole.neighbours)

    def planes(skin: Skin, most: int) -> LocalPlanes:
        return skin.local_planes(drawn(len(skin.points), most, rng))

    def half(some: Index) -> LocalPlanes:
        return planes(whole.half(some), PLANES // 2)

    one, two = planes(whole, PLANES), planes(other, PLANES)
    diagonal = tight_diagonal(one.points)
    between = np.concatenate([disc_distances(a, b.points) for a, b in ((one, two), (two, one))])
    true, promised = (
        float(needs(d / diagonal, np.empty(0))) for d in (between, noise_distances(len(points), half, rng))
    )
    return Promise(true=true, promised=promised, flatness=float(np.median(one.flatness)), neighbours=whole.neighbours)


def _of_shape(shape: Shape, noise: float, count: int, rng: np.random.Generator) -> Array:
    return sample(shape, count, noise, rng)


def _of_rod(curve: Curve, count: int, rng: np.random.Generator) -> Array:
    return along(curve, "C1", np.eye(3), count, rng).shape.points


def main(arguments: list[str] | None = None) -> None:
    """Print a line for each shape and number of points, and the range."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.studies.noise",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--counts", type=int, nargs="+", default=COUNTS, help="points (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the samples (default: %(default)s)")
    options = parser.parse_args(arguments)
    ratios = []
    print("shape               points  neighbours  flatness  true %  promised %  true / promised")
    for name, draw in shapes():
        for count in options.counts:
            rng = np.random.default_rng(options.seed)
            both = draw(2 * count, rng)
            one, two = (both[half] for half in halves(2 * count, rng))
            found = promise(one, two, rng)
            ratios.append(found.true / found.promised)
            print(
                f"{name:18s}  {count:6d}  {found.neighbours:10d}  {found.flatness:8.2f}  {100 * found.true:6.2f}  "
                f"{100 * found.promised:10.2f}  {ratios[-1]:15.2f}",
                flush=True,
            )
    least, median, most = np.quantile(ratios, [0.0, 0.5, 1.0])
    print(f"\n{len(ratios)} clouds: {least:.2f} to {most:.2f} times what is promised, median {median:.2f}")


if __name__ == "__main__":
    main()
