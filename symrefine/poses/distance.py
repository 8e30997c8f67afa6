"""How far two poses of a symmetric body are apart.

MSSD and MSPD are those of the BOP benchmark (Hodan and others, "BOP challenge 2020 on 6D object localization"): the
largest distance of a vertex in one pose from the same vertex in the other, in space or in the image, for the
operation of the body that makes it smallest.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from symrefine.errors import InputError
from symrefine.geometry import Array, corners, numbers, read_only
from symrefine.groups.orthogonal import chord_angles
from symrefine.poses.canonicalizer import Canonicalizer
from symrefine.poses.given import Group, symmetry_of
from symrefine.poses.minimax import least_depth, least_largest
from symrefine.poses.symmetry import Symmetry


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseDistance:
    """How far poses are apart modulo a symmetry: arrays [...] of the shape of the pairs, [] of a single pair.

    Attributes:
        angle_rad: smallest angle between a rotation of the first and one of the poses equivalent to the second.
        translation: distance of the places of the centre, which is the point nearest to the origin of the body that all
            operations leave in place; the origin itself wherever they do.
        mssd: in the unit of the poses; None without vertices.
        mspd: in pixels; None without vertices and a camera.
    """

    angle_rad: Array
    translation: Array
    mssd: Array | None
    mspd: Array | None

    def __post_init__(self) -> None:
        for name in ("angle_rad", "translation", "mssd", "mspd"):
            values = getattr(self, name)
            object.__setattr__(self, name, None if values is None else read_only(values))


def symmetric_distance(
    pose_a: ArrayLike,
    pose_b: ArrayLike,
    group: Group | Canonicalizer,
    *,
    points: ArrayLike | None = None,
    intrinsics: ArrayLike | None = None,
) -> PoseDistance:
    """How far poses are apart, whichever of the equivalents is meant.

    Angle and translation are 0 for what looks the same, the same both ways, and no detour is shorter. So are MSSD and
    MSPD where the vertices have the symmetry exactly; elsewhere it is the second pose that is replaced by its
    equivalents, as BOP does with the true one.

    MSSD is exact, about continuous axes too, and of a sphere if its centre lies among the vertices. MSPD is exact for
    finite groups; about an axis it is the best of 360 turns, improved, and of a sphere that with the same rotation:
    never below the exact one.

    Args:
        pose_a: [..., 4, 4], such as estimates.
        pose_b: [..., 4, 4], such as true poses; the shapes are broadcast.
        group: whatever `Canonicalizer` takes, or one.
        points: [V, 3] vertices of the body, for MSSD and MSPD.
        intrinsics: [3, 3] of a pinhole camera, or fx, fy, cx, cy, for MSPD; the poses are in its frame, z forward.

    Raises:
        InputError: what is no pose, group, vertex or camera; shapes that do not fit; vertices behind the camera.
    """
    symmetry = group.symmetry if isinstance(group, Canonicalizer) else symmetry_of(group)
    a, b = symmetry.rigid(pose_a, "pose_a"), symmetry.rigid(pose_b, "pose_b")
    try:
        a, b = np.broadcast_arrays(a, b)
    except ValueError:
        raise InputError(f"pose_a has shape {list(a.shape)}, pose_b {list(b.shape)}; they do not fit") from None
    turns = b[..., :3, :3].swapaxes(-1, -2) @ a[..., :3, :3]
    mssd = mspd = None
    if points is not None:
        vertices = _vertices(points)
        # Of a convex function, as the distance of two linear images is, corners of the hull have the largest values.
        mssd = least_largest(symmetry, a, b, corners(vertices))
        mspd = None if intrinsics is None else _projected(symmetry, a, b, vertices, _camera(intrinsics))
    elif intrinsics is not None:
        raise InputError("intrinsics are for MSPD, which needs points, the vertices [V, 3] of the body, too")
    return PoseDistance(
        angle_rad=chord_angles(turns, symmetry.nearest(turns)),
        translation=np.linalg.norm(symmetry.places(a) - symmetry.places(b), axis=-1),
        mssd=mssd,
        mspd=mspd,
    )


def _projected(symmetry: Symmetry, a: Array, b: Array, vertices: Array, camera: Array) -> Array:
    for name, poses in (("pose_a", a), ("pose_b", b)):
        nearest = least_depth(poses, vertices)
        if nearest <= 0.0:
            raise InputError(f"{name} puts a vertex behind the camera, at the depth {nearest:.3g}; expected above 0")
    return least_largest(symmetry, a, b, vertices, camera)


def _vertices(given: ArrayLike) -> Array:
    points = numbers(given, "points")
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0 or not np.isfinite(points).all():
        raise InputError(f"points has shape {list(points.shape)}; expected finite vertices [V, 3], V at least 1")
    return points


def _camera(given: ArrayLike) -> Array:
    """The matrix [3, 3] of a pinhole camera."""
    camera = numbers(given, "intrinsics")
    if camera.shape == (4,):
        fx, fy, cx, cy = camera
        camera = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    pinhole = camera.shape == (3, 3) and np.isfinite(camera).all() and (camera[2] == [0.0, 0.0, 1.0]).all()
    if not (pinhole and camera[0, 0] > 0.0 and camera[1, 1] > 0.0):
        raise InputError(
            "intrinsics are no pinhole camera; expected fx, fy, cx, cy in pixels, or a matrix [3, 3] whose last row is "
            "0, 0, 1, fx and fy above 0"
        )
    return camera
