"""glTF 2.0, as .gltf with its buffers or as one .glb, read by trimesh once nothing in it would be left out."""

import json
import os
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from symrefine.errors import InputError, about
from symrefine.files import ask, file_bytes
from symrefine.load.content import Content
from symrefine.load.image import LARGEST_FILE
from symrefine.load.scene import flattened, opened
from symrefine.load.text import shorten

_MAGIC = b"glTF"
_JSON = b"JSON"
_POINTS, _TRIANGLES, _STRIP, _FAN, _FLOAT = 0, 4, 5, 6, 5126
_LINES = (1, 2, 3)
# Extensions that a file may call necessary though they do not touch positions.
_HARMLESS = ("KHR_materials_", "KHR_texture_", "KHR_lights_", "EXT_texture_")

Json = dict[str, Any]


def read_glb(data: bytes, path: Path, *, texture: bool = False) -> Content:
    """Content of a .glb file: the default scene, every node in its place; its textures where they are wanted."""
    if not data.startswith(_MAGIC):
        raise InputError(f"not a GLB file: begins with {data[:8]!a}; expected {_MAGIC!a}")
    if len(data) < 20:
        raise InputError(f"cut off in the header after {len(data)} bytes")
    version, length, json_length = (int.from_bytes(data[k : k + 4], "little") for k in (4, 8, 12))
    if version != 2:
        raise InputError(f"glTF version {version}; expected 2")
    if length != len(data):
        raise InputError(f"the header gives {length} bytes, the file has {len(data)}: cut off or added to")
    if data[16:20] != _JSON or 20 + json_length > length:
        raise InputError("the first chunk is no whole JSON text; the file is damaged")
    return _read(data, data[20 : 20 + json_length], "glb", path, texture=texture)


def read_gltf(data: bytes, path: Path, *, texture: bool) -> Content:
    """Content of a .gltf file: the default scene, every node in its place; buffers and images are found beside it."""
    return _read(data, data, "gltf", path, texture=texture)


def _read(data: bytes, text: bytes, kind: str, path: Path, *, texture: bool) -> Content:
    tree = _parse(text)
    _check_tree(tree)
    for name in _beside(tree, "buffers", *(["images"] if texture else [])):
        ask(path.parent / name)
    if texture:
        _check_textures(tree, path.parent)
    scene = opened("glTF", data, kind, resolver=_Beside(path.parent, tree), skip_materials=not texture)
    if texture:
        _check_images(tree, scene)
    return flattened(scene, texture=texture)


def _parse(text: bytes) -> Json:
    try:
        tree = json.loads(text.decode("utf-8"))
    except (ValueError, RecursionError) as error:  # no JSON, no UTF-8, or a number of thousands of digits
        raise InputError(f"not a glTF file: its JSON text is not valid: {error}") from None
    if not isinstance(tree, dict) or not isinstance(tree.get("asset"), dict):
        raise InputError("not a glTF file: its JSON text has no object 'asset'")
    return tree


def _check_tree(tree: Json) -> None:
    """Refuse what trimesh leaves out or fills with zeros without a word."""
    names = tree.get("extensionsRequired", [])
    required = [name for name in names if not str(name).startswith(_HARMLESS)] if isinstance(names, list) else ["?"]
    if required:
        raise InputError(f"requires {', '.join(map(str, required))}; save it without extensions")
    if not _objects(tree, "scenes"):
        raise InputError("has no scene, so nothing is in its place; save it with a scene")
    _referred(tree, "scenes", tree.get("scene", 0), "shows scene")
    for number, node in enumerate(_objects(tree, "nodes")):
        if "mesh" in node:
            _referred(tree, "meshes", node["mesh"], f"node {number} has mesh")
        if "camera" in node and ("mesh" in node or "children" in node):
            raise InputError(f"node {number} has a camera besides a mesh or children; remove the camera")
    for number, accessor in enumerate(_objects(tree, "accessors")):
        if "sparse" in accessor:
            raise InputError(f"accessor {number} is sparse, which is not supported; save it in full")
        if not _is_whole(accessor.get("count"), 1):
            raise InputError(f"accessor {number} has count {accessor.get('count')!r}; expected a whole number from 1")
    for primitive in _primitives(tree):
        _check_primitive(primitive, tree)


def _check_primitive(primitive: Json, tree: Json) -> None:
    mode = primitive.get("mode", _TRIANGLES)
    if mode not in (_POINTS, *_LINES, _TRIANGLES, _STRIP):
        what = "a triangle fan" if mode == _FAN else f"of mode {mode}"
        raise InputError(f"a primitive is {what}; expected points, lines, triangles or triangle strips")
    attributes = primitive.get("attributes")
    position = attributes.get("POSITION") if isinstance(attributes, dict) else None
    accessor = _referred(tree, "accessors", position, "a primitive has POSITION")
    _referred(tree, "accessors", primitive.get("indices", 0), "a primitive has indices")
    if accessor.get("componentType") != _FLOAT or accessor.get("type") != "VEC3" or "bufferView" not in accessor:
        raise InputError(f"accessor {position} holds positions, but not as three stored floats each")


def _is_whole(value: Any, least: int) -> bool:
    """Whether JSON gives a whole number; Python takes `true` for 1, and trimesh -1 for the last of a list."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= least


def _referred(tree: Json, key: str, number: Any, what: str) -> Json:
    """The object of a list that a number refers to; trimesh leaves out a mesh that is not there."""
    things = _objects(tree, key)
    if not _is_whole(number, 0) or number >= len(things):
        raise InputError(f"{what} {number!r}; expected one of {len(things)} {key}")
    return things[number]


def _beside(tree: Json, *kinds: str) -> list[str]:
    """Names of the files that a text refers to; others of these kinds lie in it."""
    uris = [thing.get("uri") for kind in kinds for thing in _objects(tree, kind)]
    return [unquote(uri) for uri in uris if isinstance(uri, str) and not uri.startswith("data:")]


class _Beside:
    """The files beside a glTF text, as trimesh asks for them: of a buffer no more than it is said to have.

    Trimesh's own would wait for a pipe, and hold all of a file of any size.
    """

    def __init__(self, folder: Path, tree: Json) -> None:
        self._folder, self._lengths = folder, dict[str, int]()
        for number, buffer in enumerate(_objects(tree, "buffers")):
            uri: Any = buffer.get("uri")
            length: Any = buffer.get("byteLength")
            if not isinstance(uri, str | None):
                raise InputError(f"buffer {number} has uri {shorten(str(uri))}; expected the name of a file")
            if not _is_whole(length, 1):
                raise InputError(f"buffer {number} has byteLength {length!r}; expected a whole number from 1")
            if uri is not None:
                self._lengths[uri] = max(length, self._lengths.get(uri, 0))

    def __getitem__(self, uri: str) -> bytes:
        length = self._lengths.get(uri)
        with about(f"{'image' if length is None else 'buffer'} {shorten(uri)}"):
            if uri.startswith("data:"):
                raise InputError("is no data in base64")
            name = Path(unquote(uri))
            if name.is_absolute() or ".." in Path(os.path.normpath(name)).parts:
                raise InputError("lies outside of the folder of the file; move it there")
            if length is None:
                return file_bytes(self._folder / name, most=LARGEST_FILE)
            data = file_bytes(self._folder / name, first=length)
            if len(data) < length:
                raise InputError(f"has {len(data):,} bytes; expected {length:,}, its byteLength")
            return data

    get = __getitem__


def _check_textures(tree: Json, folder: Path) -> None:
    """Refuse what trimesh leaves out of textures without a word."""
    for number, image in enumerate(_objects(tree, "images")):
        uri = image.get("uri")
        if isinstance(uri, str) and not uri.startswith("data:") and not (folder / unquote(uri)).is_file():
            raise InputError(f"image {number}, {shorten(uri)}: no such file beside it")
    for number, material in enumerate(_objects(tree, "materials")):
        shown = (material.get("pbrMetallicRoughness") or {}).get("baseColorTexture") or {}
        if shown.get("texCoord", 0) != 0 or "KHR_texture_transform" in (shown.get("extensions") or {}):
            raise InputError(
                f"material {number} places its image by other coordinates; save it with TEXCOORD_0 as it is"
            )
    accessors = _objects(tree, "accessors")
    for primitive in _primitives(tree):
        place = primitive["attributes"].get("TEXCOORD_0")
        if isinstance(place, int) and place < len(accessors) and accessors[place].get("componentType") != _FLOAT:
            raise InputError(f"accessor {place} holds texture coordinates, but not as floats")


def _check_images(tree: Json, scene: Any) -> None:
    """Refuse images that trimesh could not open, and left out without a word."""
    shown = [("baseColorTexture" in (m.get("pbrMetallicRoughness") or {})) for m in _objects(tree, "materials")]
    used = [primitive.get("material") for primitive in _primitives(tree)]
    asked = sum(isinstance(m, int) and m < len(shown) and shown[m] for m in used)
    materials = [getattr(getattr(part, "visual", None), "material", None) for part in scene.geometry.values()]
    if sum(getattr(m, "baseColorTexture", None) is not None for m in materials) < asked:
        raise InputError("an image of its textures cannot be read; expected .png or .jpg, whole")


def _primitives(tree: Json) -> list[Json]:
    """What all meshes are made of."""
    return [p for mesh in _objects(tree, "meshes") for p in _objects(mesh, "primitives")]


def _objects(owner: Json, key: str) -> list[Json]:
    objects = owner.get(key, [])
    if not isinstance(objects, list) or not all(isinstance(item, dict) for item in objects):
        raise InputError(f"'{key}' of the glTF text is no list of objects; the file is damaged")
    return objects
