"""Rows as a flat table, in CSV or Parquet: the same rows give the same bytes, and few of them are ever held."""

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symrefine.errors import InputError

if TYPE_CHECKING:
    from pyarrow import DataType

FORMATS = (".csv", ".parquet")
# Rows of a row group of Parquet, which are held together: some 50 MB of the widest.
_GROUP = 4096
_LARGEST_INT64 = 2**63 - 1
# A column that rows of every kind have, and characters of a head at most.
_EVERYWHERE, _LONGEST = "error", 2**16


def flat(row: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """A row without what is nested: `options.seed` for a mapping in it, and JSON for a list."""
    return dict(_flat(row, prefix))


def _flat(row: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    for name, value in row.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", json.dumps(value) if isinstance(value, list | tuple) else value


def check_table(path: Path) -> None:
    """Refuse a table in another format, or in place of a file that holds no rows, such as somebody's cloud.

    Raises:
        InputError: naming the formats that there are, or the file.
    """
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"{path}: expected the name of a table that ends in {' or '.join(FORMATS)}")
    if path.is_file() and path.stat().st_size and _EVERYWHERE not in _columns(path):
        raise InputError(f"{path}: is there already and holds no rows of symrefine; name another file")


def _columns(path: Path) -> list[str]:
    """The names of the columns of a table that is there; none if it is no such table."""
    if path.suffix.lower() == ".csv":
        with path.open(encoding="utf-8", errors="replace", newline="") as stream:
            return next(csv.reader([stream.readline(_LONGEST)]), [])
    from pyarrow import ArrowException
    from pyarrow.parquet import read_schema

    try:
        return list(read_schema(path).names)
    except (ArrowException, OSError):
        return []


def write_table(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write flat rows in the format of the name: every column that any row has, in order of appearance.

    In CSV no value is an empty field; Parquet columns are whole numbers, numbers, truth values or texts.

    Args:
        rows: are asked for twice, one after the other.
    """
    (_write_csv if path.suffix.lower() == ".csv" else _write_parquet)(rows, path)


def _write_csv(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    columns = list({name: None for row in rows for name in row})
    with path.open("w", encoding="utf-8", errors="backslashreplace", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        values = ([row.get(name) for name in columns] for row in rows)
        writer.writerows([str(v).lower() if isinstance(v, bool) else v for v in row] for row in values)


def _write_parquet(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    import pyarrow as pa
    from pyarrow.parquet import ParquetWriter

    schema = pa.schema([(name, _type(kinds)) for name, kinds in _kinds(rows).items()])
    with ParquetWriter(path, schema) as writer:
        for start in range(0, max(len(rows), 1), _GROUP):
            group = rows[start : start + _GROUP]
            columns = [_column([row.get(field.name) for row in group], field.type) for field in schema]
            writer.write_table(pa.Table.from_arrays(columns, schema=schema))


def _kinds(rows: Sequence[Mapping[str, Any]]) -> dict[str, set[type]]:
    """The types of the values of each column, in order of appearance; a whole number of more than 64 bits is a text."""
    kinds: dict[str, set[type]] = {}
    for row in rows:
        for name, value in row.items():
            known = kinds.setdefault(name, set())
            if value is not None:
                known.add(str if type(value) is int and abs(value) > _LARGEST_INT64 else type(value))
    return kinds


def _type(kinds: set[type]) -> "DataType":
    """Of a column: that of its values, a number where there are whole and other ones, else text."""
    import pyarrow as pa

    if kinds == {bool}:
        return pa.bool_()
    if kinds == {int}:
        return pa.int64()
    return pa.float64() if kinds and kinds <= {int, float} else pa.string()


def _column(values: Sequence[Any], kind: "DataType") -> Any:
    import pyarrow as pa

    if kind == pa.float64():
        return pa.array([None if value is None else float(value) for value in values], kind)
    if kind != pa.string():
        return pa.array(values, kind)
    return pa.array([None if value is None else _text(value) for value in values], kind)


def _text(value: Any) -> str:
    """A value as text in UTF-8, as names of files that hold other bytes are none."""
    text = value if isinstance(value, str) else json.dumps(value)
    return text if text.isascii() else text.encode("utf-8", "backslashreplace").decode("utf-8")
