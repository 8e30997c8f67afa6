"""A result in six lines, and as the card that a notebook shows; told from its record, whatever it is about."""

from collections import Counter
from collections.abc import Iterator, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from symrefine.picture.words import order_name, percent, symbol
from symrefine.shape import Shape

if TYPE_CHECKING:
    from symrefine.align.alignment import Alignment

Record = dict[str, Any]
# Width of what a line is about, elements and alternatives that are told one by one, decimals of a direction.
LABEL, TOLD = 12, 4


def summary(record: Record) -> list[str]:
    """Six lines: the answer, its mirrors and turns, what else it may be, near misses, and what was asked."""
    told = {
        "mirrors": _mirrors(record),
        "turns": _turns(record),
        "otherwise": _otherwise(record),
        "near misses": _near(record),
        "asked": _asked(record),
    }
    return [f"{record['source']}: {answer(record)}", *(f"  {name:<{LABEL}}{text}" for name, text in told.items())]


def answer(record: Record) -> str:
    """The answer with how sure it is, or why there is none."""
    if record["undetermined"]:
        return f"undetermined: {record['undetermined']}"
    if "hyperplanes" in record:
        order = record["reflection_group_order"]
        least = "at least " if record["incomplete"] else ""
        return f"{least}{len(record['hyperplanes'])} hyperplanes" + (f", a group of order {order}" if order else "")
    least = "at least " if record.get("at_least") else ""
    return f"{least}{symbol(record['point_group'])}, confidence {record['confidence']:.3f}"


def mirrors(record: Record) -> Sequence[Record]:
    """The records of all mirrors: planes, lines or hyperplanes."""
    return next(record[name] for name in ("planes", "lines", "hyperplanes") if name in record)


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
    told = [f"{symbol(a['point_group'])} {100 * a['probability']:.2g} %" for a in others[:TOLD]]
    return ", ".join(told + ["..."] * (len(others) > TOLD)) or "nothing else"


def _near(record: Record) -> str:
    missed = record.get("near_misses", record.get("rejected", []))
    if not missed:
        return "none"
    best = missed[0].get("excess")
    return str(len(missed)) + ("" if best is None else f", the best {best:.2g} times what the tolerance allows")


def _asked(record: Record) -> str:
    tolerance = record.get("tolerance", record["options"].get("tolerance"))
    sample = f", {record['outliers']['count']:,} outliers" if record.get("outliers", {}).get("count") else ""
    took = sum(record["timings"].values())
    whole = "diagonal" if "diagonal" in record else "diameter"
    return f"tolerance {percent(tolerance)} of the {whole}{sample}; {took:.2g} s"


def alignment_summary(found: "Alignment", source: Shape, target: Shape) -> list[str]:
    """The status, the map, and how well it holds."""
    rows = zip(found.matrix.tolist(), found.translation.tolist(), strict=True)
    kind = "rotation" if found.determinant > 0 else "reflection or rotoreflection"
    met = " and ".join(f"{100 * share:.0f} %" for share in found.overlap)
    return [
        f"{source.source} onto {target.source}: {found.status}",
        *(f"  {' '.join(f'{x + 0.0:11.8f}' for x in row)}  |  {shift:.8g}" for row, shift in rows),
        f"  determinant {found.determinant:+d} ({kind}), confidence {found.confidence:.3f}, overlap {met}",
        f"  rms {percent(found.rms)} of the diagonal, scale {found.scale:.6g}; {sum(found.timings.values()):.2g} s",
    ]


def card(record: Record, picture: str) -> str:
    """HTML for a notebook: the picture (PNG in base64) and a table of mirrors and turns."""
    head = "<tr><th>element</th><th>direction</th><th>offset</th><th>95 % within</th><th>confidence</th></tr>"
    rows = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in _rows(record))
    said = escape(answer(record), quote=True)
    told = "<br>".join(escape(line) for line in summary(record)[3:])
    return (
        f"<div><p><b>{escape(record['source'])}: {said}</b></p>"
        f'<img src="data:image/png;base64,{picture}" alt="{said}" style="max-width:600px">'
        f"<table><thead>{head}</thead><tbody>{rows}</tbody></table><p>{told}</p></div>"
    )


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
