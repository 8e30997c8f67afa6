"""Surfaces of revolution that are not quite: coarsely turned, with a small detail, or of slightly elliptic section."""

from collections.abc import Callable
from functools import partial

import numpy as np

from experiments.objects.constructions import thread
from experiments.objects.instances import Build, Instance, centred, of_parts
from experiments.objects.parts import Part, assembled, block, cylinder, lofted, spun, stacked
from symrefine.geometry import rotation
from symrefine.shape import Shape

Rng = np.random.Generator
Profile = list[tuple[float, float]]
# A detail of no more than this share of the surface may be overlooked.
SMALL = 0.01
FINE = 144


def vase(rng: Rng) -> Profile:
    """A belly, a neck and a lip."""
    belly, neck, height = rng.uniform(0.35, 0.6), rng.uniform(0.15, 0.25), rng.uniform(1.0, 1.5)
    curve = [(neck + (belly - neck) * np.sin(np.pi * t) ** 2, height * t) for t in np.linspace(0.15, 1.0, 12)]
    return [(0, curve[0][1]), *curve, (neck + 0.1, height + 0.03), (0, height + 0.03)]


def goblet(rng: Rng) -> Profile:
    """A foot, a stem and a cup."""
    foot, cup, stem = rng.uniform(0.3, 0.4), rng.uniform(0.35, 0.5), rng.uniform(0.4, 0.7)
    return [
        (0, 0),
        (foot, 0),
        (foot, 0.05),
        (0.06, 0.1),
        (0.06, stem),
        (cup, stem + 0.3),
        (cup, stem + 0.7),
        (0, stem + 0.2),
    ]


def bottle(rng: Rng) -> Profile:
    """A body, a shoulder and a neck."""
    body, neck, height = rng.uniform(0.28, 0.4), rng.uniform(0.1, 0.14), rng.uniform(0.6, 0.9)
    return [(0, 0), (body, 0), (body, height), (neck, height + 0.25), (neck, height + 0.5), (0, height + 0.5)]


def tin(rng: Rng) -> Profile:
    """A can with a rim above."""
    radius, height = rng.uniform(0.35, 0.5), rng.uniform(0.9, 1.3)
    return [
        (0, 0),
        (radius, 0),
        (radius, height),
        (radius - 0.04, height),
        (radius - 0.04, height - 0.05),
        (0, height - 0.05),
    ]


def _mirrored(half: Profile) -> Profile:
    """A profile from z = 0 upwards, with its image below."""
    return [(r, -z) for r, z in reversed(half)] + half


def spool(rng: Rng) -> Profile:
    """Two flanges on a core."""
    core, height = rng.uniform(0.2, 0.5), rng.uniform(0.4, 0.7)
    return _mirrored([(core, 0.001), (core, height), (0.8, height), (0.8, height + 0.15), (0, height + 0.15)])


def drum(rng: Rng) -> Profile:
    """A bulging cylinder."""
    height, bulge = rng.uniform(0.5, 0.8), rng.uniform(0.05, 0.15)
    return _mirrored([*((0.5 + bulge * np.cos(2.0 * t), height * t) for t in np.linspace(0.001, 1.0, 6)), (0, height)])


def ring(rng: Rng) -> Profile:
    """A ring of round section."""
    thick = rng.uniform(0.1, 0.25)
    t = np.linspace(0.0, 2.0 * np.pi, 25)
    return [(float(0.8 - thick * np.cos(a)), float(-thick * np.sin(a))) for a in t]


def coarse(profile: Callable[[Rng], Profile], group: str, segments: int, rng: Rng) -> Instance:
    """Turned with few facets: as round as it was meant, or of as many fold as it has facets."""
    return of_parts([spun(profile(rng), segments)], group, group.replace("inf", str(segments)))


def with_detail(group: str, build: Callable[[Rng], tuple[list[Part], list[Part]]], low: bool, rng: Rng) -> Instance:
    """A round body with a detail; also right as round where that is small or `low`: lower than a tolerance sees."""
    body, detail = build(rng)
    share = sum(p.area for p in detail) / sum(p.area for p in (*body, *detail))
    return of_parts([*body, *detail], group, *(("Cinfv",) if low or share < SMALL else ()))


def tab(size: float, rng: Rng) -> tuple[list[Part], list[Part]]:
    """A pull-tab on a can: a plate beside the axis, raised above the lid."""
    outline = tin(rng)
    low = outline[-1][1]
    length = size * rng.uniform(0.9, 1.1)
    return [spun(outline, FINE)], [block((0.15, 0, low + 0.15 * length), (length, 0.5 * length, 0.3 * length))]


def dot(rng: Rng) -> tuple[list[Part], list[Part]]:
    """A raised dot on the belly of a bottle."""
    outline = bottle(rng)
    body, height = outline[2]
    disc = cylinder(rng.uniform(0.04, 0.06), -0.03, 0.03, 24).turned(rotation([0, 1, 0], np.pi / 2))
    return [spun(outline, FINE)], [disc.moved((body, 0, rng.uniform(0.3, 0.6) * height))]


def lugs(size: float, rng: Rng) -> tuple[list[Part], list[Part]]:
    """Two lugs on opposite sides of a can."""
    outline = tin(rng)
    radius, height = outline[1][0], outline[2][1]
    lug = block((radius, 0, 0.8 * height), (1.2 * size, size, size))
    return [spun(outline, FINE)], [lug, lug.turned(rotation([0, 0, 1], np.pi))]


def label(rng: Rng) -> tuple[list[Part], list[Part]]:
    """A label around half of a can, as thick as card."""
    outline = tin(rng)
    radius, height = outline[1][0] + 0.004, outline[2][1]
    angle = np.linspace(-1.0, 1.0, 49) * rng.uniform(1.2, 1.8)
    corners = [(radius, 0.2), (radius, 0.7), (0.98 * radius, 0.7), (0.98 * radius, 0.2)]
    sections = np.array([[(r * np.cos(a), r * np.sin(a), z * height) for r, z in reversed(corners)] for a in angle])
    return [spun(outline, FINE)], [lofted(sections)]


def screw(rng: Rng) -> tuple[list[Part], list[Part]]:
    """A bottle whose neck carries a thread of a few thousandths of the diagonal."""
    outline = bottle(rng)
    neck, foot = outline[3]
    heights = np.linspace(foot + 0.1, foot + 0.45, 33)
    return [spun(outline, FINE)], [stacked(thread(neck + 0.004, 0.006, 0.08, heights))]


def oval(profile: Callable[[Rng], Profile], group: str, percent: float, rng: Rng) -> Instance:
    """A section whose axes differ by so much."""
    made = assembled([spun(profile(rng), FINE)])
    shape = Shape(points=made.points * [1.0 + percent / 100.0, 1.0, 1.0], faces=made.faces, measure=made.measure)
    own = group.replace("inf", "2")
    return Instance(shape=shape, truth=centred(own), also=(centred(group).group,), diagonal=shape.diagonal)


def _coarse(profile: Callable[[Rng], Profile], group: str, numbers: str) -> dict[str, Build]:
    return {f"{profile.__name__}{n}": partial(coarse, profile, group, int(n)) for n in numbers.split()}


ROUND: dict[str, Build] = {
    **_coarse(vase, "Cinfv", "16 24 40"),
    **_coarse(goblet, "Cinfv", "20 48"),
    **_coarse(bottle, "Cinfv", "32 64"),
    **_coarse(spool, "Dinfh", "18 36"),
    **_coarse(drum, "Dinfh", "28"),
    **_coarse(ring, "Dinfh", "24 48"),
    "tab": partial(with_detail, "Cs", partial(tab, 0.12), False),
    "wide_tab": partial(with_detail, "Cs", partial(tab, 0.35), False),
    "dot": partial(with_detail, "Cs", dot, False),
    "lugs": partial(with_detail, "C2v", partial(lugs, 0.045), False),
    "wide_lugs": partial(with_detail, "C2v", partial(lugs, 0.2), False),
    "label": partial(with_detail, "Cs", label, True),
    "screw": partial(with_detail, "C1", screw, True),
    **{
        f"oval_{profile.__name__}_{percent:g}": partial(oval, profile, group, percent)
        for profile, group, percents in (
            (bottle, "Cinfv", (0.5, 1.0, 2.0, 4.0)),
            (tin, "Cinfv", (1.0, 4.0)),
            (drum, "Dinfh", (0.5, 2.0)),
        )
        for percent in percents
    },
}
