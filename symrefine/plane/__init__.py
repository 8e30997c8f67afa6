"""Symmetry in the plane: pictures and 2-D points, their mirror lines and turns."""

from symrefine.plane.detection import FoundLine, FoundRotation, PlanarDetection, PlanarNearMiss, detect_planar
from symrefine.plane.doublets import PLANAR_ORDERS, DoubletClass, VectorDoublets

__all__ = [
    "PLANAR_ORDERS",
    "DoubletClass",
    "FoundLine",
    "FoundRotation",
    "PlanarDetection",
    "PlanarNearMiss",
    "VectorDoublets",
    "detect_planar",
]
