"""What a person reads: the JSON record of a detection or of an alignment, as tables."""

import math
from collections.abc import Iterator, Sequence
from itertools import compress, groupby
from typing import Any

from rich.table import Table

from symrefine.cli.rows import inversions, percentage, seconds
from symrefine.front.lines import handedness, map_rows
from symrefine.groups import point_group
from symrefine.picture.rows import Said, kept, said_of
from symrefine.picture.words import (
    DOUBLETS,
    NO_FLOOR,
    TUPLES,
    all_turned_down,
    elsewhere,
    evened,
    exactly,
    exceeds,
    kind_name,
    meaning,
    more_for,
    planar_meaning,
    sampled,
    taken_out,
    turns_name,
)

Record = dict[str, Any]

_RESIDUALS = ("mean", "p95", "max")
_WORDS = ("kind",)


def record_lines(record: Record) -> Iterator[Table | str]:
    """Everything to be said about a detection in any dimension, or an alignment."""
    if "matrix" in record:
        return alignment_lines(record)
    tell = planar_lines if "lines" in record else hyperplane_lines if "hyperplanes" in record else detection_lines
    return tell(record)


def detection_lines(record: Record) -> Iterator[Table | str]:
    """Everything a table can say about one detection."""
    yield f"{record['source']}: {headline(record)}"
    yield from textured(record)
    yield f"n-tuples {TUPLES[record['ntuples']['kind']]}"
    yield _place(record)
    if record["exact"]:
        yield exactly(record["exact"]["miss"], record["exact"]["faces"], record["exact"]["point_group"])
    if record["classes"]:
        yield f"labels: {_count(record['classes']['count'], 'class', 'classes')}"
    out, sample = record["outliers"], record["sample"]
    of = None if sample is None else (sample["points"], sample["of"])
    yield from filter(
        None,
        (
            taken_out(out["count"], out["share"], out["clumps"], floor=out["floor"] is not None),
            NO_FLOOR if record["options"].get("outliers") == "floor" and out["floor"] is None else "",
            sampled(of),
            evened(record["even_sample"]),
        ),
    )
    if record["at_least"]:
        yield partial(record)
    yield from _apart(*_spatial(record))
    yield ""
    if record["verified"]:
        yield _verified(record["verified"])
    if record["planes"] or record["axes"] or record["inversion"] or record["near_misses"]:
        yield "Offsets in units of the file, misses in % of the diagonal; axes go through the centre."
    if record["near_misses"]:
        yield from all_turned_down([float(miss["excess"]) for miss in record["near_misses"]], record["point_group"])
    each = [e["confidence"] for e in (*record["planes"], *record["axes"])]
    if told := elsewhere(record["point_group"], record["confidence"], each):
        yield told
    if record["alternatives"]:
        yield f"It may be meant otherwise: {otherwise(record)}."
    if record["staircase"]:
        yield f"Group by tolerance: {staircase(record)}"
    yield f"{_count(record['iterations'], 'iteration')}, {seconds(record)} s"


def _verified(said: Record) -> str:
    """What all points say, one by one."""
    misses = ", ".join(f"{name} {100 * said['residual'][name]:.3f}" for name in _RESIDUALS)
    return (
        f"All {said['points']:,} points, with their noise, moved by the worst element: {misses} %; "
        f"{said['beyond']:,} miss by more than any point may."
    )


def partial(record: Record) -> str:
    """What was not seen, and what of the surface speaks for what was found."""
    more = more_for(strewn=record["strewn"], sparse=record["sparse"])
    seen = [e["coverage"] for e in (*record["planes"], *record["axes"])]
    if record["strewn"] or record["sparse"] or not seen:
        return more
    most = max(seen, key=lambda c: c["unseen"])
    told = (
        f"{more}; at least {100 * min(c['supported'] for c in seen):.0f} % of what was seen supports each element, "
        f"at most {100 * max(c['contradicted'] for c in seen):.2g} % contradicts it"
    )
    if not most["unseen"]:
        return told
    return f"{told}, up to {100 * most['unseen']:.0f} % has its image where nobody looked"


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
    means = _in_the_plane(record) if "lines" in record else meaning(point_group(name))
    name = f"at least {name}" if record.get("at_least") else name
    return f"{name}, {means}; tolerance {_tolerance(record)}, confidence {record['confidence']:.2f}"


def _tolerance(record: Record) -> str:
    """The tolerance as a fraction of the diagonal, and as the length that was asked for, if it was one."""
    asked, relative = record["options"]["tolerance"], 100 * record["tolerance"]
    return f"{asked}, {relative:.3g} %" if isinstance(asked, str) else f"{relative:g} %"


def _in_the_plane(record: Record) -> str:
    rotation = record["rotation"]
    turns = float(rotation["order"]) if rotation else None
    return planar_meaning(record["point_group"], len(record["lines"]), turns)


def otherwise(record: Record) -> str:
    """The groups it may be instead, and what of the diagonal they forgive: `C1 (7 %); D4h (5 %), forgiving 3 %`."""
    return "; ".join(
        f"{a['point_group']} ({100 * a['probability']:.0f} %)"
        + (f", forgiving {100 * a['forgiven']:.2g} %" if a["forgiven"] else "")
        for a in record["alternatives"]
    )


def textured(record: Record) -> Iterator[str]:
    """What the texture keeps of the group, where one was read."""
    if kept := record.get("textured"):
        sure = "" if kept["undetermined"] else f", confidence {kept['confidence']:.2f}"
        others = f"; or {otherwise(kept)}" if kept["alternatives"] else ""
        name = f"undetermined: {kept['undetermined']}" if kept["undetermined"] else kept["point_group"]
        yield f"with its texture: {name}{sure}{others}"


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
        yield from all_turned_down([miss["excess"] for miss in record["near_misses"]], record["point_group"])
    yield f"{seconds(record)} s"


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
        from symrefine.picture.words import generated

        yield generated(len(found), order)
    if record["incomplete"]:
        yield f"there may be more: {record['incomplete']}"
    yield f"n-tuples of rank {record['ntuples']['rank']}; turns are not looked for in {dim} dimensions"
    titled = {"hyperplanes: normal": found, "turned down: normal": record["rejected"]}
    yield from _apart(*(_hyperplanes(title, candidates, record) for title, candidates in titled.items()))
    yield ""
    yield "Offsets in units of the file, asymmetry and noise in % of the moments, largest miss in % of the diameter."
    yield f"{seconds(record)} s"


def _hyperplanes(title: str, candidates: Sequence[Record], record: Record) -> Table:
    table = _table(title, "offset", "asymmetry", "noise", "largest miss")
    for h in candidates:
        miss = "" if h["miss"] is None else percentage(h["miss"])
        table.add_row(
            *_mirror(h, {"diagonal": record["diameter"]}), percentage(h["asymmetry"]), percentage(h["noise"]), miss
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
    yield from map_rows(record)
    yield ""
    scale = "" if record["scale"] == 1.0 else f", scale {record['scale']:.8g}"
    yield f"matrix | translation in units of the target; {handedness(record)}{scale}"
    distance = f"rms distance {percentage(record['rms'])} % of the diagonal"
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
    yield f"{seconds(record)} s"


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


def _spatial(record: Record) -> Iterator[Table]:
    """Planes, axes, the inversion and near misses of a detection in space."""
    marks = _kept(record)
    planes = [(_mirror(p, record), p) for p in record["planes"]]
    yield _elements(("mirror planes: normal", "offset"), "confidence", planes, marks[: len(planes)])
    axes = [(_axis(a), a) for a in record["axes"]]
    yield _elements(("axes: direction", "kind"), "confidence", axes, marks[len(planes) :])
    inversion = [(("about the centre",), found) for found in inversions(record)]
    yield _elements(
        ("inversion",), "confidence", inversion, marks and ["kept" if record["textured"]["inversion"] else ""]
    )
    if record.get("textured"):
        yield from _only_textured(record)
    near = [(_near(m, record), m) for m in record["near_misses"]]
    yield _elements(("near misses: direction", "offset", "kind"), "x limit", near)


def _said(record: Record) -> list[Said]:
    """Planes and axes of a record, or of what of them is told with a texture."""
    turns = ((a["direction"], float(a["order"]), a["improper"]) for a in record["axes"])
    return said_of((p["normal"] for p in record["planes"]), turns)


def _kept(record: Record) -> list[str]:
    """What the texture keeps of each plane and axis; nothing where no texture was read or nothing is decided."""
    told = record.get("textured")
    if not told or told["undetermined"]:
        return []
    textured = _said(told)
    return [kept(one, textured) for one in _said(record)]


def _only_textured(record: Record) -> Iterator[Table]:
    """What the texture keeps of endless planes and axes, which are no rows of their own."""
    told, own = record["textured"], _said(record)
    alone = [not kept(one, own) for one in _said(told)]
    planes = [(_mirror(p, record), p) for p in compress(told["planes"], alone)]
    yield _elements(("with its texture: normal", "offset"), "confidence", planes)
    axes = [(_axis(a), a) for a in compress(told["axes"], alone[len(told["planes"]) :])]
    yield _elements(("with its texture: axis", "kind"), "confidence", axes)


def _axis(axis: Record) -> tuple[str, str]:
    """Where an axis points, and what it turns by."""
    return _direction(axis["direction"]), _turn("improper" if axis["improper"] else "axis", axis["order"])


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


def _elements(
    heads: Sequence[str], last: str, rows: Sequence[tuple[Sequence[str], Record]], marks: Sequence[str] = ()
) -> Table:
    """A line for each element: what it is, what it misses by, and how sure it is or how far beyond the limit.

    With `marks`, one for each, also what its texture keeps of it.
    """
    table = _table(*heads, *_RESIDUALS, last, *(["texture"] if marks else []))
    score, shown = ("excess", exceeds) if last == "x limit" else ("confidence", "{:.2f}".format)
    for k, (named, element) in enumerate(rows):
        misses = [percentage(element["residual"][name]) for name in _RESIDUALS]
        table.add_row(*named, *misses, shown(float(element[score])), *marks[k : k + 1])
    return table


def _table(first: str, *others: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
    table.add_column(first, overflow="fold")
    for name in others:
        title = f"{name} %" if name in _RESIDUALS else name
        table.add_column(title, overflow="fold", justify="left" if name in _WORDS else "right")
    return table


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


def _count(number: int, noun: str, plural: str = "") -> str:
    return f"{number} {noun if number == 1 else plural or noun + 's'}"
