"""From a config to the cases that are to be run, each checked before anything is."""

import hashlib
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, fields
from itertools import product
from pathlib import Path
from typing import Any

from symrefine.errors import InputError, meant
from symrefine.study.document import Node, override, put, read_document
from symrefine.study.experiment import Experiment, Row, find_root, load_experiment
from symrefine.study.schema import NOTHING, Study
from symrefine.study.typed import mapping, scalar, typed

_MANY = 100_000
_EXPERIMENT = re.compile(rb"^experiment:", re.MULTILINE)
# For those who have none.
_WHAT = (
    "configs are YAML files with a key `experiment`, the name of a module with `Case` and `run`; examples are in the "
    "directories configs and experiments/studies of symrefine's repository"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A study ready to run.

    Attributes:
        study: the config, with what the command line put in.
        cases: instances of the experiment's `Case`, in the order of the sweep.
        config_hash: of the experiment's name and all cases: what decides the rows.
        changed: whether the quick version or the command line changed the config.
    """

    study: Study
    experiment: Experiment
    cases: Sequence[Any]
    config_hash: str
    changed: bool


def make_plan(path: Path, settings: Sequence[str] = (), *, quick: bool = False) -> Plan:
    """Read a config, put in its quick version and what the command line sets, and list the cases.

    Args:
        settings: `KEY.KEY=VALUE`, applied after the quick version.
        quick: whether the config's `quick` section is applied.

    Raises:
        InputError: whatever is wrong, with file, line and key path.
    """
    if path.is_dir():
        raise InputError(f"{path}: is a directory; expected a config (`symrefine run --list {path}` names those in it)")
    if not path.is_file():
        raise InputError(f"{path}: no such config file; {_elsewhere(path)}")
    root = read_document(path)
    if quick:
        section = root.value.get("quick", NOTHING) if isinstance(root.value, dict) else NOTHING
        for key, node in mapping(section).items():
            root = put(root, key.split("."), node, f"{node.place}: {node.path}")
    root = override(root, settings)
    if isinstance(root.value, dict) and "experiment" not in root.value:
        for key in root.value:
            if close := meant(key, ["experiment"]):
                raise root.at(key).error(f"unknown key{close}")
        raise root.error(f"missing experiment, so `symrefine run` can do nothing with it; {_elsewhere(path)}")
    study: Study = typed(root, Study)
    name = root.at("experiment")
    if not all(part.isidentifier() for part in study.experiment.split(".")):
        raise name.error(
            f"expected the name of a Python module such as experiments.studies.planes, got {study.experiment!r}"
        )
    try:
        experiment = load_experiment(study.experiment, find_root(study.experiment, path.parent))
    except InputError as error:
        raise name.error(str(error)) from None
    cases = list(_cases(study, experiment))
    content = json.dumps([experiment.name, [asdict(case) for case in cases]], sort_keys=True)
    return Plan(
        study=study,
        experiment=experiment,
        cases=cases,
        config_hash=hashlib.sha256(content.encode()).hexdigest()[:12],
        changed=bool(settings) or (quick and bool(study.quick)),
    )


def configs(folder: Path) -> list[Path]:
    """The configs of studies in a directory, by name; other YAML files have no experiment."""
    return sorted(f for f in folder.glob("*.yaml") if f.is_file() and _EXPERIMENT.search(f.read_bytes()))


def configs_near(folder: Path) -> list[Path]:
    """The configs in `configs` of a directory, else in the directory, else in `configs` of the nearest one above.

    Raises:
        InputError: there are none, with what a config is.
    """
    above = [parent / "configs" for parent in folder.resolve().parents]
    for place in (folder / "configs", folder, *above):
        if found := configs(place):
            return found
    raise InputError(f"{folder.resolve()}: no config in it, in configs there, or in configs above; {_WHAT}")


def varying(cases: Sequence[Any]) -> list[str]:
    """The fields in which cases differ."""
    rows = [asdict(case) for case in cases]
    return [name for name in (rows[0] if rows else ()) if len({row[name] for row in rows}) > 1]


def _elsewhere(path: Path) -> str:
    """Which configs there are, for messages: beside `path`, or in a directory `configs` here or above."""
    here = Path.cwd()
    for folder in (path.parent, *(above / "configs" for above in (here, *here.parents))):
        if names := [file.name for file in configs(folder)]:
            return f"in {folder} there are {' '.join(names)}"
    return _WHAT


def _cases(study: Study, experiment: Experiment) -> Iterator[Any]:
    """Every case of the sweep, checked."""
    seen = set()
    for nodes in _choices(study):
        case = _case(nodes, study.node, experiment)
        key = tuple(asdict(case).items())
        if key in seen:
            raise study.sweep.error(f"the same case twice: {', '.join(f'{k}={v}' for k, v in key)}")
        seen.add(key)
        if len(seen) > _MANY:
            raise study.sweep.error(f"more than {_MANY:,} runs")
        yield case


def _choices(study: Study) -> Iterator[Mapping[str, Node]]:
    """A node for every field that a case sets: the fixed ones and the product of each block of the sweep."""
    fixed = mapping(study.fixed)
    for block in study.sweep.value if isinstance(study.sweep.value, list) else [study.sweep]:
        swept = {key: spread(node) for key, node in mapping(block).items()}
        if both := sorted(set(fixed) & set(swept)):
            raise fixed[both[0]].error(f"is in `sweep` too ({swept[both[0]][0].place}); set it in one place")
        for combination in product(*swept.values()):
            yield {**fixed, **dict(zip(swept, combination, strict=True))}


def spread(node: Node) -> list[Node]:
    """The values that a node of a sweep or a selection stands for: a list, `{range: 5}`, `{range: [2, 5]}`, or one.

    Raises:
        InputError: none at all, or a range that is not one.
    """
    if isinstance(node.value, dict):
        values = [Node(value=i, place=node.place, path=node.path) for i in _range(node)]
    else:
        values = node.value if isinstance(node.value, list) else [node]
    if not values:
        raise node.error("expected at least one value, got none")
    return values


def _range(node: Node) -> range:
    for key, inner in node.value.items():
        if key != "range":
            raise inner.error("unknown key; expected a value, a list, {range: 5} or {range: [2, 5]}")
    bounds = node.plain().get("range")
    bounds = bounds if isinstance(bounds, list) else [0, bounds]
    if len(bounds) != 2 or not all(type(b) is int for b in bounds) or bounds[1] - bounds[0] > _MANY:
        raise node.error(f"expected a value, a list, {{range: 5}} or {{range: [2, 5]}}, got {node.plain()!r}")
    return range(*bounds)


def _case(nodes: Mapping[str, Node], root: Node, experiment: Experiment) -> Any:
    """The case that the nodes describe; wrong names, types and impossible values are told where they stand."""
    hints = {name: experiment.field(name, node) for name, node in nodes.items()}
    needed = [f.name for f in fields(experiment.case) if f.default is MISSING and f.default_factory is MISSING]
    if missing := [name for name in needed if name not in nodes]:
        raise root.error(f"neither `fixed` nor `sweep` sets {', '.join(missing)}")
    values = {name: scalar(node, hints[name]) for name, node in nodes.items()}
    try:
        case = experiment.case(**values)
        if experiment.check is not None:
            experiment.check(case)
    except InputError as error:
        name, _, rest = str(error).partition(": ")
        raise (nodes[name].error(rest) if name in nodes else root.at("sweep").error(str(error))) from None
    return case


def select(where: Node, experiment: Experiment) -> Callable[[Row], bool]:
    """Whether a `where` picks a row, or the fields of a case.

    Raises:
        InputError: an unknown field, a value of the wrong type.
    """
    picked = {}
    for name, node in mapping(where).items():
        kind = experiment.field(name, node)
        picked[name] = frozenset(scalar(inner, kind) for inner in spread(node))
    return lambda row: all(row[name] in values for name, values in picked.items())


def chosen(rows: Sequence[Row], wheres: Iterable[Node], experiment: Experiment, columns: Iterable[str]) -> list[Row]:
    """The rows that every `where` picks, of each these columns as far as it has them, and `error`."""
    picks = [select(where, experiment) for where in wheres]
    names = frozenset({"error", *columns})
    return [{k: v for k, v in row.items() if k in names} for row in rows if all(pick(row) for pick in picks)]
