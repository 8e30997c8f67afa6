"""Where the baseline starts: a fixed grid of planes through the centroid, each moved once along its normal."""

import numpy as np

from experiments.ecins.clouds import Clouds
from experiments.ecins.settings import Settings
from symrefine.geometry import Array, Plane, frame_with_z
from symrefine.shape import Index


def grid_normals(divisions: int, basis: Array) -> Array:
    """Normals [K, 3] at azimuths i 180/d in the plane of the first two axes and elevations j 180/d towards the third.

    For an even d the pole comes up at every azimuth and is taken once: 13, 25, 31, 49, 91, 225 for d = 4, 5, 6, 7, 10,
    15.
    """
    pole = divisions / 2
    steps = [(i, j) for i in range(divisions) for j in range(divisions) if j != pole or i == 0]
    azimuth, elevation = np.pi * np.array(steps, dtype=np.float64).T / divisions
    local = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    return np.column_stack(local) @ basis


def position(clouds: Clouds, normal: Array, settings: Settings) -> Plane:
    """The plane with this normal moved to the median midpoint of pairs that face one another across it.

    Partners lie on one line along the normal, up to half a cell. Without any pair the plane stays at the centroid.
    """
    source, target = _facing(clouds, normal, settings)
    reach, flipped = clouds.queries @ normal, clouds.points @ normal
    reflected = clouds.normals - 2.0 * np.multiply.outer(clouds.normals @ normal, normal)
    cosine = np.einsum("ij,ij->i", clouds.query_normals[source], reflected[target])
    # The angle is at most pi: as the code has it, the gate never closes.
    if settings.position_gate_rad < np.pi:
        kept = cosine > np.cos(settings.position_gate_rad)
        source, target, cosine = source[kept], target[kept], cosine[kept]
    chosen = best_of_each(target, best_of_each(source, np.arange(len(source)), -cosine), -cosine)
    if chosen.size == 0:
        return Plane(normal=normal, offset=0.0)
    return Plane(normal=normal, offset=float(np.median(0.5 * (reach[source[chosen]] + flipped[target[chosen]]))))


def _facing(clouds: Clouds, normal: Array, settings: Settings) -> tuple[Index, Index]:
    """Queries and points that fall within reach of one another when projected, and are far apart along the normal."""
    from scipy.spatial import cKDTree

    across = frame_with_z(normal)[:2].T
    trees = [cKDTree(p @ across, balanced_tree=False, compact_nodes=False) for p in (clouds.queries, clouds.points)]
    reach = settings.position_reach * settings.query_voxel_rel
    pairs = trees[0].sparse_distance_matrix(trees[1], reach, output_type="ndarray")
    source, target = pairs["i"], pairs["j"]
    apart = np.abs((clouds.queries @ normal)[source] - (clouds.points @ normal)[target])
    far = apart >= settings.near_plane * settings.query_voxel_rel
    return source[far], target[far]


def best_of_each(keys: Index, rows: Index, cost: Array) -> Index:
    """Of the given rows [R], for each value of `keys` [N] the row of least `cost` [N]; the first where they tie."""
    order = rows[np.lexsort((cost[rows], keys[rows]))]
    _, first = np.unique(keys[order], return_index=True)
    return order[first]
