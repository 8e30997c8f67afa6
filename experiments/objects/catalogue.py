"""The catalogued real meshes of `../shared/objects`: 52 files with their symmetry, no part of the product."""

import json
from functools import cache
from pathlib import Path
from typing import Any

from symrefine.errors import InputError
from symrefine.geometry import Array, unit
from symrefine.load import load
from symrefine.shape import Shape

FOLDER = Path(__file__).parents[3] / "shared" / "objects"
ROUND = ("Cinfv", "Dinfh")


@cache
def catalogue() -> dict[str, dict[str, Any]]:
    """Entries by name; none where the meshes are not."""
    path = FOLDER / "catalog.json"
    return {e["name"]: e for e in json.loads(path.read_text(encoding="utf-8"))} if path.is_file() else {}


@cache
def catalogued(name: str) -> Shape:
    """The mesh of an entry.

    Raises:
        InputError: there is none of that name, or the meshes are not there.
    """
    if name not in catalogue():
        raise InputError(f"{FOLDER}: has no catalogued mesh {name!r}")
    return load(FOLDER / catalogue()[name]["file"])


def listed_normals(entry: dict[str, Any]) -> list[Array]:
    """Normals of the mirrors; none for a surface of revolution, of whose endless planes the catalogue lists four."""
    return [] if entry["point_group"] in ROUND else [unit(p["normal"]) for p in entry["planes"]]
