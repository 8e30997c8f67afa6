"""Points of any dimension: the subspace that their symmetries fix, and their hyperplanes of symmetry."""

from symrefine.ndim.detection import Hyperplane, SubspaceDetection, detect_nd

__all__ = ["Hyperplane", "SubspaceDetection", "detect_nd"]
