"""`symrefine completion`: what a shell needs to complete commands, options, their values and files."""

import argparse
from typing import TYPE_CHECKING

from symrefine.cli.outputs import say

if TYPE_CHECKING:
    from symrefine.cli.parser import Parser

HELP = "print the script that lets a shell complete commands, options and files"
DESCRIPTION = (
    "Print the script that lets a shell complete commands, options, their values and files. For this session: "
    '`eval "$(symrefine completion bash)"`, the same with zsh, and `symrefine completion fish | source`; for all put '
    "that line into ~/.bashrc, ~/.zshrc or ~/.config/fish/config.fish."
)
# What stands for a file in the help of an argument; DIR stands for a directory.
_FILES = ("FILE", "PATH", "OUT", "CONFIG", "PART", "A", "B")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("shell", choices=("bash", "zsh", "fish"), help="for which shell")


def run(args: argparse.Namespace) -> int:
    """Print the script, made from the grammar of the command line."""
    import shtab

    from symrefine.cli.parser import grammar

    parser = grammar()
    for command in parser.commands.values():
        _mark_files(command)
    say(shtab.complete(parser, args.shell) + "\n")
    return 0


def _mark_files(parser: "Parser") -> None:
    """Say of each argument that is a file or a directory what completes it."""
    import shtab

    for argument in parser.arguments:
        name = str(argument.metavar).partition("|")[0].partition(".")[0]
        completed = shtab.DIRECTORY if name == "DIR" else shtab.FILE if name in _FILES else None
        if completed is not None:
            argument.complete = completed  # type: ignore[attr-defined]
