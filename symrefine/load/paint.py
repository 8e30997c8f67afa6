"""Images of textures, and how faces show them; asked for by name, so that whatever is missing is refused."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from symrefine.errors import InputError, about
from symrefine.files import file_bytes
from symrefine.geometry import Array
from symrefine.load.content import Paint, Polygons
from symrefine.load.image import FORMATS, LARGEST_FILE, check_size, open_image
from symrefine.load.text import numbered_lines, shorten
from symrefine.shape import Index
from symrefine.texture import Pixels, Texture

# Pixels of all images of an object: 200 MB of colours.
LARGEST = 2**26
# White, where a material says nothing.
_WHITE = (255.0, 255.0, 255.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """What a face looks like: an image, or else one colour, 0 to 255."""

    image: Path | None = None
    plain: tuple[float, ...] = _WHITE


def read_images(paths: Sequence[Path]) -> tuple[Pixels, ...]:
    """The images [H, W, 3] in files.

    Raises:
        InputError: one is missing, damaged or too large, or all are together.
    """
    made: list[Pixels] = []
    for path in paths:
        with about(f"texture {path}"):
            if path.suffix.lower() not in FORMATS:
                raise InputError(f"unknown suffix {path.suffix!r}; known are {' '.join(sorted(FORMATS))}")
            image = open_image(file_bytes(path, most=LARGEST_FILE), path.suffix.lower())
            made.append(np.asarray(image.convert("RGB"), dtype=np.uint8))
            check_total(made)
    return tuple(made)


def decoded(images: Sequence[Any]) -> tuple[Pixels, ...]:
    """The pixels of images of Pillow that are not decoded yet.

    Raises:
        InputError: one is damaged or too large, or all are together.
    """
    made: list[Pixels] = []
    for number, image in enumerate(images):
        with about(f"image {number}"):
            check_size(image)
            try:
                made.append(np.asarray(image.convert("RGB"), dtype=np.uint8))
            except Exception as error:  # noqa: BLE001 (Pillow leaks many types on damaged files; nothing else here)
                raise InputError(f"is damaged: {shorten(str(error), 80)}") from None
            check_total(made)
    return tuple(made)


def check_total(images: Sequence[Pixels]) -> None:
    """Refuse images that have too many pixels together."""
    if (total := sum(image.shape[0] * image.shape[1] for image in images)) > LARGEST:
        raise InputError(f"images of {total:,} pixels together; at most {LARGEST:,}: scale them down")


def read_materials(path: Path) -> dict[str, Material]:
    """The materials of an .mtl file: `map_Kd`, beside the file, or else the colour `Kd`; how they shine is no matter.

    Raises:
        InputError: no such file, statements before the first material, options of `map_Kd`, or no colour.
    """
    found: dict[str, Material] = {}
    name = None
    with about(str(path)):
        for number, text in numbered_lines(file_bytes(path, most=LARGEST_FILE), comment="#"):
            keyword, _, rest = text.replace("\t", " ").partition(" ")
            rest = rest.strip()
            if keyword == "newmtl":
                name = rest
                found[name] = Material()
            elif keyword in ("map_Kd", "Kd"):
                if name is None:
                    raise InputError(f"line {number}: {keyword} before the first newmtl")
                found[name] = _with(found[name], keyword, rest, number, path.parent)
    return found


def _with(material: Material, keyword: str, rest: str, number: int, folder: Path) -> Material:
    if keyword == "map_Kd":
        if not rest or rest.startswith("-"):
            raise InputError(f"line {number}: map_Kd {shorten(rest)}; expected the name of an image and no options")
        return Material(image=folder / rest.replace("\\", "/"), plain=material.plain)
    try:
        plain = tuple(255.0 * float(word) for word in rest.split())
    except ValueError:
        plain = ()
    if len(plain) != 3 or not all(0.0 <= value <= 255.0 for value in plain):
        raise InputError(f"line {number}: Kd {shorten(rest)}; expected red green blue, each from 0 to 1")
    return Material(image=material.image, plain=plain)


def painted(names: Sequence[str], materials: Mapping[str, Material], uv: Array, faces: Polygons) -> Paint:
    """What faces show by the names of their materials.

    Args:
        names: [F] of the materials of the faces.
        materials: by name.
        uv: [sum of counts, 2] of the corners of the faces, NaN where there is none.

    Raises:
        InputError: a material that is not there, no image at all, or a face with an image and without coordinates.
    """
    missing = next((name for name in names if name not in materials), None)
    if missing is not None:
        known = ", ".join(materials) or "none"
        raise InputError(f"no material {shorten(missing) or 'for some faces'}; there are {shorten(known)}")
    paths = [path for path in dict.fromkeys(materials[name].image for name in names) if path is not None]
    if not paths:
        raise InputError("has no texture: no material of its faces has an image (map_Kd)")
    image = np.array([-1 if (path := materials[name].image) is None else paths.index(path) for name in names])
    without = np.repeat(image >= 0, faces.counts) & ~np.isfinite(uv).all(axis=1)
    if without.any():
        face = int(np.repeat(np.arange(len(faces)), faces.counts)[without][0])
        raise InputError(f"face {face} shows an image and has no texture coordinates at some corner")
    plain = np.array([materials[name].plain for name in names])
    return Paint(images=read_images(paths), uv=uv, image=image, plain=plain)


def texture_of(paint: Paint, faces: Polygons, triangles: Index, owner: Index) -> Texture:
    """The texture of triangles [T, 3] that polygons were cut into, each a part of the face [T] that owns it."""
    row = np.repeat(np.arange(len(faces)), faces.counts)
    largest = int(faces.corners.max()) + 1
    keys = row * largest + faces.corners
    order = np.argsort(keys, kind="stable")
    corner = order[np.searchsorted(keys[order], owner[:, None] * largest + triangles)]
    return Texture(images=paint.images, uv=paint.uv[corner], image=paint.image[owner], plain=paint.plain[owner])
