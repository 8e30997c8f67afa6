"""Shapes of the project's own making, as watertight parts: boxes, cylinders, solids of revolution, swept handles."""

from collections.abc import Callable, Sequence

import numpy as np

from symrefine.geometry import Array, rotation
from symrefine.groups import PointGroup
from symrefine.moments.quadrature import sample_surface
from symrefine.shape import Index, Shape

Mesh = tuple[Array, Index]


def box(center: Sequence[float], size: Sequence[float], turn_rad: float = 0.0) -> Mesh:
    """Axis-parallel box, turned about its own vertical axis."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * np.asarray(size)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return corners @ rotation([0, 0, 1], turn_rad).T + np.asarray(center), np.array(faces)


def revolve(profile: Sequence[Sequence[float]], segments: int = 96) -> Mesh:
    """Surface of revolution about z of a polyline of (radius, height)."""
    outline = np.asarray(profile, dtype=float)
    angle = 2 * np.pi * np.arange(segments) / segments
    rings = np.stack(
        [
            np.outer(outline[:, 0], np.cos(angle)),
            np.outer(outline[:, 0], np.sin(angle)),
            np.repeat(outline[:, 1:], segments, axis=1),
        ],
        axis=-1,
    )
    return rings.reshape(-1, 3), _grid_faces(len(outline), segments)


def tube(path: Array, radius: float, segments: int = 24) -> Mesh:
    """Round tube along a planar path [K, 3] in the x-z plane."""
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.array([0.0, 1.0, 0.0])
    up = np.cross(tangent, side)
    angle = 2 * np.pi * np.arange(segments) / segments
    rings = path[:, None] + radius * (
        np.cos(angle)[None, :, None] * up[:, None] + np.sin(angle)[None, :, None] * side[None, None]
    )
    return rings.reshape(-1, 3), _grid_faces(len(path), segments)


def _grid_faces(rings: int, segments: int) -> Index:
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(segments), indexing="ij")
    a, b = i * segments + j, i * segments + (j + 1) % segments
    return np.concatenate([np.stack([a, b, b + segments], -1), np.stack([a, b + segments, a + segments], -1)]).reshape(
        -1, 3
    )


def join(parts: Sequence[Mesh]) -> Shape:
    """One surface from several parts."""
    offsets = np.cumsum([0, *(len(v) for v, _ in parts)])
    vertices = np.concatenate([v for v, _ in parts])
    faces = np.concatenate([f + o for (_, f), o in zip(parts, offsets[:-1], strict=True)])
    return Shape(points=vertices, faces=faces, measure="surface")


def table(legs: int = 4) -> Shape:
    """Square table with four square legs near the corners: C4v."""
    assert legs == 4
    parts = [box((0, 0, 0.7), (1, 1, 0.06))]
    parts += [box((x, y, 0.335), (0.08, 0.08, 0.67)) for x in (-0.43, 0.43) for y in (-0.43, 0.43)]
    return join(parts)


def stool(legs: int) -> Shape:
    """Round seat on `legs` round legs: C_legs v."""
    seat = revolve([(0, 0.5), (0.4, 0.5), (0.4, 0.56), (0, 0.56)], 2 * legs * (96 // (2 * legs) + 1))
    parts = [seat]
    for j in range(legs):
        vertices, faces = revolve([(0, 0), (0.035, 0), (0.035, 0.5), (0, 0.5)], 24)
        turn = rotation([0, 0, 1], 2 * np.pi * j / legs)
        parts.append(((vertices + [0.33, 0, 0]) @ turn.T, faces))
    return join(parts)


def mug() -> Shape:
    """Mug with a D-shaped handle: Cs, though its body maps onto itself under any plane through the axis."""
    body = revolve([(0, 0), (0.4, 0), (0.4, 0.95), (0.36, 0.95), (0.36, 0.05), (0, 0.05)], 96)
    t = np.linspace(-np.pi / 2, np.pi / 2, 33)
    handle = tube(np.stack([0.38 + 0.28 * np.cos(t), 0 * t, 0.48 + 0.28 * np.sin(t)], axis=1), 0.045)
    return join([body, handle])


def bottle() -> Shape:
    """Bottle, a surface of revolution: Cinfv."""
    profile = [
        (0, 0),
        (0.3, 0),
        (0.32, 0.03),
        (0.32, 0.7),
        (0.27, 0.85),
        (0.12, 1.0),
        (0.1, 1.05),
        (0.1, 1.3),
        (0.12, 1.3),
        (0.12, 1.36),
        (0, 1.36),
    ]
    return join([revolve(profile, 180)])


def asymmetric() -> Shape:
    """Four boxes with nothing in common: C1."""
    return join(
        [
            box((0, 0, 0), (1.0, 0.6, 0.2)),
            box((0.35, 0.2, 0.25), (0.15, 0.12, 0.4), 0.3),
            box((-0.3, -0.1, 0.2), (0.2, 0.3, 0.3), 0.7),
            box((0.1, -0.4, 0.05), (0.4, 0.3, 0.1), 0.2),
        ]
    )


def sample(shape: Shape, count: int, noise_rel: float, rng: np.random.Generator) -> Array:
    """`count` points of the surface with isotropic Gaussian noise of `noise_rel` bounding-box diagonals."""
    return oriented_sample(shape, count, noise_rel, rng)[0]


def oriented_sample(shape: Shape, count: int, noise_rel: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """The same points [count, 3], and the normals [count, 3] of the surface where they were taken."""
    points, normals, _ = sample_surface(shape, count, rng)
    order = rng.permutation(count)
    return points[order] + rng.normal(scale=noise_rel * shape.diagonal, size=points.shape), normals[order]


def mirror_normals(group: str) -> Array:
    """Normals [m, 3] of the mirrors as our shapes stand: the main axis on z, a mirror through x.

    None for a surface of revolution, which has too many to list.
    """
    if group in ("C1", "Cinfv"):
        return np.empty((0, 3))
    return np.array([[0.0, 1.0, 0.0]]) if group == "Cs" else PointGroup(name=group).mirrors()


SHAPES: dict[str, tuple[Callable[[], Shape], str]] = {
    "table": (table, "C4v"),
    "stool3": (lambda: stool(3), "C3v"),
    "stool5": (lambda: stool(5), "C5v"),
    "stool6": (lambda: stool(6), "C6v"),
    "stool8": (lambda: stool(8), "C8v"),
    "mug": (mug, "Cs"),
    "bottle": (bottle, "Cinfv"),
    "asymmetric": (asymmetric, "C1"),
}
