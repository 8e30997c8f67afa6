"""`models_info.json` of the BOP benchmark of 6-D pose: size of a model and the rotations that leave it unchanged.

Lengths are millimetres in the frame of the model file. A discrete symmetry is a rigid motion, 16 numbers row by row; a
continuous one is an axis and a point on it. `bop_toolkit` multiplies every discrete one with every turn about every
continuous axis; it adds the identity itself. Only proper rotations belong here: nobody can turn a thing into its mirror
image. Some readers know less than the format: MegaPose takes axes along +x, +y or +z through the origin, FoundationPose
the first axis only. So an axis points to its positive side, its offset is the point nearest to the origin, and what is
within a thousandth (of the diameter, or in radians) of the axes of the file is put on them: a tenth of the step at
which `bop_toolkit` samples a continuous symmetry.
"""

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.distance import cdist

from symrefine.detection.result import Detection
from symrefine.errors import InputError
from symrefine.files import json_text
from symrefine.geometry import Array, Isometry, corners, frame_with_z, rotation, toward_positive, unit
from symrefine.groups import PointGroup
from symrefine.shape import Shape
from symrefine.symmetrize import exact_place
from symrefine.units import EVERYDAY_M, METRES, check_scale

Entry = dict[str, Any]

# Object 1 is obj_000001.ply.
_NAME = re.compile(r"obj_([0-9]{1,9})")
# Points whose distances are formed at once.
_BLOCK = 512
_SNAP = 1e-3
# Below this fraction of the diameter, or of a unit vector, components are rounding.
_ROUNDING = 1e-10


def bop_entry(detection: Detection, shape: Shape, *, scale: float = 1.0) -> Entry:
    """The entry of one object: diameter, bounding box and symmetries.

    Args:
        scale: millimetres in one unit of the shape: 1 if the file is in millimetres, 1000 if in metres.

    Raises:
        InputError: the scale is not positive, or the detection was undecided.
    """
    check_scale(scale)
    group, center = decided(detection, shape)
    return placed_entry(group, center * scale, shape.points * scale)


def decided(detection: Detection, shape: Shape) -> tuple[PointGroup, Array]:
    """The group and the point [3] where its operations meet, as exactly as the shape has them.

    Raises:
        InputError: the detection was undecided.
    """
    if detection.undetermined:
        raise InputError(f"{shape.source}: no symmetries to export: {detection.undetermined}")
    return exact_place(shape, detection.group, detection.center)


def placed_entry(group: PointGroup, center: Array, points: Array) -> Entry:
    """The entry of an object with a group about a centre.

    Args:
        points: [N, 3] vertices, millimetres.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    size = diameter(points)
    entry: Entry = {"diameter": size}
    entry |= {f"min_{k}": float(v) for k, v in zip("xyz", low, strict=True)}
    entry |= {f"size_{k}": float(v) for k, v in zip("xyz", high - low, strict=True)}
    proper = _snapped(group.proper_subgroup())
    discrete = [_motion(matrix, center, size) for matrix in _discrete(proper)]
    # Three axes for a sphere, see `bop_limits`.
    axes = np.eye(3) if proper.name == "K" else proper.continuous_axes()
    continuous = [_turning(toward_positive(u) * u, center, size) for u in axes]
    entry |= {"symmetries_discrete": discrete} if discrete else {}
    entry |= {"symmetries_continuous": continuous} if continuous else {}
    return entry


def bop_limits(detection: Detection) -> str:
    """What of the symmetry the format cannot hold, as a sentence; empty where it holds all.

    No reader multiplies turns about one continuous axis with those about another, so the three axes that stand for a
    sphere, as its users write it (DOPE #249), give only a part of its rotations.
    """
    if detection.group.proper_subgroup().name != "K":
        return ""
    return "BOP cannot express a sphere: three continuous axes through its centre stand for all the others"


def metres_doubt(source: str, size: float, option: str, scale: float | None) -> str:
    """That a file may be in metres, or millimetres, and was taken for the other, as a sentence; else nothing.

    Args:
        size: diameter in millimetres.
        option: of the command line that takes the millimetres in one unit of the file.
        scale: what that was given, if anything.
    """
    if scale is None and size * METRES["mm"] < EVERYDAY_M[0]:
        return f"{source}: a diameter of {size:.3g} mm is little; metres? then give {option} 1000"
    if scale is not None and size * METRES["mm"] > EVERYDAY_M[1]:
        return f"{source}: a diameter of {size:,.0f} mm is much; is one unit of it {scale:g} mm, as {option} says?"
    return ""


def bop_text(path: Path, entries: Mapping[int, Entry]) -> str:
    """Content of `path` with the entries of objects, by their number, put in or replaced, all others as they are.

    Raises:
        InputError: a number is negative, or the file is not a `models_info.json`.
    """
    for number in entries:
        if number < 0:
            raise InputError(f"object id is {number}; expected an integer from 0")
    return json_text(read_models_info(path) | {str(number): entry for number, entry in entries.items()})


def replaced(path: Path, entries: Mapping[int, Entry]) -> str:
    """Which objects a `models_info.json` has that are put in anew and differ, as a sentence; empty if there is none."""
    known = read_models_info(path)
    others = [n for n, entry in entries.items() if known.get(str(n), entry) != entry]
    if not others:
        return ""
    was = known[str(others[0])].get("diameter")
    size = f", of a diameter of {was:.4g} mm," if isinstance(was, int | float) else ""
    return f"{path}: object {others[0]} was there{size} and is replaced"


def read_models_info(path: Path) -> dict[str, Entry]:
    """The entries of an existing file; none if there is no file.

    Raises:
        InputError: not JSON, or not an object for each object.
    """
    if not path.is_file():
        return {}
    try:
        data = json.loads(path.read_text(encoding="utf-8"), parse_constant=_number, parse_float=_number)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is there already and is no models_info.json: {error}") from None
    if not isinstance(data, dict) or not all(isinstance(entry, dict) for entry in data.values()):
        raise InputError(f"{path}: is there already and is no models_info.json: expected an object for each object id")
    return data


def number_of(name: str) -> int | None:
    """The number of the object whose model BOP gives a name: 1 of obj_000001; None if it is no such name."""
    match = _NAME.fullmatch(name)
    return int(match[1]) if match else None


def number_for(source: str, asked: int | None) -> int:
    """The number of the object in a file: what is asked for, or that of its name as BOP gives them, or 1."""
    from symrefine.load import stem_of

    found = number_of(stem_of(Path(source))) if asked is None else asked
    return 1 if found is None else found


def models_of(folder: Path, known: Mapping[str, int]) -> tuple[dict[int, Path], bool]:
    """The models of a folder by their number, and whether their names tell it.

    Where a name is as BOP gives them, object 1 is obj_000001.ply, the numbers are theirs, and what else is there stays.
    Where none is, all count: a model keeps the number that it had, and the others go on from there, from 1 if there is
    none, in the order of their names.

    Args:
        known: numbers that models without such a name had before, by the names of their files.

    Raises:
        InputError: no such folder, no model, or two of one object.
    """
    from symrefine.load import READERS, stem_of, suffix_of

    if not folder.is_dir():
        raise InputError(f"{folder}: {'is a file, not a' if folder.exists() else 'no such'} directory")
    paths = sorted(p for p in folder.iterdir() if suffix_of(p) in READERS and p.is_file() and p.name[0] != ".")
    if not paths:
        raise InputError(f"{folder}: no mesh and no cloud in it; known are {' '.join(READERS)}, and .gz of each")
    numbers = {path: number for path in paths if (number := number_of(stem_of(path))) is not None}
    if is_told := bool(numbers):
        paths = list(numbers)
    else:
        numbers = {path: known[path.name] for path in paths if path.name in known}
        new = (path for path in paths if path not in numbers)
        numbers |= {path: number for number, path in enumerate(new, max(known.values(), default=0) + 1)}
    models: dict[int, Path] = {}
    for path in paths:
        other = models.setdefault(numbers[path], path)
        if other != path:
            raise InputError(f"{path}: is object {numbers[path]}, and so is {other.name}; keep one of them")
    return dict(sorted(models.items())), is_told


def diameter(points: Array) -> float:
    """Largest distance between two of the points [N, n], exactly; only corners of the convex hull can have it."""
    outer = corners(points)
    radius = np.linalg.norm(outer - outer.mean(axis=0), axis=1)
    order = np.argsort(-radius)
    outer, radius = outer[order], radius[order]
    best = 0.0
    for start in range(0, len(outer), _BLOCK):
        if 2.0 * radius[start] <= best:
            break
        best = max(best, float(cdist(outer[start : start + _BLOCK], outer[start:]).max()))
    return best


def _number(text: str) -> float:
    """A number that can be written again; Python reads NaN, and takes 1e999 for infinity."""
    value = float(text)
    if not np.isfinite(value):
        raise ValueError(f"{text[:40]} is no finite number")
    return value


def _snapped(group: PointGroup) -> PointGroup:
    """The group turned onto the coordinate axes if it is that close: its z first, then x and y."""
    z = group.frame[2]
    if np.abs(np.round(z) - z).max() > _SNAP:
        return group
    z = np.round(z)
    x = unit(group.frame[0] - (group.frame[0] @ z) * z)
    frame = np.stack([x, np.cross(z, x), z])
    nearest = np.round(frame)
    return PointGroup(name=group.name, frame=nearest if np.abs(nearest - frame).max() <= _SNAP else frame)


def _discrete(group: PointGroup) -> Array:
    """Rotations [k, 3, 3] of a proper group but for the identity, to be multiplied with the continuous ones."""
    if group.is_finite:
        return group.operations()[1:]
    if group.symbol.family != "D":
        return np.zeros((0, 3, 3))
    return rotation(frame_with_z(group.continuous_axes()[0])[1], math.pi)[None]


def _turning(axis: Array, center: Array, size: float) -> Entry:
    """All turns about an axis through the centre of something of that diameter."""
    foot = center - (center @ axis) * axis
    return {"axis": _clean(axis, _ROUNDING), "offset": _clean(foot, _SNAP * size)}


def _motion(matrix: Array, center: Array, size: float) -> list[float]:
    """A rotation about the centre as a 4 x 4 matrix, row by row."""
    shift = _clean(Isometry.about(_clean(center, _SNAP * size), matrix).shift, _ROUNDING * size)
    rows = [[*_clean(row, _ROUNDING), t] for row, t in zip(matrix, shift, strict=True)]
    return [x for row in [*rows, [0.0, 0.0, 0.0, 1.0]] for x in row]


def _clean(values: Array, negligible: float) -> list[float]:
    """The values, 0 where they are negligible."""
    return [0.0 if abs(v) <= negligible else float(v) for v in values]
