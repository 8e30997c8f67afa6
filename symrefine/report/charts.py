"""Charts as inline SVG: small, sharp, and readable without a script."""

import math
from collections.abc import Sequence
from html import escape

import numpy as np

INK, PALE, GRID = "#2b3240", "#6b7484", "#e3e7ee"
WIDTH, HEIGHT = 400, 210
LEFT, RIGHT, TOP, BOTTOM = 62, 22, 16, 40


def line_chart(title: str, values: Sequence[float], *, first: int, unit: str, colour: str, log: bool = False) -> str:
    """A quantity over the iterations `first`, `first + 1`, ...; every point carries its value.

    Args:
        title: what the chart tells someone who cannot see it.
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
    parts += [_text(place(k, kept[0][1])[0], HEIGHT - BOTTOM + 18, str(k), "middle", PALE) for k in named]
    parts.append(_text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 6, "iteration", "middle", PALE))
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    parts.append(
        f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2.2" stroke-linejoin="round"/>'
    )
    for (x, y), (k, v) in zip(points, kept, strict=True):
        hint = f"<title>iteration {k}: {_short(v)}{unit}</title>"
        parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4.2" fill="{colour}">{hint}</circle>')
    return _svg(title, WIDTH, HEIGHT, parts)


def bar_chart(title: str, rows: Sequence[tuple[str, float, str, bool]], threshold: float, threshold_name: str) -> str:
    """Horizontal bars on a logarithmic scale: (name, value, remark, strong); a line marks the threshold."""
    positive = [v for _, v, _, _ in rows if 0 < v < math.inf] + [threshold]
    low, high = math.floor(math.log10(min(positive)) - 0.2), math.ceil(math.log10(max(positive)) + 0.1)
    left, right, width = 32, 190, 640

    def place(value: float) -> float:
        level = math.log10(min(max(value, 10.0**low), 10.0**high))
        return left + (level - low) / (high - low) * (width - left - right)

    height = 34 * len(rows) + 34
    parts = []
    for k, (name, value, remark, strong) in enumerate(rows):
        y = 34 * k + 8
        fill = "#0072b2" if strong else "#b9c2d0"
        parts.append(_text(left - 10, y + 16, name, "end", INK))
        parts.append(
            f'<rect x="{left}" y="{y}" width="{max(place(value) - left, 2):.1f}" height="22" rx="3" fill="{fill}"/>'
        )
        parts.append(_text(max(place(value), place(threshold)) + 10, y + 16, remark, "start", INK))
    x = place(threshold)
    parts.append(f'<line x1="{x:.1f}" y1="2" x2="{x:.1f}" y2="{height - 26}" stroke="{INK}" stroke-dasharray="4 3"/>')
    parts.append(_text(x, height - 8, threshold_name, "middle", PALE))
    return _svg(title, width, height, parts)


def _svg(title: str, width: int, height: int, parts: Sequence[str]) -> str:
    return (
        f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{escape(title, quote=True)}">'
        + "".join(parts)
        + "</svg>"
    )


def _text(x: float, y: float, text: str, anchor: str, colour: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{colour}">{escape(text)}</text>'


def _gridline(y: float, name: str) -> str:
    line = f'<line x1="{LEFT}" y1="{y:.1f}" x2="{WIDTH - RIGHT}" y2="{y:.1f}" stroke="{GRID}"/>'
    return line + _text(LEFT - 8, y + 4, name, "end", PALE)


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
