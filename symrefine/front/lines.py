"""A result in six lines, and as the card that a notebook shows; told from its record, whatever it is about."""

from collections import Counter
from collections.abc import Iterator, Sequence
from html import escape
from typing import Any

from symrefine.errors import printable
from symrefine.picture.words import order_name, percent, symbol

Record = dict[str, Any]
# Width of what a line is about, elements and alternatives that are told one by one, decimals of a direction.
LABEL, TOLD = 13, 4
# What a detection calls its mirrors, in space, in the plane, and beyond.
MIRRORS = ("planes", "lines", "hyperplanes")
# How a shape was made symmetric.
METHODS = {
    "vertices": "each is the mean of its counterparts",
    "orbits": "one sector moved onto the symmetric surface, and its copies",
    "surface": "the others lie on the symmetric surface, the triangles are as they were",
}


def summary(record: Record) -> list[str]:
    """A result in six lines, whatever it is: the answer, what there is to say of it, and what was asked."""
    if "matrix" in record:
        return list(_aligned(record))
    told = _made(record) if "found" in record else _completed(record) if "inferred" in record else _detected(record)
    painted = {"with texture": answer(record["textured"])} if record.get("textured") else {}
    lines = {**told, **painted, "asked": _asked(record)}
    return [
        f"{printable(record['source'])}: {answer(record)}",
        *(f"  {name:<{LABEL}}{text}" for name, text in lines.items()),
    ]


def _detected(record: Record) -> dict[str, str]:
    """Mirrors and turns, what else it may be, near misses."""
    return {
        "mirrors": _mirrors(record),
        "turns": _turns(record),
        "otherwise": _otherwise(record),
        "near misses": _near(record),
    }


def _made(record: Record) -> dict[str, str]:
    """What was made exact, how, how far points moved, and how exact it is."""
    out = f"; {record['outliers']:,} outliers left out" if record["outliers"] else ""
    return {
        "found": f"{symbol(record['found'])}, confidence {record['confidence']:.3f}",
        "points": f"{record['points']:,}, {percent(record['paired'])} of them paired; {METHODS[record['method']]}{out}",
        "moved": f"by {percent(record['largest'])} of the diagonal at most, {percent(record['rms'])} RMS",
        "result": f"misses itself by {record['residual']:.1e} of the diagonal",
    }


def _completed(record: Record) -> dict[str, str]:
    """What was seen, what was inferred from it, what speaks against it, and what was left out."""
    return {
        "seen": f"{record['seen']:,} points",
        "inferred": f"{record['inferred']:,} points where nobody looked",
        "against": f"{record['contradicted']:,} points have an image where the scan says that there is nothing",
        "left out": f"{record['outliers']:,} outliers",
    }


def answer(record: Record) -> str:
    """The answer with how sure it is, or why there is none."""
    if "found" in record:
        return f"{symbol(record['point_group'])}, {_how_exact(record)}"
    if record.get("undetermined"):
        return f"undetermined: {record['undetermined']}"
    if "hyperplanes" in record:
        order = record["reflection_group_order"]
        least = "at least " if record["incomplete"] else ""
        return f"{least}{len(record['hyperplanes'])} hyperplanes" + (f", a group of order {order}" if order else "")
    least = "at least " if record.get("at_least") else ""
    return f"{least}{symbol(record['point_group'])}, confidence {record['confidence']:.3f}"


def _how_exact(record: Record) -> str:
    """Whether all of a shape was made exact, or its vertices alone."""
    if record["method"] != "surface":
        return "made exact"
    between = percent(record["residual"])
    return f"vertices moved onto the symmetric surface; the triangles between them miss by {between}"


def mirrors(record: Record) -> Sequence[Record]:
    """The records of all mirrors of a detection: planes, lines or hyperplanes."""
    return next(record[name] for name in MIRRORS if name in record)


def _mirrors(record: Record) -> str:
    found = mirrors(record)
    worst = max((m["residual"]["p95"] for m in found if "residual" in m), default=None)
    return f"{len(found)}" + (
        "" if worst is None else f", 95 % of the surface within {percent(max(worst, 1e-5))} of the diagonal"
    )


def _turns(record: Record) -> str:
    if "hyperplanes" in record:
        return "not looked for"
    rotation = record.get("rotation")
    orders = Counter(_order(a) for a in record.get("axes", [rotation] if rotation else []))
    told = [f"{count} x {name}" if count > 1 else name for name, count in orders.items()]
    return ", ".join(told + ["inversion"] * bool(record.get("inversion"))) or "none"


def _order(axis: Record) -> str:
    return order_name(float(axis["order"]), bool(axis.get("improper")))


def _otherwise(record: Record) -> str:
    others = record.get("alternatives", [])
    told = [f"{symbol(a['point_group'])} {percent(a['probability'])}" for a in others[:TOLD]]
    return ", ".join(told + ["..."] * (len(others) > TOLD)) or "nothing else"


def _near(record: Record) -> str:
    missed = record.get("near_misses", record.get("rejected", []))
    if not missed:
        return "none"
    best = missed[0].get("excess")
    if best == "inf":
        return f"{len(missed)}, of which nothing tells that was seen"
    return str(len(missed)) + ("" if best is None else f", the best {best:.2g} times what the tolerance allows")


def _asked(record: Record) -> str:
    tolerance = record.get("tolerance", record["options"].get("tolerance"))
    out = record.get("outliers")
    sample = f", {out['count']:,} outliers" if isinstance(out, dict) and out["count"] else ""
    took = sum(record["timings"].values())
    whole = "diagonal" if "diagonal" in record else "diameter"
    return f"tolerance {percent(tolerance)} of the {whole}{sample}; {took:.2g} s"


def _aligned(record: Record) -> Iterator[str]:
    """The status, the map, and how well it holds."""
    yield f"{printable(record['source'])} onto {printable(record['target'])}: {record['status']}"
    yield from map_rows(record)
    met = " and ".join(percent(record["overlap"][side]) for side in ("source", "target"))
    hand = f"{handedness(record)}, confidence {record['confidence']:.3f}"
    holds = f"overlap {met}, rms {percent(record['rms'])} of the diagonal, scale {record['scale']:.6g}"
    yield from [f"  {hand}", f"  {holds}"] if len(record["matrix"]) < 3 else [f"  {hand}, {holds}"]
    observable = "everything" if record["observable"] == "full" else record["observable"]
    yield f"  determined: {observable}; {sum(record['timings'].values()):.2g} s"


def map_rows(record: Record) -> Iterator[str]:
    """The rows of the matrix of an alignment, each with its entry of the translation."""
    for row, shift in zip(record["matrix"], record["translation"], strict=True):
        yield f"  {' '.join(f'{x + 0.0:11.8f}' for x in row)}  |  {shift:.8g}"


def handedness(record: Record) -> str:
    """The determinant of an alignment, and what it means."""
    kind = "rotation" if record["determinant"] > 0 else "reflection or rotoreflection"
    return f"determinant {record['determinant']:+d} ({kind})"


def card(record: Record, picture: str) -> str:
    """HTML for a notebook: the picture (PNG in base64) if any, mirrors and turns or the matrix as a table, the rest."""
    if "matrix" in record:
        title, said = f"{record['source']} onto {record['target']}", escape(record["status"], quote=True)
        rows, told = _map_table(record), list(_aligned(record))[1 + len(record["matrix"]) :]
    else:
        title, said = record["source"], escape(answer(record), quote=True)
        detected = any(name in record for name in MIRRORS)
        rows, told = _table(record) if detected else "", summary(record)[3 if detected else 1 :]
    data = f'src="data:image/png;base64,{picture}" alt="{said}" style="max-width:600px"'
    shown = f"<img {data}>" if picture else ""
    lines = "<br>".join(escape(line) for line in told)
    return f"<div><p><b>{escape(title)}: {said}</b></p>{shown}{rows}<p>{lines}</p></div>"


def _map_table(record: Record) -> str:
    """HTML of the matrix of an alignment, its translation behind it."""
    body = "".join(
        f"<tr>{''.join(f'<td>{x + 0.0:.6f}</td>' for x in row)}<td>{shift:.6g}</td></tr>"
        for row, shift in zip(record["matrix"], record["translation"], strict=True)
    )
    return f"<table><tbody>{body}</tbody></table>"


def _table(record: Record) -> str:
    """HTML of a line for each mirror and turn."""
    head = "<tr><th>element</th><th>direction</th><th>offset</th><th>95 % within</th><th>confidence</th></tr>"
    rows = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in _rows(record))
    return f"<table><thead>{head}</thead><tbody>{rows}</tbody></table>"


def _rows(record: Record) -> Iterator[tuple[str, str, str, str, str]]:
    for m in mirrors(record):
        yield "mirror", _vector(m["normal"]), f"{m['offset']:.6g}", *_held(m)
    for a in record.get("axes", []):
        yield _order(a), _vector(a["direction"]), "", *_held(a)
    if record.get("rotation"):
        yield _order(record["rotation"]), "", "", *_held(record["rotation"])


def _held(element: Record) -> tuple[str, str]:
    if "residual" not in element:
        return percent(element["asymmetry"]) + " asymmetry", ""
    return percent(element["residual"]["p95"]), f"{element['confidence']:.3f}"


def _vector(values: Sequence[float]) -> str:
    return " ".join(f"{v:.4f}" for v in values)
