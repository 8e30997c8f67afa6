"""Many rows summed up in one figure: "max worst_deg", "tally right", or a column that all rows share."""

import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from symrefine.study.document import Node
from symrefine.study.experiment import Row
from symrefine.study.typed import Scalar, scalar

EMPTY = "-"
_NUMBERS: Mapping[str, Callable[[Sequence[float]], float]] = {
    "mean": lambda v: float(np.mean(v)),
    "median": lambda v: float(np.median(v)),
    "min": min,
    "max": max,
    "sum": sum,
    "std": lambda v: float(np.std(v)),
    "p95": lambda v: float(np.percentile(v, 95)),
    "count": lambda v: float(len(v)),
    "share": lambda v: 100.0 * float(np.mean(v)),
    "tally": lambda v: 100.0 * float(np.mean(v)),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure:
    """How many values of which column become one figure; `how` is empty for a column that stands for itself."""

    how: str
    column: str
    node: Node

    @classmethod
    def read(cls, node: Node) -> "Measure":
        """Parse "AGGREGATE COLUMN" or "COLUMN".

        Raises:
            InputError: something else.
        """
        how, _, column = " ".join(scalar(node, str).split()).rpartition(" ")
        if not column or (how and how not in _NUMBERS):
            known = " ".join(_NUMBERS)
            raise node.error(f"expected COLUMN or AGGREGATE COLUMN with one of {known}, got {node.value!r}")
        return cls(how=how, column=column, node=node)


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """A figure as text, and the values it stands for: one, or the ends of a range; none for no rows.

    `total` is how many rows were counted, where the text tells a count; its value is the share in percent.
    """

    text: str
    values: tuple[Scalar, ...]
    total: int | None = None


def summarise(rows: Sequence[Row], measure: Measure) -> Summary:
    """Sum up what the rows that did not fail hold in a column.

    Raises:
        InputError: text where numbers are needed.
    """
    values = [v for row in rows if row["error"] is None and (v := row.get(measure.column)) is not None]
    if not values and measure.how not in ("sum", "count"):
        return Summary(text=EMPTY, values=())
    if not measure.how:
        return _shared(values)
    numbers = [float(v) for v in values if not isinstance(v, str)]
    if len(numbers) < len(values):
        raise measure.node.error(f"{measure.column} is text, such as {values[0]!r}; {measure.how} takes numbers")
    figure = float(_NUMBERS[measure.how](numbers))
    if measure.how == "tally":
        return Summary(text=f"{sum(numbers):.0f} of {len(numbers)}", values=(figure,), total=len(numbers))
    return Summary(text=short(figure) + (" %" if measure.how == "share" else ""), values=(figure,))


def _shared(values: Sequence[Scalar]) -> Summary:
    """The value that all share; else the ends of their range, or for text all of them."""
    if any(isinstance(v, str) for v in values):
        names = sorted({str(v) for v in values})
        return Summary(text=", ".join(names), values=tuple(names))
    ends = (min(values), max(values))
    if ends[0] == ends[1]:
        return Summary(text=short(ends[0]), values=ends[:1])
    return Summary(text=f"{short(ends[0])} to {short(ends[1])}", values=ends)


def short(value: Scalar | None) -> str:
    """A value for a reader: three significant digits, integers whole, yes and no."""
    if value is None:
        return EMPTY
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    if 1e3 <= abs(value) < 1e6 or (abs(value) < 1e12 and value == int(value)):
        return f"{value:.0f}"
    return f"{value:.4g}" if 10 <= abs(value) < 1e6 else f"{value:.3g}"


def check_columns(measures: Sequence[Measure], rows: Sequence[Row]) -> None:
    """Refuse columns that no row has; nothing can be said if every row failed.

    Raises:
        InputError: naming the columns that there are.
    """
    known = {name: None for row in rows if row["error"] is None for name in row}
    for measure in measures:
        if known and measure.column not in known:
            raise measure.node.error(f"no run has a result {measure.column!r}; there are {' '.join(known)}")


_COMPARED: Mapping[str, Callable[[float, float], bool]] = {
    ">=": operator.ge, "<=": operator.le, "==": operator.eq, ">": operator.gt, "<": operator.lt,
}  # fmt: skip
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"


@dataclass(frozen=True, slots=True, kw_only=True)
class Expectation:
    """What a figure must satisfy: comparisons with numbers, or being a text; `said` as in the config, "" if nothing."""

    said: str = ""
    comparisons: tuple[tuple[str, float], ...] = ()
    text: str = ""

    @classmethod
    def read(cls, node: Node) -> "Expectation":
        """Parse ">= 4", "== Cs", "0.4 to 0.6".

        Raises:
            InputError: something else.
        """
        said = scalar(node, str)
        if ends := re.fullmatch(rf"\s*({_NUMBER})\s+to\s+({_NUMBER})\s*", said):
            return cls(said=said, comparisons=((">=", float(ends[1])), ("<=", float(ends[2]))))
        if one := re.fullmatch(rf"\s*(>=|<=|==|<|>)\s*({_NUMBER})\s*", said):
            return cls(said=said, comparisons=((one[1], float(one[2])),))
        same = re.fullmatch(r"\s*==\s*(\S.*?)\s*", said)
        if said and not same:
            raise node.error(f"expected a comparison such as '>= 4', '== Cs' or '0.4 to 0.6', got {said!r}")
        return cls(said=said, text=same[1] if same else "")

    def holds(self, summary: Summary) -> bool:
        """Whether every value of the summary satisfies it; without values nothing does."""
        return bool(summary.values) and all(self._fits(v) for v in summary.values)

    def of(self, total: int | None) -> str:
        """What is expected, in counts where a number of rows is counted: "all", "at least 9 of 12"."""
        if total is None or self.text:
            return self.said
        counts = [k for k in range(total + 1) if self._fits(100.0 * k / total)]
        if not counts or counts != [*range(counts[0], counts[-1] + 1)]:
            return f"{self.said} %"
        least, most = counts[0], counts[-1]
        if least == most:
            return "all" if least == total else "none" if least == 0 else f"{least} of {total}"
        if most == total:
            return f"at least {least} of {total}"
        return f"at most {most} of {total}" if least == 0 else f"{least} to {most} of {total}"

    def _fits(self, value: Scalar) -> bool:
        if self.text:
            return str(value) == self.text
        return not isinstance(value, str) and all(_COMPARED[sign](value, to) for sign, to in self.comparisons)
