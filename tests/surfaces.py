"""Surfaces that tests are made of."""

from collections.abc import Callable
from typing import Any

import numpy as np

from symrefine.geometry import Array
from symrefine.shape import Index
from symrefine.surface.skin import LocalPlanes, drawn, make_skin


def local_planes(
    points: Array,
    count: int,
    rng: np.random.Generator,
    *,
    labels: Index | None = None,
    weights: Array | None = None,
    **given: Any,
) -> LocalPlanes:
    """Local planes at `count` of the points [N, 3], each drawn as often as its weight [N] says; `given` the skin."""
    pick = drawn(len(points), count, rng, weights)
    return make_skin(points, rng, **given).local_planes(pick, labels)


def half_of(points: Array, count: int, rng: np.random.Generator, **given: Any) -> Callable[[Index], LocalPlanes]:
    """What half of the points [N, 3] show of the surface of all, at `count` of them; `given` the skin."""
    whole = make_skin(points, rng, **given)
    return lambda some: whole.half(some).local_planes(drawn(len(some), count, rng))
