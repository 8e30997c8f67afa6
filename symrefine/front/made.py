"""What can be made of any object with its symmetry: `symmetrize`, `complete`, `export`."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from symrefine.clock import Clock
from symrefine.errors import InputError
from symrefine.files import path_of
from symrefine.front.asked import found_in, in_space, told
from symrefine.front.verbs import detect_in_space
from symrefine.lengths import relative_tolerance
from symrefine.load.objects import shape_of
from symrefine.options import flag_of, whole_of
from symrefine.picture.words import MORE, kind_name
from symrefine.surface.misses import TOLERANCE

# Each verb imports what it needs when it is used.
if TYPE_CHECKING:
    from symrefine.detection.measure import Outliers
    from symrefine.export.formats import Format
    from symrefine.export.packages import Package
    from symrefine.front.derived import Completion, Symmetrized
    from symrefine.front.space import Detection


def symmetrize(
    shape: Any,
    found: "Detection | None" = None,
    *,
    group: str | None = None,
    tolerance: float | str = TOLERANCE,
    units: str | None = None,
    seed: int = 0,
) -> "Symmetrized":
    """The nearest exactly symmetric mesh or cloud; outliers of a cloud are left out.

    Args:
        shape: whatever `detect` takes, in 3-space.
        found: what `detect` found in it; detected if None.
        group: the subgroup of it that is to be made exact, such as "Cs"; the whole group if None.
        tolerance: by how much the shape may miss the symmetry, as of `detect`.
        units: as of `detect`.
        seed: of the random samples of a surface.

    Raises:
        InputError: nothing is decided, no symmetry, no such subgroup, or what was found in another object.
        DegenerateShapeError: a few points, of which some have no counterpart.
    """
    from symrefine.front.derived import Symmetrized
    from symrefine.symmetrize import placed_subgroup, symmetrize

    shape = shape_of(shape)
    found = (
        detect_in_space(shape, tolerance=tolerance, units=units, seed=seed) if found is None else found_in(found, shape)
    )
    if found.undetermined:
        raise InputError(f"{shape.source}: no symmetry to make exact: {found.undetermined}")
    if found.point_group == "C1":
        raise InputError(f"{shape.source}: is C1, nothing to make symmetric{_nearest_miss(found)}")
    # Of a continuous group what the vertices have of it was told already.
    fold = None if found.exact is None or found.group.is_finite else found.exact.point_group
    wanted = fold if group is None else group
    chosen = found.group if wanted is None else placed_subgroup(found.group, wanted)
    used, clock, seed = relative_tolerance(tolerance, shape, units=units), Clock(), whole_of("seed", seed)
    # Of what a sample alone was looked at, no others are known.
    out = found.outliers if shape.faces is None and len(found.shape.points) == len(shape.points) else found.outliers[:0]
    own = shape.without(out) if len(out) else shape
    with clock("symmetrize"):
        made = symmetrize(own, chosen, found.center, tolerance=used, seed=seed)
    return Symmetrized.of(
        made,
        source=shape,
        detection=found,
        outliers=len(out),
        options=told(tolerance, units) | {"seed": seed, "group": group},
        timings={**found.timings, **clock.seconds},
    )


def complete(
    shape: Any,
    found: "Detection | None" = None,
    *,
    viewpoint: ArrayLike | None = None,
    outliers: "Outliers" = "auto",
    tolerance: float | str = TOLERANCE,
    units: str | None = None,
    seed: int = 0,
) -> "Completion":
    """The points of a scan and their images where nobody looked, under the group that is found in it.

    Args:
        shape: a cloud in 3-space, in any form that `detect` takes.
        found: what `detect` found in it; the options that follow are those of `detect` where this is None.
        viewpoint: as of `detect`.
        outliers: as of `detect`.
        tolerance: as of `detect`.
        units: as of `detect`.
        seed: as of `detect`.

    Raises:
        InputError: a mesh or atoms, an object without a symmetry, none that can be decided, or what was found in
            another object.
    """
    from symrefine.complete import check_scan, complete
    from symrefine.front.derived import Completion
    from symrefine.front.verbs import detect

    shape, clock = shape_of(shape, viewpoint=viewpoint), Clock()
    check_scan(shape)
    asked: dict[str, Any] = {"tolerance": tolerance, "units": units, "seed": seed, "outliers": outliers}
    found = in_space(detect(shape, **asked)) if found is None else found_in(found, shape)
    with clock("complete"):
        made = complete(shape, found)
    options = told(tolerance, units) | {"seed": whole_of("seed", seed), "outliers": outliers}
    return Completion.of(made, source=shape, options=options, timings={**found.timings, **clock.seconds})


def export(
    shape: Any,
    to: "Format",
    out: str | Path,
    *,
    found: "Detection | None" = None,
    number: int | None = None,
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
        found: what `detect` found in it, at the tolerance and with all else that it was asked; if None it is detected
            as `detect` does unasked.
        number: of the object in `models_info.json`; if None that of the name of the file, 7 of obj_000007.ply, or 1.
        scale: millimetres in one unit of the object.
        improper: npz: whether mirrors and the like belong to the matrices.
        steps: npz: turns that stand for a continuous axis; 72 if None.
        transform: canonical: where the transform goes, .json or .npz; `OUT_transform.json` if None.

    Returns:
        What was written, and notes on what the format cannot express.

    Raises:
        InputError: another format, an option that it has no use for, nothing decided, what was found in another object,
            or files that cannot be written.
    """
    from symrefine.export.packages import package_of, write_package

    shape, out = shape_of(shape), path_of(out)
    found = detect_in_space(shape) if found is None else found_in(found, shape)
    package = package_of(
        to,
        out,
        found,
        shape,
        number=None if number is None else whole_of("number", number),
        scale=scale,
        improper=flag_of("improper", improper),
        steps=None if steps is None else whole_of("steps", steps, least=1),
        transform=None if transform is None else path_of(transform),
    )
    write_package(package, to, out)
    return package


def _nearest_miss(found: "Detection") -> str:
    """By how much the best of what was turned down is none, and what there is to do; nothing where there is none."""
    if not found.near_misses:
        return ""
    miss, allowed = found.near_misses[0], f"what a tolerance of {100 * found.tolerance:.3g} % allows"
    told = f"; the nearest, a {kind_name(miss.kind, miss.order)}, misses by {miss.excess:.2g} times {allowed}"
    told = "; nothing that was seen tells of any" if math.isinf(miss.excess) else told
    told += f", {MORE}" if miss.excess < 1.0 else ""
    told += "; parts of the surface were not seen" if found.is_partial else ""
    return f"{told}: choose a larger tolerance if that counts as symmetric"
