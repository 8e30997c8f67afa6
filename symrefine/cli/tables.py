"""What a person reads: the JSON record of a detection, as tables, or as one line among those of many files."""

import math
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any

from rich.table import Table

from symrefine.errors import one_line
from symrefine.groups import point_group
from symrefine.picture.words import DOUBLETS, TUPLES, evened, kind_name, meaning, taken_out, turns_name

Record = dict[str, Any]

_RESIDUALS = ("mean", "p95", "max")
_WORDS = ("kind",)
# One of many files; names last, so that none is ever cut or folded, and no row waits for the longest.
_ROW = "{:<13}  {:>6}  {:>4}  {:>6}  {:>10}  {:>7}  {}"
ROW_HEAD = _ROW.format("group", "planes", "axes", "p95 %", "confidence", "seconds", "file")
_REFINED = "Near misses were refined and turned down: they miss by `x limit` times what the tolerance allows"


def record_lines(record: Record) -> Iterator[Table | str]:
    """Everything to be said about a detection in any dimension, or an alignment."""
    if "matrix" in record:
        return alignment_lines(record)
    tell = planar_lines if "lines" in record else hyperplane_lines if "hyperplanes" in record else detection_lines
    return tell(record)


def detection_lines(record: Record) -> Iterator[Table | str]:
    """Everything a table can say about one detection."""
    yield f"{record['source']}: {headline(record)}"
    yield f"n-tuples {TUPLES[record['ntuples']['kind']]}"
    yield _place(record)
    if record["classes"]:
        yield f"labels: {_count(record['classes']['count'], 'class', 'classes')}"
    out = record["outliers"]
    yield from filter(None, (taken_out(out["count"], out["share"], out["clumps"]), evened(record["even_sample"])))
    if record["at_least"]:
        yield partial(record)
    yield from _apart(*_spatial(record))
    yield ""
    if record["planes"] or record["axes"] or record["inversion"] or record["near_misses"]:
        yield "Offsets in units of the file, misses in % of the diagonal; axes go through the centre."
    if record["near_misses"]:
        yield f"{_REFINED}, or, below 1, by more than what was meant so mostly does."
    if record["alternatives"]:
        yield f"It may be meant otherwise: {otherwise(record)}."
    if record["staircase"]:
        yield f"Group by tolerance: {staircase(record)}"
    yield f"{_count(record['iterations'], 'iteration')}, {_seconds(record)} s"


def partial(record: Record) -> str:
    """What was not seen, and what of the surface speaks for what was found."""
    seen = [e["coverage"] for e in (*record["planes"], *record["axes"])]
    if not seen:
        return "parts of the surface were not seen: there may be more"
    most = max(seen, key=lambda c: c["unseen"])
    return (
        "parts of the surface were not seen: there may be more; of what was seen "
        f"{100 * min(c['supported'] for c in seen):.0f} % and more support each element, "
        f"{100 * max(c['contradicted'] for c in seen):.2g} % and less contradict it, "
        f"{100 * most['unseen']:.0f} % and less have an image where nobody looked"
    )


def _place(record: Record) -> str:
    centre = ", ".join(_length(x, record) for x in record["center"])
    return f"centre ({centre}), diagonal {_length(record['diagonal'], record)} in units of the file"


def _apart(*tables: Table) -> Iterator[Table | str]:
    """The tables that have rows, each after an empty line."""
    for table in tables:
        if table.row_count:
            yield ""
            yield table


def staircase(record: Record) -> str:
    """The group as a function of the tolerance: `C1 at 0.25-0.5 %, C4v at 1-8 %`."""
    parts = []
    for name, steps in groupby(record["staircase"], key=lambda s: s["point_group"]):
        percents = [f"{100 * s['tolerance']:g}" for s in steps]
        span = percents[0] if len(percents) == 1 else f"{percents[0]}-{percents[-1]}"
        parts.append(f"{name} at {span} %")
    return ", ".join(parts)


def headline(record: Record) -> str:
    """The group and what it means, or why there is none."""
    name = record["point_group"]
    if record["undetermined"]:
        return f"undetermined: {record['undetermined']}"
    means = _planar_meaning(record) if "lines" in record else meaning(point_group(name))
    name = f"at least {name}" if record.get("at_least") else name
    return f"{name}, {means}; tolerance {_tolerance(record)}, confidence {record['confidence']:.2f}"


def _tolerance(record: Record) -> str:
    """The tolerance as a fraction of the diagonal, and as the length that was asked for, if it was one."""
    asked, relative = record["options"]["tolerance"], 100 * record["tolerance"]
    return f"{asked}, {relative:.3g} %" if isinstance(asked, str) else f"{relative:g} %"


def _planar_meaning(record: Record) -> str:
    rotation = record["rotation"]
    if record["point_group"] in ("C1", "O(2)"):
        return "no symmetry" if record["point_group"] == "C1" else "round"
    lines = _count(len(record["lines"]), "mirror line") if record["lines"] else "no mirror line"
    return lines + (f", {turns_name(float(rotation['order']))}" if rotation else "")


def otherwise(record: Record) -> str:
    """The groups it may be instead, and what of the diagonal they forgive: `C1 (7 %); D4h (5 %), forgiving 3 %`."""
    return "; ".join(
        f"{a['point_group']} ({100 * a['probability']:.0f} %)"
        + (f", forgiving {100 * a['forgiven']:.2g} %" if a["forgiven"] else "")
        for a in record["alternatives"]
    )


def planar_lines(record: Record) -> Iterator[Table | str]:
    """Everything a table can say about one detection in the plane."""
    yield f"{record['source']}: {headline(record)}"
    if record["alternatives"]:
        yield f"It may be meant otherwise: {otherwise(record)}."
    yield f"n-tuples {DOUBLETS[record['ntuples']['kind']]}"
    yield _place(record)
    yield from _apart(*_planar(record))
    if record["ntuples"]["kind"] != "centre":
        yield from _apart(_ratios(record))
    yield ""
    yield "Offsets in units of the file (of a picture: pixels, y up), misses in % of the diagonal."
    if record["near_misses"]:
        yield f"{_REFINED}."
    yield f"{_seconds(record)} s"


def _planar(record: Record) -> Iterator[Table]:
    """Mirror lines with the turns, and near misses, of a detection in the plane."""
    rotation = record["rotation"]
    lines = [((*_mirror(line, record), "mirror"), line) for line in record["lines"]]
    turns = [(("", "", turns_name(float(rotation["order"]))), rotation)] if rotation else []
    yield _elements(("mirror lines: normal", "offset", "kind"), "confidence", lines + turns)
    near = [
        ((*_mirror(m, record), "mirror") if m["kind"] == "line" else ("", "", turns_name(float(m["order"]))), m)
        for m in record["near_misses"]
    ]
    yield _elements(("near misses: normal", "offset", "kind"), "x limit", near)


def _ratios(record: Record) -> Table:
    """Singular values of the doublets of each vector of moments, and their ratio, as the paper prints it."""
    table = _table("doublets of v(p,p')", "sigma 1", "sigma 2", "ratio")
    for v in record["ntuples"]["vectors"]:
        ratio = v["ratio"]
        told = "they vanish" if ratio is None else ratio if ratio == "inf" else f"{ratio:.4g}"
        table.add_row(str(tuple(v["orders"])), *(f"{s:.2e}" for s in v["singular_values"]), told)
    return table


def hyperplane_lines(record: Record) -> Iterator[Table | str]:
    """Everything a table can say about points of four and more dimensions."""
    found, dim = record["hyperplanes"], record["dimension"]
    told = _count(len(found), "hyperplane") + " of symmetry" if found else "no hyperplane of symmetry"
    doubt = record["undetermined"]
    yield f"{record['source']}: {f'undetermined: {doubt}' if doubt else f'{told} in {dim} dimensions'}"
    order = record["reflection_group_order"]
    if found and order is not None:
        yield f"their reflections generate a group of order {order}"
    if record["incomplete"]:
        yield f"there may be more: {record['incomplete']}"
    yield f"n-tuples of rank {record['ntuples']['rank']}; turns are not looked for in {dim} dimensions"
    titled = {"hyperplanes: normal": found, "turned down: normal": record["rejected"]}
    yield from _apart(*(_hyperplanes(title, candidates, record) for title, candidates in titled.items()))
    yield ""
    yield "Offsets in units of the file, asymmetry and noise in % of the moments, largest miss in % of the diameter."
    yield f"{_seconds(record)} s"


def _hyperplanes(title: str, candidates: Sequence[Record], record: Record) -> Table:
    table = _table(title, "offset", "asymmetry", "noise", "largest miss")
    for h in candidates:
        miss = "" if h["miss"] is None else _percent(h["miss"])
        table.add_row(
            *_mirror(h, {"diagonal": record["diameter"]}), _percent(h["asymmetry"]), _percent(h["noise"]), miss
        )
    return table


def alignment_lines(record: Record) -> Iterator[str]:
    """Everything a person wants to know about one alignment; of a misfit nothing that sounds like an answer."""
    if record["misfit"]:
        yield misfit(record)
        yield ""
        yield "The closest map that was found, and no answer:"
    else:
        yield f"{record['source']} onto {record['target']}: {record['status']}"
    yield ""
    rows = list(zip(record["matrix"], record["translation"], strict=True))
    yield from (f"  {' '.join(f'{x + 0.0:11.8f}' for x in row)}  |  {t:.8g}" for row, t in rows)
    yield ""
    kind = "rotation" if record["determinant"] > 0 else "reflection or rotoreflection"
    scale = "" if record["scale"] == 1.0 else f", scale {record['scale']:.8g}"
    yield f"matrix | translation in units of the target; determinant {record['determinant']:+d} ({kind}){scale}"
    distance = f"rms distance {_percent(record['rms'])} % of the diagonal"
    if record["misfit"]:
        yield distance
    else:
        yield f"{distance}, {_known(record)}"
        met = (f"{100 * record['overlap'][side]:.0f} % of the {side}" for side in ("source", "target"))
        yield (
            f"overlap {' and '.join(met)}; confidence {record['confidence']:.3f}, "
            f"of the determinant {record['determinant_confidence']:.3f}"
        )
        observable = record["observable"]
        yield f"determined: {'everything' if observable == 'full' else observable}"
    yield f"{_seconds(record)} s"


def misfit(record: Record) -> str:
    """That the objects do not agree, and why not."""
    options, reason = record["options"], record["status"]
    maps = "rotation" if options["rotations_only"] else "orthogonal map"
    maps += " with any scale" if options["scale"] else ""
    # Elsewhere than in space the sampling noise of the moments decides, not the tolerance.
    tolerance = options.get("relative_tolerance", options["tolerance"])
    within = f" within {100 * tolerance:.4g} % of the diagonal" if "tolerance" in reason else ""
    return f"{record['source']} onto {record['target']}: no {maps} takes the one onto the other{within}: {reason}"


def _known(record: Record) -> str:
    """How well the rotation is known."""
    if record["exact"]:
        return "moments equal to rounding"
    sigma = record["sigma_rad"]
    return "rotation unknown" if isinstance(sigma, str) else f"rotation known to {math.degrees(sigma):.2g} degrees"


def row_line(name: str, row: Record) -> str:
    """What was found in one of many files, or what was wrong with it; the name stands last and whole."""
    if row["error"] is not None:
        told, name = one_line(row["error"]), one_line(name)
        return f"failed: {told}" if name in told else f"failed: {name}: {told}"
    if "hyperplanes" in row:
        told, mirrors, turns = f"{row['dimension']}-D", row["hyperplanes"], None
    else:
        # Planes and axes of a detection in space, lines and turns of one in the plane.
        mirrors = row["lines"] if "lines" in row else row["planes"]
        turns = ([row["rotation"]] if row["rotation"] else []) if "lines" in row else row["axes"]
        told = f"at least {row['point_group']}" if row.get("at_least") else row["point_group"]
    elements = [] if turns is None else mirrors + turns + _inversions(row)
    return _ROW.format(
        "undetermined" if row["undetermined"] else told,
        len(mirrors),
        "" if turns is None else len(turns),
        _percent(max(e["residual"]["p95"] for e in elements)) if elements else "",
        f"{min(e['confidence'] for e in elements):.2f}" if elements else "",
        _seconds(row),
        one_line(name),
    )


def _inversions(record: Record) -> list[Record]:
    """The inversion as an element, if there is one; rows of a batch in the plane, or of an early version, tell none."""
    if not record.get("inversion_residual"):
        return []
    return [{"residual": record["inversion_residual"], "confidence": record["inversion_confidence"]}]


def _spatial(record: Record) -> Iterator[Table]:
    """Planes, axes, the inversion and near misses of a detection in space."""
    planes = [(_mirror(p, record), p) for p in record["planes"]]
    yield _elements(("mirror planes: normal", "offset"), "confidence", planes)
    turns = [_turn("improper" if a["improper"] else "axis", a["order"]) for a in record["axes"]]
    axes = [((_direction(a["direction"]), turn), a) for a, turn in zip(record["axes"], turns, strict=True)]
    yield _elements(("axes: direction", "kind"), "confidence", axes)
    yield _elements(("inversion",), "confidence", [(("about the centre",), found) for found in _inversions(record)])
    near = [(_near(m, record), m) for m in record["near_misses"]]
    yield _elements(("near misses: direction", "offset", "kind"), "x limit", near)


def _near(miss: Record, record: Record) -> tuple[str, ...]:
    """Where a candidate that was turned down stands, and what it is."""
    if miss["kind"] == "inversion":
        return "about the centre", "", "inversion"
    if miss["kind"] != "plane":
        return _direction(miss["direction"]), "", _turn(miss["kind"], miss["order"])
    offset = sum(n * x for n, x in zip(miss["direction"], miss["point"], strict=True))
    return *_mirror({"normal": miss["direction"], "offset": offset}, record), "mirror"


def _mirror(mirror: Record, record: Record) -> tuple[str, str]:
    return _direction(mirror["normal"]), _length(mirror["offset"], record)


def _elements(heads: Sequence[str], last: str, rows: Sequence[tuple[Sequence[str], Record]]) -> Table:
    """A line for each element: what it is, what it misses by, and how sure it is or how far beyond the limit."""
    table = _table(*heads, *_RESIDUALS, last)
    score = "excess" if last == "x limit" else "confidence"
    for named, element in rows:
        misses = [_percent(element["residual"][name]) for name in _RESIDUALS]
        table.add_row(*named, *misses, f"{element[score]:.2f}")
    return table


def _table(first: str, *others: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
    table.add_column(first, overflow="fold")
    for name in others:
        title = f"{name} %" if name in _RESIDUALS else name
        table.add_column(title, overflow="fold", justify="left" if name in _WORDS else "right")
    return table


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.3f}"


def _direction(values: list[float]) -> str:
    return " ".join(f"{round(v, 4) + 0.0:7.4f}" for v in values)


def _length(value: float, record: Record) -> str:
    """A length to about a hundred-thousandth of the diagonal."""
    diagonal = record["diagonal"]
    if not 1e-4 < diagonal < 1e6:
        return f"{value:.4e}"
    places = max(0, 4 - math.floor(math.log10(diagonal)))
    return f"{round(value, places) + 0.0:.{places}f}"


def _turn(kind: str, order: int | str) -> str:
    return "revolution" if order == "inf" else f"{kind_name(kind)} {order}"


def _seconds(record: Record) -> str:
    return f"{sum(record['timings'].values()):.2f}"


def _count(number: int, noun: str, plural: str = "") -> str:
    return f"{number} {noun if number == 1 else plural or noun + 's'}"
