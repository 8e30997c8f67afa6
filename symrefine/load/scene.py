"""Scenes of trimesh, as one object in one frame."""

from typing import Any

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.load.content import Content, Polygons, Values
from symrefine.load.text import count
from symrefine.shape import Index


def flattened(scene: Any) -> Content:
    """All triangles of a scene, or all points if it has no triangles, in the frame of the scene.

    The field `color` is that of the vertices, where all parts have it; textures and materials are not read.
    """
    meshes: list[tuple[Array, Index]] = []
    clouds: list[Array] = []
    colours: list[Values] = []
    lines = 0
    for node in scene.graph.nodes_geometry:
        with np.errstate(all="ignore"):  # points that are not finite are refused by name later
            to_scene, name = scene.graph[node]
            part = scene.geometry[name]
            points = np.asarray(part.vertices, dtype=np.float64) @ to_scene[:3, :3].T + to_scene[:3, 3]
        colours += _colours(part)
        if hasattr(part, "faces"):
            # A mirroring node turns the triangles inside out; their order must follow.
            faces = np.asarray(part.faces, dtype=np.int64)
            meshes.append((points, faces[:, ::-1] if np.linalg.det(to_scene[:3, :3]) < 0 else faces))
        elif hasattr(part, "entities"):
            lines += 1
        else:
            clouds.append(points)
    if meshes and clouds:
        raise InputError(
            f"holds {count(len(meshes), 'mesh part')} and {count(len(clouds), 'cloud')}; expected one kind"
        )
    if lines and not meshes:
        raise InputError("holds lines but no triangles; expected triangles, or points alone")
    fields = {"color": np.concatenate(colours)} if colours and len(colours) == len(meshes) + len(clouds) else {}
    if not meshes:
        return Content(points=np.concatenate(clouds) if clouds else np.empty((0, 3)), point_fields=fields)
    shifts = np.cumsum([0] + [len(points) for points, _ in meshes[:-1]])
    joined = np.concatenate([faces + shift for (_, faces), shift in zip(meshes, shifts, strict=True)])
    return Content(
        points=np.concatenate([points for points, _ in meshes]),
        faces=Polygons(corners=joined.ravel(), counts=np.full(len(joined), 3)),
        point_fields=fields,
        split=True,
    )


def _colours(part: Any) -> list[Values]:
    """Colours [V, 3] of the vertices of a part, if it has them."""
    if getattr(getattr(part, "visual", None), "kind", None) != "vertex":
        return []
    colours = np.asarray(part.visual.vertex_colors)  # those of clouds may be empty
    return [colours[:, :3]] if colours.ndim == 2 and len(colours) == len(part.vertices) else []
