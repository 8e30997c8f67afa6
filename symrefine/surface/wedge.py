"""A surface folded into one wedge about an axis: under turns that carry it onto itself all its wedges are one.

Neighbourhoods of a cloud may be as wide as the blades of a rotor. Which way these lean is smoothed away then, and a
mirror seems to hold that does not. But of n wedges that show the same each point tells of all of them: one wedge that
holds all points is known n times as densely, by neighbourhoods of as many points that are n times as small.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, Axis, Isometry, frame_with_z, orthogonal_factor
from symrefine.samples import COUNT
from symrefine.shape import Index
from symrefine.surface.misses import disc_distances, halves, needs, of_the_whole
from symrefine.surface.skin import LocalPlanes, Skin, drawn

# Neighbourhoods side by side that a wedge has to be wide for what leans in it to be seen as it is: two for each half of
# the second harmonic, the first that tells a wedge from its mirror image. With more, wider wedges are folded too.
ACROSS = 4.0
# Turns that are the same to so small a part of a wedge are one.
PARTS = 16
# See `_kind`.
Kind = tuple[int, int, int]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Wedge:
    """Local planes of a wedge, and beside them those of the wedges next to it.

    Attributes:
        frame: [3, 3] rows of a right-handed frame; the third is the axis.
        center: [3] a point of the axis.
        fold: how many wedges there are.
        width: radius of the neighbourhoods of the whole, which tells no axes apart that are nearer.
        cloud: local planes in the frame about the centre: first those of the wedge, then as many beside it.
        noise: [M] what halves of the points miss one another by, ascending.
    """

    frame: Array
    center: Array
    fold: int
    width: float
    cloud: LocalPlanes
    noise: Array

    @classmethod
    def of(cls, skin: Skin, axis: Axis, fold: int) -> "Wedge":
        """The wedge of a skin about an axis of so many folds."""
        rng, frame, pitch = np.random.default_rng(0), frame_with_z(axis.direction), 2.0 * np.pi / fold
        local = (skin.points - axis.point) @ frame.T
        pick = drawn(len(local), round(min(_denser(skin, axis, pitch) / fold, 1.0) * len(local)), rng)
        turned, turns = _into(local[pick], pitch)
        whole = Skin(
            points=turned,
            normals=None if skin.normals is None else _turned(skin.normals[pick] @ frame.T, turns),
            neighbours=skin.neighbours,
            labels=None if skin.labels is None else skin.labels[pick],
        )
        one, other = (_planes(whole.half(half), pitch, rng) for half in halves(len(pick), rng))
        noise = [
            disc_distances(a, _own(b), _own_classes(b)) * of_the_whole(b.flatness[: len(_own(b))], "surface")
            for a, b in ((one, other), (other, one))
        ]
        return cls(
            frame=frame,
            center=axis.point,
            fold=fold,
            width=skin.width,
            cloud=_planes(whole, pitch, rng),
            noise=np.sort(np.concatenate(noise)),
        )

    @classmethod
    def is_needless(cls, skin: Skin, axis: Axis, fold: int) -> bool:
        """Whether the neighbourhoods of a skin are small enough to tell of so many folds about an axis."""
        return _denser(skin, axis, 2.0 * np.pi / fold) <= 1.0

    @property
    def pitch(self) -> float:
        """Angle of the wedge."""
        return 2.0 * np.pi / self.fold

    def is_about(self, axis: Axis, fold: int) -> bool:
        """Whether it was folded so often about this axis."""
        tilt, foot = self.frame[:2] @ axis.direction, self.frame[:2] @ (axis.point - self.center)
        return fold == self.fold and bool(max(np.linalg.norm(tilt), np.linalg.norm(foot)) < self.width)

    def needs(self, motions: Sequence[Isometry], diagonal: float, *, open_: bool) -> Array:
        """The smallest tolerances [K], fractions of the diagonal, at which operations hold that keep the axis.

        Of others it tells nothing, which is 0, and of turns by whole wedges. Where the surface is `open_`, what was
        seen of it is wider than such a wedge, but need not be there with the axis turned over.
        """
        known = [self._along(m) for m in motions]
        kinds = [_kind(m, self.pitch) for m in known]
        told = {
            k: m for k, m in zip(kinds, known, strict=True) if m is not None and not (open_ and m.matrix[2, 2] < 0.0)
        }
        told.pop((1, 1, 0), None)  # turns by whole wedges
        if not told:
            return np.zeros(len(motions))
        moved = [_into(m.apply(_own(self.cloud)), self.pitch)[0] for m in told.values()]
        misses = np.stack([disc_distances(self.cloud, points, _own_classes(self.cloud)) for points in moved])
        found = needs(misses / diagonal, self.noise / diagonal, len(told), self.cloud.redundancy)
        each = dict(zip(told, found.tolist(), strict=True))
        return np.array([each.get(k, 0.0) for k in kinds])

    def _along(self, motion: Isometry) -> Isometry | None:
        """An operation in the frame, where it keeps the axis as far as fits tell; None if it does not."""
        matrix = self.frame @ motion.matrix @ self.frame.T
        shift = self.frame @ (motion.apply(self.center) - self.center)
        if max(np.linalg.norm(matrix[:2, 2]), np.linalg.norm(shift[:2])) > 2.0 * self.width:
            return None
        kept = np.zeros((3, 3))
        kept[:2, :2], kept[2, 2] = orthogonal_factor(matrix[:2, :2]), np.sign(matrix[2, 2])
        return Isometry(matrix=kept, shift=np.array([0.0, 0.0, shift[2]]))


def _denser(skin: Skin, axis: Axis, pitch: float) -> float:
    """How many times as densely a wedge about an axis has to be known as a skin is."""
    across, (mean, covariance) = frame_with_z(axis.direction)[:2], skin.spread
    from_axis = across @ (mean - axis.point)
    width = pitch * math.sqrt(np.trace(across @ covariance @ across.T) + from_axis @ from_axis)
    return float((2.0 * ACROSS * skin.width / width) ** 2)


def _kind(motion: Isometry | None, pitch: float) -> Kind | None:
    """What an operation does along the third axis, its determinant, and the part of a wedge that it turns by.

    Operations of one kind are the same but for turns by whole wedges.
    """
    if motion is None:
        return None
    wedges = float(np.arctan2(motion.matrix[1, 0], motion.matrix[0, 0])) / pitch
    return int(motion.matrix[2, 2]), round(float(np.linalg.det(motion.matrix))), round(PARTS * wedges) % PARTS


def _into(points: Array, pitch: float) -> tuple[Array, Array]:
    """Points [N, 3] turned about the third axis into the wedge of angles 0 to `pitch`, and the angles [N] of that."""
    turns = -pitch * np.floor(np.arctan2(points[:, 1], points[:, 0]) / pitch)
    return _turned(points, turns), turns


def _turned(vectors: Array, angles: Array) -> Array:
    """Vectors [N, 3] turned about the third axis, each by its angle [N]."""
    c, s = np.cos(angles), np.sin(angles)
    x, y = vectors[:, 0], vectors[:, 1]
    return np.stack([c * x - s * y, s * x + c * y, vectors[:, 2]], axis=1)


def _planes(skin: Skin, pitch: float, rng: np.random.Generator) -> LocalPlanes:
    """Local planes of the wedge that the points of a skin fill, then the same turned into the halves beside it."""
    points, normals, labels = skin.points, skin.normals, skin.labels
    aside = _aside(points, pitch)
    wider = Skin(
        points=np.concatenate([points, _turned(points, aside)]),
        normals=None if normals is None else np.concatenate([normals, _turned(normals, aside)]),
        neighbours=skin.neighbours,
        labels=None if labels is None else np.tile(labels, 2),
    )
    own = wider.local_planes(drawn(len(points), COUNT, rng))
    aside = _aside(own.points, pitch)
    return own.with_copies(_turned(own.points, aside), _turned(own.normals, aside))


def _own(cloud: LocalPlanes) -> Array:
    """Points of the local planes of the wedge itself."""
    return cloud.points[: len(cloud.points) // 2]


def _own_classes(cloud: LocalPlanes) -> Index | None:
    """Classes of the local planes of the wedge itself."""
    return cloud.classes(slice(len(cloud.points) // 2))


def _aside(points: Array, pitch: float) -> Array:
    """Angles [N] that turn the halves of a wedge to its other sides."""
    return np.where(np.arctan2(points[:, 1], points[:, 0]) < 0.5 * pitch, pitch, -pitch)
