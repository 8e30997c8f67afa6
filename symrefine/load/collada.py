"""COLLADA, read by trimesh once nothing in it would be left out; coordinates are rounded to float32 by pycollada."""

import math
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from symrefine.errors import InputError
from symrefine.load.content import Content
from symrefine.load.extras import library
from symrefine.load.scene import flattened, opened
from symrefine.load.text import NATURAL, is_number, shorten

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

# What trimesh leaves out without a word, and what would be right.
_LEFT_OUT = {
    "lines": "triangles alone",
    "linestrips": "triangles alone",
    "tristrips": "triangles or polygons",
    "trifans": "triangles or polygons",
    "spline": "triangles or polygons",
    "convex_mesh": "triangles or polygons",
    "instance_controller": "a mesh without a skeleton",
}
# How many numbers say where a node stands.
_PLACES = {"matrix": "16", "translate": "3", "rotate": "4", "scale": "3", "lookat": "9"}


def read_dae(data: bytes) -> Content:
    """Content of a .dae file: its scene, every node in its place, in the unit of its numbers.

    Raises:
        InputError: no valid XML, no COLLADA, arrays that do not hold what they declare, parts that would be left out,
            or pycollada is not installed.
    """
    _check_tree(_parse(data))
    library("collada", "cad")
    return flattened(opened("COLLADA", data, "dae", ignore_broken=False))


def _parse(data: bytes) -> "Element":
    try:
        root = ET.fromstring(data)
    except (ET.ParseError, ValueError, LookupError) as error:
        raise InputError(f"not valid XML: {shorten(str(error), 80)}") from None
    if _name(root) != "COLLADA":
        raise InputError(f"begins with <{shorten(_name(root))}>; expected <COLLADA>")
    return root


def _check_tree(root: "Element") -> None:
    """Refuse what pycollada and trimesh leave out, and numbers that are none."""
    for element in root.iter():
        name = _name(element)
        if name in _LEFT_OUT:
            raise InputError(f"holds <{name}>, which is not read; save it with {_LEFT_OUT[name]}")
        if name == "float_array":
            _check_numbers(element, element.get("count", ""), f"float_array {shorten(element.get('id', ''))}")
        elif name in _PLACES:
            _check_numbers(element, _PLACES[name], f"<{name}>")
        elif name in ("p", "vcount", "v"):
            odd = next((word for word in (element.text or "").split() if not NATURAL.fullmatch(word)), None)
            if odd is not None:
                raise InputError(f"<{name}> holds {shorten(odd)}; expected whole numbers")


def _check_numbers(element: "Element", told: str, place: str) -> None:
    """Refuse all but so many finite numbers: pycollada stops at what is none, trimesh leaves out the others."""
    words = (element.text or "").split()
    if told != str(len(words)):
        raise InputError(f"{place}: declares {shorten(told)} numbers, {len(words)} follow")
    odd = next((word for word in words if not (is_number(word) and math.isfinite(float(word)))), None)
    if odd is not None:
        raise InputError(f"{place}: holds {shorten(odd)}; expected finite numbers")


def _name(element: "Element") -> str:
    """Name of an element without its namespace."""
    return element.tag.rpartition("}")[2]
