"""Files to shapes: the one way in for meshes, clouds, molecules and volumes, and the only place that knows formats.

Nothing in a file is skipped, guessed or repaired: what cannot be read whole is refused with its place in the file.

Each format has the reader that proved most faithful in tests. Measured with open3d 0.20: its PLY reader returns
uninitialised memory for truncated files and ended the process (signal 11) on a header that counts one vertex too few;
its OBJ and OFF readers round to float32, and that for OBJ leaves out every quadrilateral; its PCD reader returns zeros
for binary doubles and reads `x` as 0. trimesh 5.2 cuts ragged OBJ rows to the shortest, and 3MF vertices that are no
numbers. gemmi 0.7 takes 6.x34 of a PDB file for 6. laspy 2.7 returns fewer points than declared. So text formats, PLY,
STL, 3MF, molecules and uncompressed PCD are read here, line by line or straight from the bytes; glTF by trimesh, LAS by
laspy and compressed PCD by open3d, after a check of what they would leave out; the syntax of CIF by gemmi, E57 by
pye57, volumes by nibabel, mrcfile and pynrrd, pictures by Pillow. cascadio 0.1 leaves out faces of a STEP file that
lack a reference, and hangs on a NaN: it works in a process of its own, and what it says there is heard. pycollada 0.9
rounds to float32, stops at what is no number and leaves out what it does not know: COLLADA is checked first, too.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any, Literal

from symrefine.clock import passed
from symrefine.errors import InputError, about
from symrefine.files import file_bytes, path_of
from symrefine.load.content import Content, Threshold, Wanted, check_distinct, check_finite
from symrefine.load.frames import Frames, one
from symrefine.load.image import FORMATS
from symrefine.load.labels import point_classes, point_weights
from symrefine.load.mesh import mesh_arrays
from symrefine.load.packed import GZIP, LARGEST, stem_of, suffix_of, unpacked
from symrefine.load.stream import stream, stream_if_large
from symrefine.options import flag_of
from symrefine.shape import Shape

__all__ = [
    "IMAGES",
    "READERS",
    "SUFFIXES",
    "Frames",
    "load",
    "load_frames",
    "stem_of",
    "stream",
    "stream_if_large",
    "suffix_of",
]

# A reader gets the bytes of a file, its path where others lie beside it or another program reads it, and what the
# caller wants beyond coordinates. It says what is wrong, not in which file. Of formats that can hold several objects it
# gives the frames.
Reader = Callable[[bytes, Path, Wanted], Content | Frames[Content]]


@dataclass(frozen=True, slots=True)
class _Format:
    """How to read files of one suffix, and which groups of options they take, and the unit that all have."""

    read: Reader
    takes: tuple[str, ...] = ("fields",)
    unit: str | None = None


def _by(module: str) -> Any:
    """The module of this room that reads a format, imported when the first file of it comes: few need more than one."""
    return import_module(f"{__name__}.{module}")


# What to say where a file takes none of a group.
_OPTIONS = {
    "fields": "labels and weights apply to meshes, clouds and molecules only",
    "frame": "a frame is chosen of molecules and volumes only",
    "grey": "threshold and invert apply to pictures and volumes only",
    "texture": "textures are read of meshes only",
}

_PAINTED, _ATOMS, _GRID = ("fields", "texture"), ("fields", "frame"), ("frame", "grey", "measure")
_MESHES_AND_CLOUDS = {
    ".3mf": _Format(lambda data, *_: _by("threemf").read_3mf(data)),
    ".csv": _Format(lambda data, _, wanted: _by("tables").read_table(data, wanted.fields)),
    ".dae": _Format(lambda data, *_: _by("collada").read_dae(data)),
    ".e57": _Format(lambda data, path, _: _by("scans").read_e57(data, path), unit="m"),
    ".glb": _Format(lambda data, path, wanted: _by("gltf").read_glb(data, path, texture=wanted.texture), _PAINTED, "m"),
    ".gltf": _Format(
        lambda data, path, wanted: _by("gltf").read_gltf(data, path, texture=wanted.texture), _PAINTED, "m"
    ),
    ".las": _Format(lambda data, *_: _by("scans").read_las(data)),
    ".laz": _Format(lambda data, *_: _by("scans").read_las(data)),
    ".npy": _Format(lambda data, *_: _by("tables").read_npy(data)),
    ".npz": _Format(lambda data, _, wanted: _by("tables").read_npz(data, wanted.fields)),
    ".obj": _Format(lambda data, path, wanted: _by("obj").read_obj(data, path if wanted.texture else None), _PAINTED),
    ".off": _Format(lambda data, *_: _by("off").read_off(data)),
    ".pcd": _Format(lambda data, path, _: _by("pcd").read_pcd(data, path)),
    ".ply": _Format(lambda data, path, wanted: _by("ply").read_ply(data, path if wanted.texture else None), _PAINTED),
    ".step": _Format(lambda data, path, _: _by("step").read_step(data, path), unit="m"),
    ".stl": _Format(lambda data, *_: _by("stl").read_stl(data)),
    ".stp": _Format(lambda data, path, _: _by("step").read_step(data, path), unit="m"),
    ".txt": _Format(lambda data, _, wanted: _by("tables").read_table(data, wanted.fields)),
    ".xyz": _Format(lambda data, *_: _by("tables").read_xyz(data), _ATOMS),
}
_MOLECULES = {
    ".cif": _Format(lambda data, _, wanted: _by("cif").read_cif(data, wanted.fields), _ATOMS, "A"),
    ".mol": _Format(lambda data, *_: _by("molfile").read_molfile(data), _ATOMS, "A"),
    ".pdb": _Format(lambda data, _, wanted: _by("pdb").read_pdb(data, wanted.fields), _ATOMS, "A"),
    ".sdf": _Format(lambda data, *_: _by("molfile").read_molfile(data), _ATOMS, "A"),
}
_VOLUMES = {
    ".map": _Format(lambda data, _, wanted: _by("volume_files").read_mrc(data, wanted), _GRID, "A"),
    ".mrc": _Format(lambda data, _, wanted: _by("volume_files").read_mrc(data, wanted), _GRID, "A"),
    ".nii": _Format(lambda data, _, wanted: _by("volume_files").read_nifti(data, wanted), _GRID),
    ".nrrd": _Format(lambda data, _, wanted: _by("volume_files").read_nrrd(data, wanted), _GRID),
}
_PICTURES = {
    suffix: _Format(lambda data, path, wanted: _by("image").read_image(data, suffix_of(path), wanted), ("grey",))
    for suffix in FORMATS
}
_IN_SPACE = _MESHES_AND_CLOUDS | _MOLECULES | _VOLUMES
_FORMATS = _IN_SPACE | _PICTURES
# Suffixes of objects in space.
READERS = tuple(sorted(_IN_SPACE))
# Suffixes of pictures: apart from the others, because the textures of meshes lie beside these in one directory.
IMAGES = frozenset(FORMATS)
# All that `load` reads; each may have `.gz` behind it.
SUFFIXES = tuple(sorted(_FORMATS))


def load(
    path: str | PathLike[str],
    *,
    measure: Literal["surface", "solid"] | None = None,
    labels: str | None = None,
    weights: str | None = None,
    frame: int | None = None,
    threshold: Threshold | None = None,
    invert: bool = False,
    texture: bool = False,
) -> Shape:
    """Shape in a file: a mesh if it has faces, else a cloud with its normals where the file has them.

    A picture becomes the weighted points of the plane that its pixels are (see `symrefine.load.image`), a volume the
    surface in it, or its voxels (see `symrefine.load.volume`).

    Coordinates keep the precision of the file, float64 where it has that. Polygons become triangles; several parts of
    a scene become one shape in the frame of the scene.

    Molecules (.xyz with an element before each x y z, .mol, .sdf, .pdb, .cif) give their elements as labels.
    Other labels, and colours, are read only where they are asked for; images of textures by `texture`.

    Args:
        path: file whose suffix is one of `SUFFIXES`, in any case, and may be followed by `.gz`.
        measure: what carries the mass of a mesh or a volume, "surface" if None. Clouds and pictures have no choice.
        labels: what tells the classes that every symmetry must keep: a vertex or face property of .ply (`label`,
            `material_index`), a field of .pcd, a titled column of .csv or .txt (numbers or texts), an array of .npz
            ([F] for faces, [N] for points), `material` for what `usemtl` names in .obj, or `color` for the colours of
            vertices or faces (.ply, .obj, .off, .glb, and columns red green blue). Colours closer than about a quarter
            of the scale become one class (see `symrefine.texture`). A face whose vertices have labels takes that
            of two corners, or of the first where all differ. Elements if None, for molecules.
        weights: a property, column or array of numbers that are the masses of the points of a cloud.
        frame: which of several molecules, models or volumes in one file, from 0; None where there is one. `load_frames`
            takes all.
        threshold: of a picture or a volume: grey value from 0 (its darkest) to 1 that makes it binary, or "otsu"; it is
            taken as it is if None.
        invert: of a picture or a volume: exchange object and background.
        texture: of a mesh (.obj, .ply, .glb, .gltf): what its faces show, with the images beside it or in it; `detect`
            then also tells the group of the shape with its texture.

    Raises:
        InputError: the file is missing, unreadable, not what its suffix says, incomplete, contradicts itself, holds
            coordinates that are not finite, fewer than two distinct points or no area; a measure for a cloud; several
            frames of which none is chosen; options that the format knows nothing of; labels or weights that the file
            does not have, or that are of the wrong kind; a library that is not installed.
    """
    if frame is not None and (isinstance(frame, bool) or not isinstance(frame, int)):
        raise InputError(f"frame is {frame!r}; expected a whole number from 0, or None")
    file, wanted = path_of(path), _wanted(measure, labels, weights, threshold, invert, texture)
    with about(str(path)):
        content = _contents(file, wanted, is_chosen=frame is not None).chosen(frame)
    return _shape(content, file, wanted, source=str(path))


def load_frames(
    path: str | PathLike[str],
    *,
    measure: Literal["surface", "solid"] | None = None,
    labels: str | None = None,
    weights: str | None = None,
    threshold: Threshold | None = None,
    invert: bool = False,
    texture: bool = False,
) -> Frames[Shape]:
    """Every object in a file: molecules one after the other, models, volumes of a series; one of any other file.

    Args:
        path: as of `load`, and so are the others.

    Returns:
        A sequence of as many shapes as the file has, each made when it is asked for, and named `traj.xyz#3` where there
        are several.

    Raises:
        InputError: as `load`; what is wrong with one of several objects is told when that is asked for.
    """
    file, source = path_of(path), str(path)
    wanted = _wanted(measure, labels, weights, threshold, invert, texture)
    with about(source):
        contents = _contents(file, wanted)

    def shape(number: int) -> Shape:
        name = source if len(contents) == 1 else f"{source}#{number}"
        with about(name):
            content = contents[number]
        return _shape(content, file, wanted, source=name)

    return Frames(contents.what, len(contents), shape)


def _wanted(
    measure: Literal["surface", "solid"] | None,
    labels: str | None,
    weights: str | None,
    threshold: Threshold | None,
    invert: bool,
    texture: bool,
) -> Wanted:
    """What a caller wants of a file beyond coordinates."""
    if measure not in (None, "surface", "solid"):
        raise InputError(f"measure is {measure!r}; expected 'surface', 'solid' or None")
    if threshold not in (None, "otsu") and not (isinstance(threshold, int | float) and 0.0 < threshold < 1.0):
        raise InputError(f"threshold is {threshold}; expected a grey value between 0 (black) and 1 (white), or 'otsu'")
    said: dict[str, Any] = {"labels": labels, "weights": weights}
    for option, name in said.items():
        if not isinstance(name, str | None):
            raise InputError(f"{option}: is of type {type(name).__name__}; expected a name that the file has")
    flags = {"invert": flag_of("invert", invert), "texture": flag_of("texture", texture)}
    return Wanted(labels=labels, weights=weights, measure=measure, threshold=threshold, **flags)


def _contents(file: Path, wanted: Wanted, *, is_chosen: bool = False) -> Frames[Content]:
    """The objects in a file, of which one may be chosen."""
    suffix = suffix_of(file)
    try:
        is_folder = file.is_dir()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error  # without the name, which may be long
        raise InputError(f"is no name of a file: {reason}") from None
    if is_folder:
        raise InputError("is a directory; expected a file")
    if suffix not in _FORMATS and not file.exists():
        raise InputError("no such file")
    if suffix not in _FORMATS:
        images = " ".join(sorted(IMAGES))
        raise InputError(
            f"unknown suffix {suffix!r}; known are {' '.join(READERS)}, and images {images}, and {GZIP} of each"
        )
    kind = _FORMATS[suffix]
    _check_options(kind, wanted, is_chosen=is_chosen)
    data = file_bytes(file)
    if file.suffix.lower() == GZIP:
        data = unpacked(data, LARGEST if "grey" in kind.takes else None)
    found = kind.read(data, file, wanted)
    return found if isinstance(found, Frames) else one(found, "objects")


def _shape(content: Content, file: Path, wanted: Wanted, *, source: str) -> Shape:
    """The shape that a content of a file is."""
    kind = _FORMATS[suffix_of(file)]
    with about(source):
        check_finite(content)
        check_distinct(content)
        if wanted.texture and content.paint is None:
            raise InputError("has no faces, so no texture; leave it out for clouds")
        passed(len(content.points), len(content.points))
        arrays = _arrays(content, wanted, None if "measure" in kind.takes else wanted.measure, source)
    # Labels that count unasked are elements, of atoms whatever else is asked of these, and lengths then are angstroms.
    atoms = content.labels is not None
    elements = wanted.labels is None and atoms
    unit = content.unit or kind.unit or ("A" if elements else None)
    return Shape(source=source, unit=unit, elements=elements, isolated=atoms or None, **arrays)


def _check_options(kind: _Format, wanted: Wanted, *, is_chosen: bool) -> None:
    """Refuse what the files of one suffix know nothing of."""
    given = {
        "fields": bool(wanted.fields),
        "frame": is_chosen,
        "grey": wanted.threshold is not None or wanted.invert,
        "texture": wanted.texture,
    }
    for group, said in given.items():
        if said and group not in kind.takes:
            users = [suffix for suffix in SUFFIXES if group in _FORMATS[suffix].takes]
            raise InputError(_OPTIONS[group] + (f": {' '.join(users)}" if group != "fields" else ""))


def _arrays(content: Content, wanted: Wanted, measure: str | None, source: str) -> dict[str, Any]:
    """What becomes of a content, by the names that `Shape` has for it."""
    if content.faces is not None:
        if wanted.weights is not None:
            raise InputError("has faces, which weigh what their areas do; weights are for clouds")
        return {"measure": measure or "surface"} | mesh_arrays(content, content.faces, wanted.labels, source)
    if measure is not None:
        raise InputError(f"has no faces, so measure {measure!r} does not apply; leave it out for clouds")
    classes, kinds = (content.labels, None) if wanted.labels is None else point_classes(content, wanted.labels)
    return {
        "points": content.points,
        "normals": content.normals,
        "weights": content.weights if wanted.weights is None else point_weights(content, wanted.weights),
        "labels": classes,
        "kinds": kinds,
        "viewpoint": content.viewpoint,
    }
