"""Registration by published packages, beside `align`: clouds [N, 3] and [M, 3] in, homogeneous matrix [4, 4] out.

None of them knows reflections. So each is asked twice, for the source and for its mirror image, and the answer that
leaves the target nearer is kept. Parameters are those of each package's own example, with one voxel for all.
"""

from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from itertools import product
from typing import Any

import numpy as np

from experiments.peers.open3d_registration import VOXEL, by_icp, by_ransac
from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.load.open3d import open3d

# Distances beyond so many voxels count as that many: what only one of the two clouds shows says nothing.
BEYOND = 2.0
Method = Callable[[Array, Array, float], Array]


def both_hands(method: Method, source: Array, target: Array, diagonal: float) -> Array:
    """The better answer [4, 4] of a method for the source and for its mirror image."""
    from scipy.spatial import cKDTree

    tree, limit = cKDTree(target), BEYOND * VOXEL * diagonal
    found = []
    for mirror in (np.eye(4), np.diag([-1.0, 1.0, 1.0, 1.0])):
        matrix = method(source @ mirror[:3, :3], target, VOXEL * diagonal) @ mirror
        moved = source @ matrix[:3, :3].T + matrix[:3, 3]
        found.append((float(tree.query(moved, distance_upper_bound=limit)[0].clip(max=limit).mean()), matrix))
    return min(found, key=lambda f: f[0])[1]


def _prepared(points: Array, voxel: float) -> tuple[Any, Any, Any]:
    """Cloud with normals, the same on a grid, and the features of that."""
    o3d = open3d()
    search = o3d.geometry.KDTreeSearchParamHybrid
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals(search(radius=2 * voxel, max_nn=30))
    coarse = cloud.voxel_down_sample(voxel)
    coarse.estimate_normals(search(radius=2 * voxel, max_nn=30))
    features = o3d.pipelines.registration.compute_fpfh_feature(coarse, search(radius=5 * voxel, max_nn=100))
    return cloud, coarse, features


def fast_global(source: Array, target: Array, voxel: float) -> Array:
    """Open3D: FPFH, fast global registration, point-to-plane ICP."""
    o3d = open3d()
    o3d.utility.random.seed(0)
    registration = o3d.pipelines.registration
    (a, coarse_a, features_a), (b, coarse_b, features_b) = (_prepared(p, voxel) for p in (source, target))
    option = registration.FastGlobalRegistrationOption(maximum_correspondence_distance=0.5 * voxel)
    found = registration.registration_fgr_based_on_feature_matching(coarse_a, coarse_b, features_a, features_b, option)
    return by_icp(a, b, found.transformation, voxel)


def ransac(source: Array, target: Array, voxel: float) -> Array:
    """Open3D: FPFH, RANSAC, point-to-plane ICP."""
    o3d = open3d()
    o3d.utility.random.seed(0)
    (a, coarse_a, features_a), (b, coarse_b, features_b) = (_prepared(p, voxel) for p in (source, target))
    return by_icp(a, b, by_ransac(coarse_a, coarse_b, features_a, features_b, voxel), voxel)


def kiss(source: Array, target: Array, voxel: float) -> Array:
    """KISS-Matcher."""
    import kiss_matcher

    matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(voxel))
    found = matcher.estimate(source.astype(np.float32), target.astype(np.float32))
    return _rigid(found.rotation, found.translation)


def kiss_and_gicp(source: Array, target: Array, voxel: float) -> Array:
    """KISS-Matcher, then small_gicp."""
    import small_gicp

    return np.asarray(
        small_gicp.align(
            target, source, kiss(source, target, voxel), registration_type="GICP",
            downsampling_resolution=0.5 * voxel, max_correspondence_distance=2.0 * voxel,
        ).T_target_source
    )  # fmt: skip


def trimesh_icp(source: Array, target: Array, _: float) -> Array:
    """trimesh: the 24 turns of the principal axes onto each other, ICP from each, as `mesh_other` does for meshes."""
    from trimesh.registration import icp

    rng = np.random.default_rng(0)
    a, b = (p[rng.permutation(len(p))[:500]] for p in (source, target))
    frames = [np.linalg.svd(p - p.mean(axis=0), full_matrices=False)[2] for p in (a, b)]
    starts = []
    for turn in _cube():
        matrix = frames[1].T @ turn @ frames[0]
        matrix = matrix if np.linalg.det(matrix) > 0 else -matrix
        start = _rigid(matrix, b.mean(axis=0) - matrix @ a.mean(axis=0))
        found, _, cost = icp(a, b, initial=start, max_iterations=10, scale=False, reflection=False)
        starts.append((cost, found))
    best = min(starts, key=lambda s: s[0])[1]
    return np.asarray(icp(a, target, initial=best, max_iterations=50, scale=False, reflection=False)[0])


@cache
def _cube() -> tuple[Array, ...]:
    """The 24 rotations of a cube."""
    signs = [np.diag(s) for s in product((1.0, -1.0), repeat=3)]
    orders = [np.eye(3)[list(p)] for p in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (1, 0, 2), (0, 2, 1), (2, 1, 0))]
    return tuple(s @ o for s in signs for o in orders if np.linalg.det(s @ o) > 0)


def _rigid(matrix: Array, shift: Array) -> Array:
    full = np.eye(4)
    full[:3, :3], full[:3, 3] = matrix, np.ravel(shift)
    return full


# The name that a table shows, the package that has to be there, and the method.
PEERS: dict[str, tuple[str, Method]] = {
    "kiss": ("kiss_matcher", kiss),
    "kiss + gicp": ("kiss_matcher small_gicp", kiss_and_gicp),
    "open3d fgr": ("open3d", fast_global),
    "open3d ransac": ("open3d", ransac),
    "trimesh icp": ("trimesh", trimesh_icp),
}


def installed(name: str) -> bool:
    """Whether the packages of a peer are there."""
    return all(find_spec(package) is not None for package in PEERS[name][0].split())


def register(name: str, source: Array, target: Array, diagonal: float) -> Array:
    """The answer of a peer, determinant +1 or -1.

    Raises:
        InputError: its package is not installed.
    """
    if not installed(name):
        raise InputError(f"{name}: {PEERS[name][0]} is not installed")
    return both_hands(PEERS[name][1], source, target, diagonal)
