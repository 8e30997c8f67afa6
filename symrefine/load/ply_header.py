"""Header of a PLY file: which elements follow, how many of each, and what they are made of."""

from dataclasses import dataclass, field

from symrefine.errors import InputError
from symrefine.load.text import NATURAL, shorten

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
_BYTE_ORDER = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Property:
    """One value of each row, or a list of values preceded by its length; types as NumPy codes, without byte order."""

    name: str
    type: str
    length_type: str | None = None


@dataclass(slots=True, kw_only=True)
class Element:
    """Rows of one kind; grows by properties while the header is read."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)

    @property
    def has_lists(self) -> bool:
        """Whether rows differ in length."""
        return any(p.length_type for p in self.properties)


@dataclass(frozen=True, slots=True, kw_only=True)
class Header:
    """Byte order ("" for text, "<" or ">"), elements in their order, where the rows begin, and the comments."""

    byte_order: str
    elements: list[Element]
    size: int
    lines: int
    comments: list[str] = field(default_factory=list)


def parse_header(data: bytes) -> Header:
    """Header of a PLY file.

    Raises:
        InputError: not a PLY file, no end, or a line that the format does not know.
    """
    end_of_line = next((e for e in (b"\r\n", b"\n", b"\r") if data.startswith(b"ply" + e)), None)
    if end_of_line is None:
        raise InputError(f"not a PLY file: begins with {data[:12]!a}; expected a line 'ply'")
    end = data.find(end_of_line + b"end_header" + end_of_line)
    if end < 0:
        raise InputError("the header has no line 'end_header'; the file is cut off or not a PLY file")
    size = end + len(b"end_header") + 2 * len(end_of_line)
    lines = [line.decode("utf-8", errors="replace") for line in data[:end].split(end_of_line)]
    byte_order = _byte_order(lines)
    elements: list[Element] = []
    for number, line in enumerate(lines[2:], start=3):
        fault = _add(elements, line.split())
        if fault:
            raise InputError(f"line {number}: {shorten(line)}: {fault}")
    for element in elements:
        if not element.properties:
            raise InputError(f"the header gives element '{element.name}' no properties")
    comments = [line[8:] for line in lines if line.startswith("comment ")]
    return Header(byte_order=byte_order, elements=elements, size=size, lines=len(lines) + 1, comments=comments)


def _byte_order(lines: list[str]) -> str:
    words = lines[1].split() if len(lines) > 1 else []
    if len(words) != 3 or words[0] != "format" or words[1] not in _BYTE_ORDER or words[2] != "1.0":
        choice = ", ".join(_BYTE_ORDER)
        raise InputError(f"line 2: {shorten(' '.join(words))}; expected 'format KIND 1.0', KIND one of {choice}")
    return _BYTE_ORDER[words[1]]


def _add(elements: list[Element], words: list[str]) -> str:
    """Take in one line of the header; returns what is wrong with it, or nothing."""
    match words:
        case [] | ["comment", *_] | ["obj_info", *_]:
            return ""
        case ["element", name, count]:
            if not NATURAL.fullmatch(count):
                return "the number of rows must be a whole number"
            if any(e.name == name for e in elements):
                return "this element was declared before"
            elements.append(Element(name=name, count=int(count)))
            return ""
        case ["property", "list", length_type, type_, name]:
            if not length_type.startswith(("u", "i", "char", "short")) or length_type not in _TYPES:
                return f"the length of a list must be of an integer type, not {length_type}"
            return _add_property(elements, type_, name, _TYPES[length_type])
        case ["property", type_, name]:
            return _add_property(elements, type_, name, None)
        case _:
            return "expected 'element NAME COUNT', 'property TYPE NAME', 'property list TYPE TYPE NAME' or 'comment'"


def _add_property(elements: list[Element], type_: str, name: str, length_type: str | None) -> str:
    if type_ not in _TYPES:
        return f"unknown type {type_}; known are {' '.join(_TYPES)}"
    if not elements:
        return "a property before the first element"
    if any(p.name == name for p in elements[-1].properties):
        return "this property was declared before"
    elements[-1].properties.append(Property(name=name, type=_TYPES[type_], length_type=length_type))
    return ""
