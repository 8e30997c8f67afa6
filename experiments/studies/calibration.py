"""Confidence against what is right: by bins with intervals, in a few figures, as a plot."""

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.studies.answers import SURE
from symrefine.files import whole
from symrefine.geometry import Array

EDGES = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0)
BLUE, RULE, GRID = "#0072b2", "#6b7484", "#e3e7ee"


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """A statement: the look it comes from, how sure it was made, and whether it is right."""

    look: Hashable
    confidence: float
    right: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Bin:
    """Statements of similar confidence: from `low` to `high`, `sure` in the mean.

    Attributes:
        right: share that is right.
        looks: that they come from. Elements of one stand or fall together, so that these are what counts.
        right_each: share that is right, every look counting as one.
    """

    low: float
    high: float
    count: int
    sure: float
    right: float
    looks: int
    right_each: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """How well confidences agree with what is right; shares in [0, 1], NaN where nothing is.

    Attributes:
        count: statements.
        right: share of them that is right.
        brier: mean square of the difference.
        gap: mean over all statements of the difference between confidence and share right in their bin (expected
            calibration error).
        sure: statements at `SURE` and above.
        sure_right: share of them that is right.
        sure_right_each: the same, every look counting as one.
        right_sure: share of the right statements that are called sure.
    """

    count: int
    right: float
    brier: float
    gap: float
    sure: int
    sure_right: float
    sure_right_each: float
    right_sure: float


def bins(rows: Sequence[Judged], edges: Sequence[float] = EDGES) -> list[Bin]:
    """Rows by confidence: a bin holds its lower edge, the last one both; empty ones are left out."""
    sure, _ = _columns(rows)
    place = np.clip(np.searchsorted(edges, sure, side="right") - 1, 0, len(edges) - 2)
    return [_bin([rows[j] for j in np.flatnonzero(place == i)], edges[i], edges[i + 1]) for i in np.unique(place)]


def _bin(rows: Sequence[Judged], low: float, high: float) -> Bin:
    sure, right = _columns(rows)
    each = _by_look(rows)
    return Bin(
        low=low,
        high=high,
        count=len(rows),
        sure=_mean(sure),
        right=_mean(right),
        looks=len(each),
        right_each=_mean(each),
    )


def summary(rows: Sequence[Judged]) -> Summary:
    """All rows in a few figures."""
    sure, right = _columns(rows)
    called = sure >= SURE
    return Summary(
        count=len(rows),
        right=_mean(right),
        brier=_mean((sure - right) ** 2),
        gap=sum(b.count * abs(b.sure - b.right) for b in bins(rows)) / max(1, len(rows)),
        sure=int(called.sum()),
        sure_right=_mean(right[called]),
        sure_right_each=_mean(_by_look([r for r in rows if r.confidence >= SURE])),
        right_sure=_mean(called[right > 0]),
    )


def _by_look(rows: Sequence[Judged]) -> Array:
    """Share right [K] of each look that the rows come from."""
    looks: dict[Hashable, list[bool]] = {}
    for r in rows:
        looks.setdefault(r.look, []).append(r.right)
    return np.array([np.mean(found) for found in looks.values()])


def _columns(rows: Sequence[Judged]) -> tuple[Array, Array]:
    """Confidences [N] and, as 0 and 1, whether each is right [N]."""
    return np.array([r.confidence for r in rows]), np.array([r.right for r in rows], dtype=float)


def _mean(values: Array) -> float:
    return float(values.mean()) if values.size else math.nan


def plausible(right: float, count: int) -> tuple[float, float]:
    """Interval of the true share, 95 %, given the share right of `count` (Wilson 1927)."""
    z2 = 1.96**2
    middle = (right + z2 / (2 * count)) / (1 + z2 / count)
    half = math.sqrt(z2 * (right * (1 - right) / count + z2 / (4 * count**2))) / (1 + z2 / count)
    return middle - half, middle + half


def plot(rows: Sequence[Judged], path: Path) -> None:
    """The reliability plot: bin by bin the share that is right, with its interval, and the looks it comes from."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    found = bins(rows)
    figure = Figure(figsize=(6.8, 4.8), dpi=130, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    place = np.arange(len(found))
    right = np.array([b.right_each for b in found])
    ends = np.array([plausible(b.right_each, b.looks) for b in found]).reshape(-1, 2).T
    axes.hlines([b.sure for b in found], place - 0.35, place + 0.35, color=RULE, lw=2, label="mean confidence")
    errors = np.maximum(np.abs(ends - right), 0.0)
    axes.errorbar(place, right, errors, fmt="o", color=BLUE, capsize=4, label="share right, 95 % interval")
    for x, b in zip(place, found, strict=True):
        axes.annotate(str(b.looks), (x, 1.04), ha="center", fontsize=9, color=BLUE)
    axes.set(
        title="Confidence against truth, and how many looks",
        xlabel="confidence",
        ylabel="share that is right",
        xticks=place,
        xticklabels=[f"{b.low:g} to {b.high:g}" for b in found],
        yticks=np.linspace(0, 1, 11),
        ylim=(-0.03, 1.1),
    )
    axes.legend(loc="lower right", frameon=False, fontsize=9)
    axes.grid(axis="y", color=GRID, lw=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    with whole(path) as draft:
        figure.savefig(draft, format="png", metadata={"Software": None})
