"""Figures of the experiments in the plane: objects with what was found in them, and their doublets."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from symrefine.geometry import Array, Plane
from symrefine.plane import PlanarDetection, VectorDoublets

if TYPE_CHECKING:
    from experiments.objects.drawings import Drawing

INK, SOFT, PALE, RULE = "#1d2430", "#3a4352", "#6b7484", "#e3e7ee"
LINE, CENTRE, OBJECT = "#d55e00", "#0072b2", "#2f4858"
FONT = {"font.family": "DejaVu Sans", "font.size": 10, "text.color": INK, "axes.labelcolor": SOFT}
# Vectors of moments shown by themselves for the object without symmetry, as in the paper.
ALONE = ((2, 3), (4, 5), (6, 3))


class Shown(Protocol):
    """What a figure needs of a trial."""

    @property
    def drawing(self) -> "Drawing": ...
    @property
    def picture(self) -> Array: ...
    @property
    def detection(self) -> PlanarDetection: ...


def case_study_figure(trials: Sequence[Shown], path: Path) -> None:
    """The paper's case study: three objects over their doublets, then the object without symmetry beside its own."""
    with _style():
        import matplotlib.pyplot as plt

        figure = plt.figure(figsize=(12.4, 11.3))
        upper = figure.add_gridspec(2, 4, left=0.03, right=0.97, top=0.89, bottom=0.385, hspace=0.06, wspace=0.09)
        lower = figure.add_gridspec(1, 4, left=0.03, right=0.97, top=0.29, bottom=0.03, wspace=0.09)
        _heading(figure, 0.962, "Doublets point where the symmetry is", 17)
        about = "All 56 doublets of the paper's ten vectors of moments, as arrows from the origin"
        figure.text(0.03, 0.936, f"{about}; dark: low orders, light: high orders.", color=SOFT)
        _heading(figure, 0.352, "The object without symmetry, one vector of moments at a time", 13)
        figure.text(0.03, 0.331, "The smaller the ratio, the farther the doublets are from one line.", color=SOFT)
        _upper(figure, upper, trials)
        _lower(figure, lower, trials[3])
        figure.savefig(path, dpi=160, facecolor="white")
        plt.close(figure)


def _heading(figure: Any, y: float, text: str, size: float) -> None:
    figure.text(0.03, y, text, fontsize=size, weight="bold")


def _upper(figure: Any, grid: Any, trials: Sequence[Shown]) -> None:
    reach = max(float(np.abs(v.doublets).max()) for t in trials for v in t.detection.doublets.vectors)
    for column, trial in enumerate(trials):
        _object(figure.add_subplot(grid[0, column]), trial, caption(trial.detection), crop=0.1)
        _doublets(figure.add_subplot(grid[1, column]), trial.detection.doublets.vectors, reach)


def _lower(figure: Any, grid: Any, trial: Shown) -> None:
    _object(figure.add_subplot(grid[0, 0]), trial, "", crop=0.1)
    own = {v.orders: v for v in trial.detection.doublets.vectors}
    for column, orders in enumerate(ALONE, start=1):
        vector = own[orders]
        axes = figure.add_subplot(grid[0, column])
        _doublets(axes, [vector], 1.15 * float(np.abs(vector.doublets).max()), width=2.2)
        name = f"$\\mathbf{{v}}^{{(1,1)}}_{{({orders[0]},{orders[1]})}}$"
        axes.text(
            0.97, 0.06, f"{name}   $\\sigma_1/\\sigma_2$ = {vector.ratio:.2f}", transform=axes.transAxes, ha="right"
        )


def caption(detection: PlanarDetection) -> str:
    """Group, lines and turns in a few words."""
    name = detection.point_group
    if name == "C1":
        return "C1: no symmetry"
    if name == "O(2)":
        return "O(2): round"
    lines = len(detection.lines)
    parts = [f"{lines} line{'s' if lines > 1 else ''}" if lines else "no line"]
    if detection.rotation is not None:
        parts.append(f"turns by 1/{int(detection.rotation.order)}")
    return f"{name}: {', '.join(parts)}"


def gallery_figure(trials: Sequence[Shown], path: Path, columns: int = 5) -> None:
    """Every object as photographed, with the lines and the centre that were found."""
    with _style():
        import matplotlib.pyplot as plt

        rows = -(-len(trials) // columns)
        figure, axes = plt.subplots(rows, columns, figsize=(2.45 * columns, 2.95 * rows + 0.6))
        figure.subplots_adjust(left=0.015, right=0.985, top=0.91, bottom=0.01, hspace=0.22, wspace=0.06)
        figure.text(0.015, 0.972, "Mirror lines and turns found in photographs", fontsize=17, weight="bold")
        figure.text(
            0.015, 0.952, "Random poses, uneven light, grain; made grey, then binary by Otsu's threshold.", color=SOFT
        )
        for axis, trial in zip(axes.flat, trials, strict=False):
            _object(axis, trial, f"{trial.drawing.name}\n{caption(trial.detection)}")
        for axis in list(axes.flat)[len(trials) :]:
            axis.axis("off")
        figure.savefig(path, dpi=160, facecolor="white")
        plt.close(figure)


def _style() -> Any:
    import matplotlib as mpl

    mpl.use("Agg")
    return mpl.rc_context(FONT)


def _object(axes: Any, trial: Shown, title: str, crop: float = 0.0) -> None:
    """A picture in its own pixels, y up, with lines, centre and turns over it."""
    height, width = trial.picture.shape[:2]
    grey = trial.picture.ndim == 2
    picture = np.where(trial.picture[:, :, None] < 128, _rgb(OBJECT), _rgb("#f4f6f9")) if grey else trial.picture
    axes.imshow(picture, extent=(0, width, 0, height), interpolation="lanczos")
    found = trial.detection
    for line in found.lines:
        ends = _ends(line.line, found.center, 0.56 * found.diagonal)
        axes.plot(*ends.T, color="white", linewidth=3.4, alpha=0.75, solid_capstyle="round")
        axes.plot(*ends.T, color=LINE, linewidth=1.7, solid_capstyle="round")
    if found.rotation is not None:
        _turns(axes, found)
    axes.set(xlim=(crop * width, (1 - crop) * width), ylim=(crop * height, (1 - crop) * height), xticks=[], yticks=[])
    for spine in axes.spines.values():
        spine.set_color(RULE)
    axes.set_title(title, fontsize=10.5, color=INK, pad=6, linespacing=1.3)


def _turns(axes: Any, found: PlanarDetection) -> None:
    """The centre, and for turns without mirror lines spokes at their angle."""
    order = found.rotation.order if found.rotation is not None else 1.0
    if not found.lines and np.isfinite(order):
        for k in range(int(order)):
            angle = 2 * np.pi * k / order
            tip = found.center + 0.12 * found.diagonal * np.array([np.cos(angle), np.sin(angle)])
            axes.plot(*np.stack([found.center, tip]).T, color="white", linewidth=3.0, solid_capstyle="round")
            axes.plot(*np.stack([found.center, tip]).T, color=CENTRE, linewidth=1.5, solid_capstyle="round")
    axes.plot(*found.center, "o", color=CENTRE, markersize=8, markeredgecolor="white", markeredgewidth=1.6)


def _ends(line: Plane, center: Array, half: float) -> Array:
    along = np.array([-line.normal[1], line.normal[0]])
    foot = center - line.signed_distance(center) * line.normal
    return np.stack([foot - half * along, foot + half * along])


def _doublets(axes: Any, vectors: Sequence[VectorDoublets], reach: float, width: float = 1.3) -> None:
    """Doublets as arrows from the origin; where they vanish, a point."""
    import matplotlib as mpl

    shades = mpl.colormaps["viridis"](np.linspace(0.08, 0.86, max(2, len(vectors))))
    for axis in (axes.axhline, axes.axvline):
        axis(0.0, color=RULE, linewidth=1.0, zorder=0)
    for tip, shade in reversed(list(_tips(vectors, shades))):
        axes.plot([0, tip[0]], [0, tip[1]], color=shade, linewidth=width, alpha=0.75, solid_capstyle="round")
        axes.plot(*tip, "o", color=shade, markersize=4.5, markeredgecolor="white", markeredgewidth=0.6)
    axes.set(xlim=(-1.1 * reach, 1.1 * reach), ylim=(-1.1 * reach, 1.1 * reach), xticks=[], yticks=[], aspect="equal")
    for spine in axes.spines.values():
        spine.set_color(RULE)


def _tips(vectors: Sequence[VectorDoublets], shades: Array) -> Iterator[tuple[Array, Array]]:
    order = np.argsort([sum(v.orders) for v in vectors], kind="stable")
    for shade, k in zip(shades, order, strict=False):
        for tip in vectors[k].doublets:
            yield tip, shade


def _rgb(colour: str) -> Array:
    return np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)], dtype=np.uint8)
