"""What the viewer says in words: a page in Markdown, and the lines of its log."""

import math
from collections.abc import Iterable, Sequence

from symrefine.detection.result import Detection
from symrefine.fit.refine import Iterate
from symrefine.picture.rows import found_rows, near_miss_rows
from symrefine.picture.words import TUPLES, coordinates, fit, headline, percent, scanned, verdicts_told
from symrefine.shape import Shape
from symrefine.surface.misses import Deviation


def markdown(detection: Detection, shape: Shape) -> str:
    """The report as a page."""
    d = detection
    told = (f"`{shape.source}`.", fit(d), scanned(d), verdicts_told(d))
    parts = [f"# {headline(d)}", " ".join(said for said in told if said)]
    found = [(r.name, r.kind, r.vector, *_misses(r.residual)) for r in found_rows(d)]
    if found:
        parts.append(table(("", "kind", "normal or direction", "mean %", "95 %"), found))
    near = [(r.name, r.kind, *_misses(r.residual), f"{r.score:.2f}") for r in near_miss_rows(d)]
    if near:
        parts.append("**Near misses** (grey, hidden until `near_misses` is switched on)")
        parts.append(table(("", "kind", "mean %", "95 %", "times the limit"), near))
    pairs = zip(d.tuples.singular_values, d.tuples.significance, strict=True)
    sizes = ", ".join(f"{value:.2g} ({times:.1f} times its noise)" for value, times in pairs)
    meaning = f"The {len(d.vectors.vectors)} n-tuples (yellow arrows) {TUPLES[d.tuples.kind]}"
    conventions = (
        f"Positions are relative to the centre {coordinates(d.center, d.diagonal)}, in the units of the input; "
        "misses are in percent of the diagonal of the bounding box."
    )
    return "\n\n".join([*parts, f"{meaning}. Singular values: {sizes}.", conventions]) + "\n"


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _misses(residual: Deviation) -> tuple[str, str]:
    return f"{100.0 * residual.mean:.2f}", f"{100.0 * residual.p95:.2f}"


def report_lines(detection: Detection, shape: Shape) -> list[str]:
    """The report as lines of a log."""
    return [
        f"{shape.source}: {headline(detection)}",
        *(
            f"{r.kind} {r.name} {r.vector} misses by {percent(r.residual.mean)} (95 %: {percent(r.residual.p95)})"
            for r in found_rows(detection)
        ),
        *(f"near miss {r.name}: {r.kind} {r.vector}, {r.score:.2f} times the limit" for r in near_miss_rows(detection)),
    ]


def iteration_line(now: Iterate, detection: Detection) -> str:
    """One iteration in one line."""
    if now.index == 0:
        return "start: where the moments put it"
    miss = math.sqrt(max(now.cost, 0.0)) * detection.scale / detection.diagonal
    settled = "; settled" if now.converged else ""
    return f"iteration {now.index}: {now.inliers} pairs, RMS residual {percent(miss)}, step {now.step:.1e}{settled}"
