"""The grammar of the command line, and what its values must look like."""

import argparse
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NoReturn

from symrefine.cli import (
    align,
    batch,
    complete,
    completion,
    derive,
    detect,
    export,
    info,
    label,
    merge,
    run,
    symmetrize,
    view,
)
from symrefine.cli.values import add_loudness
from symrefine.errors import InputError, meant

_COMMANDS = (detect, info, align, derive, export, symmetrize, complete, batch, label, run, merge, view, completion)
_DESCRIPTION = "Symmetry of 3-D shapes: mirror planes, rotation axes and the point group of a mesh or a point cloud."
_EPILOG = (
    "`symrefine COMMAND --help` explains a command. Exit status: 0 done, 1 some files of a batch or runs failed, 2 bad "
    "input or options, 3 undetermined (`--strict`), 70 a fault of symrefine itself (one line names it, "
    "SYMREFINE_DEBUG=1 shows where), 130 interrupted, 141 nobody read on."
)


# What argparse takes for an option, and what of it is likely to be the name of a file.
_DASHED = re.compile("-.")
_FILE = re.compile(r"-[^=]*\.[A-Za-z]\w*")
# How argparse refuses a value that is none of its choices, among them the commands.
_CHOICE = re.compile(r"invalid choice: '([^']*)' \(choose from (.*)\)")


class Parser(argparse.ArgumentParser):
    """A parser that raises one clear line where argparse would print usage and exit.

    Attributes:
        commands: the parser of each command, by its name.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.commands: Mapping[str, Parser] = {}

    @property
    def arguments(self) -> Sequence[argparse.Action]:
        """Every option and every other argument."""
        return self._actions

    def error(self, message: str) -> NoReturn:
        """Raise the message with what may have been meant and the place to look."""
        if choice := _CHOICE.search(message):
            message += meant(choice[1], re.findall(r"[^\s,']+", choice[2]))
        raise InputError(f"{message.removeprefix('argument ')}; see `{self.prog} --help`")

    def unknown(self, argument: str) -> NoReturn:
        """Refuse an argument that has no place."""
        known: Iterable[str] = self._option_string_actions if argument.startswith("-") else ()
        self.error(f"unknown argument: {argument}{meant(argument.partition('=')[0], known)}")

    def dashed(self, words: Iterable[str]) -> str:
        """`; if -x.ply is a file, write ./-x.ply`, to end a message with, for the first name that passed for an option.

        Args:
            words: of the whole command line.
        """
        words = [*words]
        command = next((self.commands[word] for word in words if word in self.commands), self)
        known = tuple(name for action in command.arguments for name in action.option_strings if action.nargs != 0)
        for word in words[: _end_of_options(words)]:
            if (_FILE.fullmatch(word) or os.path.lexists(word)) and _DASHED.match(word) and not word.startswith(known):
                return f"; if {word} is a file, write ./{word}"
        return ""

    def check_filled(self, args: argparse.Namespace) -> None:
        """Refuse an empty text, as a variable of a shell leaves that is not set: as a path it would be this directory.

        Raises:
            InputError: with the argument that is empty.
        """
        for action in self._actions:
            given = getattr(args, action.dest, None)
            if given == "" or (isinstance(given, list) and "" in given):
                is_option = bool(action.option_strings)
                name = "/".join(action.option_strings) if is_option else action.metavar
                self.error(f"{name}: is empty; expected {action.metavar if is_option else 'a name'}")


class _Version(argparse.Action):
    """Print the version; looking it up takes too long to do it for every command."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print("symrefine", version("symrefine"))
        parser.exit()


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """The values of a command line, with its words as `argv` and the function to call as `run`.

    Raises:
        InputError: unknown commands, options or values; empty ones.
    """
    argv, parser = _joined(argv), grammar()
    try:
        args, rest = parser.parse_known_args(argv)
        args.argv = argv
        several = next((name for name in ("path", "target") if isinstance(getattr(args, name, None), list)), None)
        if several and (names := _names(rest)):
            setattr(args, several, getattr(args, several) + names)  # argparse takes only files that stand together
        elif rest:
            args.parser.unknown(rest[0])
        args.parser.check_filled(args)
    except InputError as error:
        raise InputError(f"{error}{parser.dashed(argv)}") from None
    return args


def _names(words: Sequence[str]) -> list[str]:
    """The names of files that words are; none if an option is among them, as it may be until a `--`."""
    before, after = words[: (end := _end_of_options(words))], words[end + 1 :]
    return [] if any(map(_DASHED.match, before)) else [*before, *after]


def _end_of_options(words: Sequence[str]) -> int:
    """Where the `--` stands after which no word is an option."""
    return words.index("--") if "--" in words else len(words)


def _joined(argv: Sequence[str]) -> list[str]:
    """The arguments, places joined to their option: `--viewpoint -1,0,0` would pass for an option of that name."""
    joined: list[str] = []
    for word in argv:
        if joined and joined[-1] == "--viewpoint" and re.match(r"-[0-9.]", word):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def grammar() -> Parser:
    """The parser of the whole command line."""
    parser = Parser(prog="symrefine", description=_DESCRIPTION, epilog=_EPILOG, allow_abbrev=False)
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in _COMMANDS:
        name = command.__name__.rpartition(".")[2]
        sub = commands.add_parser(name, help=command.HELP, description=command.DESCRIPTION, allow_abbrev=False)
        command.add_arguments(sub)
        add_loudness(sub)
        sub.set_defaults(run=command.run, parser=sub)
    parser.commands = commands.choices
    return parser
