"""What a detection found, in the frame and units of the input."""

from dataclasses import dataclass, field

from symrefine.decide.posterior import Alternative
from symrefine.detection.examined import Examined
from symrefine.detection.sketch import Sample
from symrefine.fit.refine import Iterate
from symrefine.geometry import Array, Axis, Plane, ReadOnly
from symrefine.groups import PointGroup
from symrefine.ntuples.contract import NTuples
from symrefine.ntuples.rank import FixedSubspace
from symrefine.shape import Index, Shape
from symrefine.surface.floor import Floor
from symrefine.surface.misses import Deviation
from symrefine.surface.surface import Coverage, Surface


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundPlane:
    """A mirror plane in input units: its miss as fractions of the diagonal, and the probability that it is meant.

    `sigma_rad` is the standard deviation of the normal in its least certain direction, `sigma` that of the offset in
    input units: both from the joint refinement of the whole group; NaN where there was none. `coverage` says how much
    of the surface its image supports, contradicts and leaves unseen.
    """

    plane: Plane
    residual: Deviation
    confidence: float
    sigma_rad: float
    sigma: float
    coverage: Coverage


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundAxis:
    """A rotation axis (or rotoreflection, if `improper`) in input units; `order` is `math.inf` for revolution.

    `sigma_rad` and `sigma` (input units) are standard deviations of direction and position, each where it is least
    certain; NaN where no refinement told them. `coverage` as of `FoundPlane`.
    """

    axis: Axis
    order: float
    improper: bool
    residual: Deviation
    confidence: float
    sigma_rad: float
    sigma: float
    coverage: Coverage


@dataclass(frozen=True, kw_only=True)
class Step:
    """The answer at one tolerance: the group as a function of the tolerance is a staircase."""

    tolerance: float
    point_group: str
    undetermined: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class NearMiss:
    """A candidate that was refined and turned down, with what it misses by, for a person to judge.

    `excess` is the smallest tolerance at which it would hold, over the one asked for; infinite if nothing that was seen
    tells of it.
    """

    kind: str
    direction: Array
    point: Array
    order: float
    residual: Deviation
    excess: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """A group that moments or votes proposed, where a glance or a coarse fit left it, in input units.

    `excess` is the smallest tolerance at which it may hold, by a few points, over the tolerance asked for.
    """

    point_group: str
    direction: Array
    point: Array
    excess: float


@dataclass(frozen=True, kw_only=True)
class Exact:
    """That the group maps the vertices of a mesh onto one another: planes, axes and centre are those of the vertices.

    Of a group that holds within the tolerance only, what of it does so. Likewise the points of a cloud, which are only
    asked where noise leaves nothing to be told at the tolerance.

    Attributes:
        miss: largest distance of an image to its counterpart, a fraction of the diagonal; rounding alone leaves 1e-15.
        faces: whether faces are mapped onto faces as well, triangles in one plane as one, and vertices are but the
            corners of those; if not, a triangulation chose its diagonals where four corners lie in no plane. None of a
            cloud.
        point_group: what does so: the group, a part of it, or the fold that a continuous one has in the vertices.
    """

    miss: float
    faces: bool | None
    point_group: str


@dataclass(frozen=True, kw_only=True)
class Verified:
    """What all points say, which were moved one by one, with whatever noise they have.

    Attributes:
        points: how many.
        residual: the largest of every statistic over all elements; misses end at 5.55 tolerances.
        beyond: how many points, of that element of which most, miss by more than 1.85 tolerances.
    """

    points: int
    residual: Deviation
    beyond: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Detection(ReadOnly):
    """Everything `detect` found, in the frame and units of the input.

    Attributes:
        point_group: Schoenflies symbol; "C1" when there is nothing, "undetermined" where the data support no decision.
        confidence: probability that this is the group: the worst element kept and the best turned down both count.
        alternatives: the groups it may be instead, likeliest first.
        group: the same placed in space; C1 where nothing is decided.
        center: [3] the point all operations leave in place.
        planes: discrete mirror planes, best first.
        axes: rotation and rotoreflection axes, highest order first.
        inversion: whether the inversion about the centre is a symmetry.
        inversion_residual: its miss as fractions of the diagonal; None where there is none.
        inversion_confidence: how sure it is; None where there is none.
        near_misses: candidates turned down, best first.
        iterations: outer iterations of the refinement of all planes together; where the group was put together from
            parts, those of the part that took most come on top (coarse looks at a tenth of the points do not count).
        tolerance: the tolerance the decisions were made at, as a fraction of `diagonal`.
        diagonal: diagonal of the smallest bounding box over all orientations, input units.
        undetermined: why the data support no decision; empty when they do.
        staircase: the group at the tolerances that were asked for besides.
        tuples: class of the n-tuples, with singular values, as measured.
        vectors: the n-tuples themselves, dimensionless.
        history: the iterates of that refinement, in normalised units; `scale` and `origin` undo the normalisation.
        points: [M, 3] the points the refinement used, normalised units.
        surface: what judged all candidates: these points with normals, noise, and where nobody looked.
        candidates: what was proposed and given up before a full fit, the nearest misses first.
        outliers: indices, ascending, of the points that were taken as no part of the object; of a stream among those of
            its sample.
        at_least: whether the surface has open borders beyond which nobody looked, or is `strewn`, or `sparse`: the
            object may have more symmetry.
        strewn: whether so many strays are left beside the surface that they may hide some, and all of it was seen, or
            a group of points that may be a clump, or a part of it, alone speaks against a larger group.
        sparse: whether so few points were taken to stand for themselves, as they are carried onto one another, and may
            have been made of samples of a surface, of which they tell too little.
        floor: what the object stands on, in input units, where that was told and found: outliers, too.
        no_floor: whether that was told and none found.
        clumps: how many groups of them stand apart from the body, the others being single strays.
        outlier_share: of all points.
        exact: that and how exactly the group maps vertices of a mesh onto vertices, or points of a cloud, if it does.
        sample: what stands for the surface where there are too many points to look at all of them; None where all do.
        verified: what all points say, where they were asked.
        even_sample: how many points, more evenly spread, it was decided by where the density differs; None where by
            all.
        timings: seconds by stage; everything else is a function of the input and the options alone.
        examined: what it was decided from, with the chain of groups.
        textured: what of it the texture keeps: the same for the shape with its texture, where it has one.
    """

    point_group: str
    confidence: float
    alternatives: tuple[Alternative, ...]
    group: PointGroup
    center: Array
    planes: tuple[FoundPlane, ...]
    axes: tuple[FoundAxis, ...]
    inversion: bool
    inversion_residual: Deviation | None
    inversion_confidence: float | None
    near_misses: tuple[NearMiss, ...]
    iterations: int
    tolerance: float
    diagonal: float
    undetermined: str
    staircase: tuple[Step, ...]
    tuples: FixedSubspace
    vectors: NTuples
    history: tuple[Iterate, ...]
    points: Array
    surface: Surface = field(repr=False)
    candidates: tuple[Candidate, ...]
    outliers: Index
    outlier_share: float
    floor: Floor | None
    no_floor: bool
    clumps: int
    exact: Exact | None
    sample: Sample | None
    even_sample: int | None
    at_least: bool
    strewn: bool
    sparse: bool
    origin: Array
    scale: float
    verified: Verified | None = None
    timings: dict[str, float] = field(default_factory=dict)
    examined: Examined = field(repr=False)
    textured: "Detection | None" = None

    @property
    def is_partial(self) -> bool:
        """Whether there may be more for parts of the surface that were not seen."""
        return self.at_least and not (self.strewn or self.sparse)

    def own(self, shape: Shape) -> Shape:
        """The shape it was found in without the outliers, if a floor is among them: what stands on it."""
        return shape if self.floor is None else shape.without(self.outliers)

    def choices(self, tolerance: float | None = None) -> tuple[Alternative, ...]:
        """Every group that a person may choose instead, C1 first, each inside the next, as likely as at a tolerance.

        Args:
            tolerance: one of the staircase; that of the answer if None.
        """
        return self.examined.choices(self.tolerance if tolerance is None else tolerance)
