"""Symmetry in the plane: pictures and 2-D points, their mirror lines and turns."""

from symrefine.plane.detection import PlanarDetection, detect_planar
from symrefine.plane.doublets import PLANAR_ORDERS, VectorDoublets

__all__ = ["PLANAR_ORDERS", "PlanarDetection", "VectorDoublets", "detect_planar"]
