"""An experiment: a Python module with a dataclass `Case` and a function `run` that turns a case into a flat row."""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType, NoneType, UnionType
from typing import Any, get_args, get_type_hints

from symrefine.errors import InputError, meant
from symrefine.study.document import Node
from symrefine.study.typed import Scalar

Row = dict[str, Scalar | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """What a module offers; `check`, `trace`, `record` and `MEASURED` are optional.

    Attributes:
        name: of the module.
        root: directory that the name counts from.
        case: dataclass of plain fields.
        hints: types of these fields.
        check: raises InputError("field: what is wrong") for an impossible case.
        trace: a row for each iteration of a case.
        record: writes a recording of a case.
        measured: results that differ from run to run like timings do, and are kept with them.
    """

    name: str
    root: Path
    case: type[Any]
    hints: Mapping[str, Any]
    run: Callable[[Any], Mapping[str, Any]]
    check: Callable[[Any], None] | None
    trace: Callable[[Any], list[dict[str, Any]]] | None
    record: Callable[[Any, Path], None] | None
    measured: frozenset[str]

    def field(self, name: str, node: Node) -> Any:
        """The type of a field of the case, which `node` names.

        Raises:
            InputError: there is none.
        """
        if name not in self.hints:
            known = f"{sorted(self.hints)}{meant(name, self.hints)}"
            raise node.error(f"{self.name} has no field {name!r}; expected one of {known}")
        return self.hints[name]


def find_root(name: str, start: Path) -> Path:
    """The nearest directory at or above `start` in which the module stands.

    Raises:
        InputError: in none.
    """
    inside = Path(*name.split("."))
    for folder in [start.resolve(), *start.resolve().parents]:
        if (folder / inside).with_suffix(".py").is_file():
            return folder
    raise InputError(f"there is no {inside.with_suffix('.py')} in {start.resolve()} nor in a directory above it")


def load_experiment(name: str, root: Path) -> Experiment:
    """Import the module of an experiment.

    Raises:
        InputError: it cannot be imported, or offers no `Case` of plain fields or no `run`.
    """
    module = _import(name, root)
    case = getattr(module, "Case", None)
    if not (isinstance(case, type) and is_dataclass(case)) or not callable(getattr(module, "run", None)):
        raise InputError(f"{name} is no experiment: it needs a dataclass `Case` and a function `run(case)`")
    hints = {f.name: get_type_hints(case)[f.name] for f in fields(case)}
    for field, kind in hints.items():
        kinds = get_args(kind) if isinstance(kind, UnionType) else (kind,)
        if not set(kinds) <= {int, float, str, bool, NoneType}:
            raise InputError(f"{name}.Case.{field}: is {kind}; fields are int, float, str or bool")
    optional: dict[str, Any] = {part: getattr(module, part, None) for part in ("check", "trace", "record")}
    measured = frozenset(getattr(module, "MEASURED", ()))
    return Experiment(name=name, root=root, case=case, hints=hints, run=module.run, measured=measured, **optional)


def _import(name: str, root: Path) -> ModuleType:
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    try:
        module = import_module(name)
    except (ImportError, SyntaxError) as error:
        raise InputError(f"{name} cannot be imported: {error}") from None
    expected = (root / Path(*name.split("."))).with_suffix(".py")
    if Path(module.__file__ or "").resolve() != expected.resolve():
        raise InputError(f"{name} is {module.__file__} already, not {expected}")
    return module
