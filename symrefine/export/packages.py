"""Everything that one export writes: names and contents of files, and what they cannot express."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np

from symrefine.detection.result import Detection
from symrefine.errors import InputError, SymrefineError
from symrefine.export.bop import bop_entry, bop_limits, bop_text, decided, number_for, replaced
from symrefine.export.canonical import Canonical, canonical_pose
from symrefine.export.consumers import CONSUMERS, Consumer, reading
from symrefine.export.formats import TAKES, Format, takers
from symrefine.export.models import check_suffix, keeps_labels, model_bytes, moved, npz_bytes
from symrefine.export.operations import STEPS, motions_bytes, motions_limits, reflections_left_out
from symrefine.files import bytes_writer, check_other, check_target, json_text, write_all
from symrefine.load import SUFFIXES, load
from symrefine.shape import Index, Shape
from symrefine.units import check_scale

SCHEMA = "symrefine.canonical/1"
# Formats of meshes that show nothing but triangles.
_BARE = (".npz", ".stl")


@dataclass(frozen=True, kw_only=True)
class Package:
    """Contents by path, all to be written or none, and notes for people, a sentence each."""

    files: Mapping[Path, bytes]
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        return "\n".join([*map(str, self.files), *self.notes])


def package_of(
    to: Format,
    out: Path,
    detection: Detection,
    shape: Shape,
    *,
    number: int | None = None,
    scale: float = 1.0,
    improper: bool = False,
    steps: int | None = None,
    transform: Path | None = None,
) -> Package:
    """What one export writes.

    Args:
        out: the file, or the folder of a consumer.
        number: and what follows as of `symrefine.export`.

    Raises:
        InputError: another format, an option of another one, nothing decided, or a file that would take the place of
            the input, or of a model that no export made.
    """
    if to not in get_args(Format):
        raise InputError(f"to is {to!r}; expected one of {list(get_args(Format))}")
    check_scale(scale)
    given = {
        "number": number is not None,
        "scale": scale != 1.0,
        "improper": improper,
        "steps": steps is not None,
        "transform": transform is not None,
    }
    for name in (name for name, is_given in given.items() if is_given and name not in TAKES[to]):
        raise InputError(f"{name} does not apply to {to!r}; it is for {', '.join(map(repr, takers(name)))}")
    number = number_for(shape.source, number)
    if to == "bop":
        check_table_name(out)
        made = bop_package(out, detection, shape, number=number, scale=scale)
    elif to == "npz":
        if out.suffix.lower() != ".npz":
            raise InputError(f"{out}: expected a name that ends in .npz")
        made = npz_package(out, detection, shape, improper=improper, steps=steps or STEPS)
    elif to == "canonical":
        made = canonical_package(out, detection, shape, transform=transform or place_of_transform(out))
    else:
        check_folder_name(to, out)
        made = consumer_package(to, out, detection, shape, number=number, scale=scale)
    _check_places(list(made.files), shape.source, in_folder=to in CONSUMERS)
    return made


def check_table_name(out: Path) -> None:
    """Refuse the name of a model where a `models_info.json` is written.

    Raises:
        InputError: it has the suffix of a model.
    """
    if out.suffix.lower() in SUFFIXES:
        raise InputError(f"{out}: has the suffix of an object; expected a name such as models_info.json")


def check_folder_name(to: str, folder: Path) -> None:
    """Refuse the name of a model where a folder is made.

    Raises:
        InputError: the folder has the suffix of a model, and is not there.
    """
    if folder.suffix.lower() in SUFFIXES and not folder.is_dir():
        raise InputError(f"{folder}: is the name of a model, and {to} takes a folder; expected a name without suffix")


def _check_places(files: Sequence[Path], source: str, *, in_folder: bool) -> None:
    """Refuse files that cannot be written, or would take the place of the input or of a model of others."""
    for path in files:
        check_other(path, source, in_folder=in_folder)
        if path.parent.is_dir():
            check_target(path)
    if in_folder:
        _check_made(files[0])


def _check_made(model: Path) -> None:
    """Refuse to replace a model in a folder, named after its number and not by a person, that no export put there."""
    place = place_of_transform(model)
    if model.exists() and not place.exists():
        raise InputError(
            f"{model}: is there and was not made by export, which leaves {place.name} beside it; name another folder"
        )


def place_of_transform(out: Path) -> Path:
    """Where the transform to a canonical model goes unless told otherwise."""
    return out.with_name(f"{out.stem}_transform.json")


def write_package(package: Package, to: Format, out: Path) -> None:
    """Write all files or none; a folder that was not there goes again if one cannot be written."""
    with ExitStack() as undo:
        if to in CONSUMERS and not out.exists():
            out.mkdir()
            undo.callback(out.rmdir)
        write_all({str(path): bytes_writer(data) for path, data in package.files.items()})
        undo.pop_all()


def bop_package(out: Path, detection: Detection, shape: Shape, *, number: int, scale: float) -> Package:
    """`models_info.json` with the entry of one object put in, in the frame of the model file."""
    entries = {number: bop_entry(detection, shape, scale=scale)}
    text = bop_text(out, entries)
    said = (bop_limits(detection), replaced(out, entries))
    notes = (*reflections_left_out(detection.group), *filter(None, said))
    return Package(files={out: text.encode("ascii")}, notes=notes)


def npz_package(out: Path, detection: Detection, shape: Shape, *, improper: bool, steps: int) -> Package:
    """All operations as matrices in the frame and the units of the file."""
    content = motions_bytes(*decided(detection, shape), improper=improper, steps=steps)
    notes = motions_limits(detection.group, improper=improper, steps=steps)
    return Package(files={out: content}, notes=tuple(notes))


def canonical_package(out: Path, detection: Detection, shape: Shape, *, transform: Path) -> Package:
    """The model in its canonical pose, in the units of the file, and the transform that was applied.

    Raises:
        InputError: no symmetry, so nothing to put on an axis; or a format that does not hold the shape.
    """
    pose = canonical(detection, shape)
    model, notes = _model(out, shape, pose, 1.0)
    return Package(files={out: model, transform: transform_bytes(transform, pose, shape.source)}, notes=tuple(notes))


def canonical(detection: Detection, shape: Shape) -> Canonical:
    """The canonical pose of a shape with the symmetry that was found in it.

    Raises:
        InputError: no symmetry, so nothing to put on an axis.
    """
    group, center = decided(detection, shape)
    if group.name == "C1":
        raise InputError(f"{shape.source}: is C1: there is no axis and no mirror to put on the axes")
    return canonical_pose(group, center, shape)


def consumer_package(
    consumer: Consumer, folder: Path, detection: Detection, shape: Shape, *, number: int, scale: float
) -> Package:
    """A canonical model and the files that one consumer reads beside it, in a folder.

    Args:
        scale: millimetres in one unit of the shape.
    """
    pose = canonical_pose(*decided(detection, shape), shape)
    _, suffix, per_metre = CONSUMERS[consumer]
    found = reading(consumer, pose.group, pose.apply(shape.points, scale))
    stem = f"obj_{number:06d}" if found.models_info is not None else "model"
    unit = scale * per_metre / 1000.0
    path = folder / (stem + suffix)
    model, notes = _model(path, shape, pose, unit)
    place = place_of_transform(path)
    files = {path: model, place: transform_bytes(place, pose, shape.source, unit)}
    if found.models_info is not None:
        info = folder / "models_info.json"
        files[info] = bop_text(info, {number: found.models_info}).encode("ascii")
        notes += list(filter(None, [replaced(info, {number: found.models_info})]))
    if found.name:
        files[folder / (found.name if found.models_info is None else f"{stem}_{found.name}")] = found.content
    return Package(files=files, notes=(*found.notes, *notes))


def transform_bytes(path: Path, pose: Canonical, source: str, scale: float = 1.0) -> bytes:
    """The transform [4, 4] from the file to the canonical model as JSON, or as .npz if the path says so."""
    matrix = pose.matrix(scale)
    if path.suffix.lower() == ".npz":
        return npz_bytes(transform=matrix, inverse=np.linalg.inv(matrix), point_group=np.array(pose.group.name))
    data: dict[str, Any] = {"schema": SCHEMA, "source": source, "point_group": pose.group.name, "scale": scale}
    data |= {"transform": matrix.tolist(), "inverse": np.linalg.inv(matrix).tolist()}
    return json_text(data).encode("ascii")


def _model(path: Path, shape: Shape, pose: Canonical, scale: float) -> tuple[bytes, list[str]]:
    """The file of the shape with its coordinates moved, or else the shape written anew."""
    source, suffix = Path(shape.source), path.suffix.lower()
    if source.suffix.lower() == suffix and _is_in(source, shape):
        kept = moved(source.read_bytes(), suffix, pose.matrix(scale))
        if kept is not None:
            has_materials = suffix == ".obj" and b"\nmtllib" in b"\n" + kept
            return kept, ["materials and textures stay where they are: copy them beside the model"] * has_materials
    check_suffix(path, shape)
    more = shape.faces is not None and source.is_file() and source.suffix.lower() not in _BARE
    notes = ["colours, textures and normals that the file may have are not carried over"] * more
    notes += ["labels are not carried over"] * (not keeps_labels(suffix, shape))
    return model_bytes(suffix, pose.shape(shape, scale)), notes


def _is_in(source: Path, shape: Shape) -> bool:
    """Whether a file has what a shape has: a shape that was made of that, or is left of it, has its name, too."""
    try:
        there = load(source)
    except SymrefineError:  # no file, or one that has changed
        return False
    return np.array_equal(there.points, shape.points) and np.array_equal(_faces(there), _faces(shape))


def _faces(shape: Shape) -> Index:
    return np.empty((0, 3), dtype=np.int64) if shape.faces is None else shape.faces
