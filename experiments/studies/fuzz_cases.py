"""Cases for `experiments.studies.fuzz`: a damaged text by seed, target and number, and how the product takes it in."""

import contextlib
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

from experiments.studies.fuzz_mutations import NUMBERS, damaged, packed
from experiments.studies.fuzz_seeds import SUFFIXES, seeds
from symrefine.errors import SymrefineError

# Share of the files that are packed besides.
GZIPPED = 0.2
_CONFIG = Path("configs/table.yaml")


@dataclass(frozen=True, slots=True)
class Case:
    """One damaged text: where it goes, its suffix, and its bytes, or the words of a command line."""

    target: str
    number: int
    name: str
    data: bytes


def case(seed: int, target: str, number: int) -> Case:
    """A case, the same for the same seed, target and number."""
    rng = Random(f"{seed}/{target}/{number}")
    if target == "command line":
        return Case(target, number, "", "\0".join(_words(rng)).encode("utf-8", "surrogatepass"))
    sound = _SOUND[target]() if target in _SOUND else seeds(target)
    data = damaged(rng, rng.choice(sound))
    suffix = target if target in SUFFIXES else _NAMES[target]
    if target in SUFFIXES and rng.random() < GZIPPED:
        data, suffix = packed(rng, data), suffix + ".gz"
    return Case(target, number, f"a{suffix}", data)


def _words(rng: Random) -> list[str]:
    """A command line: commands, options and values, some of them right."""
    commands = _commands()
    command = rng.choice(sorted(commands))
    options = commands[command]
    values = [
        "a.ply",
        "-",
        "0.02",
        "0,0,1",
        "none",
        "otsu",
        "color",
        "1e-3mm",
        "*",
        "[",
        "\x1b[31m",
        "",
        "--",
        "-1",
        "é",
    ]
    values += [n.decode() for n in NUMBERS]
    line = [command] if rng.random() < 0.95 else []
    for _ in range(rng.randint(0, 6)):
        option = rng.choice(options) if rng.random() < 0.6 else rng.choice(values)
        line.append(f"{option}={rng.choice(values)}" if rng.random() < 0.2 else option)
    return line


@cache
def _commands() -> dict[str, list[str]]:
    """Commands and their options."""
    from symrefine.cli.parser import grammar

    commands = grammar().commands
    return {name: [o for action in commands[name]._actions for o in action.option_strings] for name in commands}


def _info() -> tuple[bytes, ...]:
    text = '{"1": {"diameter": 4.1, "min_x": 0, "min_y": 0, "min_z": 0, "size_x": 1, "size_y": 2, "size_z": 3.5, '
    text += '"symmetries_discrete": [[1,0,0,0,0,-1,0,0,0,0,-1,0,0,0,0,1]], "symmetries_continuous": []}}'
    return (text.encode(),)


def _journal() -> tuple[bytes, ...]:
    row = b'{"file": "a.ply", "sha256": "00", "error": null, "version": "0.1.0", "options": {"tolerance": 0.02}}\n'
    return (row + row.replace(b"a.ply", b"b.ply"),)


# Sound texts of what is no shape, and their names.
_SOUND: dict[str, Callable[[], Sequence[bytes]]] = {
    "config": lambda: (_CONFIG.read_bytes(),),
    "--set": lambda: (b"sweep.seed=[0,1]", b"fixed={points: 5000}", b"fixed.points=20"),
    "models_info.json": _info,
    "rows.jsonl": _journal,
    "depth .png": lambda: seeds(".png"),
    "depth .npy": lambda: seeds(".npy"),
}
_NAMES = {
    "config": ".yaml", "--set": "", "models_info.json": ".json", "rows.jsonl": ".jsonl", "depth .png": ".png",
    "depth .npy": ".npy",
}  # fmt: skip
# Formats that may tell classes.
_LABELLED = (".csv", ".txt", ".npz", ".ply", ".obj", ".off", ".glb", ".pcd", ".cif")
# What is typed; a refusal says it again.
TYPED = ("--set", "command line")
TARGETS = (*SUFFIXES, *_SOUND, "command line")


def attempt(one: Case, folder: Path) -> None:
    """Read a case as the product would.

    Raises:
        SymrefineError: it is refused, which is right.
    """
    from symrefine.load import load
    from symrefine.load.depth import load_depth

    path = folder / one.name
    if one.name:
        path.write_bytes(one.data)
    match one.target:
        case "command line":
            _parse(one.data.decode("utf-8", "surrogatepass").split("\0"))
        case "config":
            _invoke(["run", str(path), "--list"])
        case "--set":
            _invoke(["run", str(_CONFIG), "--list", "--set", one.data.decode("utf-8", "replace")])
        case "models_info.json":
            from symrefine.export.bop import bop_text, read_models_info

            read_models_info(path)
            bop_text(path, {7: {"diameter": 1.0}})
        case "rows.jsonl":
            from symrefine.cli.batch import opened

            with opened(path):
                pass
        case "depth .png" | "depth .npy":
            load_depth(path, (10.0, 10.0, 8.0, 6.0))
        case _:
            options: dict[str, Any] = {}
            if one.number % 4 == 0 and one.target in _LABELLED:
                options["labels"] = ("label", "color", "occupancy", "material")[one.number // 4 % 4]
            load(path, **options)


def _parse(words: list[str]) -> None:
    from symrefine.cli.parser import parse

    with contextlib.redirect_stdout(io.StringIO()):
        try:
            parse(words)
        except SystemExit as done:
            if done.code:
                raise


def _invoke(words: list[str]) -> None:
    """Run a command line; its complaint is the refusal, and must be one line that steers no terminal."""
    from symrefine.cli import invoke

    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = invoke(words)
    if not all(line.isprintable() for line in (out.getvalue() + err.getvalue()).split("\n")):
        raise AssertionError(f"control characters on the terminal: {out.getvalue()[:100]!a} {err.getvalue()[:100]!a}")
    if status == 2:
        raise SymrefineError(err.getvalue())
    if status:
        raise AssertionError(f"status {status}: {err.getvalue()[:200]}")
