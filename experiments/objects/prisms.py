"""Prisms, cones, bolts and extruded curves, to be seen by few points."""

from functools import partial

import numpy as np

from experiments.objects.constructions import oblong, polygon, wall
from experiments.objects.instances import Build, Instance, of_parts
from experiments.objects.parts import Part, cylinder, extruded, ring_of, spun, stacked
from symrefine.geometry import Array, rotation

Rng = np.random.Generator


def _height(rng: Rng) -> float:
    return float(rng.uniform(0.35, 1.2))


def prism(outline: Array, name: str, rng: Rng) -> Instance:
    """Over an outline: the mirror across the axis comes on top."""
    return of_parts([extruded(outline * rng.uniform(0.8, 1.3), -(half := _height(rng)), half)], name)


def regular(count: int, rng: Rng) -> Instance:
    """A regular prism, no cube: D_nh."""
    height = _height(rng)
    half = height if abs(height - np.sqrt(0.5)) > 0.1 else 1.5 * height
    return of_parts([extruded(polygon(count), -half, half)], f"D{count}h")


def frustum(count: int, rng: Rng) -> Instance:
    """A truncated pyramid: C_nv."""
    rings = wall(polygon(count), (0.0, 2.0 * _height(rng)))
    rings[1, :, :2] *= rng.uniform(0.3, 0.75)
    return of_parts([stacked(rings)], f"C{count}v")


def cone(rng: Rng) -> Instance:
    """A cone, turned finely: also a pyramid with as many sides."""
    return of_parts([spun([(0, 0), (rng.uniform(0.4, 0.9), 0), (0.001, rng.uniform(0.8, 1.6))])], "Cinfv", "C96v")


def bolt(sides: int, rng: Rng) -> Instance:
    """A head with flat sides on a plain shaft: C_nv."""
    head = rng.uniform(0.4, 0.7)
    shaft = cylinder(rng.uniform(0.4, 0.6), -rng.uniform(1.2, 2.5), 0.05)
    return of_parts([extruded(polygon(sides), 0.0, head), shaft], f"C{sides}v")


def star(points: int, rng: Rng) -> Instance:
    """A star: D_nh."""
    radius = np.tile([1.0, rng.uniform(0.4, 0.6)], points)
    return prism(radius[:, None] * polygon(2 * points), f"D{points}h", rng)


def waved(terms: tuple[tuple[int, float, float], ...], rng: Rng) -> Array:
    """A smooth closed curve [240, 2], its radius 1 + sum a cos(k t + p) for terms (k, a, p), each a varied a little."""
    angle = 2 * np.pi * np.arange(240) / 240
    radius = 1 + sum(rng.uniform(0.85, 1.15) * a * np.cos(k * angle + p) for k, a, p in terms)
    return np.asarray(radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def waves(name: str, terms: tuple[tuple[int, float, float], ...], rng: Rng) -> Instance:
    """A prism over a smooth closed curve."""
    return prism(waved(terms, rng), name, rng)


def puddle(rng: Rng) -> Instance:
    """A prism over a curve without symmetry: Cs, the mirror across its axis, which is y."""
    outline = waved(((1, 0.15, 0.0), (2, 0.2, 0.9), (3, 0.15, 2.2)), rng)
    return of_parts([extruded(outline, -(h := _height(rng)), h).turned(rotation([1, 0, 0], np.pi / 2))], "Cs")


def tee(rng: Rng) -> Instance:
    """A T profile, one mirror along it: C2v."""
    web, long, flange = rng.uniform(0.12, 0.25), rng.uniform(0.9, 1.5), rng.uniform(0.7, 1.0)
    above = np.array([[-long, web], [-0.15, web], [-0.15, flange], [0.15, flange]])
    outline = np.concatenate([above[::-1], above * [1, -1]])
    return _upright_mirror(extruded(outline, -(h := _height(rng)), h))


def angle_profile(rng: Rng) -> Instance:
    """An L profile of equal legs: C2v."""
    thick, leg = rng.uniform(0.15, 0.3), rng.uniform(1.0, 1.4)
    outline = np.array([[-thick, -thick], [leg, -thick], [leg, thick], [thick, thick], [thick, leg], [-thick, leg]])
    turned = outline @ np.array([[1.0, -1.0], [1.0, 1.0]]) * np.sqrt(0.5)  # the diagonal on x
    return _upright_mirror(extruded(turned, -(h := _height(rng)), h))


def _upright_mirror(part: Part) -> Instance:
    """A prism whose outline has one mirror, across y: C2v with its axis on x."""
    stood = part.turned(np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]))  # x becomes z, y becomes x
    return of_parts([stood], "C2v")


def fluted_bolt(rng: Rng) -> Instance:
    """A round head with five flats below it on a shaft: C5v."""
    fins = [p.moved((0, 0, -0.5)) for p in ring_of(extruded(oblong(0.3, 0.12), -0.5, 0.5).moved((0.55, 0, 0)), 5)]
    return of_parts([cylinder(0.9, 0.0, 0.3, 100), cylinder(0.42, -rng.uniform(1.3, 2.0), 0.0, 100), *fins], "C5v")


SPARSE: dict[str, Build] = {
    **{f"prism{n}": partial(regular, n) for n in (3, 5, 6)},
    **{f"frustum{n}": partial(frustum, n) for n in (4, 6)},
    "cone": cone,
    "bolt4": partial(bolt, 4),
    "bolt6": partial(bolt, 6),
    "fluted_bolt": fluted_bolt,
    "star5": partial(star, 5),
    "star7": partial(star, 7),
    "tee": tee,
    "angle": angle_profile,
    "clover": partial(waves, "D3h", ((3, 0.25, 0.0),)),
    "swirl3": partial(waves, "C3h", ((3, 0.22, 0.0), (6, 0.12, 1.0))),
    "leaf": partial(waves, "C2h", ((2, 0.3, 0.0), (4, 0.15, 1.1))),
    "puddle": puddle,
}
