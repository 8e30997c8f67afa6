"""What a shape has exactly, whatever is sampled of it: what its vertices, or points, are mapped onto, and its faces."""

from dataclasses import replace

from symrefine.detection.measure import Measured
from symrefine.fit.placed import Placed
from symrefine.fit.vertices import OnVertices, exact_symmetry
from symrefine.propose.candidates import Evidence


def by_vertices(
    measured: Measured, diagonal: float, evidence: Evidence
) -> tuple[OnVertices | None, OnVertices | None, Evidence]:
    """The group that vertices of a mesh, or points of a cloud, have, what of it faces prove, and the evidence."""
    origin, scale = measured.moments.center, measured.moments.scale
    exact, proof = exact_symmetry(measured.shape, scale * diagonal)
    if exact is None or exact.group.name == "C1":
        return exact, None, evidence
    found = [None if known is None else known.beside(origin) for known in (exact, proof)]
    placed = [None if k is None else Placed(group=k.group, center=(k.center - origin) / scale) for k in found]
    return found[0], found[1], replace(evidence, vertices=placed[0], proven=placed[1])
