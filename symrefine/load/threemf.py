"""3MF, the archive of printed models: what its build places, in the unit of the file (millimetres as a rule).

Read here, for trimesh 5.2 takes as many numbers of a vertex as it can and leaves the rest out. Files of the production
extension, which spread objects over several parts, are read; extensions that would change the shape are refused.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from symrefine.errors import InputError, about
from symrefine.geometry import Array
from symrefine.load.content import Content, Polygons
from symrefine.load.packed import archive
from symrefine.load.text import count, is_number, shorten
from symrefine.shape import Index

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
_MODEL = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
_PATH = "{http://schemas.microsoft.com/3dmanufacturing/production/2015/06}path"
# Namespaces of extensions that change no surface: materials, parts in several files.
_HARMLESS = ("/3dmanufacturing/material/", "/3dmanufacturing/production/")
# Units as 3MF spells them; feet are not told.
_UNITS = {"micron": "um", "millimeter": "mm", "centimeter": "cm", "inch": "in", "foot": None, "meter": "m"}
_INDEX = re.compile(r"[0-9]{1,9}")
# Components may stand in components, each several times: a small file can ask for more triangles than memory holds.
_LARGEST, _DEEPEST = 2**24, 100

_Mesh = tuple[Array, Index]
# The part of the archive that an object stands in, and its number there.
_Key = tuple[str, str]


@dataclass(frozen=True, slots=True)
class _Use:
    """An object that is placed, and a map [4, 3] of its points."""

    key: _Key
    transform: Array


@dataclass(frozen=True, slots=True)
class _Object:
    """A mesh, or none, and the objects that it is made of besides."""

    meshes: list[_Mesh]
    components: list[_Use]


def read_3mf(data: bytes) -> Content:
    """Triangles of all that is built, each object in its place.

    Raises:
        InputError: no whole archive, no valid XML, numbers or references that are none, extensions that would change
            the shape, nothing to build.
    """
    package = _Package(archive(data, ".3mf"))
    part = package.root()
    model = package.model(part)
    unit = model.get("unit", "millimeter")
    if unit not in _UNITS:
        raise InputError(f"{shorten(part)}: unit is {shorten(unit)}; expected one of {' '.join(_UNITS)}")
    uses = [_use(item, part) for item in model.iterfind(f"{_CORE}build/{_CORE}item")]
    if not uses:
        raise InputError("builds nothing: its <build> has no <item>")
    size = sum(package.size(use.key) for use in uses)
    if size > _LARGEST:
        raise InputError(f"builds {float(size):.3g} triangles and parts; at most {_LARGEST:,}")
    meshes = [mesh for use in uses for mesh in package.placed(use)]
    shifts = np.cumsum([0] + [len(points) for points, _ in meshes[:-1]])
    corners = [faces + shift for (_, faces), shift in zip(meshes, shifts, strict=False)]
    if not sum(map(len, corners)):
        raise InputError("builds no triangles")
    joined = np.concatenate(corners)
    return Content(
        points=np.concatenate([points for points, _ in meshes]), faces=Polygons.alike(joined), unit=_UNITS[unit]
    )


class _Package:
    """Objects of an archive, each read when it is first used."""

    def __init__(self, members: Mapping[str, bytes]) -> None:
        self._members = members
        self._elements: dict[str, dict[str, Element]] = {}
        self._objects: dict[_Key, _Object] = {}
        self._sizes: dict[_Key, int] = {}

    def root(self) -> str:
        """Part of the archive that holds the build."""
        found = [r.get("Target", "") for r in self._xml("_rels/.rels") if r.get("Type") == _MODEL]
        if len(found) != 1:
            raise InputError(f"_rels/.rels: names {count(len(found), 'model')}; expected one")
        return found[0].lstrip("/")

    def model(self, part: str) -> "Element":
        """The model in a part, if it asks for nothing that is not read here."""
        model = self._xml(part)
        if model.tag != f"{_CORE}model":
            raise InputError(f"{shorten(part)}: begins with {shorten(model.tag, 90)}; expected {_CORE}model")
        spaces = dict(re.findall(rb"xmlns:([\w.-]+)\s*=\s*[\"']([^\"']*)", self._members[part][:10_000]))
        for prefix in model.get("requiredextensions", "").split():
            space = spaces.get(prefix.encode(), b"").decode(errors="replace")
            if not any(name in space for name in _HARMLESS):
                raise InputError(
                    f"{shorten(part)}: requires {shorten(space or prefix, 90)}; save it without extensions"
                )
        return model

    def size(self, key: _Key, depth: int = 0) -> int:
        """Triangles that an object is made of, and the parts that hold them, before any of them is placed."""
        if depth > _DEEPEST:
            raise InputError(f"object {shorten(key[1])} is made of components more than {_DEEPEST} deep: of itself?")
        if key not in self._sizes:
            thing = self._object(key)
            own = sum(len(faces) for _, faces in thing.meshes)
            self._sizes[key] = 1 + own + sum(self.size(part.key, depth + 1) for part in thing.components)
        return self._sizes[key]

    def placed(self, use: _Use) -> Iterator[_Mesh]:
        """Points and triangles of an object and of its components, in the frame of what uses it."""
        thing = self._object(use.key)
        # A mirrored object is inside out; its triangles must turn with it.
        turned = np.linalg.det(use.transform[:3]) < 0
        for points, faces in [*thing.meshes, *(mesh for part in thing.components for mesh in self.placed(part))]:
            with np.errstate(all="ignore"):  # points that are not finite are refused by name later
                moved = points @ use.transform[:3] + use.transform[3]
            yield moved, faces[:, ::-1] if turned else faces

    def _object(self, key: _Key) -> _Object:
        if key not in self._objects:
            self._objects[key] = self._read(key)
        return self._objects[key]

    def _read(self, key: _Key) -> _Object:
        part, number = key
        if part not in self._elements:
            found = self.model(part).iterfind(f"{_CORE}resources/{_CORE}object")
            self._elements[part] = {thing.get("id", ""): thing for thing in found}
        thing = self._elements[part].get(number)
        if thing is None:
            raise InputError(f"{shorten(part)}: has no object {shorten(number)}, which is to be built")
        mesh = thing.find(f"{_CORE}mesh")
        with about(f"object {shorten(number)}"):
            components = [_use(item, part) for item in thing.iterfind(f"{_CORE}components/{_CORE}component")]
            return _Object([] if mesh is None else [_mesh(mesh)], components)

    def _xml(self, part: str) -> "Element":
        from xml.etree import ElementTree as ET

        if part not in self._members:
            raise InputError(f"has no part {shorten(part)}; not a 3MF archive, or a damaged one")
        try:
            return ET.fromstring(self._members[part])
        except (ET.ParseError, ValueError, LookupError) as error:
            raise InputError(f"{shorten(part)}: not valid XML: {shorten(str(error), 80)}") from None


def _use(item: "Element", part: str) -> _Use:
    """What an item of the build or a component places: rows [x y z 1] of points stand in front of its 12 numbers."""
    words = item.get("transform", "1 0 0 0 1 0 0 0 1 0 0 0").split()
    if len(words) != 12 or not all(map(is_number, words)):
        raise InputError(f"transform {shorten(' '.join(words))}; expected 12 numbers")
    key = item.get(_PATH, part).lstrip("/"), item.get("objectid", "")
    return _Use(key, np.array(words, dtype=np.float64).reshape(4, 3))


def _mesh(mesh: "Element") -> _Mesh:
    vertices = _table(mesh, f"{_CORE}vertices/{_CORE}vertex", ("x", "y", "z"))
    triangles = _table(mesh, f"{_CORE}triangles/{_CORE}triangle", ("v1", "v2", "v3"))
    for row, words in enumerate(vertices):
        if not all(map(is_number, words)):
            raise InputError(f"vertex {row}: x y z are {shorten(' '.join(words))}; expected three numbers")
    for row, words in enumerate(triangles):
        if not all(_INDEX.fullmatch(word) and int(word) < len(vertices) for word in words):
            raise InputError(
                f"triangle {row}: corners are {shorten(' '.join(words))}; expected three of {len(vertices)} vertices, "
                "numbered from 0"
            )
    points = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    return points, np.array(triangles, dtype=np.int64).reshape(-1, 3)


def _table(mesh: "Element", path: str, names: tuple[str, ...]) -> list[list[str]]:
    return [[row.get(name, "").strip() for name in names] for row in mesh.iterfind(path)]
