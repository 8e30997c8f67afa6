"""How an object is shown: in a pose and unit of its own, as a mesh or as noisy points."""

from dataclasses import dataclass, replace

import numpy as np

from experiments.objects.shapes import sample
from symrefine.geometry import Array, random_orthogonal
from symrefine.shape import Shape

# Of what is shown, for those who let one choose.
FORMS = ("mesh", "cloud")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pose:
    """x -> scale * turn x + shift, `turn` of determinant +1."""

    turn: Array
    shift: Array
    scale: float

    @classmethod
    def random(cls, rng: np.random.Generator) -> "Pose":
        """Any rotation, a shift of several units, a scale from a twentieth to twenty."""
        return cls(turn=random_orthogonal(rng), shift=rng.uniform(-5, 5, 3), scale=float(np.exp(rng.uniform(-3, 3))))

    def of(self, points: Array) -> Array:
        """Points [N, 3] in this pose."""
        return self.scale * points @ self.turn.T + self.shift


def observed(mesh: Shape, form: str, points: int, noise_rel: float, rng: np.random.Generator) -> Shape:
    """What is given to a method: the mesh itself, or points of it with noise of `noise_rel` diagonals, no normals."""
    return mesh if form == "mesh" else Shape(points=sample(mesh, points, noise_rel, rng))


def posed(shape: Shape, pose: Pose) -> Shape:
    """The same in another pose."""
    normals = None if shape.normals is None else shape.normals @ pose.turn.T
    return replace(shape, points=pose.of(shape.points), normals=normals)
