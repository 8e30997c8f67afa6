"""The baseline to compare with: Ecins, Fermuller, Aloimonos (2017), planes by symmetrical fitting from a fixed grid."""

from experiments.ecins.method import Candidate, EcinsPlane, EcinsResult, ecins
from experiments.ecins.normals import estimated_normals
from experiments.ecins.settings import SHIPPED, TUNED, Settings

__all__ = ["SHIPPED", "TUNED", "Candidate", "EcinsPlane", "EcinsResult", "Settings", "ecins", "estimated_normals"]
