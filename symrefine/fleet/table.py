"""Rows as a flat table, in CSV or Parquet: the same rows give the same bytes."""

import csv
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from symrefine.errors import InputError

FORMATS = (".csv", ".parquet")


def csv_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows as CSV: every column that any row has, in order of appearance; no value is an empty field."""
    columns = columns_of(rows)
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    values = [[row.get(name) for name in columns] for row in rows]
    writer.writerows([str(v).lower() if isinstance(v, bool) else v for v in row] for row in values)
    return stream.getvalue()


def columns_of(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Every column that any row has, in order of appearance."""
    return list({name: None for row in rows for name in row})


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
    """Refuse a table in another format.

    Raises:
        InputError: naming those that there are.
    """
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"{path}: expected the name of a table that ends in {' or '.join(FORMATS)}")


def write_table(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write flat rows in the format of the name; Parquet columns are whole numbers, numbers, truth values or texts."""
    if path.suffix.lower() == ".csv":
        path.write_text(csv_text(rows), encoding="utf-8", newline="")
        return
    from pyarrow import Table
    from pyarrow.parquet import write_table as write_parquet

    write_parquet(
        Table.from_pydict({name: _column([row.get(name) for row in rows]) for name in columns_of(rows)}), path
    )


def _column(values: Sequence[Any]) -> Any:
    """A column of one type: that of its values, a number where there are whole and other ones, else text."""
    import pyarrow as pa

    kinds = {type(value) for value in values if value is not None}
    if kinds == {bool}:
        return pa.array(values, pa.bool_())
    if kinds == {int}:
        return pa.array(values, pa.int64())
    if kinds and kinds <= {int, float}:
        return pa.array(values, pa.float64())
    texts = [value if value is None or isinstance(value, str) else json.dumps(value) for value in values]
    return pa.array(texts, pa.string())
