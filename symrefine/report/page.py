"""The page: one HTML file that needs nothing else, readable from a headline down to how to reproduce it."""

import base64
import shlex
from collections.abc import Iterable, Sequence
from html import escape
from importlib.metadata import version

from symrefine.detection.result import Detection
from symrefine.ntuples.rank import SIGNIFICANT
from symrefine.picture.measures import rms_series, series, turn_series_deg
from symrefine.picture.rows import found_rows, near_miss_rows
from symrefine.picture.words import TUPLES, coordinates, fit, headline, meaning, percent, scanned, symbol, verdicts_told
from symrefine.report.charts import bar_chart, line_chart
from symrefine.report.style import STYLE
from symrefine.shape import Shape
from symrefine.surface.misses import LIMITS, Deviation

_MISSES = ("mean", "p95", "p99", "max")
_MISS_NAMES = ("mean", "95 %", "99 %", "largest")


def html_page(detection: Detection, shape: Shape, picture: bytes) -> str:
    """The whole page; `picture` is a PNG."""
    source = escape(shape.source)
    sections = [
        _head(detection, shape),
        _figure(detection, picture),
        _facts(detection, shape),
        _found(detection),
        _near_misses(detection),
        _alternatives(detection),
        _staircase(detection),
        _convergence(detection),
        _tuples(detection),
        _reproduce(detection, shape),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(symbol(detection.point_group))} · {source}</title>\n<style>{STYLE}</style>\n</head>\n"
        "<body>\n<main>\n" + "\n".join(s for s in sections if s) + "\n</main>\n</body>\n</html>\n"
    )


def _head(d: Detection, shape: Shape) -> str:
    title, below = symbol(d.point_group), meaning(d.group)
    summary = fit(d) or f"Nothing holds at a tolerance of {percent(d.tolerance)} of the diagonal."
    if d.undetermined:
        title, below, summary = "Undetermined", "", d.undetermined
    return (
        f'<header><p class="over">Symmetry of {escape(shape.source)}</p>'
        f'<h1>{escape(title)} <span>{escape(below)}</span></h1><p class="lead">{escape(summary)}</p></header>'
    )


def _figure(d: Detection, picture: bytes) -> str:
    data = base64.b64encode(picture).decode("ascii")
    alt = escape(f"The shape with what was found. {headline(d)}", quote=True)
    return f'<figure><img src="data:image/png;base64,{data}" alt="{alt}"></figure>'


def _facts(d: Detection, shape: Shape) -> str:
    kind = f"{len(shape.points):,} points"
    if shape.faces is not None:
        kind = f"{len(shape.faces):,} triangles, {shape.measure}"
    facts = [
        ("Input", kind),
        ("Centre", coordinates(d.center, d.diagonal)),
        ("Diagonal", f"{d.diagonal:.5g}"),
        ("Tolerance", percent(d.tolerance)),
        ("Confidence", "none" if d.undetermined else f"{d.confidence:.2f}"),
    ]
    if said := scanned(d):
        facts.append(("Scan", f"{said} {verdicts_told(d)}".rstrip()))
    if d.iterations:
        facts.append(("Iterations", str(d.iterations)))
    items = "".join(f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in facts)
    return f"<dl>{items}</dl>"


def _found(d: Detection) -> str:
    rows = [
        (
            f'<b class="swatch" style="background:rgb{r.colour}">{escape(r.name)}</b>',
            r.kind,
            _code(r.vector),
            *_misses(r.residual),
            _bar(r.residual.p95 / (LIMITS[1] * d.tolerance)),
            f"{r.score:.2f}",
        )
        for r in found_rows(d)
    ]
    told = (
        "Each element maps the surface onto an image of itself. The columns say by how much "
        "that image misses the surface, in % of the diagonal: on average, for the best 95 % and 99 % of the surface, "
        "and at worst. "
        f"The bar shows the 95 % column against the {percent(LIMITS[1] * d.tolerance)} that is allowed."
    )
    heads = ("", "kind", "normal or direction", *_MISS_NAMES, "95 % and its limit", "confidence")
    return _listed("What was found, and how well it holds", told, heads, rows)


def _near_misses(d: Detection) -> str:
    rows = [(r.name, r.kind, _code(r.vector), *_misses(r.residual), f"{r.score:.2f}") for r in near_miss_rows(d)]
    told = (
        "Candidates that were refined and turned down, best first. The last column is by how many times the worst of "
        "their statistics exceeds what the tolerance allows."
    )
    heads = ("", "kind", "normal or direction", *_MISS_NAMES, "times the limit")
    return _listed("Near misses", told, heads, rows)


def _alternatives(d: Detection) -> str:
    rows = [
        (escape(symbol(a.point_group)), f"{100 * a.probability:.0f} %", escape(percent(a.forgiven)))
        for a in d.alternatives
    ]
    told = (
        f"The answer has a probability of {100 * d.confidence:.0f} %. These groups are what the object may have been "
        "meant to have instead, with what their worst element misses by: the tolerance that would have to be granted."
    )
    return _listed("What else it may be", told, ("group", "probability", "to be forgiven"), rows)


def _staircase(d: Detection) -> str:
    if not d.staircase:
        return ""
    cells = "".join(
        f"<div><dt>{escape(percent(s.tolerance))}</dt>"
        f"<dd>{escape('undetermined' if s.undetermined else symbol(s.point_group))}</dd></div>"
        for s in d.staircase
    )
    told = (
        "What the answer would be at other tolerances, as fractions of the diagonal: an exact symmetry stands at all "
        "of them, an approximate one only from what it misses by."
    )
    return _section("The group as a function of the tolerance", told, f"<dl>{cells}</dl>")


def _convergence(d: Detection) -> str:
    if len(d.history) < 2:
        return ""
    turns, misses = turn_series_deg(d.history), rms_series(d.history, 100 * d.scale / d.diagonal)
    told = "All elements are refined together: one frame turns and shifts until the points agree with their images."
    if len(turns) == 1:
        told += f" One iteration was enough: it turned the frame by {turns[0]:.2g} degrees."
        return _section("How the refinement converged", told, "")
    charts = (
        _chart("Turn of the frame [degrees]", turns, "°", "#d55e00", log=True),
        _chart("RMS residual [% of the diagonal]", misses, " %", "#0072b2"),
        _chart("Pairs in agreement", series(d.history, "inliers"), "", "#009e73"),
    )
    return _section("How the refinement converged", told, f'<div class="charts">{"".join(charts)}</div>')


def _chart(title: str, values: Sequence[float], unit: str, colour: str, *, log: bool = False) -> str:
    chart = line_chart(title, values, first=1, unit=unit, colour=colour, log=log)
    return f"<figure><figcaption>{escape(title)}</figcaption>{chart}</figure>"


def _tuples(d: Detection) -> str:
    rows = [
        (f"σ{'₁₂₃'[k]}", float(s), f"size {v:.2g}, {s:.1f} times its noise", s > SIGNIFICANT)
        for k, (s, v) in enumerate(zip(d.tuples.significance, d.tuples.singular_values, strict=True))
    ]
    told = (
        f"{len(d.vectors.vectors)} vectors made of moments (n-tuples) turn with the shape, so a symmetry leaves all of "
        f"them in place. Here they {TUPLES[d.tuples.kind]}. The bars are their singular values over the noise "
        "that sampling leaves."
    )
    chart = bar_chart("Singular values of the n-tuples over their noise", rows, SIGNIFICANT, "significant from here")
    return _section("What the moments said first", told, f'<div class="wide bars">{chart}</div>')


def _reproduce(d: Detection, shape: Shape) -> str:
    command = f"symrefine detect {shlex.quote(shape.source)} --tolerance {d.tolerance:g}"
    if shape.measure == "solid":
        command += " --measure solid"
    call = f"symrefine.detect(shape, tolerance={d.tolerance:g})"
    lines = [call] if shape.source == "array" else [command, f"# or in Python: {call}"]
    told = (
        f"symrefine {version('symrefine')}. The result is a function of the input, the tolerance and the seed of the "
        "samples (--seed, 0 unless given) alone."
    )
    return _section("Reproduce", told, f"<pre>{escape(chr(10).join(lines))}</pre>")


def _section(title: str, told: str, body: str) -> str:
    return f"<section><h2>{escape(title)}</h2><p>{escape(told)}</p>{body}</section>"


def _listed(title: str, told: str, heads: Iterable[str], rows: Sequence[Sequence[str]]) -> str:
    """A section with a table, or nothing where there are no rows."""
    if not rows:
        return ""
    head = "".join(f"<th>{escape(h)}</th>" for h in heads)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    table = f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'
    return _section(title, told, table)


def _misses(residual: Deviation) -> list[str]:
    return [f"{100.0 * getattr(residual, name):.2f}" for name in _MISSES]


def _bar(share: float) -> str:
    """A bar of up to 1.25 times what is allowed, with a mark there."""
    width = 80.0 * min(max(share, 0.01), 1.25)
    return f'<span class="bar" title="{100 * share:.0f} % of what is allowed"><i style="width:{width:.1f}%"></i></span>'


def _code(text: str) -> str:
    return f"<code>{escape(text)}</code>"
