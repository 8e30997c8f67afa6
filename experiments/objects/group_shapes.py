"""Shapes of every point group, of the project's own making, each with a sibling that misses it in one detail.

`python -m experiments.objects.group_shapes` prints them all with what their details amount to. The sibling has one part
(a leg, a tooth, a blade, a lid) 3 % of the bounding-box diagonal out of place; its group is what then remains. The
groups are stated here and follow from the construction: `parts.exact_group` finds the same by trying every operation.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from scipy.spatial import cKDTree

from experiments.objects import constructions as made
from experiments.objects.parts import Part, assembled, block, cylinder, extruded, placed_group, spun
from symrefine.geometry import Array, tight_diagonal, unit
from symrefine.groups import PointGroup
from symrefine.moments.quadrature import sample_surface
from symrefine.shape import Shape

MISS_REL = 0.03
# What the sibling shows of its miss: the share of its surface that a lost operation moves off it by so much.
SEEN_REL = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """A shape by its parts.

    Attributes:
        group: its point group.
        sibling: the point group that remains when the detail is moved.
        build: its parts.
        detail: index of the part that the sibling has out of place.
        along: direction of that displacement.
    """

    group: str
    sibling: str
    build: Callable[[], list[Part]]
    detail: int = -1
    along: tuple[float, float, float] = (1.0, 0.0, 0.0)

    def parts(self, sibling: bool = False) -> list[Part]:
        """The parts of the shape or of its sibling."""
        parts = self.build()
        if sibling:
            step = MISS_REL * assembled(parts).diagonal * unit(self.along)
            parts[self.detail] = parts[self.detail].moved(step)
        return parts

    @property
    def share(self) -> float:
        """Share of the surface that is the detail."""
        parts = self.build()
        return parts[self.detail].area / sum(p.area for p in parts)


@cache
def shape(name: str, sibling: bool = False) -> Shape:
    """The mesh of a shape or of its sibling."""
    return assembled(DESIGNS[name].parts(sibling))


def group(name: str, sibling: bool = False) -> str:
    """The point group of a shape or of its sibling."""
    return DESIGNS[name].sibling if sibling else DESIGNS[name].group


TANGENT, AXIAL = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
ROOT5 = 5**0.5
ROUND_BODY = spun([(0, 0), (0.35, 0), (0.35, 0.7), (0.13, 0.9), (0, 0.9)])


def _designs() -> dict[str, Design]:
    """Every shape by name."""
    return {**_low(), **_cyclic(), **_dihedral(), **_many_axes()}


def _low() -> dict[str, Design]:
    return {
        "clutter": Design(group="C1", sibling="C1", build=made.clutter, along=AXIAL),
        "flange_nut": Design(group="C1", sibling="C1", build=made.flange_nut),
        "bolt": Design(group="C1", sibling="C1", build=made.bolt, detail=0),
        "chair": Design(group="Cs", sibling="C1", build=made.chair, along=TANGENT),
        "bracket": Design(group="Cs", sibling="C1", build=made.bracket, along=TANGENT),
        "skew_box": Design(group="Ci", sibling="C1", build=made.skew_box, along=TANGENT),
        "opposed_rods": Design(group="Ci", sibling="C1", build=made.opposed_rods, along=AXIAL),
    }


def _cyclic() -> dict[str, Design]:
    found = {"threaded_collar": Design(group="C2", sibling="C1", build=made.threaded_collar, along=AXIAL)}
    for n in range(2, 9):
        build = partial(made.fan, n, nose=True)
        found[f"fan{n}"] = Design(group=f"C{n}", sibling="C1", build=build, detail=1, along=(0, -1, 1))
    found |= {
        "flat_bottle": Design(group="C2v", sibling="Cs", build=lambda: made.bottle(made.flat_sided())),
        "stool3": Design(group="C3v", sibling="C1", build=partial(made.stool, 3), detail=1, along=TANGENT),
        "table": Design(group="C4v", sibling="C1", build=made.table),
        "square_bottle": Design(
            group="C4v", sibling="Cs", build=lambda: made.bottle(block((0, 0, 0.45), (0.6, 0.6, 0.9)))
        ),
        "starfish": Design(group="C5v", sibling="C1", build=made.starfish, detail=1, along=TANGENT),
        "plain_flange_nut": Design(
            group="C6v", sibling="Cs", build=lambda: [extruded(made.polygon(6), -0.3, 0.5), cylinder(1.2, -0.4, -0.2)]
        ),
        "swivel_base7": Design(group="C7v", sibling="C1", build=partial(made.swivel_base, 7), detail=8, along=TANGENT),
        "stool8": Design(group="C8v", sibling="C1", build=partial(made.stool, 8), detail=1, along=TANGENT),
        "crown_gear12": Design(group="C12v", sibling="C1", build=made.crown_gear, detail=2, along=TANGENT),
    }
    for n in range(2, 7):
        build = partial(made.rotor, n, [(0.0, 1, 0.0)])
        found[f"rotor{n}"] = Design(group=f"C{n}h", sibling="Cs", build=build, detail=1 + n)
    for n in range(2, 6):
        build = partial(made.rotor, n, [(0.3, 1, 0.0), (-0.3, 1, 0.5)])
        found[f"swirl{2 * n}"] = Design(group=f"S{2 * n}", sibling="C1", build=build, detail=1 + n)
    return found


def _dihedral() -> dict[str, Design]:
    found = {}
    for n in range(2, 7):
        build = partial(made.fan, n, nose=False)
        found[f"propeller{n}"] = Design(group=f"D{n}", sibling="C1", build=build, detail=1, along=(0, -1, 1))
    found |= {
        "brick": Design(group="D2h", sibling="C2h", build=lambda: made.halves(made.oblong(1.2, 0.7), 0.5)),
        "triangular_bar": Design(group="D3h", sibling="Cs", build=lambda: made.halves(made.polygon(3), 1.4)),
        "square_bar": Design(group="D4h", sibling="C2h", build=lambda: made.halves(made.oblong(1.0, 1.0), 2.0)),
        "five_sided_bar": Design(group="D5h", sibling="Cs", build=lambda: made.halves(made.polygon(5), 1.2)),
        "crate": Design(group="D2h", sibling="Cs", build=made.crate, along=AXIAL),
        "slabs": Design(group="D2h", sibling="Cs", build=made.slabs),
        "bossed_prism": Design(group="D3h", sibling="Cs", build=made.bossed_prism, along=AXIAL),
        "cross": Design(group="D4h", sibling="C2v", build=made.cross, detail=5),
        "wheel5": Design(group="D5h", sibling="Cs", build=partial(made.wheel, 5), detail=2, along=TANGENT),
        "bushed_nut": Design(group="D6h", sibling="C2v", build=made.bushed_nut),
        "wheel7": Design(group="D7h", sibling="Cs", build=partial(made.wheel, 7), detail=2, along=TANGENT),
        "gear8": Design(group="D8h", sibling="Cs", build=partial(made.gear, 8), detail=1, along=TANGENT),
        "gear12": Design(group="D12h", sibling="Cs", build=partial(made.gear, 12), detail=1, along=TANGENT),
        "gear24": Design(group="D24h", sibling="Cs", build=partial(made.gear, 24), detail=1, along=TANGENT),
    }
    for n in range(2, 7):
        build = partial(made.rotor, n, [(0.3, 0, 0.0), (-0.3, 0, 0.5)])
        found[f"crossed{n}"] = Design(group=f"D{n}d", sibling="Cs", build=build, detail=1 + n)
    return found


def _many_axes() -> dict[str, Design]:
    return {
        "six_bars_askew": Design(
            group="T",
            sibling="C1",
            build=partial(made.bars, "T", np.pi / 8),
            detail=1,
            along=(0, -np.sin(np.pi / 8), np.cos(np.pi / 8)),
        ),
        "methane": Design(group="Td", sibling="Cs", build=made.methane, detail=5, along=(1, 1, -2)),
        "caltrop": Design(group="Td", sibling="C1", build=made.caltrop, detail=1, along=(1, -1, 0)),
        "volleyball": Design(group="Th", sibling="Cs", build=partial(made.bars, "T", 0.0), detail=1, along=AXIAL),
        "twelve_bars": Design(group="O", sibling="C1", build=made.twelve_bars, detail=1, along=(1, -1, 2**0.5)),
        "snub_balls": Design(group="O", sibling="C1", build=made.snub_balls, detail=1, along=TANGENT),
        "cube": Design(group="Oh", sibling="Cs", build=made.eight_cubes, detail=0),
        "jack": Design(group="Oh", sibling="Cs", build=made.jack, detail=3, along=TANGENT),
        "bossed_cube": Design(group="Oh", sibling="Cs", build=made.bossed_cube, detail=1, along=TANGENT),
        "thirty_bars": Design(group="I", sibling="C1", build=made.thirty_bars, detail=1, along=(0, -1, 1)),
        "spiked_ball": Design(
            group="Ih", sibling="Cs", build=made.spiked_ball, detail=1, along=(5 + ROOT5, -2, ROOT5 - 1)
        ),
        "dodecahedral_frame": Design(
            group="Ih", sibling="C3v", build=made.dodecahedral_frame, along=(1, 1, 1), detail=30
        ),
        "bottle": Design(group="Cinfv", sibling="Cs", build=lambda: made.bottle(ROUND_BODY)),
        "goblet": Design(group="Cinfv", sibling="Cs", build=made.goblet),
        "cone": Design(group="Cinfv", sibling="Cs", build=made.cone),
        "drum": Design(group="Dinfh", sibling="C2h", build=made.drum),
        "dumbbell": Design(group="Dinfh", sibling="Cs", build=made.dumbbell),
        "spool": Design(group="Dinfh", sibling="Cs", build=made.spool),
        "hollow_ball": Design(group="Kh", sibling="Cinfv", build=made.hollow_ball, along=AXIAL),
    }


DESIGNS = _designs()


def triangles(name: str) -> int:
    """Number of triangles of a shape."""
    faces = shape(name).faces
    return 0 if faces is None else len(faces)


def lost_share(name: str, count: int = 60000, operations: int = 12) -> float:
    """Share of the sibling's surface that the shape's lost operations, left where they were, move off it by 2 %.

    Of up to `operations` of them the one that shows least counts, of a continuous group the one that shows most.
    Refitting a lost operation makes it show less still.
    """
    parts = DESIGNS[name].parts(sibling=True)
    whole, center = placed_group(DESIGNS[name].build())
    left, _ = placed_group(parts)
    rng = np.random.default_rng(0)
    points = sample_surface(assembled(parts), count, rng)[0] - center
    tree, some = cKDTree(points), points[:: count // 3000]
    limit = SEEN_REL * tight_diagonal(points)
    shares = [np.mean(tree.query(some @ o.T)[0] > limit) for o in _lost(whole, left, operations, rng)]
    return float((min if whole.is_finite else max)(shares, default=0.0))


def _lost(whole: PointGroup, left: PointGroup, most: int, rng: np.random.Generator) -> Array:
    """Up to `most` of the operations of a group that are none of another."""
    all_of, kept = (g.operations() if g.is_finite else g.sampled(6).operations() for g in (whole, left))
    nearest = np.abs(all_of[:, None] - kept[None]).max(axis=(2, 3)).min(axis=1)
    lost = all_of[nearest > 1e-6]
    return lost[rng.permutation(len(lost))[:most]]


def main() -> None:
    """Print every shape, what it is made of, and how far its sibling's detail shows."""
    print("shape               group   sibling  triangles  detail, % of the surface  moved off by 2 % and more, %")
    for name, design in DESIGNS.items():
        print(
            f"{name:19s} {design.group:7s} {design.sibling:7s} {triangles(name):10d}"
            f"  {100 * design.share:24.1f}  {100 * lost_share(name):28.1f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
