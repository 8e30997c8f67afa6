"""What a refinement did, as series over its iterations; iterate 0 is the start and has none of them."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from symrefine.fit.refine import Iterate


def series(history: Sequence[Iterate], name: str) -> list[float]:
    """A field of each iterate: mean weighted squared residual (`cost`), pairs in agreement (`inliers`), `step`."""
    return [float(getattr(i, name)) for i in history[1:]]


def rms_series(history: Sequence[Iterate], unit: float = 1.0) -> list[float]:
    """Root of the cost, in RMS radii times `unit`; exact data leave a cost of rounding errors, of either sign."""
    return [unit * float(np.sqrt(max(cost, 0.0))) for cost in series(history, "cost")]


def turn_series_deg(history: Sequence[Iterate]) -> list[float]:
    """Angle by which each iteration turned the shared frame, degrees."""
    turns = []
    for before, after in pairwise(history):
        turn = after.state.frame @ before.state.frame.T
        sine = 0.5 * np.linalg.norm([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        turns.append(float(np.degrees(np.arctan2(sine, 0.5 * (np.trace(turn) - 1.0)))))
    return turns


def theta_series_deg(history: Sequence[Iterate]) -> list[list[float]]:
    """For each plane of a bundle the angle it alone would have turned about the shared axis, degrees."""
    rows = [np.degrees(i.theta_rad) for i in history[1:] if i.theta_rad.size]
    return [list(map(float, column)) for column in np.array(rows).T] if rows else []
