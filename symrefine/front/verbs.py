"""What can be asked of any object: `detect`, `align`, `symmetrize`, `complete`, `export`, `report`."""

from collections.abc import Sequence
from dataclasses import replace
from operator import index
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from numpy.typing import ArrayLike

from symrefine.errors import InputError
from symrefine.front.answers import Found, check_kind
from symrefine.geometry import check_tolerance
from symrefine.load.objects import shape_of
from symrefine.surface.misses import TOLERANCE

# Each verb imports what it needs when it is used: who detects waits for no alignment.
if TYPE_CHECKING:
    from symrefine.complete import Completion
    from symrefine.detection.measure import Outliers
    from symrefine.export.packages import Format, Package
    from symrefine.front.aligned import Alignment
    from symrefine.front.beyond import SubspaceDetection
    from symrefine.front.planar import PlanarDetection
    from symrefine.front.space import Detection
    from symrefine.symmetrize import Symmetrized

    Detected: TypeAlias = Detection | PlanarDetection | SubspaceDetection


def detect(
    shape: Any,
    *,
    weights: ArrayLike | None = None,
    normals: ArrayLike | None = None,
    labels: ArrayLike | None = None,
    viewpoint: ArrayLike | None = None,
    outliers: "Outliers" = "auto",
    tolerance: float = TOLERANCE,
    ladder: Sequence[float] | None = None,
    seed: int = 0,
) -> "Detected":
    """The symmetry of an object: point group, mirrors and turns, how sure it is, and what it misses each of them by.

    Args:
        shape: a path, points [N, n], `(vertices, faces)`, a `Shape`, or a mesh, a cloud or a molecule of trimesh,
            Open3D, pyvista, ASE, pymatgen or torch (see `symrefine.load.objects.shape_of`).
        weights: [N] masses of the points. Of up to 250 points those of different mass are different things, which no
            symmetry exchanges; of more, masses are a sampling density.
        normals: [N, n] normals, any sign; estimated where absent.
        labels: [N] whole numbers, [F] for a mesh: classes (elements, colours, materials) that every symmetry must keep.
        viewpoint: [3] or [N, 3] place of the camera that saw the points, or each of them.
        outliers: "auto": points of a cloud that belong to no surface are set apart; "none": all points count.
        tolerance: largest miss that still counts as symmetric, as a fraction of the bounding-box diagonal.
        ladder: other tolerances to tell the group at, in space; those of the command line if None.
        seed: of the random choices (samples of a mesh, subsets of a cloud).

    Returns:
        A `Detection` of an object in 3-space, a `PlanarDetection` of a picture or of points [N, 2], a
        `SubspaceDetection` of points of four to eight coordinates.

    Raises:
        InputError: what is no such object, or cannot be used; tolerances outside (0, 0.2].
        DegenerateShapeError: the points do not spread.
    """
    shape = shape_of(shape, weights=weights, normals=normals, labels=labels, viewpoint=viewpoint)
    tolerance, seed = _number(tolerance), _seed(seed)
    options: dict[str, Any] = {"tolerance": tolerance, "seed": seed}
    if shape.dim == 3:
        from symrefine.detection import story
        from symrefine.front.space import Detection

        steps = story.LADDER if ladder is None else tuple(ladder)
        found = story.detect(shape, outliers=outliers, ladder=steps, tolerance=tolerance, seed=seed)
        told = options | {"outliers": outliers}
        if found.textured is not None:
            found = replace(found, textured=Detection.of(found.textured, shape=shape, options=told))
        return Detection.of(found, shape=shape, options=told)
    given = {
        "labels are": shape.labels is not None,
        "a ladder is": ladder is not None,
        "outliers are": outliers != "auto",
    }
    for name in (name for name, is_given in given.items() if is_given):
        raise InputError(
            f"{shape.source}: points have {shape.dim} coordinates; {name} for objects in space, leave them out"
        )
    if shape.dim == 2:
        from symrefine.front.planar import PlanarDetection
        from symrefine.plane import detect_planar

        return PlanarDetection.of(detect_planar(shape, tolerance=tolerance, seed=seed), shape=shape, options=options)
    from symrefine.front.beyond import SubspaceDetection
    from symrefine.ndim import detect_nd

    return SubspaceDetection.of(detect_nd(shape, tolerance=tolerance, seed=seed), shape=shape, options=options)


def detect_in_space(shape: Any, *, tolerance: float = TOLERANCE, seed: int = 0) -> "Detection":
    """What `detect` says of an object in space.

    Raises:
        InputError: points of another number of coordinates.
    """
    from symrefine.front.space import Detection

    shape = shape_of(shape)
    if shape.dim != 3:
        raise InputError(f"{shape.source}: points have {shape.dim} coordinates; this is for objects in space")
    found = detect(shape, tolerance=tolerance, seed=seed)
    assert isinstance(found, Detection)
    return found


def align(
    source: Any,
    target: Any,
    *,
    scale: bool = False,
    polish: bool = True,
    allow_reflection: bool = True,
    tolerance: float = TOLERANCE,
    seed: int = 0,
) -> "Alignment":
    """The orthogonal map and the translation that take one object onto another; samplings and formats may differ.

    Args:
        source: whatever `detect` takes.
        target: whatever `detect` takes.
        scale: whether the objects may differ in size; then `target ~ scale * matrix @ source + translation`.
        polish: refine on the points (3-space only); without it the moments have the last word, in half of the time.
        allow_reflection: whether determinant -1 is an answer.
        tolerance: largest miss that still counts as agreement, as in `detect`.
        seed: of the random choices (samples of meshes, subsets of clouds).

    Raises:
        InputError: what is no such object, or cannot be used; different dimensions, or options out of range.
        DegenerateShapeError: the points do not spread.
    """
    from symrefine.align import story
    from symrefine.front.aligned import Alignment

    moved, met = shape_of(source, name="source"), shape_of(target, name="target")
    tolerance, seed = _number(tolerance), _seed(seed)
    found = story.align(
        moved, met, scale=scale, polish=polish, allow_reflection=allow_reflection, tolerance=tolerance, seed=seed
    )
    options = {"tolerance": tolerance, "scale": bool(scale), "seed": seed}
    told = options | {"measure": None, "rotations_only": not allow_reflection}
    return Alignment.of(found, source=moved, target=met, options=told)


def symmetrize(
    shape: Any,
    found: "Detection | None" = None,
    *,
    group: str | None = None,
    tolerance: float = TOLERANCE,
    seed: int = 0,
) -> "Symmetrized":
    """The nearest exactly symmetric mesh or cloud.

    Args:
        shape: whatever `detect` takes, in 3-space.
        found: what `detect` found in it; detected if None.
        group: the subgroup of it that is to be made exact, such as "Cs"; the whole group if None.
        tolerance: by what fraction of the diagonal the shape may miss the symmetry.
        seed: of the random samples of a surface.

    Raises:
        InputError: nothing is decided, no symmetry, or no such subgroup.
        DegenerateShapeError: a few points, of which some have no counterpart.
    """
    from symrefine.symmetrize import placed_subgroup, symmetrize

    shape = shape_of(shape)
    found = detect_in_space(shape, tolerance=tolerance, seed=seed) if found is None else _in_space(found)
    if found.undetermined:
        raise InputError(f"{shape.source}: no symmetry to make exact: {found.undetermined}")
    if found.point_group == "C1":
        raise InputError(f"{shape.source}: is C1, nothing to make symmetric{_nearest_miss(found)}")
    chosen = found.group if group is None else placed_subgroup(found.group, group)
    return symmetrize(shape, chosen, found.center, tolerance=tolerance, seed=seed)


def complete(
    shape: Any,
    found: "Detection | None" = None,
    *,
    viewpoint: ArrayLike | None = None,
    outliers: "Outliers" = "auto",
    tolerance: float = TOLERANCE,
    seed: int = 0,
) -> "Completion":
    """The points of a scan and their images where nobody looked, under the group that is found in it.

    Args:
        shape: a cloud in 3-space, in any form that `detect` takes.
        found: what `detect` found in it; the options that follow are those of `detect` where this is None.
        viewpoint: as of `detect`.
        outliers: as of `detect`.
        tolerance: as of `detect`.
        seed: as of `detect`.

    Raises:
        InputError: a mesh or atoms, an object without a symmetry, or none that can be decided.
    """
    from symrefine.complete import complete
    from symrefine.front.space import Detection

    shape = shape_of(shape, viewpoint=viewpoint)
    made = complete(shape, found, outliers=outliers, tolerance=tolerance, seed=seed)
    options = {"tolerance": tolerance, "seed": seed, "outliers": outliers}
    return replace(made, detection=found or Detection.of(made.detection, shape=shape, options=options))


def export(
    shape: Any,
    to: "Format",
    out: str | Path,
    *,
    found: "Detection | None" = None,
    number: int = 1,
    scale: float = 1.0,
    improper: bool = False,
    steps: int | None = None,
    transform: str | Path | None = None,
) -> "Package":
    """Write the symmetries as another program reads them: all files or none.

    Args:
        shape: whatever `detect` takes, in 3-space.
        to: "bop": an entry in `models_info.json`; "npz": matrices [N, 4, 4]; "canonical": the model with its axis on z;
            or a folder for "foundationpose", "megapose", "dope", "isaac".
        out: the file, or the folder.
        found: what `detect` found in it; detected if None.
        number: of the object in `models_info.json`.
        scale: millimetres in one unit of the object.
        improper: npz: whether mirrors and the like belong to the matrices.
        steps: npz: turns that stand for a continuous axis; 72 if None.
        transform: canonical: where the transform goes, .json or .npz; `OUT_transform.json` if None.

    Returns:
        What was written, and notes on what the format cannot express.

    Raises:
        InputError: another format, nothing decided, or files that cannot be written.
    """
    from symrefine.export.operations import STEPS
    from symrefine.export.packages import package_of, write_package

    shape, out = shape_of(shape), Path(out)
    found = detect_in_space(shape) if found is None else _in_space(found)
    place = None if transform is None else Path(transform)
    turns = STEPS if steps is None else steps
    package = package_of(
        to, out, found, shape, number=number, scale=scale, improper=improper, steps=turns, transform=place
    )
    write_package(package, to, out)
    return package


def report(given: Any, path: str | Path) -> "Detected":
    """Write the page (.html), picture (.png), recording (.rrd) or record (.json) of an object, and return the answer.

    Args:
        given: an answer of `detect`, or whatever it takes.
        path: the file to write.

    Raises:
        InputError: what `detect` and `Detection.save` refuse.
    """
    check_kind(Path(path))
    found: Any = given if isinstance(given, Found) else detect(given)
    found.save(path)
    return found


def _in_space(found: Any) -> "Detection":
    """What was found before, if it is of an object in space."""
    from symrefine.front.space import Detection

    if not isinstance(found, Detection):
        raise InputError(f"found is of type {type(found).__name__}; expected what symrefine.detect found in space")
    return found


def _number(tolerance: Any) -> float:
    check_tolerance(tolerance)
    return float(tolerance)


def _seed(seed: Any) -> int:
    """A seed that numpy takes and JSON can hold."""
    try:
        whole = index(seed)
    except TypeError:
        whole = -1
    if whole < 0:
        raise InputError(f"seed is {seed!r}; expected a whole number from 0")
    return whole


def _nearest_miss(found: "Detection") -> str:
    if not found.near_misses:
        return ""
    miss = found.near_misses[0]
    return (
        f"; the nearest, a {miss.kind}, misses by {miss.residual.p95:.1%} of the diagonal at the 95th percentile: "
        "choose a larger tolerance if that counts as symmetric"
    )
