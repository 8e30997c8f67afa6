"""Scenes of trimesh, as one object in one frame."""

import io
from typing import Any

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.load.content import Content, Paint, Polygons, Values
from symrefine.load.paint import decoded
from symrefine.load.text import count, shorten
from symrefine.shape import Index


def opened(what: str, data: bytes, kind: str, **options: Any) -> Any:
    """A scene as trimesh reads it, its vertices as they are.

    Args:
        what: the format, as messages call it.
        kind: the same, as trimesh calls it.
        options: of its reader.

    Raises:
        InputError: whatever it stumbles over.
    """
    import trimesh  # here, for it takes half a second

    try:
        return trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False, **options)
    except InputError:
        raise
    except Exception as error:  # noqa: BLE001 (a third party's reader, and nothing else, in the block)
        reason = str(error) or "its parts contradict one another"
        raise InputError(f"{what} cannot be read: {type(error).__name__}: {shorten(reason, 80)}") from None


def flattened(scene: Any, *, texture: bool = False) -> Content:
    """All triangles of a scene, or all points if it has no triangles, in the frame of the scene.

    The field `color` is that of the vertices, where all parts have it; `texture` says whether images are wanted.
    """
    meshes: list[tuple[Array, Index]] = []
    clouds: list[Array] = []
    colours: list[Values] = []
    looks: list[_Look] = []
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
            meshes.append((points, faces[:, ::-1] if np.linalg.slogdet(to_scene[:3, :3])[0] < 0 else faces))
            looks += [_look(part, meshes[-1][1])] if texture else []
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
        faces=Polygons.alike(joined),
        point_fields=fields,
        split=True,
        paint=_paint(looks) if texture else None,
    )


# Texture coordinates [3 T, 2] of the corners of a part, the image of Pillow that it shows or None, and its colour [3].
_Look = tuple[Array, Any, Array]


def _look(part: Any, faces: Index) -> _Look:
    visual = part.visual
    material, uv = getattr(visual, "material", None), getattr(visual, "uv", None)
    image = getattr(material, "baseColorTexture", None)
    plain = np.full(3, 255.0) if material is None else np.asarray(material.main_color, dtype=np.float64)[:3]
    if image is None:
        return np.full((faces.size, 2), np.nan), None, plain
    if uv is None or len(uv) != len(part.vertices) or not np.isfinite(uv).all():
        raise InputError("a part shows an image and has no texture coordinates (TEXCOORD_0) for it")
    return np.asarray(uv, dtype=np.float64)[faces.ravel()], image, plain


def _paint(looks: list[_Look]) -> Paint:
    """What the parts show; an image that several show stands once.

    Raises:
        InputError: no image, or images that are damaged or too large.
    """
    images = list({id(image): image for _, image, _ in looks if image is not None}.values())
    if not images:
        raise InputError("has no texture: no material has an image (baseColorTexture) that can be read")
    shown = [next((k for k, known in enumerate(images) if known is image), -1) for _, image, _ in looks]
    counts = [len(uv) // 3 for uv, _, _ in looks]
    return Paint(
        images=decoded(images),
        uv=np.concatenate([uv for uv, _, _ in looks]),
        image=np.repeat(shown, counts),
        plain=np.repeat([plain for _, _, plain in looks], counts, axis=0),
    )


def _colours(part: Any) -> list[Values]:
    """Colours [V, 3] of the vertices of a part, if it has them."""
    if getattr(getattr(part, "visual", None), "kind", None) != "vertex":
        return []
    colours = np.asarray(part.visual.vertex_colors)  # those of clouds may be empty
    return [colours[:, :3]] if colours.ndim == 2 and len(colours) == len(part.vertices) else []
