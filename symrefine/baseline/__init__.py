"""The baseline to compare with: Ecins, Fermuller, Aloimonos (2017), planes by symmetrical fitting from a fixed grid."""

from symrefine.baseline.method import Candidate, EcinsPlane, EcinsResult, ecins
from symrefine.baseline.normals import estimated_normals
from symrefine.baseline.settings import SHIPPED, TUNED, Settings

__all__ = ["SHIPPED", "TUNED", "Candidate", "EcinsPlane", "EcinsResult", "Settings", "ecins", "estimated_normals"]
