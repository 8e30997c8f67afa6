"""Everything that one export writes: names and contents of files, and what they cannot express."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from symrefine.detection.result import Detection
from symrefine.errors import InputError
from symrefine.export.bop import bop_entry, bop_limits, bop_text, decided
from symrefine.export.canonical import Canonical, canonical_pose
from symrefine.export.consumers import CONSUMERS, Consumer, reading
from symrefine.export.models import check_suffix, model_bytes, moved, npz_bytes
from symrefine.export.operations import motions_bytes, motions_limits, reflections_left_out
from symrefine.files import json_text
from symrefine.shape import Shape

SCHEMA = "symrefine.canonical/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Package:
    """Contents by path, all to be written or none, and notes for people, a sentence each."""

    files: Mapping[Path, bytes]
    notes: tuple[str, ...]


def bop_package(out: Path, detection: Detection, shape: Shape, *, number: int, scale: float) -> Package:
    """`models_info.json` with the entry of one object put in, in the frame of the model file."""
    text = bop_text(out, {number: bop_entry(detection, shape, scale=scale)})
    limits = bop_limits(detection)
    notes = (*reflections_left_out(detection.group), *((limits,) if limits else ()))
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
    model, notes = _model(folder / (stem + suffix), shape, pose, unit)
    place = folder / f"{stem}_transform.json"
    files = {folder / (stem + suffix): model, place: transform_bytes(place, pose, shape.source, unit)}
    if found.models_info is not None:
        info = folder / "models_info.json"
        files[info] = bop_text(info, {number: found.models_info}).encode("ascii")
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
    if source.suffix.lower() == suffix and source.is_file():
        kept = moved(source.read_bytes(), suffix, pose.matrix(scale))
        if kept is not None:
            has_materials = suffix == ".obj" and b"\nmtllib" in b"\n" + kept
            return kept, ["materials and textures stay where they are: copy them beside the model"] * has_materials
    check_suffix(path, shape)
    lost = shape.faces is not None or shape.labels is not None
    notes = ["colours, textures, labels and normals of meshes are not carried over"] if lost else []
    return model_bytes(path, pose.shape(shape, scale)), notes
