"""The constants of the baseline, and the two settings it is compared in."""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Constants of the method; lengths are fractions of the diagonal of the PCA-aligned bounding box.

    Attributes:
        divisions: d; the starts are about d x d planes through the centroid.
        voxel_rel: v, the cell that points are averaged in; the queries are averaged once more in cells of V = 2 v.
        near_plane: pairs whose signed distances differ by less than this many V say nothing about the plane.
        position_reach, refine_reach, score_reach: how far apart a pair may be, in V.
        position_gate_rad: largest angle of normals in the position step. Ten degrees were meant; the code takes the ten
            for radians, so that no pair ever fails, and so do we.
        refine_gate_deg: largest angle between a normal and the reflected one of its partner.
        max_outer: outer iterations, each with new correspondences.
        turn_deg, move_rel: converged once the normal turns and the projected centroid moves by less than these.
        tolerance: relative tolerances of the inner iteration, the root of the resolution of single precision.
        step_bound, max_evaluations: of the inner iteration (MINPACK's `factor` and `maxfev`).
        good_deg, bad_deg: a pair of normals counts in full below the first angle, not at all above the second.
        flipped_deg: larger angles are taken for a normal of the wrong sign.
        least_cloud_score: planes whose cloud score is not above this are dropped.
        merge_deg, merge_rel: planes this close in normal and in projected centroid are one.
    """

    divisions: int = 5
    voxel_rel: float = 0.008
    near_plane: float = 4.0
    position_reach: float = 0.5
    position_gate_rad: float = 10.0
    refine_reach: float = 1.0
    refine_gate_deg: float = 45.0
    max_outer: int = 20
    turn_deg: float = 0.05
    move_rel: float = 1e-4
    tolerance: float = float(np.sqrt(np.finfo(np.float32).eps))
    step_bound: float = 100.0
    max_evaluations: int = 400
    score_reach: float = 0.5
    good_deg: float = 15.0
    bad_deg: float = 20.0
    flipped_deg: float = 135.0
    least_cloud_score: float = 0.5
    merge_deg: float = 7.0
    merge_rel: float = 0.01

    @property
    def query_voxel_rel(self) -> float:
        """V = 2 v, the cell of the queries and the unit of every distance."""
        return 2.0 * self.voxel_rel


SHIPPED = Settings()
TUNED = replace(SHIPPED, divisions=10, voxel_rel=0.016)
