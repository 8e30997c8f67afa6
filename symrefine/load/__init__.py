"""Files to shapes: the one way in for meshes and clouds, and the only place that knows file formats.

Nothing in a file is skipped, guessed or repaired: what cannot be read whole is refused with its place in the file.

Each format has the reader that proved most faithful in tests. Measured with open3d 0.20: its PLY reader returns
uninitialised memory for truncated files and ended the process (signal 11) on a header that counts one vertex too few;
its OBJ and OFF readers round to float32, and that for OBJ leaves out every quadrilateral; its PCD reader returns zeros
for binary doubles and reads `x` as 0. trimesh 5.2 cuts ragged OBJ rows to the shortest. So text formats, PLY, STL and
uncompressed PCD are read here, line by line or straight from the bytes; glTF by trimesh, after a check of what it would
leave out; compressed PCD by open3d, after a check of sizes. Images are read by Pillow.
"""

from collections.abc import Callable, Collection
from os import PathLike
from pathlib import Path
from typing import Any, Literal

from symrefine.errors import InputError, about
from symrefine.files import file_bytes
from symrefine.load.content import Content, check_distinct, check_finite
from symrefine.load.depth import load_depth
from symrefine.load.gltf import read_glb, read_gltf
from symrefine.load.image import FORMATS, Threshold, read_image
from symrefine.load.labels import point_classes, point_weights
from symrefine.load.mesh import mesh_arrays
from symrefine.load.obj import read_obj
from symrefine.load.off import read_off
from symrefine.load.pcd import read_pcd
from symrefine.load.ply import read_ply
from symrefine.load.stl import read_stl
from symrefine.load.tables import read_npy, read_npz, read_table, read_xyz
from symrefine.shape import Shape

__all__ = ["IMAGES", "READERS", "load", "load_depth"]

# A reader gets the bytes of a file, its path where others lie beside it or another program reads it, and of a table of
# any columns the names of those that it shall take beside coordinates. It says what is wrong, not in which file.
Reader = Callable[[bytes, Path, Collection[str]], Content]

_READERS: dict[str, Reader] = {
    ".csv": lambda data, _, named: read_table(data, named),
    ".glb": lambda data, path, _: read_glb(data, path),
    ".gltf": lambda data, path, _: read_gltf(data, path),
    ".npy": lambda data, *_: read_npy(data),
    ".npz": lambda data, _, named: read_npz(data, named),
    ".obj": lambda data, *_: read_obj(data),
    ".off": lambda data, *_: read_off(data),
    ".pcd": lambda data, path, _: read_pcd(data, path),
    ".ply": lambda data, *_: read_ply(data),
    ".stl": lambda data, *_: read_stl(data),
    ".txt": lambda data, _, named: read_table(data, named),
    ".xyz": lambda data, *_: read_xyz(data),
}
# Suffixes of meshes and clouds.
READERS = tuple(_READERS)
# Suffixes of pictures: apart from the others, because the textures of meshes lie beside these in one directory.
IMAGES = frozenset(FORMATS)


def load(
    path: str | PathLike[str],
    *,
    measure: Literal["surface", "solid"] | None = None,
    labels: str | None = None,
    weights: str | None = None,
    threshold: Threshold | None = None,
    invert: bool = False,
) -> Shape:
    """Shape in a file: a mesh if it has faces, else a cloud with its normals where the file has them.

    A picture becomes the weighted points of the plane that its pixels are (see `symrefine.load.image`).

    Coordinates keep the precision of the file, float64 where it has that. Polygons become triangles; several parts of
    a scene become one shape in the frame of the scene.

    Chemical .xyz (the number of atoms, a remark, then an element and x y z for each atom) gives the elements as labels.
    Other labels, and colours, are read only where they are asked for; images of textures never are.

    Args:
        path: file whose suffix is one of `READERS` or `IMAGES`, in any case.
        measure: what carries the mass of a mesh, "surface" if None. Clouds and pictures have no choice.
        labels: what tells the classes that every symmetry must keep: a vertex or face property of .ply (`label`,
            `material_index`), a field of .pcd, a titled column of .csv or .txt (numbers or texts), an array of .npz
            ([F] for faces, [N] for points), `material` for what `usemtl` names in .obj, or `color` for the colours of
            vertices or faces (.ply, .obj, .off, .glb, and columns red green blue). Colours closer than about a quarter
            of the scale become one class (see `symrefine.load.colours`). A face whose vertices have labels takes that
            of two corners, or of the first where all differ. Elements if None, for chemical .xyz.
        weights: a property, column or array of numbers that are the masses of the points of a cloud.
        threshold: of a picture: grey value from 0 to 1 that makes it binary, or "otsu"; it is taken as it is if None.
        invert: of a picture: exchange object and background.

    Raises:
        InputError: the file is missing, unreadable, not what its suffix says, incomplete, contradicts itself, holds
            coordinates that are not finite, fewer than two distinct points or no area; a measure for a cloud, a
            threshold or `invert` for what is no picture; labels or weights that the file does not have, or that are
            of the wrong kind.
    """
    if measure not in (None, "surface", "solid"):
        raise InputError(f"measure is {measure!r}; expected 'surface', 'solid' or None")
    if threshold not in (None, "otsu") and not (isinstance(threshold, int | float) and 0.0 < threshold < 1.0):
        raise InputError(f"threshold is {threshold}; expected a grey value between 0 (black) and 1 (white), or 'otsu'")
    source, file = str(path), Path(path)
    with about(source):
        named = [name for name in (labels, weights) if name is not None]
        content = _content(file, named, threshold=threshold, invert=invert)
        check_finite(content)
        check_distinct(content)
        arrays = _arrays(content, measure, labels, weights, source)
    return Shape(source=source, **arrays)


def _content(file: Path, named: Collection[str], *, threshold: Threshold | None, invert: bool) -> Content:
    suffix = file.suffix.lower()
    if file.is_dir():
        raise InputError("is a directory; expected a file")
    if suffix in IMAGES:
        if named:
            raise InputError("is a picture: labels and weights apply to meshes and clouds only")
        return read_image(file_bytes(file), suffix, threshold=threshold, invert=invert)
    images = " ".join(sorted(IMAGES))
    if suffix not in READERS:
        raise InputError(f"unknown suffix {file.suffix!r}; known are {' '.join(READERS)}, and images {images}")
    if threshold is not None or invert:
        raise InputError(f"is no picture: threshold and invert apply to {images} only")
    return _READERS[suffix](file_bytes(file), file, named)


def _arrays(
    content: Content, measure: str | None, labels: str | None, weights: str | None, source: str
) -> dict[str, Any]:
    """What becomes of a content, by the names that `Shape` has for it."""
    if content.faces is not None:
        if weights is not None:
            raise InputError("has faces, which weigh what their areas do; weights are for clouds")
        return {"measure": measure or "surface"} | mesh_arrays(content, content.faces, labels, source)
    if measure is not None:
        raise InputError(f"has no faces, so measure {measure!r} does not apply; leave it out for clouds")
    return {
        "points": content.points,
        "normals": content.normals,
        "weights": content.weights if weights is None else point_weights(content, weights),
        "labels": content.labels if labels is None else point_classes(content, labels),
        "viewpoint": content.viewpoint,
    }
