"""YAML documents as trees whose every value knows its file, line and key path; `--set` puts other values in."""

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from symrefine.errors import InputError

# Levels, values with all aliases written out, and bytes: ten times what the largest config here has, or more. A few
# lines of aliases stand for billions of values, and the parser takes a second for 25 kB.
_DEEPEST, _MOST, _LARGEST = 20, 100_000, 2**16
_NESTED = 100
_DASHES = re.compile(rf"(?:[-?:]\s+){{{_NESTED}}}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """A value of a document: a scalar, a list of nodes, or a dict of nodes."""

    value: Any
    place: str  # "configs/table.yaml:7" or "--set sweep.seed=[0,1]"
    path: str  # "sweep.seed"; empty at the root

    def error(self, message: str) -> InputError:
        """An error that says where this value stands."""
        return InputError(f"{self.place}: {self.path or 'config'}: {message}")

    def at(self, *keys: str | int) -> "Node":
        """The node under a key path; the last one that is there."""
        node = self
        for key in keys:
            inside = dict(enumerate(node.value)) if isinstance(node.value, list) else node.value
            if not isinstance(inside, dict) or key not in inside:
                return node
            node = inside[key]
        return node

    def plain(self) -> Any:
        """The value without its places."""
        if isinstance(self.value, dict):
            return {key: node.plain() for key, node in self.value.items()}
        return [node.plain() for node in self.value] if isinstance(self.value, list) else self.value


def read_document(path: Path) -> Node:
    """The tree of a YAML 1.2 file.

    Raises:
        InputError: no such file, not text, not YAML, keys that are no text or stand there twice.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such config file")
    if (size := path.stat().st_size) > _LARGEST:
        raise InputError(f"{path}: has {size:,} bytes; a config has at most {_LARGEST:,}")
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not YAML: no text in UTF-8") from None
    return _parse(text, str(path), lines=True)


def _parse(text: str, source: str, *, lines: bool) -> Node:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    if _nests(text):
        raise InputError(f"{source}: nested too deep: {_NESTED} brackets or dashes that nothing closes")
    try:
        tree = YAML(typ="rt", pure=True).load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark
        where = f":{mark.line + 1 if mark else 1}" if lines else ""
        raise InputError(f"{source}{where}: not YAML: {error.problem}") from None
    except YAMLError as error:
        raise InputError(f"{source}: not YAML: {str(error).splitlines()[0]}") from None
    except Exception as error:  # noqa: BLE001 - values that their tag or form promises and that are none: !!int x
        raise InputError(f"{source}: not YAML: {str(error)[:80]}") from None
    if (size := _size(tree, 0, {})) > _MOST:
        raise InputError(f"{source}: its aliases stand for {float(size):.3g} values; at most {_MOST:,}")
    return _node(tree, source, 1 if lines else None, "", 0)


def _nests(text: str) -> bool:
    """Whether a text opens more than any config does: for 1,000 levels the parser takes 8 s, and then gives up."""
    steps = (1 if c in "[{" else -1 for c in text if c in "[]{}")
    return max(itertools.accumulate(steps), default=0) > _NESTED or bool(_DASHES.search(text))


def _size(value: Any, depth: int, known: dict[int, int]) -> int:
    """Values in a tree as if every alias were written out; what holds itself counts as too many.

    Args:
        known: sizes of the mappings and lists that were counted before, by identity.
    """
    if not isinstance(value, dict | list) or depth > _DEEPEST:
        return 1
    if id(value) not in known:
        known[id(value)] = _MOST + 1  # until it is counted: itself
        inner = value.values() if isinstance(value, dict) else value
        known[id(value)] = 1 + sum(_size(item, depth + 1, known) for item in inner)
    return known[id(value)]


def _node(value: Any, source: str, line: int | None, path: str, depth: int) -> Node:
    """A value as ruamel loads it, as a node; lines are counted unless `line` is None."""
    place = source if line is None else f"{source}:{line}"
    if depth > _DEEPEST:
        raise InputError(f"{place}: {path.split('.')[0]}: nested too deep")
    if isinstance(value, dict):
        inside: Any = {}
        for key, inner in value.items():
            if not isinstance(key, str):
                raise InputError(f"{place}: {path or 'config'}: keys are text, got {key!r}")
            inside[key] = _node(
                inner, source, _line(value, "key", key, line), f"{path}.{key}" if path else key, depth + 1
            )
    elif isinstance(value, list):
        below = [_line(value, "item", i, line) for i in range(len(value))]
        inside = [_node(inner, source, below[i], f"{path}[{i}]", depth + 1) for i, inner in enumerate(value)]
    else:
        # Of the plain type that it stands for: ruamel remembers how a number was written.
        inside = next((kind(value) for kind in (bool, int, float, str) if isinstance(value, kind)), value)
    return Node(value=inside, place=place, path=path)


def _line(holder: Any, kind: str, key: str | int, line: int | None) -> int | None:
    """Line of an entry, counted from 1; that of its holder for entries merged in from elsewhere."""
    if line is None:
        return None
    try:
        return int(getattr(holder.lc, kind)(key)[0]) + 1
    except (KeyError, TypeError):
        return line


def override(root: Node, settings: Sequence[str]) -> Node:
    """The tree with every `KEY.KEY=VALUE` put in; a name below a list stands for each of its mappings.

    Raises:
        InputError: not of this form, or the key path leads through something that holds no keys.
    """
    for setting in settings:
        name, equals, text = setting.partition("=")
        keys = name.strip().split(".")
        source = f"--set {setting}"
        if len(keys) > _DEEPEST or len(setting) > _LARGEST:
            raise InputError(f"--set {setting[:60]}...: {len(keys)} keys deep, {len(setting)} characters: too many")
        if not equals or not all(re.fullmatch(r"\w[\w -]*", key) for key in keys):
            raise InputError(f"{source}: expected KEY=VALUE, such as sweep.seed=[0,1] or fixed.points=5000")
        root = put(root, keys, _parse(text, source, lines=False), source)
    return root


def put(node: Node, keys: Sequence[str], new: Node, source: str) -> Node:
    """The tree with a node put under a key path; `source` is named if there is no place for it.

    Raises:
        InputError: the key path leads through something that holds no keys.
    """
    if not keys:
        return _moved(new, node.path)
    if node.value is None:
        node = Node(value={}, place=source, path=node.path)
    if isinstance(node.value, list):
        return _put_in_list(node, keys, new, source)
    if not isinstance(node.value, dict):
        raise InputError(f"{source}: {node.path} is {node.value!r}, it holds no key {keys[0]!r}")
    path = f"{node.path}.{keys[0]}" if node.path else keys[0]
    old = node.value.get(keys[0], Node(value=None, place=source, path=path))
    return Node(value=node.value | {keys[0]: put(old, keys[1:], new, source)}, place=node.place, path=node.path)


def _put_in_list(node: Node, keys: Sequence[str], new: Node, source: str) -> Node:
    chosen = [int(keys[0])] if keys[0].isdigit() else range(len(node.value))
    if keys[0].isdigit():
        keys = keys[1:]
        if chosen[0] >= len(node.value):
            raise InputError(f"{source}: {node.path} has {len(node.value)} entries, numbered from 0")
    items = [put(item, keys, new, source) if i in chosen else item for i, item in enumerate(node.value)]
    return Node(value=items, place=node.place, path=node.path)


def _moved(node: Node, path: str) -> Node:
    """The tree with another key path at its root."""
    value = node.value
    if isinstance(value, dict):
        value = {key: _moved(inner, f"{path}.{key}") for key, inner in value.items()}
    elif isinstance(value, list):
        value = [_moved(inner, f"{path}[{i}]") for i, inner in enumerate(value)]
    return Node(value=value, place=node.place, path=path)
