"""Rows of a PLY file: all of them, and nothing behind them."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrefine.errors import InputError
from symrefine.load.ply_header import Element, Header
from symrefine.load.text import Line, count, numbered_lines, parse_numbers, parse_table, shorten
from symrefine.shape import Index

Values = NDArray[Any]

_STRUCT = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q", "f4": "f", "f8": "d"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Column:
    """One property of all rows: a value each, or the lists one after the other and their lengths."""

    values: Values
    counts: Index | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rows:
    """Columns of one element by name, and for text the line of each row."""

    columns: dict[str, Column]
    lines: list[int] | None = None


def read_rows(data: bytes, header: Header) -> dict[str, Rows]:
    """Rows of every element of the header, by its name.

    Raises:
        InputError: fewer or more rows than declared, or rows that do not have the declared form.
    """
    return _read_binary(data, header) if header.byte_order else _read_text(data, header)


def _read_binary(data: bytes, header: Header) -> dict[str, Rows]:
    offset = header.size
    rows = {}
    for element in header.elements:
        table = _equal_rows(data, offset, element, header.byte_order)
        if table is not None:
            rows[element.name] = _columns(table, element)
            offset += table.nbytes
        elif element.has_lists:
            rows[element.name], offset = _unequal_rows(data, offset, element, header.byte_order)
        else:
            raise _cut_off(element, (len(data) - offset) // row_type(element, header.byte_order, []).itemsize)
    if offset != len(data):
        raise InputError(
            f"{count(len(data) - offset, 'byte')} behind {_declared(header)}; "
            "the counts in the header are wrong, or something was added to the file"
        )
    return rows


def _equal_rows(data: bytes, offset: int, element: Element, byte_order: str) -> NDArray[np.void] | None:
    """All rows at once if their lists are as long as those of the first, and if they are all there; else None."""
    lengths: list[int] = []
    for p in element.properties if element.count else []:
        if p.length_type:
            start = offset + row_type(element, byte_order, lengths, until=p.name).itemsize
            length = np.dtype(byte_order + p.length_type)
            if start + length.itemsize > len(data):
                return None
            lengths.append(int(np.frombuffer(data, length, count=1, offset=start)[0]))
            if not 0 <= lengths[-1] <= len(data):
                return None
    record = row_type(element, byte_order, lengths)
    if element.count * record.itemsize > len(data) - offset:
        return None
    table = np.frombuffer(data, record, count=element.count, offset=offset) if element.count else np.empty(0, record)
    lists = [p.name for p in element.properties if p.length_type]
    equal = all((table[_length(name)] == length).all() for name, length in zip(lists, lengths, strict=False))
    return table if equal else None


def row_type(element: Element, byte_order: str, lengths: list[int], until: str = "") -> np.dtype[np.void]:
    """Layout of a row, given the lengths of its lists; optionally of its part before one property."""
    fields: list[tuple[str, str, tuple[int, ...]]] = []
    remaining = iter(lengths)
    for p in element.properties:
        if p.name == until:
            break
        if p.length_type:
            fields.append((_length(p.name), byte_order + p.length_type, ()))
        fields.append((p.name, byte_order + p.type, (next(remaining, 0),) if p.length_type else ()))
    return np.dtype(fields)


def _length(name: str) -> str:
    return name + " length"  # names hold no space, so that it is free


def _columns(table: NDArray[np.void], element: Element) -> Rows:
    return Rows(
        columns={
            p.name: Column(values=table[p.name].ravel(), counts=table[_length(p.name)].astype(np.int64))
            if p.length_type
            else Column(values=table[p.name])
            for p in element.properties
        }
    )


def _unequal_rows(data: bytes, offset: int, element: Element, byte_order: str) -> tuple[Rows, int]:
    """Rows one by one, and where they end."""
    rows: list[list[tuple[float, ...]]] = []
    for row in range(element.count):
        rows.append([])
        try:
            for p in element.properties:
                size = 1
                if p.length_type:
                    (size,) = struct.unpack_from(byte_order + _STRUCT[p.length_type], data, offset)
                    offset += struct.calcsize(byte_order + _STRUCT[p.length_type])
                    if size < 0:
                        raise InputError(f"row {row} of element '{element.name}': list of length {size}")
                layout = f"{byte_order}{size}{_STRUCT[p.type]}"
                rows[-1].append(struct.unpack_from(layout, data, offset))
                offset += struct.calcsize(layout)
        except struct.error:
            raise _cut_off(element, row) from None
    return _rows(element, rows, None), offset


def _rows(element: Element, rows: Sequence[Sequence[Sequence[float]]], lines: list[int] | None) -> Rows:
    """Columns of rows that were read one by one, each with the values of every property."""
    columns = {}
    for k, p in enumerate(element.properties):
        parts = [row[k] for row in rows]
        counts = np.array([len(part) for part in parts], dtype=np.int64) if p.length_type else None
        columns[p.name] = Column(values=np.array([value for part in parts for value in part]), counts=counts)
    return Rows(columns=columns, lines=lines)


def _read_text(data: bytes, header: Header) -> dict[str, Rows]:
    lines = [(number + header.lines, text) for number, text in numbered_lines(data[header.size :])]
    rows = {}
    start = 0
    for element in header.elements:
        part = lines[start : start + element.count]
        rows[element.name] = _text_rows(part, element)
        # After the rows themselves: where one count is too large, the first row of the wrong form says more.
        if len(part) < element.count:
            raise _cut_off(element, len(part))
        start += element.count
    if start < len(lines):
        raise InputError(
            f"line {lines[start][0]}: {shorten(lines[start][1])} behind {_declared(header)}; "
            "the counts in the header are wrong, or something was added to the file"
        )
    return rows


def _text_rows(lines: list[Line], element: Element) -> Rows:
    names = " ".join(f"LENGTH {p.name}..." if p.length_type else p.name for p in element.properties)
    layout = f"a row of element '{element.name}': {names}"
    numbers = [number for number, _ in lines]
    if not element.has_lists:
        table = parse_table(lines, columns=(len(element.properties),), layout=layout)
        columns = {p.name: Column(values=table[:, k]) for k, p in enumerate(element.properties)}
        return Rows(columns=columns, lines=numbers)
    rows = []
    for line in lines:
        rows.append(_split(parse_numbers(line, layout), element))
        if len(rows[-1]) != len(element.properties):
            raise InputError(f"line {line[0]}: {shorten(line[1])}; expected {layout}")
    return _rows(element, rows, numbers)


def _split(numbers: list[float], element: Element) -> list[list[float]]:
    """Values of each property in a row; too few or too many parts if the row has not the form of the element."""
    parts: list[list[float]] = []
    position = 0
    for p in element.properties:
        size = 1.0
        if p.length_type:
            size = numbers[position] if position < len(numbers) else -1.0
            position += 1
        if not (size.is_integer() and 0 <= size <= len(numbers) - position):
            return []
        parts.append(numbers[position : position + int(size)])
        position += int(size)
    return parts if position == len(numbers) else [*parts, numbers[position:]]


def _cut_off(element: Element, rows: int) -> InputError:
    return InputError(
        f"cut off in element '{element.name}': the header declares {count(element.count, 'row')}, "
        f"only {rows} {'is' if rows == 1 else 'are'} there"
    )


def _declared(header: Header) -> str:
    return "the " + " and ".join(f"{e.count} {e.name}" for e in header.elements) + " rows that the header declares"
