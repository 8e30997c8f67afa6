"""YAML configs read into frozen dataclasses: every mistake is one line with file, line and key path."""

from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from symrefine.errors import InputError

T = TypeVar("T")


def read_config(path: Path, kind: type[T]) -> T:
    """The config in a YAML file as an instance of the dataclass `kind`.

    Raises:
        InputError: no such file, not YAML, an unknown or a missing key, a value of the wrong type.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError

    if not path.is_file():
        raise InputError(f"{path}: no such config file")
    try:
        document = YAML(typ="rt", pure=True).load(path.read_text())
    except MarkedYAMLError as error:
        where = error.problem_mark.line + 1 if error.problem_mark else 1
        raise InputError(f"{path}:{where}: not YAML: {error.problem}") from None
    return _value(document, kind, f"{path}:1", "config")


def _value(value: Any, kind: Any, where: str, name: str) -> Any:
    if is_dataclass(kind):
        return _section(value, kind, where, name)
    if get_origin(kind) is list:
        if not isinstance(value, list):
            raise InputError(f"{where}: {name}: expected a list, got {value!r}")
        return [_value(v, get_args(kind)[0], where, f"{name}[{i}]") for i, v in enumerate(value)]
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise InputError(f"{where}: {name}: expected {kind.__name__}, got {value!r}")
    return kind(value)


def _section(value: Any, kind: Any, where: str, name: str) -> Any:
    if not isinstance(value, dict):
        raise InputError(f"{where}: {name}: expected keys {[f.name for f in fields(kind)]}, got {value!r}")
    path = where.rsplit(":", 1)[0]
    lines = {key: f"{path}:{value.lc.key(key)[0] + 1}" for key in value}
    known = {f.name for f in fields(kind)}
    for key in value:
        if key not in known:
            raise InputError(f"{lines[key]}: {name}.{key}: unknown key; expected one of {sorted(known)}")
    if missing := sorted(known - set(value)):
        raise InputError(f"{where}: {name}: missing {', '.join(missing)}")
    hints = get_type_hints(kind)
    return kind(**{key: _value(v, hints[key], lines[key], f"{name}.{key}") for key, v in value.items()})
