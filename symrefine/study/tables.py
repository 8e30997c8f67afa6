"""Rows as Markdown tables."""

from collections.abc import Sequence

from symrefine.study.experiment import Experiment, Row
from symrefine.study.plan import chosen
from symrefine.study.schema import Study, Table
from symrefine.study.summary import Measure, short, summarise
from symrefine.study.typed import Scalar


def check_tables(study: Study, experiment: Experiment) -> list[Measure]:
    """The measures of all tables.

    Raises:
        InputError: fields that do not exist.
    """
    for table in study.tables:
        for i, name in enumerate(table.groups):
            experiment.field(name, table.node.at("groups", i))
    return [measure for table in study.tables for measure in table.values.values()]


def markdown(table: Table, rows: Sequence[Row], experiment: Experiment) -> str:
    """A table under its title, with the number of runs that failed."""
    needed = [*table.groups, *(measure.column for measure in table.values.values())]
    picked = chosen(rows, [table.where], experiment, needed)
    # In the order in which the sweep came upon them.
    groups: dict[tuple[Scalar | None, ...], list[Row]] = {}
    for row in picked:
        groups.setdefault(tuple(row[name] for name in table.groups), []).append(row)
    lines = [
        [*map(short, key), *(summarise(members, m).text for m in table.values.values()), str(len(members))]
        for key, members in groups.items()
    ]
    failed = sum(row["error"] is not None for row in picked)
    note = f"\n{failed} of {len(picked)} runs failed and are left out of the figures.\n" if failed else ""
    return f"## {table.title}\n\n{grid([*table.groups, *table.values, 'runs'], lines)}{note}"


def grid(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    rows = [head, ["---"] * len(head), *lines]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |\n" for row in rows)
