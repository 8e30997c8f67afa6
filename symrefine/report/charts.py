"""Charts as inline SVG and HTML: small, sharp, and readable without a script, on white and on black."""

import math
from collections.abc import Sequence
from html import escape

import numpy as np

from symrefine.report.markup import schoenflies

WIDTH, HEIGHT = 400, 210
LEFT, RIGHT, TOP, BOTTOM = 62, 22, 16, 40


def line_chart(title: str, values: Sequence[float], *, first: int, unit: str, name: str, log: bool = False) -> str:
    """A quantity over the iterations `first`, `first + 1`, ...; every point carries its value.

    Args:
        title: what the chart tells someone who cannot see it.
        name: of its colour in the style sheet.
        log: whether the scale is logarithmic; values that are not above zero are then left out.
    """
    kept = [(first + k, v) for k, v in enumerate(values) if math.isfinite(v) and (v > 0 or not log)]
    if not kept:
        return '<p class="quiet">nothing to show</p>'
    ticks = _log_ticks([v for _, v in kept]) if log else _ticks(max(v for _, v in kept))
    low, high = (math.log10(ticks[0]), math.log10(ticks[-1])) if log else (ticks[0], ticks[-1])

    def place(iteration: int, value: float) -> tuple[float, float]:
        last = first + len(values) - 1
        share = (iteration - first) / (last - first) if last > first else 0.5
        level = ((math.log10(value) if log else value) - low) / (high - low)
        return LEFT + 14 + share * (WIDTH - LEFT - RIGHT - 28), HEIGHT - BOTTOM - level * (HEIGHT - TOP - BOTTOM)

    points = [place(k, v) for k, v in kept]
    parts = [_gridline(place(first, t)[1], _short(t)) for t in ticks]
    named = range(first, first + len(values), math.ceil(len(values) / 10))
    parts += [_text(place(k, kept[0][1])[0], HEIGHT - BOTTOM + 18, str(k), "middle") for k in named]
    parts.append(_text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 6, "iteration", "middle"))
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    parts.append(f'<polyline class="{name}" points="{path}" fill="none" stroke-width="2.2" stroke-linejoin="round"/>')
    for (x, y), (k, v) in zip(points, kept, strict=True):
        hint = f"<title>iteration {k}: {_short(v)}{unit}</title>"
        parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4.2" class="{name}">{hint}</circle>')
    shown = f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(title, quote=True)}">'
    return f"{shown}{''.join(parts)}</svg>"


def bar_chart(title: str, rows: Sequence[tuple[str, float, str, bool]], threshold: float, threshold_name: str) -> str:
    """Horizontal bars on a logarithmic scale: (name, value, remark, strong); a line marks the threshold."""
    positive = [v for _, v, _, _ in rows if 0 < v < math.inf] + [threshold]
    low, high = math.floor(math.log10(min(positive)) - 0.2), math.ceil(math.log10(max(positive)) + 0.1)

    def place(value: float) -> float:
        level = math.log10(min(max(value, 10.0**low), 10.0**high))
        return 100.0 * (level - low) / (high - low)

    mark = f'<u style="left:{place(threshold):.1f}%"></u>'
    lines = "".join(
        f'<li><b>{escape(name)}</b><span class="track">{mark}<i{"" if strong else " class=weak"} '
        f'style="width:{max(place(value), 0.5):.1f}%"></i></span><span>{escape(remark)}</span></li>'
        for name, value, remark, strong in rows
    )
    key = f'<p class="quiet"><u></u>{escape(threshold_name)}; on a logarithmic scale</p>'
    return f'<ul class="bars" aria-label="{escape(title, quote=True)}">{lines}</ul>{key}'


def decision_chart(
    answer: str, groups: Sequence[tuple[str, float, float]], steps: Sequence[tuple[float, str]], tolerance: float
) -> str:
    """A row for each group: how likely it is, what it would forgive, and at which tolerances it is the answer.

    Args:
        answer: name of the group that is the answer.
        groups: name, probability, and what has to be forgiven; those of `steps` that are not among them are less
            likely than is worth telling.
        steps: tolerances in ascending order, each with the group that is the answer there.
        tolerance: the one that was asked for.
    """
    known = [name for name, _, _ in groups]
    only = [(name, math.nan, 0.0) for name in dict.fromkeys(name for _, name in steps) if name not in known]
    rows = [*groups, *only]
    reached = {name: min(t for t, at in steps if at == name) for _, name in steps}
    rows = sorted(rows, key=lambda row: (reached.get(row[0], math.inf), row[2])) if steps else rows
    forgives = ["forgives"] if any(forgiven for _, _, forgiven in groups) else []
    head = "".join(f'<th scope="col">{title}</th>' for title in ("group", "probability", *forgives))
    head += "".join(
        f'<th scope="col"{_asked(t == tolerance)}>{100 * t:g}<span class="unit"> %</span></th>' for t, _ in steps
    )
    body = "".join(_decided(row, steps, tolerance, bool(forgives), row[0] == answer) for row in rows)
    return (
        '<div class="wide" tabindex="0" role="region" aria-label="Groups by probability and tolerance">'
        f'<table class="decision"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'
    )


def _decided(
    row: tuple[str, float, float], steps: Sequence[tuple[float, str]], tolerance: float, forgives: bool, answer: bool
) -> str:
    name, probability, forgiven = row
    needs = f"<td>{100 * forgiven:.2g} %</td>" if forgiven else "<td></td>" if forgives else ""
    share = f'<span class="bar"><i style="width:{100 * probability:.1f}%"></i></span> {100 * probability:.0f} %'
    if math.isnan(probability):
        share = ""
    cells = "".join(
        f'<td class="{"step" if at == name else "off"}{" asked" if t == tolerance else ""}">'
        f"{'<i></i><span class=unseen>the answer</span>' if at == name else ''}</td>"
        for t, at in steps
    )
    strong = ' class="answer"' if answer else ""
    title = "undeter&shy;mined" if name == "undetermined" else schoenflies(name)
    return f'<tr{strong}><th scope="row">{title}</th><td>{share}</td>{needs}{cells}</tr>'


def _asked(is_asked: bool) -> str:
    """The mark of the column of the tolerance that was asked for."""
    return ' class="asked"' if is_asked else ""


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def _gridline(y: float, name: str) -> str:
    line = f'<line x1="{LEFT}" y1="{y:.1f}" x2="{WIDTH - RIGHT}" y2="{y:.1f}" class="grid"/>'
    return line + _text(LEFT - 8, y + 4, name, "end")


def _ticks(high: float) -> list[float]:
    """Round steps from zero to beyond `high`."""
    step = 10.0 ** math.floor(math.log10(high)) if high > 0 else 1.0
    step = next(step * f for f in (0.2, 0.25, 0.5, 1.0, 2.0, 2.5) if high / (step * f) <= 5.0)
    return [float(step * k) for k in range(math.ceil(high / step * (1 + 1e-9)) + 1)] if high > 0 else [0.0, 1.0]


def _log_ticks(values: Sequence[float]) -> list[float]:
    low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
    high = max(high, low + 1)
    return [10.0**k for k in np.unique(np.linspace(low, high, min(high - low, 4) + 1).astype(int)).tolist()]


def _short(value: float) -> str:
    """Three significant digits, with a power of ten only where needed."""
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 1e5:
        return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
    mantissa, exponent = f"{value:.2e}".split("e")
    mantissa = mantissa.rstrip("0").rstrip(".")
    return f"{mantissa}e{int(exponent)}"
