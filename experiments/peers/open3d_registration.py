"""Open3D's map between two clouds: feature matching and ICP, beside `align`."""

from typing import Any

import numpy as np

from symrefine.geometry import Array
from symrefine.load.open3d import open3d

# Voxel of Open3D's feature matching, as a fraction of the diagonal: of 5, 3 and 2 % the first at which it finds
# (nearly) every rotation: 24 of 24 and 15 of 16 in two runs, against 4 of 8 at 5 % and 7 of 8 at 3 %.
VOXEL = 0.02


def open3d_align(source: Array, target: Array, voxel: float) -> Array:
    """FPFH features, RANSAC, point-to-plane ICP, with the parameters of Open3D's own tutorial."""
    o3d = open3d()

    registration, search = o3d.pipelines.registration, o3d.geometry.KDTreeSearchParamHybrid
    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    o3d.utility.random.seed(0)

    def prepared(points: Array) -> tuple[o3d.geometry.PointCloud, o3d.geometry.PointCloud, object]:
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
        coarse = cloud.voxel_down_sample(voxel)
        coarse.estimate_normals(search(radius=2 * voxel, max_nn=30))
        return cloud, coarse, registration.compute_fpfh_feature(coarse, search(radius=5 * voxel, max_nn=100))

    a, coarse_a, features_a = prepared(source)
    b, coarse_b, features_b = prepared(target)
    start = by_ransac(coarse_a, coarse_b, features_a, features_b, voxel)
    b.estimate_normals(search(radius=2 * voxel, max_nn=30))
    return by_icp(a, b, start, voxel)[:3, :3]


def by_ransac(source: Any, target: Any, source_features: Any, target_features: Any, voxel: float) -> Array:
    """Map [4, 4] of one cloud onto another that most of the pairs with like features agree on."""
    registration = open3d().pipelines.registration
    checks = [
        registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
        registration.CorrespondenceCheckerBasedOnDistance(1.5 * voxel),
    ]
    return np.asarray(
        registration.registration_ransac_based_on_feature_matching(
            source, target, source_features, target_features, True, 1.5 * voxel,
            registration.TransformationEstimationPointToPoint(False), 3, checks,
            registration.RANSACConvergenceCriteria(100000, 0.999),
        ).transformation
    )  # fmt: skip


def by_icp(source: Any, target: Any, start: Array, voxel: float) -> Array:
    """Map [4, 4] of one cloud onto another that has normals, from a start, by the distances from its planes."""
    registration = open3d().pipelines.registration
    plane = registration.TransformationEstimationPointToPlane()
    return np.asarray(registration.registration_icp(source, target, 0.4 * voxel, start, plane).transformation)
