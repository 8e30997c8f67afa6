"""The grammar of the command line, and what its values must look like."""

import argparse
from collections.abc import Sequence
from typing import Any, NoReturn

from symrefine.cli import align, batch, complete, derive, detect, export, run, symmetrize, view
from symrefine.errors import InputError

_COMMANDS = (detect, align, derive, export, symmetrize, complete, batch, run, view)
_DESCRIPTION = "Symmetry of 3-D shapes: mirror planes, rotation axes and the point group of a mesh or a point cloud."
_EPILOG = (
    "`symrefine COMMAND --help` explains a command. Exit status: 0 done, 1 some files of a batch or runs failed, 2 bad "
    "input or options, 130 interrupted."
)


class Parser(argparse.ArgumentParser):
    """A parser that raises one clear line where argparse would print usage and exit."""

    def error(self, message: str) -> NoReturn:
        """Raise the message with the place to look."""
        raise InputError(f"{message.removeprefix('argument ')}; see `{self.prog} --help`")


class _Version(argparse.Action):
    """Print the version; looking it up takes too long to do it for every command."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print("symrefine", version("symrefine"))
        parser.exit()


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """The values of a command line, with the function to call as `run`.

    Raises:
        InputError: unknown commands, options or values.
    """
    args, rest = _parser().parse_known_args(argv)
    if rest:
        args.parser.error(f"unknown argument: {rest[0]}")
    return args


def _parser() -> Parser:
    parser = Parser(prog="symrefine", description=_DESCRIPTION, epilog=_EPILOG, allow_abbrev=False)
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in _COMMANDS:
        name = command.__name__.rpartition(".")[2]
        sub = commands.add_parser(name, help=command.HELP, description=command.DESCRIPTION, allow_abbrev=False)
        command.add_arguments(sub)
        sub.set_defaults(run=command.run, parser=sub)
    return parser
