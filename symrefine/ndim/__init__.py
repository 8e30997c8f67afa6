"""Points of any dimension: the subspace that their symmetries fix, and their hyperplanes of symmetry."""

from symrefine.ndim.detection import Hyperplane, SubspaceDetection, detect_nd
from symrefine.ntuples.rank import FLOOR, SIGNIFICANT, FixedSubspace, fixed_subspace

__all__ = [
    "FLOOR",
    "SIGNIFICANT",
    "FixedSubspace",
    "Hyperplane",
    "SubspaceDetection",
    "detect_nd",
    "fixed_subspace",
]
