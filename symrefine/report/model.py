"""The object as the page carries it: a quantised mesh or cloud, with what each part misses under each element."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from symrefine.detection.result import Detection
from symrefine.geometry import Array, Isometry
from symrefine.picture.camera import FOV_RAD, look_at
from symrefine.picture.palette import INFERRED, OUTLIER
from symrefine.picture.scene import Scene
from symrefine.picture.surface import Surface, make_surface
from symrefine.report.elements import Element
from symrefine.report.mesh import simplified, subdivided
from symrefine.shape import Index, Shape
from symrefine.surface.tree import Tree
from symrefine.texture import corner_weights

# Of the page, which is to stay below 3 MB: triangles, points, and misses (vertices times elements) that it carries.
MOST_TRIANGLES, MOST_POINTS, MOST_MISSES = 40_000, 24_000, 700_000
# Longest edge of a triangle in diagonals: finer than most details that count, and than letters on a can.
EDGE, EDGE_TEXTURED = 1.0 / 60.0, 1.0 / 120.0
# Steps of a position along the longest side, and of a miss; the last of these means that nobody looked there.
POSITIONS, MISSES, UNSEEN = 65535, 250, 255
# The deepest colour stands for so many tolerances: what no symmetry may miss by anywhere, and a little more.
DEEPEST = 2.0
# Of a palette that a byte points into.
COLOURS = 256
# Directions in which the outermost points are looked for.
OUTLINE = 200


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Model:
    """What the script draws, and what was left out for that, in words."""

    data: dict[str, Any]
    told: str


def model(detection: Detection, shape: Shape, scene: Scene, elements: Sequence[Element]) -> Model:
    """The object, relative to the centre and in diagonals, with its misses under each element.

    Positions are whole steps of 16 bits along the longest side, misses of 8 bits up to two tolerances.
    """
    surface = make_surface(shape, replace(scene, planes=()))
    parts = packed(surface, scene, MOST_MISSES // max(1, len(elements)))
    told = _told(shape, surface, parts)
    places = parts.pop("places")
    misses = _misses(detection, places + detection.center, elements)
    camera = look_at(scene, aspect=1.4, fov_rad=FOV_RAD)
    back = camera.eye - camera.target
    data = {
        **parts,
        "frame": np.round(scene.stage.frame, 9).tolist(),
        "outline": outline(scene.stage.points / scene.stage.diagonal),
        "view": np.round(scene.stage.frame @ back / np.linalg.norm(back), 6).tolist(),
        **heat(misses, detection.tolerance),
    }
    return Model(data=data, told=told)


def packed(surface: Surface, scene: Scene, most: int) -> dict[str, Any]:
    """A surface as the page carries it: up to about `most` places, and these, [N, 3], as `places`."""
    if scene.balls is not None:
        return _balls(surface, scene)
    if surface.faces is not None:
        return _mesh(surface, scene, min(MOST_TRIANGLES, 2 * most))
    return _cloud(surface, scene, min(MOST_POINTS, most))


def heat(misses: Array, tolerance: float) -> dict[str, Any]:
    """Misses [E, N] in steps of 8 bits up to two tolerances, and what the steps mean; NaN where nobody looked."""
    return {
        "limit": DEEPEST * tolerance,
        "steps": MISSES,
        "unseen": UNSEEN,
        "misses": _encoded(_stepped(misses, DEEPEST * tolerance)),
    }


def outline(points: Array) -> list[list[float]]:
    """The outermost of points in diagonals, which the camera has to have in view."""
    k = np.arange(OUTLINE) + 0.5
    # Directions spread evenly over the sphere (Fibonacci's spiral).
    height, turn = 1.0 - 2.0 * k / OUTLINE, np.pi * (1.0 + 5.0**0.5) * k
    ring = np.sqrt(1.0 - height**2)
    directions = np.stack([ring * np.cos(turn), ring * np.sin(turn), height])
    rows: list[list[float]] = np.round(points[np.unique((points @ directions).argmax(axis=0))], 6).tolist()
    return rows


def _mesh(surface: Surface, scene: Scene, most: int) -> dict[str, Any]:
    diagonal = scene.stage.diagonal
    assert surface.faces is not None
    points, faces = simplified(surface.points, surface.faces, most)
    is_whole = len(faces) == len(surface.faces)
    colours = surface.colours if is_whole else surface.colours[_nearest(surface, points[faces].mean(axis=1))]
    edge = EDGE if surface.texture is None else EDGE_TEXTURED
    points, faces, owner = subdivided(points, faces, edge * diagonal, max(most, len(faces) + 1))
    points, faces, kept = _joined(points, faces, diagonal)
    if surface.texture is None:
        return _solid(points, faces, colours[owner[kept]], diagonal)
    middles = points[faces].mean(axis=1)
    if is_whole:
        return _solid(points, faces, _textured(surface, middles, owner[kept]), diagonal)
    return _solid(points, faces, _textured(surface, middles, _nearest(surface, middles)), diagonal)


def _nearest(surface: Surface, middles: Array) -> Index:
    """Which triangle of a surface stands for each of those that were simplified, which are small: the nearest one."""
    assert surface.faces is not None
    return Tree(surface.points[surface.faces].mean(axis=1)).nearest(middles)[1]


def _textured(surface: Surface, places: Array, triangles: Index) -> Array:
    """Colours [N, 3], 0 to 1, of places on triangles [N] of a surface with a texture, `COLOURS` of them at most."""
    from PIL import Image

    assert surface.texture is not None
    assert surface.faces is not None
    weights = corner_weights(places, surface.points[surface.faces[triangles]])
    colours = surface.texture.colours(triangles, weights).round().astype(np.uint8)
    few = Image.fromarray(colours[None]).quantize(COLOURS, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    return np.asarray(few.convert("RGB"), dtype=np.float64)[0] / 255.0


def _balls(surface: Surface, scene: Scene) -> dict[str, Any]:
    """Balls and sticks: a miss for each atom, not for each vertex."""
    assert scene.balls is not None
    assert surface.faces is not None
    solid = _solid(surface.points, surface.faces, surface.colours, scene.stage.diagonal)
    return {
        **solid,
        "owners": _encoded(scene.balls.atoms.astype("<u2")),
        "places": scene.balls.centres,
        "kind": "atoms",
    }


def _solid(points: Array, faces: Index, colours: Array, diagonal: float) -> dict[str, Any]:
    palette, index = np.unique(np.round(255 * colours).astype(int), axis=0, return_inverse=True)
    wide = len(points) > POSITIONS
    return {
        "kind": "mesh",
        **_positions(points / diagonal),
        "wide": wide,
        "faces": _encoded(faces.astype("<u4" if wide else "<u2")),
        "palette": palette.tolist(),
        "colours": _encoded(index.reshape(-1).astype(np.uint8)),
        "places": points,
        "count": len(faces),
    }


def _cloud(surface: Surface, scene: Scene, most: int) -> dict[str, Any]:
    """Points, those that have no image of their own last: what is inferred, and outliers."""
    step = max(1, -(-len(surface.points) // most))
    points, normals, colours = surface.points[::step], surface.normals[::step], np.round(255 * surface.colours[::step])
    own = ~(colours[:, None] == np.array([INFERRED, OUTLIER])).all(axis=2).any(axis=1)
    order = np.argsort(~own, kind="stable")
    points, normals, colours = points[order], normals[order], colours[order]
    palette, index = np.unique(colours.astype(int), axis=0, return_inverse=True)
    return {
        "kind": "cloud",
        **_positions(points / scene.stage.diagonal),
        "normals": _encoded(np.round(127 * normals).astype(np.int8)),
        "palette": palette.tolist(),
        "colours": _encoded(index.reshape(-1).astype(np.uint8)),
        "seen": int(own.sum()),
        "radius": round(surface.radius / scene.stage.diagonal * min(step, 4) ** 0.5, 6),
        "places": points,
        "count": len(points),
    }


def _joined(points: Array, faces: Index, diagonal: float) -> tuple[Array, Index, Index]:
    """Vertices that coincide as one, triangles without area left out, and which were kept."""
    _, first, which = np.unique(np.round(points / (1e-5 * diagonal)), axis=0, return_index=True, return_inverse=True)
    faces = which.reshape(-1)[faces]
    kept = np.flatnonzero((faces != np.roll(faces, -1, axis=1)).all(axis=1))
    return points[first], faces[kept], kept


def _positions(points: Array) -> dict[str, Any]:
    low = points.min(axis=0)
    step = float(np.ptp(points, axis=0).max()) / POSITIONS
    steps = np.round((points - low) / step).astype("<u2")
    return {"low": low.tolist(), "step": step, "positions": _encoded(steps)}


def _misses(detection: Detection, points: Array, elements: Sequence[Element]) -> Array:
    """[E, N] by how much points (input units) miss under each element, as fractions of the diagonal; NaN where nobody
    looked. Each has the miss of the local plane that is nearest to it, by which the answer was decided."""
    surface, scale = detection.surface, detection.scale
    local = (points - detection.origin) / scale
    owner = Tree(surface.cloud.points).nearest(local)[1]
    found = np.zeros((len(elements), len(points)))
    for k, element in enumerate(elements):
        moved = element.motion(element.angle_rad)
        shift = (moved.shift + moved.matrix @ detection.origin - detection.origin) / scale
        motion = [Isometry(matrix=moved.matrix, shift=shift)]
        found[k] = surface.seen(surface.misses(motion), motion)[0][owner]
    return found


def _stepped(misses: Array, deepest: float) -> Any:
    steps = np.round(MISSES * np.clip(np.nan_to_num(misses) / deepest, 0.0, 1.0))
    return np.where(np.isnan(misses), UNSEEN, steps).astype(np.uint8)


def _encoded(values: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")


def _told(shape: Shape, surface: Surface, parts: dict[str, Any]) -> str:
    """What the model leaves out; empty if nothing."""
    if shape.faces is not None and parts["kind"] == "mesh" and len(shape.faces) > parts["count"]:
        return f"The model shows {parts['count']:,} of {len(shape.faces):,} triangles; all of them were used."
    if parts["kind"] == "cloud" and len(shape.points) > parts["count"] and parts["count"] < len(surface.points):
        return f"The model shows {parts['count']:,} of {len(shape.points):,} points; all of them were used."
    return ""
