"""The page of an object in space."""

import math
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.metadata import version
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from symrefine.detection.result import Detection
from symrefine.ntuples.rank import SIGNIFICANT
from symrefine.picture.draw import picture_png
from symrefine.picture.measures import rms_series, series, turn_series_deg
from symrefine.picture.rows import Said, kept, said_of
from symrefine.picture.scene import make_scene
from symrefine.picture.words import (
    TUPLES,
    body_name,
    coordinates,
    count,
    direction,
    fit,
    headline,
    kind_name,
    meaning,
    percent,
    scanned,
    sentence,
    symbol,
    verdicts_told,
)
from symrefine.report.charts import bar_chart, decision_chart, line_chart
from symrefine.report.elements import Element, drawn, space_elements
from symrefine.report.listing import HEIGHT, WIDTH, Group, Heads, Row, listing, stage, still
from symrefine.report.markup import Page, facts, head, plain, section
from symrefine.report.model import DEEPEST, model
from symrefine.shape import Index, Shape
from symrefine.surface.misses import LIMITS

# Values of options that are as if they were not given, and options that `symrefine.detect` has too.
_UNSAID = {"seed": 0, "outliers": "auto"}
_IN_PYTHON = ("tolerance", "units", "seed", "outliers", "viewpoint", "isolated", "verify")
# Options that functions have which read a file, and the labels that are the colours of images.
_IN_LOAD = tuple("measure labels weights frame threshold invert texture intrinsics depth_scale mask".split())
_TEXTURE = "texture"
# Of what the texture alone has: so many are told one by one.
_TOLD = 4


def page(detection: Detection, shape: Shape) -> Page:
    """What the page says of an object in space, and the model that turns."""
    scene = make_scene(detection, shape)
    elements = space_elements(detection, scene)
    made = model(detection, shape, scene, elements)
    alt = f"The shape with what was found. {headline(detection)}"
    picture = still(picture_png(detection, shape, title=False, width=WIDTH, height=HEIGHT), alt)
    return Page(
        title=f"{plain(symbol(detection.point_group))} · {plain(shape.source)}",
        sections=(
            _head(detection, shape),
            stage(picture, _hint(detection, elements, made.told), _list(detection, elements)),
            _facts(detection, shape),
            _decision(detection),
            _convergence(detection),
            _tuples(detection),
            reproduce(detection, shape),
        ),
        data={"kind": "space", "object": made.data, "elements": drawn(elements, detection, scene)},
        turns=True,
    )


def _head(d: Detection, shape: Shape) -> str:
    title, group, below = "", d.point_group, meaning(d.group)
    summary = fit(d) or f"Nothing holds at a tolerance of {percent(d.tolerance)} of the diagonal."
    if d.undetermined:
        title, group, below, summary = "Undetermined", "", "", sentence(d.undetermined)
    elif d.at_least:
        title = "At least"
    if d.textured is not None:
        summary += f" With its texture it is {symbol(d.textured.point_group)}."
    return head(f"Symmetry of {shape.source}", title, below, summary, group=group)


def _hint(d: Detection, elements: Sequence[Element], left_out: str) -> str:
    deepest = percent(DEEPEST * d.tolerance)
    told = (
        "Choose a plane or an axis, here or in the list, to see where it takes the object, coloured by how far that "
        f"image misses it: from grey, not at all, to red, {deepest} of the diagonal and more."
    )
    strays = "Dark pink: outliers, no part of it." if len(d.outliers) and not d.is_partial else ""
    return " ".join(said for said in (told if elements else "", verdicts_told(d), strays, left_out) if said)


def _facts(d: Detection, shape: Shape) -> str:
    kind = f"{len(shape.points):,} {'atoms' if shape.elements else 'points'}"
    if shape.faces is not None:
        kind = f"{len(shape.faces):,} triangles, {shape.measure}"
    pairs = [
        ("Input", kind),
        ("Centre", coordinates(d.center, d.diagonal)),
        ("Diagonal", f"{d.diagonal:.5g}"),
        ("Tolerance", percent(d.tolerance)),
        ("Confidence", "none" if d.undetermined else f"{d.confidence:.2f}"),
    ]
    if shape.labels is not None:
        pairs.append(("Labels", _classes(d, shape.labels)))
    if d.textured is not None:
        sure = "" if d.textured.undetermined else f", {d.textured.confidence:.2f}"
        only = "" if d.textured.undetermined else _only_textured(d, d.textured)
        pairs.append(("With its texture", f"{symbol(d.textured.point_group)}{sure}{only}"))
    if said := scanned(d):
        pairs.append(("Scan" if d.exact is None else "Vertices", said))
    return facts(pairs)


def _classes(d: Detection, labels: Index) -> str:
    """What tells points or triangles apart, if it has a name, and into how many classes."""
    name, number = getattr(d, "options", {}).get("labels"), len(np.unique(labels))
    return ", ".join(filter(None, (name, f"{number:,} {'class' if number == 1 else 'classes'}")))


def _list(d: Detection, elements: Sequence[Element]) -> str:
    """What was found by kind, then the near misses."""
    rows = [
        Row(
            index=k,
            name=e.row.name,
            colour=e.row.colour,
            kind=_kind(e, d),
            vector="" if e.kind == "inversion" else direction(e.direction),
            place="about the centre" if e.kind == "inversion" else e.place,
            misses=e.row.residual,
            share=e.row.residual.p95 / (LIMITS[1] * d.tolerance),
            score=e.row.score,
            copies=e.matrix(d.diagonal) is not None,
        )
        for k, e in enumerate(elements)
    ]
    groups = [
        Group(title=title([elements[k] for k in chosen]), rows=[rows[k] for k in chosen], missed=False)
        for kinds, title in _TITLES.items()
        if (chosen := [k for k, e in enumerate(elements) if e.kind in kinds and not e.missed])
    ]
    near = [row for e, row in zip(elements, rows, strict=True) if e.missed]
    if near:
        groups.append(Group(title=count(len(near), "near miss", "near misses"), rows=near, missed=True))
    nothing = "Nothing is decided, so nothing is listed." if d.undetermined else "No candidate came close."
    heads = Heads(vector="normal or direction", body=body_name(d.surface.cloud.body), matrix="4 × 4")
    return listing(groups, heads, nothing)


def _kind(element: Element, d: Detection) -> str:
    """What a row says of its kind where its group does not, and what the texture keeps of it."""
    if element.missed:
        return element.row.kind
    told = "" if element.kind in ("plane", "axis") else element.row.kind
    mark = _kept(element, d.textured)
    return " · ".join(filter(None, (told, f"with its texture {mark}" if mark else "")))


def _kept(element: Element, textured: Detection | None) -> str:
    """What the texture keeps of an element that was found: all, a part, or nothing."""
    if textured is None or textured.undetermined:
        return ""
    if element.kind == "inversion":
        return "kept" if textured.inversion else ""
    return kept((element.kind, element.direction.tolist(), element.order), _said(textured))


def _said(d: Detection) -> list[Said]:
    turns = ((a.axis.direction.tolist(), a.order, a.improper) for a in d.axes)
    return said_of((p.plane.normal.tolist() for p in d.planes), turns)


def _only_textured(d: Detection, textured: Detection) -> str:
    """The directions of what the texture keeps of endless planes and axes, which are no rows of their own."""
    own = _said(d)
    alone = [one for one in _said(textured) if not kept(one, own)]
    told = [f"{kind_name(kind, order)} {direction(np.array(along))}" for kind, along, order in alone]
    return "; ".join(["", *told[:_TOLD]]) + "; ..." * (len(told) > _TOLD)


def _axes_title(elements: Sequence[Element]) -> str:
    """`Three axes of order 2`, `13 axes: 3 of order 4, 4 of order 3, 6 of order 2`."""
    by_order = [(_order_text(order), len(list(same))) for order, same in groupby(elements, key=lambda e: e.order)]
    axes = count(len(elements), "axis", "axes")
    if len(by_order) == 1:
        return f"{axes} {by_order[0][0]}"
    return f"{axes}: {', '.join(f'{number} {order}' for order, number in by_order)}"


def _order_text(order: float) -> str:
    """What an axis of an order is, after the word."""
    return "of revolution" if math.isinf(order) else f"of order {round(order)}"


def _others_title(elements: Sequence[Element]) -> str:
    turned = sum(e.kind == "improper" for e in elements)
    told = [count(turned, "rotoreflection axis", "rotoreflection axes")] if turned else []
    return " and ".join([*told, *(["the inversion"] if len(elements) > turned else [])])


# The lines of the list, each with the kinds of elements it opens to.
_TITLES: dict[tuple[str, ...], Callable[[Sequence[Element]], str]] = {
    ("plane",): lambda elements: count(len(elements), "mirror plane"),
    ("axis",): _axes_title,
    ("improper", "inversion"): _others_title,
}


def _decision(d: Detection) -> str:
    if not d.alternatives and not d.staircase:
        return ""
    told = "How likely each group is to be what the object was meant to have"
    if any(a.forgiven for a in d.alternatives):
        told += ", the miss of its worst element that would have to be forgiven"
    if d.staircase:
        told += ", and the tolerances (in % of the diagonal) at which it is the answer: at all of them, if it is exact"
    steps = [(s.tolerance, "undetermined" if s.undetermined else s.point_group) for s in d.staircase]
    own = [] if d.undetermined else [(d.point_group, d.confidence, 0.0)]
    others = [(a.point_group, a.probability, a.forgiven) for a in d.alternatives]
    chart = decision_chart(d.point_group, [*own, *others], steps, d.tolerance)
    return section("What it may be" if d.undetermined else "What else it may be", f"{told}.", chart)


def _convergence(d: Detection) -> str:
    if len(d.history) < 2:
        return ""
    turns, misses = turn_series_deg(d.history), rms_series(d.history, 100 * d.scale / d.diagonal)
    told = (
        f"All elements were refined together, in {count(d.iterations, 'iteration')}: one frame turns and shifts until "
        "the points agree with their images."
    )
    if 1 < len(turns) < d.iterations:
        told += f" The last {len(turns)} are shown; the others refined its parts."
    if len(turns) == 1:
        last = "It" if d.iterations == 1 else "The last of them"
        angle = f"{turns[0]:.2g}" if turns[0] >= 1e-4 else "less than 0.0001"
        told += f" {last} turned the frame by {angle} degrees."
        return section("How the refinement converged", told, "")
    charts = (
        _chart("Turn of the frame [degrees]", turns, "°", "turn", log=True),
        _chart("RMS residual [% of the diagonal]", misses, " %", "miss"),
        _chart("Pairs in agreement", series(d.history, "inliers"), "", "pairs"),
    )
    return section("How the refinement converged", told, f'<div class="charts">{"".join(charts)}</div>')


def _chart(title: str, values: Sequence[float], unit: str, name: str, *, log: bool = False) -> str:
    chart = line_chart(title, values, first=1, unit=unit, name=name, log=log)
    return f"<figure><figcaption>{plain(title)}</figcaption>{chart}</figure>"


def _tuples(d: Detection) -> str:
    told = (
        f"{len(d.vectors.vectors)} vectors made of moments (n-tuples) turn with the shape, so a symmetry leaves all of "
        f"them in place. Here they {TUPLES[d.tuples.kind]}. The bars are their singular values over the noise "
        "that sampling leaves."
    )
    return said_first(told, d.tuples, "₁₂₃")


def said_first(told: str, tuples: Any, marks: Iterable[str]) -> str:
    """What the n-tuples told, in words and as bars: their singular values, each marked in its own way."""
    rows = [
        (f"σ{mark}", float(s), f"size {v:.2g}, {s:.1f} times its noise", s > SIGNIFICANT)
        for mark, s, v in zip(marks, tuples.significance, tuples.singular_values, strict=False)
    ]
    chart = bar_chart("Singular values of the n-tuples over their noise", rows, SIGNIFICANT, "significant from here")
    return section("What the moments said first", told, chart)


def reproduce(found: Any, shape: Shape) -> str:
    """The command, and the call in Python, that give this result again: with the options that it was asked with."""
    options: Mapping[str, Any] = getattr(found, "options", {"tolerance": getattr(found, "tolerance", None)})
    asked = {
        k: v for k, v in options.items() if v is not None and v is not False and (k not in _UNSAID or v != _UNSAID[k])
    }
    python = {name: asked[name] for name in _IN_PYTHON if name in asked}
    return again("detect", {"shape": shape.source}, asked, python)


def again(verb: str, given: Mapping[str, str], asked: Mapping[str, Any], python: Mapping[str, Any]) -> str:
    """How a result is had again.

    Args:
        verb: the command, and the function.
        given: files, or what came as an object, by the names of variables.
        asked: options of the command, by their names in Python.
        python: those of the function.
    """
    files = list(given.values())
    # What came as an object has the name of its kind, and no suffix.
    are_files = all(Path(name).suffix for name in files)
    # What is read with options of the command alone is a shape that was read so.
    is_read = are_files and any(_reading(name, asked) for name in given)
    named = list(map(repr, files)) if are_files and not is_read else list(given)
    call = f"symrefine.{verb}({_words(named, python)}){'.textured' if asked.get('labels') == _TEXTURE else ''}"
    lines = [call]
    if are_files:
        options = [word for name, value in asked.items() for word in _option(name, value)]
        lines = [shlex.join(["symrefine", verb, *files, *options])]
        read = [_read(name, file, asked) for name, file in given.items()]
        lines += ["# or in Python:", *read, call] if is_read else [f"# or in Python: {call}"]
    told = f"symrefine {version('symrefine')}. The result is a function of the input and these options alone."
    return section("Reproduce", told, "<pre>" + "\n".join(plain(line) for line in lines) + "</pre>")


def _read(name: str, file: str, asked: Mapping[str, Any]) -> str:
    """How a file is read into a variable."""
    options = _reading(name, asked)
    camera = [repr(tuple(options.pop("intrinsics")))] if "intrinsics" in options else []
    return f"{name} = symrefine.load{'_depth' if camera else ''}({_words([repr(file), *camera], options)})"


def _reading(name: str, asked: Mapping[str, Any]) -> dict[str, Any]:
    """The options with which the file of a variable is read."""
    options = {option: asked[option] for option in _IN_LOAD if option in asked}
    if f"{name}_frame" in asked:
        options["frame"] = asked[f"{name}_frame"]
    if options.get("labels") == _TEXTURE:
        options = {option: value for option, value in options.items() if option != "labels"} | {"texture": True}
    return options


def _words(named: Sequence[str], options: Mapping[str, Any]) -> str:
    """The arguments of a call."""
    return ", ".join([*named, *(f"{name}={value!r}" for name, value in options.items())])


def _option(name: str, value: Any) -> list[str]:
    """An option of the command line with its value: lists between commas, what is only said or not without one."""
    told = ",".join(f"{v:g}" for v in value) if isinstance(value, list | tuple) else str(value)
    return [f"--{name.replace('_', '-')}", *([] if value is True else [told])]
