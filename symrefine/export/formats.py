"""The formats of `export`, and which of its options each takes: for a command line that imports nothing heavy."""

from collections.abc import Mapping
from typing import Literal

Format = Literal["bop", "npz", "canonical", "foundationpose", "megapose", "dope", "isaac"]
# By the names that `symrefine.export` has for them.
TAKES: Mapping[Format, tuple[str, ...]] = {
    "bop": ("number", "scale"),
    "foundationpose": ("number", "scale"),
    "megapose": ("number", "scale"),
    "dope": ("scale",),
    "isaac": ("scale",),
    "npz": ("improper", "steps"),
    "canonical": ("transform",),
}


def takers(option: str) -> list[Format]:
    """The formats that take an option."""
    return [name for name, options in TAKES.items() if option in options]
