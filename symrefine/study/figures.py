"""Pictures of a study's rows: lines, bars, and convergence iteration by iteration; equal rows give equal bytes."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from symrefine.study.experiment import Experiment, Row
from symrefine.study.plan import chosen
from symrefine.study.schema import Figure, Study
from symrefine.study.summary import Measure, short, summarise

if TYPE_CHECKING:
    from matplotlib.axes import Axes

KINDS = ("line", "bar", "convergence")
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#5b5b5b", "#a6761d")
_MARKERS = "os^Dv<>P"
_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e3e7ee",
    "axes.axisbelow": True,
    "svg.hashsalt": "symrefine",
}


def check_figures(study: Study, experiment: Experiment) -> list[Measure]:
    """The measures of all figures, without those of traces.

    Raises:
        InputError: kinds or fields that do not exist.
    """
    measures = []
    for figure in study.figures:
        if figure.kind not in KINDS:
            raise figure.node.at("kind").error(f"expected one of {', '.join(KINDS)}, got {figure.kind!r}")
        if figure.by:
            experiment.field(figure.by, figure.node.at("by"))
        if figure.kind != "convergence":
            measures += [figure.y, Measure(how="", column=figure.x, node=figure.node.at("x"))]
        elif experiment.trace is None:
            raise figure.node.at("kind").error(f"{experiment.name} has no `trace` for a convergence plot")
    return measures


def draw(figure: Figure, rows: Sequence[Row], experiment: Experiment, path: Path) -> None:
    """Write a figure as PNG; `rows` are those of the runs, or of their iterations for a convergence plot."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Canvas

    columns = ("run", figure.by, figure.x, figure.y.column)
    done = [row for row in chosen(rows, [figure.where], experiment, columns) if row["error"] is None]
    with mpl.rc_context(_STYLE):
        canvas = Canvas(figsize=(7.2, 4.2), dpi=120, layout="constrained")
        FigureCanvasAgg(canvas)
        axes = canvas.add_subplot()
        names = list(dict.fromkeys(row[figure.by] for row in done)) if figure.by else [None]
        groups = {name: [row for row in done if not figure.by or row[figure.by] == name] for name in names}
        {"line": _lines, "bar": _bars, "convergence": _runs}[figure.kind](axes, figure, groups)
        axes.set(title=figure.title, xlabel=figure.x_label or figure.x, ylabel=figure.y_label or figure.y.node.value)
        if figure.log:
            axes.set_yscale("log")
        if len(groups) > 1:
            canvas.legend(frameon=False, title=figure.by, loc="outside right upper")
        canvas.savefig(path, metadata={"Software": None})


def _lines(axes: "Axes", figure: Figure, groups: Mapping[Any, Sequence[Row]]) -> None:
    for i, (name, rows) in enumerate(groups.items()):
        points = _points(figure, rows)
        axes.plot(*zip(*points, strict=True), label=short(name), **_look(i)) if points else None


def _points(figure: Figure, rows: Sequence[Row]) -> list[tuple[Any, Any]]:
    """(x, y) for each value of x that has a y, in order."""
    steps: dict[Any, list[Row]] = {}
    for row in rows:
        if (x := row.get(figure.x)) is not None:
            steps.setdefault(x, []).append(row)
    order = steps if any(isinstance(x, str) for x in steps) else sorted(steps)
    found = [(x, summarise(steps[x], figure.y).values) for x in order]
    return [(x, values[0]) for x, values in found if values]


def _bars(axes: "Axes", figure: Figure, groups: Mapping[Any, Sequence[Row]]) -> None:
    names = list(dict.fromkeys(row.get(figure.x) for rows in groups.values() for row in rows))
    width = 0.8 / max(len(groups), 1)
    for i, (name, rows) in enumerate(groups.items()):
        points = _points(figure, rows)
        places = [names.index(x) + (i - (len(groups) - 1) / 2) * width for x, _ in points]
        axes.bar(places, [y for _, y in points], width, label=short(name), color=_COLOURS[i % len(_COLOURS)])
    axes.set_xticks(range(len(names)), [short(name) for name in names])


def _runs(axes: "Axes", figure: Figure, groups: Mapping[Any, Sequence[Row]]) -> None:
    """Every run thin, and the median over a group's runs thick; a run that has ended keeps its last value there."""
    from matplotlib.ticker import MaxNLocator

    for i, (name, rows) in enumerate(groups.items()):
        look = _look(i)
        runs: dict[Any, dict[Any, Any]] = {}
        for row in rows:
            if row.get(figure.x) is not None and row.get(figure.y.column) is not None:
                runs.setdefault(row["run"], {})[row[figure.x]] = row[figure.y.column]
        for run in runs.values():
            axes.plot(list(run), list(run.values()), color=look["color"], alpha=0.25, lw=0.9)
        steps = sorted({x for run in runs.values() for x in run})
        level = [median(run[max(k for k in run if k <= x)] for run in runs.values() if min(run) <= x) for x in steps]
        axes.plot(steps, level, label=short(name), **look)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def _look(i: int) -> dict[str, Any]:
    return {"color": _COLOURS[i % len(_COLOURS)], "marker": _MARKERS[i % len(_MARKERS)], "ms": 5, "lw": 1.8}
