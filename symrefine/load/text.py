"""Text files: numbered lines, and tables of numbers in which no line is skipped or repaired."""

import re
from collections.abc import Collection, Iterator, Sequence

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array

# One line of a file: its number, counted from 1, and its text without the white space around it.
Line = tuple[int, str]

# Eighteen digits fit into int64; Python itself refuses to convert thousands of them.
INTEGER = re.compile(r"[+-]?[0-9]{1,18}")
NATURAL = re.compile(r"[0-9]{1,18}")
# White space of another kind than tabs between entries.
_SPACED = re.compile(r"[^\t ] +[^\t ]")


def all_lines(data: bytes) -> Iterator[Line]:
    """Every line as it stands, empty ones too, without the white space behind it.

    Raises:
        InputError: bytes that no text file holds.
    """
    if b"\0" in data:
        raise InputError(f"not a text file: zero byte at offset {data.index(0)}")
    # Names and remarks may be in any encoding; a number that is not ASCII is refused where it is parsed.
    text = data.decode("utf-8-sig", errors="replace").replace("\r\n", "\n").replace("\r", "\n")
    return ((number, line.rstrip()) for number, line in enumerate(text.split("\n"), start=1))


def numbered_lines(data: bytes, *, comment: str | None = None, tabs: bool = False) -> list[Line]:
    """Lines that hold something; `comment` begins a remark that lasts to the end of its line.

    Args:
        tabs: keep tabs at the beginning of a line, where an empty entry may stand.

    Raises:
        InputError: as for `all_lines`.
    """
    lines = all_lines(data)
    if comment is not None:
        lines = ((number, line.partition(comment)[0].rstrip()) for number, line in lines)
    return [(number, line.lstrip(" " if tabs else None)) for number, line in lines if line]


def split_lines(data: bytes) -> tuple[list[Line], str | None]:
    """Lines of a table without its remarks, and what separates columns: `;`, `,`, a tab, or None for white space.

    The first line decides: semicolons before commas, and commas before tabs, but for commas in entries between tabs,
    which may be decimal. Between tabs an entry may be empty.

    Raises:
        InputError: no text, or a first line with both tabs and commas between entries.
    """
    lines = numbered_lines(data, comment="#", tabs=True)
    first = lines[0][1] if lines else ""
    stripped = [(number, text.strip()) for number, text in lines]
    if ";" in first:
        return stripped, ";"
    if "," in first:
        if any("\t" in field.strip() for field in first.split(",")):
            raise InputError(
                f"line {lines[0][0]}: {shorten(first)} has tabs and commas; expected one of them between columns, and "
                "points in decimals (commas, where semicolons separate columns)"
            )
        return stripped, ","
    if "\t" not in first.strip() or any(" " in text and _SPACED.search(text) for _, text in lines[1:]):
        return stripped, None
    return (stripped if all(text.startswith("\t") for _, text in lines) else lines), "\t"


def with_points(lines: Sequence[Line]) -> list[Line]:
    """Lines between semicolons with a point in decimals that have a comma.

    Raises:
        InputError: commas in one entry and points in another, or both in one: neither can be told from a separator of
            thousands.
    """
    comma = next((line for line in lines if "," in line[1]), None)
    point = next((line for line in lines if "." in line[1]), None)
    if comma is not None and point is not None:
        raise InputError(
            f"line {comma[0]} has commas in decimals, line {point[0]} points; expected one of them, and no separators "
            "of thousands"
        )
    return [(number, text.replace(",", ".")) for number, text in lines] if comma is not None else list(lines)


def parse_table(lines: Sequence[Line], *, columns: Collection[int], layout: str, delimiter: str | None = None) -> Array:
    """Rows of numbers as [N, n] float64, each as precise as it is written.

    Args:
        columns: numbers of columns that are right; any, if empty, as long as all rows agree.
        layout: what would be right, for messages.
        delimiter: between the columns; white space if None.

    Raises:
        InputError: a row of another length or an entry that is not a number, with line and column.
    """
    if not lines:
        return np.empty((0, max(columns, default=0)))
    fault: object = "an empty row"
    try:
        if all(text for _, text in lines):  # NumPy would leave an empty row out
            table = np.loadtxt([text for _, text in lines], comments=None, delimiter=delimiter, ndmin=2)
            if not columns or table.shape[1] in columns:
                return table
    except ValueError as error:
        fault = error
    # NumPy counts rows, not lines, and stops at the first fault of any kind: look again, slowly, for a message.
    _explain(lines, columns, layout, delimiter)
    raise InputError(f"{fault}; expected {layout}")


def parse_integers(line: Line, what: str) -> list[int]:
    """All entries of a line as whole numbers."""
    number, text = line
    fields = text.split()
    for field in fields:
        if not INTEGER.fullmatch(field):
            raise InputError(f"line {number}: {shorten(field)} is not a whole number; expected {what}")
    return [int(field) for field in fields]


def parse_numbers(line: Line, layout: str) -> list[float]:
    """All entries of a line, for rows that differ in length."""
    number, text = line
    fields = text.split()
    try:
        if "_" not in text and text.isascii():
            return [float(field) for field in fields]
    except ValueError:
        pass
    wrong = ((k, field) for k, field in enumerate(fields, start=1) if not is_number(field))
    column, field = next(wrong, (1, text))  # all are numbers where white space between them is none of ASCII
    raise InputError(f"line {number}, column {column}: {shorten(field)} is not a number; expected {layout}")


def shorten(text: str, limit: int = 40) -> str:
    """Quotation of at most `limit` characters, in ASCII: it may be garbage and must stay on one line."""
    return ascii(text if len(text) <= limit else text[: limit - 3] + "...")


def _explain(lines: Sequence[Line], columns: Collection[int], layout: str, delimiter: str | None) -> None:
    width = 0
    for number, text in lines:
        fields = [field.strip() for field in text.split(delimiter)]
        for column, field in enumerate(fields, start=1):
            if not is_number(field):
                raise InputError(
                    f"line {number}, column {column}: {shorten(field)} is not a number; expected {layout}"
                    f"{separators(text, delimiter)}"
                )
        if columns and len(fields) not in columns:
            raise InputError(f"line {number} has {count(len(fields), 'column')}; expected {layout}")
        if width and len(fields) != width:
            raise InputError(
                f"line {number} has {count(len(fields), 'column')}, the lines above have {width}; expected {layout}"
            )
        width = len(fields)


def separators(text: str, delimiter: str | None) -> str:
    """What a row of a table has between its columns instead of what belongs there, to end a message with."""
    if ";" in text and delimiter != ";":
        return "; semicolons separate columns of .csv and .txt only, from the first line on"
    if "," in text and delimiter is None:
        return "; commas separate columns of .csv and .txt only, from the first line on, and decimals have a point"
    return ""


def count(number: int, noun: str) -> str:
    """`1 column`, `2 columns`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def is_number(field: str) -> bool:
    """Whether NumPy reads it as a number."""
    try:
        float(field)
    except ValueError:
        return False
    # Python reads 1_000 and digits of other scripts; NumPy and every other program that reads such files do not.
    return field.isascii() and "_" not in field
