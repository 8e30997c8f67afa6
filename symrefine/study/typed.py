"""Nodes read as the types that dataclasses declare: every mistake is one line with file, line and key path."""

import math
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, get_args, get_origin, get_type_hints

from symrefine.errors import meant
from symrefine.study.document import Node

Scalar = int | float | str | bool


def typed(node: Node, kind: Any) -> Any:
    """The value of a node as a scalar type, a union of them, `list[T]`, `dict[str, T]`, `Node`, a class that
    reads one, or a dataclass of these.

    A field named `node` is no key: it takes the node itself, for messages that come later.

    Raises:
        InputError: an unknown or a missing key, a value of the wrong type.
    """
    if kind is Node:
        return node
    if hasattr(kind, "read"):
        return kind.read(node)
    if is_dataclass(kind):
        return _section(node, kind)
    if get_origin(kind) is list:
        if not isinstance(node.value, list):
            raise node.error(f"expected a list, got {node.plain()!r}")
        return [typed(inner, get_args(kind)[0]) for inner in node.value]
    if get_origin(kind) is dict:
        return {key: typed(inner, get_args(kind)[1]) for key, inner in mapping(node).items()}
    return scalar(node, kind)


def mapping(node: Node) -> Mapping[str, Node]:
    """The entries of a node that must be a mapping."""
    if not isinstance(node.value, dict):
        raise node.error(f"expected `key: value` entries, got {node.plain()!r}")
    return node.value


def scalar(node: Node, kind: Any) -> Any:
    """A single value of a type, or of one of a union's; an integer is a number where one is asked for."""
    kinds = get_args(kind) if isinstance(kind, UnionType) else (kind,)
    value = node.value
    if type(value) in kinds or (value is None and NoneType in kinds):
        if isinstance(value, float) and not math.isfinite(value):
            raise node.error(f"expected a finite number, got {value!r}")
        return value
    if float in kinds and type(value) is int:
        return float(value)
    names = " or ".join(k.__name__ for k in kinds if k is not NoneType)
    raise node.error(f"expected {names}, got {node.plain()!r}")


def _section(node: Node, kind: Any) -> Any:
    inside = {f.name: f for f in fields(kind) if f.name != "node"}
    if not isinstance(node.value, dict):
        raise node.error(f"expected keys {list(inside)}, got {node.plain()!r}")
    for key, inner in node.value.items():
        if key not in inside:
            raise inner.error(f"unknown key; expected one of {sorted(inside)}{meant(key, inside)}")
    needed = [name for name, f in inside.items() if f.default is MISSING and f.default_factory is MISSING]
    if missing := [name for name in needed if name not in node.value]:
        raise node.error(f"missing {', '.join(missing)}")
    hints = get_type_hints(kind)
    itself = {"node": node} if "node" in hints else {}
    return kind(**{key: typed(inner, hints[key]) for key, inner in node.value.items()}, **itself)
