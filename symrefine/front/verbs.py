"""What can be asked of any object, and told: `detect`, `align`, `report`."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, overload

from numpy.typing import ArrayLike

from symrefine.errors import InputError
from symrefine.files import path_of
from symrefine.front.answers import Found, check_kind
from symrefine.front.asked import ladder_of, told
from symrefine.lengths import relative_tolerance
from symrefine.load.objects import objects_of, shape_of, stream_of
from symrefine.options import flag_of, whole_of
from symrefine.shape import Shape
from symrefine.stream import Stream
from symrefine.surface.misses import TOLERANCE

# Each verb imports what it needs when it is used: who detects waits for no alignment.
if TYPE_CHECKING:
    from symrefine.detection.measure import Outliers
    from symrefine.front.aligned import Alignment
    from symrefine.front.elsewhere import PlanarDetection, SubspaceDetection
    from symrefine.front.space import Detection
    from symrefine.geometry import Array

    Detected: TypeAlias = Detection | PlanarDetection | SubspaceDetection


def detect(
    shape: Any,
    *,
    frame: int | None = None,
    weights: ArrayLike | None = None,
    normals: ArrayLike | None = None,
    labels: ArrayLike | None = None,
    viewpoint: ArrayLike | None = None,
    isolated: bool | None = None,
    outliers: "Outliers" = "auto",
    tolerance: float | str = TOLERANCE,
    units: str | None = None,
    ladder: Sequence[float] | None = None,
    seed: int = 0,
    verify: Literal["sample", "all"] = "sample",
) -> "Detected":
    """The symmetry of an object: point group, mirrors and turns, how sure it is, and what it misses each of them by.

    The surface of a cloud of more than 100,000 points is known by a sample of them, its moments by all. A `Stream` is
    read in chunks, as are files of more than 1,000,000 points where that can be done (see `symrefine.stream`); the
    `shape` of the answer is that sample then.

    Args:
        shape: a path, points [N, n], `(vertices, faces)`, a `Shape`, a `Stream`, or a mesh, a cloud or a molecule of
            trimesh, Open3D, pyvista, ASE, pymatgen or torch (see `symrefine.load.objects.shape_of`). What else a file
            has, labels, a texture, is asked of `symrefine.load`, and the shape given.
        frame: which of several molecules, models or volumes in a file, from 0; None where there is one.
        weights: [N] masses of the points. Of points that stand for themselves those of different mass are different
            things, which no symmetry exchanges; of a surface masses are a sampling density.
        normals: [N, n] normals, any sign; estimated where absent.
        labels: [N] whole numbers, [F] for a mesh: classes (elements, colours, materials) that every symmetry must keep.
        viewpoint: [3] or [N, 3] place of the camera that saw the points, or each of them.
        isolated: whether the points stand for themselves, as atoms, markers and corners do, and are no samples of a
            surface; if None they do where they have elements, or are at most 250.
        outliers: "auto": points of a cloud that belong to no surface are set apart; "floor": so is the plane that the
            object stands on; "none": all points count.
        tolerance: largest miss that still counts as symmetric, as a fraction of the bounding-box diagonal, or as a
            length: "0.5mm", "0.1A", "0.5u" in units of the object.
        units: what a length of 1 in the object is, such as "mm", for a tolerance with a unit; what its format says if
            None.
        ladder: other tolerances to tell the group at, in space; those of the command line if None.
        seed: of the random choices (samples of a mesh, subsets of a cloud).
        verify: "all": of a cloud in space all points are moved, one by one, by every element that was found, and what
            they miss by is told as `Detection.verified`; it takes microseconds for each point and element.

    Returns:
        A `Detection` of an object in 3-space, a `PlanarDetection` of a picture or of points [N, 2], a
        `SubspaceDetection` of points of four to eight coordinates.

    Raises:
        InputError: what is no such object, or cannot be used; tolerances outside (0, 0.2].
        DegenerateShapeError: the points do not spread.
    """
    if verify not in ("sample", "all"):
        raise InputError(f"verify is {verify!r}; expected 'sample' or 'all'")
    beside: dict[str, Any] = {"weights": weights, "normals": normals, "labels": labels, "viewpoint": viewpoint}
    beside["isolated"] = isolated
    large = stream_of(shape) if frame is None and all(given is None for given in beside.values()) else None
    shape = shape_of(shape, frame=frame, **beside) if large is None else large
    used = relative_tolerance(tolerance, shape, units=units, outliers=outliers)
    seed = whole_of("seed", seed)
    options = told(tolerance, units) | {"seed": seed} | ({} if frame is None else {"frame": frame})
    if not isinstance(shape, Shape) or shape.dim == 3:
        from symrefine.detection import story

        steps = story.LADDER if ladder is None else ladder_of(ladder)
        return _detect_in_space(shape, options | {"outliers": outliers}, used, steps, verify)
    given = {
        "labels are": shape.labels is not None,
        "a ladder is": ladder is not None,
        "outliers are": outliers != "auto",
        "verification is": verify != "sample",
    }
    for name in (name for name, is_given in given.items() if is_given):
        raise InputError(
            f"{shape.source}: points have {shape.dim} coordinates; {name} for objects in space, leave them out"
        )
    if shape.dim == 2:
        from symrefine.front.elsewhere import PlanarDetection
        from symrefine.plane import detect_planar

        return PlanarDetection.of(detect_planar(shape, tolerance=used, seed=seed), shape=shape, options=options)
    from symrefine.front.elsewhere import SubspaceDetection
    from symrefine.ndim import detect_nd

    return SubspaceDetection.of(detect_nd(shape, tolerance=used, seed=seed), shape=shape, options=options)


def _detect_in_space(
    given: "Shape | Stream", options: dict[str, Any], tolerance: float, ladder: Sequence[float], verify: str
) -> "Detection":
    """What is found in a shape or a stream, verified by all points where that is asked for."""
    from symrefine.clock import Clock
    from symrefine.detection import story
    from symrefine.detection.sketch import MANY, Sketch, sketched
    from symrefine.front.space import Detection

    clock, seed = Clock(), options["seed"]
    if isinstance(given, Stream) and given.count <= MANY:
        given = given.held()
    looked_at: Shape | Sketch
    if isinstance(given, Shape):
        looked_at = shape = given
    else:
        with clock("pass"):
            looked_at = sketched(given, seed)
        shape = looked_at.sample
    found = story.detect(looked_at, ladder=ladder, outliers=options["outliers"], tolerance=tolerance, seed=seed)
    if shape.texture is not None:
        from symrefine.detection.textured import with_texture

        found = with_texture(found, shape, ladder=ladder, seed=seed)
    found = replace(found, timings=clock.seconds | found.timings)
    if verify == "all":
        found, options = _verified(found, given), options | {"verify": verify}
    if found.textured is not None:
        found = replace(found, textured=Detection.of(found.textured, shape=shape, options=options))
    return Detection.of(found, shape=shape, options=options)


def _verified(found: Any, given: "Shape | Stream") -> Any:
    """A detection with what all points say.

    Raises:
        InputError: the shape is no cloud, or has labels.
    """
    from symrefine.detection.verification import verified

    if isinstance(given, Stream):
        return verified(found, given)
    if given.faces is not None or found.surface.cloud.body == "atoms":
        raise InputError(f"{given.source}: --verify all is for clouds; all of this was looked at, leave it out")
    if given.labels is not None:
        raise InputError(f"{given.source}: --verify all knows of no labels; leave one of the two out")
    return verified(found, Stream.of(given.points))


def detect_in_space(
    shape: Any,
    *,
    outliers: "Outliers" = "auto",
    tolerance: float | str = TOLERANCE,
    units: str | None = None,
    seed: int = 0,
) -> "Detection":
    """What `detect` says of an object in space.

    Raises:
        InputError: points of another number of coordinates.
    """
    from symrefine.front.space import Detection

    shape = shape_of(shape)
    if shape.dim != 3:
        raise InputError(f"{shape.source}: points have {shape.dim} coordinates; this is for objects in space")
    found = detect(shape, outliers=outliers, tolerance=tolerance, units=units, seed=seed)
    assert isinstance(found, Detection)
    return found


@overload
def align(
    source: Any,
    target: "Sequence[Path | Shape] | list[str] | list[Array]",
    *,
    scale: bool = ...,
    polish: bool = ...,
    allow_reflection: bool = ...,
    tolerance: float | str = ...,
    units: str | None = ...,
    seed: int = ...,
) -> "list[Alignment]": ...


@overload
def align(
    source: Any,
    target: Any,
    *,
    scale: bool = ...,
    polish: bool = ...,
    allow_reflection: bool = ...,
    tolerance: float | str = ...,
    units: str | None = ...,
    seed: int = ...,
) -> "Alignment": ...


def align(
    source: Any,
    target: Any,
    *,
    scale: bool = False,
    polish: bool = True,
    allow_reflection: bool = True,
    tolerance: float | str = TOLERANCE,
    units: str | None = None,
    seed: int = 0,
) -> "Alignment | list[Alignment]":
    """The orthogonal map and the translation that take one object onto another; samplings and formats may differ.

    Args:
        source: whatever `detect` takes. Labels count where both have them: only what is of one class meets.
        target: whatever `detect` takes; or a list of such, or the frames of a file, for a list of answers: the source
            is read once.
        scale: whether the objects may differ in size; then `target ~ scale * matrix @ source + translation`.
        polish: refine on the points (3-space only); without it the moments have the last word, in half of the time.
        allow_reflection: whether determinant -1 is an answer.
        tolerance: largest miss that still counts as agreement, as in `detect`; a length is measured by the target.
        units: what a length of 1 in the target is, as in `detect`.
        seed: of the random choices (samples of meshes, subsets of clouds).

    Raises:
        InputError: what is no such object, or cannot be used; different dimensions, or options out of range.
        DegenerateShapeError: the points do not spread.
    """
    from symrefine.align import story
    from symrefine.front.aligned import Alignment

    moved, several = shape_of(source, name="source"), objects_of(target)
    asked = {"scale": scale, "polish": polish, "allow_reflection": allow_reflection}
    chosen: dict[str, Any] = {name: flag_of(name, value) for name, value in asked.items()}

    def onto(given: Any, name: str) -> Alignment:
        met = shape_of(given, name=name)
        used, whole = relative_tolerance(tolerance, met, units=units), whole_of("seed", seed)
        found = story.align(moved, met, **chosen, tolerance=used, seed=whole)
        options = told(tolerance, units) | {"scale": chosen["scale"], "seed": whole}
        options |= {"relative_tolerance": used} if isinstance(tolerance, str) else {}
        options |= {"measure": None, "rotations_only": not chosen["allow_reflection"]}
        return Alignment.of(found, source=moved, target=met, options=options)

    if several is None:
        return onto(target, "target")
    return [onto(given, f"target {k}") for k, given in enumerate(several)]


def report(given: Any, path: str | Path) -> "Detected | Alignment":
    """Write the page (.html), picture (.png), recording (.rrd) or record (.json) of an answer, and return it.

    Args:
        given: an answer of `detect` or `align`, or whatever `detect` takes.
        path: the file to write.

    Raises:
        InputError: what `detect` and `Detection.save` refuse.
    """
    from symrefine.front.aligned import Alignment

    check_kind(path_of(path))
    found: Any = given if isinstance(given, Found | Alignment) else detect(given)
    found.save(path)
    return found
