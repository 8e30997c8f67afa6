"""Pictures of the documentation: `python -m experiments.studies.docs_figures [--out docs/figures]`.

The stool of the first page; a camera laid on a part of it; what the n-tuples of three objects say, how a true mirror
plane and a wrong one miss a mug, and how the answer changes while one leg of a table moves out of its place. Takes a
minute; the same bytes each time.
"""

import argparse
import io
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from experiments.objects.household import chair
from experiments.objects.shapes import box, join, mug, sample, table
from experiments.studies.gallery import smaller
from experiments.studies.partial_alignment import Case, given
from symrefine.align.story import align
from symrefine.detection.result import Detection
from symrefine.detection.story import detect
from symrefine.files import whole
from symrefine.geometry import Array, Isometry, Plane
from symrefine.load import load
from symrefine.picture.draw import picture_png
from symrefine.picture.pair import make_pair
from symrefine.picture.pair_png import pair_png
from symrefine.picture.pair_words import headline
from symrefine.picture.words import symbol
from symrefine.shape import Shape
from symrefine.surface.misses import LIMITS, SHARES, TOLERANCE

INK, SOFT, RULE = "#1d2430", "#5a6474", "#d8dde6"
BLUE, ORANGE, GREY = "#0072b2", "#d55e00", "#a8b2c2"
PALE = ("#9cc9e3", "#f1c09a")
FONT = {"font.family": "DejaVu Sans", "font.size": 10, "text.color": INK, "axes.labelcolor": SOFT}
FIRST_PAGE = Path(__file__).resolve().parents[2] / "docs" / "index.md"
# Of the leg that moves, in diagonals of the table.
PLACES = np.linspace(0.0, 0.05, 21)
SEED, POINTS, NOISE_REL = 0, 20000, 0.003
# N-tuples shorter than this are not magnified.
SMALLEST = 0.05


def brick() -> Shape:
    """Three different edges: D2h, whose n-tuples all vanish."""
    return join([box((0, 0, 0), (1.0, 0.6, 0.3))])


def cloud(mesh: Shape) -> Shape:
    """Points of it as a good scanner gives them."""
    return Shape(points=sample(mesh, POINTS, NOISE_REL, np.random.default_rng(SEED)))


def tuples_figure(figure: Any) -> None:
    """The n-tuples of an object with one mirror plane, with an axis, and of one where they vanish."""
    figure.set_size_inches(10.5, 3.9)
    objects = {"chair": (chair, "in one plane"), "table": (table, "on one line"), "brick": (brick, "all vanish")}
    for column, (name, (build, where)) in enumerate(objects.items(), start=1):
        found = detect(cloud(build()), seed=SEED)
        axes = figure.add_subplot(1, 3, column, projection="3d", computed_zorder=False)
        _arrows(axes, found)
        longest = float(np.linalg.norm(found.vectors.vectors, axis=1).max())
        axes.set_title(f"{name}, {symbol(found.point_group)}: {where}", fontsize=11, color=INK, y=0.98)
        axes.text2D(0.5, 0.02, f"longest: {longest:.2g}", transform=axes.transAxes, color=SOFT, ha="center")
    figure.subplots_adjust(left=0.0, right=1.0, bottom=0.0, top=0.94, wspace=0.0)


def _arrows(axes: Any, found: Detection) -> None:
    """The n-tuples from the origin, with the plane or the line that holds them."""
    tips = found.vectors.vectors
    reach = max(float(np.linalg.norm(tips, axis=1).max()), SMALLEST)
    first, second, _ = reach * found.tuples.directions
    for direction in reach * np.eye(3):
        axes.plot(*np.outer(direction, [-1.0, 1.0]), color=RULE, linewidth=1.0)
    if found.tuples.kind == "plane":
        corners = np.array([first + second, first - second, -first - second, second - first])
        axes.plot_trisurf(*corners.T, triangles=[(0, 1, 2), (0, 2, 3)], color=BLUE, alpha=0.18, linewidth=0)
    if found.tuples.kind == "axis":
        axes.plot(*np.outer(first, [-1.1, 1.1]), color=BLUE, linewidth=5.0, alpha=0.25)
    for tip in tips:
        axes.plot(*np.outer(tip, [0.0, 1.0]), color=ORANGE, linewidth=1.6)
        axes.plot(*tip[:, None], "o", color=ORANGE, markersize=4)
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), zlim=(-reach, reach))
    axes.set_box_aspect((1, 1, 1), zoom=1.25)
    axes.view_init(elev=20, azim=-50)
    axes.set_axis_off()


def misses_figure(figure: Any) -> None:
    """By how much a true mirror plane of a mug and a wrong one through its axis miss its surface."""
    figure.set_size_inches(7.6, 4.2)
    axes = figure.add_subplot()
    found = detect(cloud(mug()), seed=SEED)
    # The mug stands on the origin, its handle along x.
    normals = [found.planes[0].plane.normal, np.array([1.0, 0.0, 0.0])]
    motions = [Isometry.reflection(Plane(normal=n, offset=float(-n @ found.origin) / found.scale)) for n in normals]
    for misses, name, colour in zip(
        found.surface.misses(motions), ("true plane", "wrong plane, across the handle"), (BLUE, ORANGE), strict=True
    ):
        label = f"{name}: {100 * misses.mean():.2f} % in the mean"
        axes.plot(100 * np.sort(misses), 100 * _beyond(len(misses)), color=colour, linewidth=2, label=label)
    noise = found.surface.noise
    axes.plot(
        100 * noise, 100 * _beyond(len(noise)), color=GREY, linewidth=2, label="two halves of the cloud", zorder=1
    )
    limits = 100 * TOLERANCE * np.array(LIMITS[1:])
    axes.plot(
        limits, 100 * np.array(SHARES), "v", color=INK, markersize=7, label="limits of the shares at 2 %", zorder=3
    )
    axes.set(xlim=(0, 9), ylim=(0.05, 100), yscale="log", xlabel="miss, % of the diagonal")
    axes.set_ylabel("share of the surface that misses by more, %")
    axes.set_yticks([0.1, 1, 10, 100], ["0.1", "1", "10", "100"])
    axes.legend(frameon=False, loc="upper right")
    _quiet(axes)
    figure.tight_layout()


def _beyond(count: int) -> Array:
    """Share of `count` sorted values that lie beyond each."""
    return 1.0 - (np.arange(count) + 0.5) / count


def answers_figure(figure: Any) -> None:
    """The probability of each group while one leg of a table moves along the diagonal of its top."""
    figure.set_size_inches(7.6, 4.0)
    axes = figure.add_subplot()
    told = [_probabilities(detect(displaced(place), seed=SEED)) for place in PLACES]
    names = sorted({n for row in told for n in row}, key=lambda n: -sum(row.get(n, 0.0) for row in told[:6]))
    shares = np.array([[100 * row.get(name, 0.0) for row in told] for name in names])
    axes.stackplot(100 * PLACES, shares, colors=PALE, edgecolor="white", linewidth=1.5)
    for name, place in zip(names, (0.06, 0.72), strict=True):
        axes.text(place, 0.5, symbol(name), transform=axes.transAxes, fontsize=18, weight="bold")
    axes.axvline(100 * TOLERANCE, color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
    axes.text(100 * TOLERANCE + 0.05, 93, "tolerance", fontsize=9)
    axes.set(xlim=(0, 100 * PLACES[-1]), ylim=(0, 100), ylabel="probability, %")
    axes.set_xlabel("how far one of four legs is out of its place, % of the diagonal")
    _quiet(axes)
    figure.tight_layout()


def displaced(place: float) -> Shape:
    """A square table, one of whose legs stands farther in along the diagonal, by a fraction of the object's."""
    aside = place * table().diagonal / np.sqrt(2.0)
    legs = [(x, y) for x in (-0.43, 0.43) for y in (-0.43, 0.43)]
    legs[3] = (0.43 - aside, 0.43 - aside)
    return join([box((0, 0, 0.7), (1, 1, 0.06)), *(box((x, y, 0.335), (0.08, 0.08, 0.67)) for x, y in legs)])


def _probabilities(found: Detection) -> dict[str, float]:
    answer = {} if found.undetermined else {found.point_group: found.confidence}
    return answer | {a.point_group: a.probability for a in found.alternatives}


def _quiet(axes: Any) -> None:
    axes.tick_params(colors=SOFT)
    axes.set_axisbelow(True)
    axes.grid(color=RULE, linewidth=0.6)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(RULE)


def start_picture() -> bytes:
    """What is found in the cloud that the first page makes, by the code that stands there."""
    code = re.search(r"^```python\n(.*?)^```$", FIRST_PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert code
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-c", code[1]], cwd=folder, check=True)
        shape = load(Path(folder) / "stool.csv")
    return smaller(io.BytesIO(picture_png(detect(shape), shape, width=760, height=560, title=False)))


def alignment_picture() -> bytes:
    """A camera laid on a mirrored scan of which a plane has cut off a part."""
    model, scan, _ = given(Case(name="camera", condition="overlap 65 %", det=-1, seed=2))
    source, target = Shape(model, source="model.ply"), Shape(scan, source="scan.ply")
    found = align(source, target)
    pair = make_pair(found, source, target, TOLERANCE)
    return smaller(io.BytesIO(pair_png(pair, headline(found, pair), width=900, height=600)))


def png(draw: Callable[[Any], None]) -> bytes:
    """A figure as PNG of 256 colours."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(FONT):
        figure = Figure(dpi=130)
        FigureCanvasAgg(figure)
        draw(figure)
        data = io.BytesIO()
        figure.savefig(data, format="png", facecolor="white", metadata={"Software": None})
    return smaller(data)


FIGURES: dict[str, Callable[[], bytes]] = {
    "start": start_picture,
    "tuples": lambda: png(tuples_figure),
    "misses": lambda: png(misses_figure),
    "answers": lambda: png(answers_figure),
    "alignment": alignment_picture,
}


def main(arguments: list[str] | None = None) -> None:
    """Draw all of them, or some."""
    parser = argparse.ArgumentParser(prog="python -m experiments.studies.docs_figures", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/figures"), help="folder (default: %(default)s)")
    parser.add_argument("--only", nargs="+", choices=FIGURES, default=tuple(FIGURES), help="some of them")
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    for name in options.only:
        with whole(options.out / f"{name}.png") as draft:
            draft.write_bytes(FIGURES[name]())
        print(options.out / f"{name}.png")


if __name__ == "__main__":
    main()
