"""Damage to files, structured as files are: bits, bytes, numbers, words, lines, trees, members of archives, chunks.

A mutation is a function of a random generator and of a text of bytes, so that the same seed gives the same damage.
"""

import gzip
import io
import json
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

from experiments.studies.fuzz_seeds import zipped

Mutation = Callable[[Random, bytes], bytes]

# What numbers in a text become.
NUMBERS = (
    b"nan", b"inf", b"-inf", b"1e308", b"-1e308", b"1e309", b"5e-324", b"1e59", b"1e61", b"0", b"-0.0", b"-1", b"1",
    b"255", b"256", b"65536", b"2147483647", b"2147483648", b"-2147483649", b"4294967296", b"9223372036854775807",
    b"9223372036854775808", b"18446744073709551616", b"1" * 400, b"0x10", b"1_000", b"1,5", b"1.5", b"1e", b"--1", b"",
    "٣".encode(), b"true", b"null", b"x" * 300, b"0" * 5000, b"1e-400", b"+1", b".", b"1d3",
)  # fmt: skip
# What stands in no text, steers terminals, or ends lines where nobody expects it.
CONTROLS = (
    b"\0", b"\x1b[31m", b"\x1b]0;a\x07", b"\x9b31m", b"\x07", b"\x08", "\u202e".encode(), "\u2028".encode(), b"\x0c",
    b"\x1c", b"\x85", b"\r", b"\xff\xfe", b"\xef\xbb\xbf", b"\xed\xa0\x80", "\U0001f600".encode(), b"\x1a", b"\v",
)  # fmt: skip
INTEGERS = (
    0,
    1,
    2,
    -1,
    127,
    128,
    255,
    256,
    32767,
    65535,
    65536,
    2**31 - 1,
    2**31,
    -(2**31),
    2**32 - 1,
    2**63 - 1,
    2**63,
)
FLOATS = (float("nan"), float("inf"), float("-inf"), 1e308, -1e308, 5e-324, 1e38, 1e61, 0.0, -0.0, 1e30)
VALUES: tuple[Any, ...] = (
    None, True, False, "", "x", "\x1b[31m", [], {}, [[]], [0], {"a": 1}, -1, 0, 1, 1.5, 2**31, 2**63, 2**64, 1e308,
    float("nan"), float("inf"), "9" * 5000, [1] * 2000,
)  # fmt: skip
BRACKETS = ((b"[", b"]"), (b"{", b"}"), (b"<a>", b"</a>"), (b"(", b")"), (b'{"a":', b"}"), (b"- ", b""))
_NUMBER = re.compile(rb"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_WORD = re.compile(rb"[^\s,;<>\"'=(){}\[\]]+")


def _span(rng: Random, data: bytes, longest: int = 64) -> tuple[int, int]:
    start = rng.randrange(len(data) + 1)
    return start, min(len(data), start + rng.randint(1, longest))


def flip_bits(rng: Random, data: bytes) -> bytes:
    """One to eight bits."""
    changed = bytearray(data)
    for _ in range(rng.randint(1, 8) if data else 0):
        changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def overwrite(rng: Random, data: bytes) -> bytes:
    """A run of bytes: random ones, or all the same."""
    start, end = _span(rng, data)
    same = rng.choice((None, 0, 255, 32, 48))
    return data[:start] + (rng.randbytes(end - start) if same is None else bytes([same]) * (end - start)) + data[end:]


def truncate(rng: Random, data: bytes) -> bytes:
    """The beginning, or the end."""
    place = rng.randrange(len(data) + 1)
    return data[:place] if rng.random() < 0.8 else data[place:]


def remove(rng: Random, data: bytes) -> bytes:
    """Without a run of bytes."""
    start, end = _span(rng, data)
    return data[:start] + data[end:]


def repeat(rng: Random, data: bytes) -> bytes:
    """A run of bytes, twice to a thousand times."""
    start, end = _span(rng, data)
    return data[:start] + data[start:end] * rng.choice((2, 3, 10, 1000)) + data[end:]


def insert(rng: Random, data: bytes) -> bytes:
    """Some bytes more."""
    start, _ = _span(rng, data)
    return data[:start] + rng.randbytes(rng.choice((1, 2, 4, 8, 100))) + data[start:]


def swap(rng: Random, data: bytes) -> bytes:
    """Two neighbouring runs of bytes exchanged."""
    (start, middle), size = _span(rng, data), rng.randint(1, 64)
    return data[:start] + data[middle : middle + size] + data[start:middle] + data[middle + size :]


def binary_number(rng: Random, data: bytes) -> bytes:
    """Two, four or eight bytes that become an integer or a float at the end of its range."""
    order, start = rng.choice("<>"), rng.randrange(max(len(data) - 8, 1))
    if rng.random() < 0.3:
        start -= start % 4
    if rng.random() < 0.6:
        code = rng.choice("HIQ")
        size = struct.calcsize(code)
        packed = (rng.choice(INTEGERS) % 2 ** (8 * size)).to_bytes(size, "little" if order == "<" else "big")
    else:
        code = rng.choice("fd")
        value = rng.choice(FLOATS)
        packed = struct.pack(order + code, value if code == "d" or not 3e38 < abs(value) < 1e309 else 3e38)
    return data[:start] + packed + data[start + len(packed) :]


def _replace_one(rng: Random, data: bytes, pattern: re.Pattern[bytes], new: Callable[[bytes], bytes]) -> bytes:
    found = list(pattern.finditer(data))
    if not found:
        return insert(rng, data)
    for match in sorted(rng.sample(found, min(len(found), rng.choice((1, 1, 1, 2, 5)))), key=lambda m: -m.start()):
        data = data[: match.start()] + new(match[0]) + data[match.end() :]
    return data


def text_number(rng: Random, data: bytes) -> bytes:
    """One number or a few that become what no number is, or at the end of its range."""
    return _replace_one(rng, data, _NUMBER, lambda _: rng.choice(NUMBERS))


def word(rng: Random, data: bytes) -> bytes:
    """A word that is left out, doubled, cut, in capitals, or very long."""
    changes: tuple[Callable[[bytes], bytes], ...] = (
        lambda _: b"", lambda w: w + b" " + w, lambda w: w[: len(w) // 2], bytes.swapcase, lambda w: w * 1000,
    )  # fmt: skip
    return _replace_one(rng, data, _WORD, rng.choice(changes))


def words_exchanged(rng: Random, data: bytes) -> bytes:
    """Two words exchanged."""
    found = list(_WORD.finditer(data))
    if len(found) < 2:
        return flip_bits(rng, data)
    one, two = sorted(rng.sample(found, 2), key=re.Match.start)
    return data[: one.start()] + two[0] + data[one.end() : two.start()] + one[0] + data[two.end() :]


def lines(rng: Random, data: bytes) -> bytes:
    """A line that is left out, repeated, moved, emptied, or joined with the next."""
    rows = data.split(b"\n")
    at = rng.randrange(len(rows))
    match rng.randrange(6):
        case 0:
            del rows[at]
        case 1:
            rows[at:at] = [rows[at]] * rng.choice((1, 2, 500))
        case 2:
            rows.insert(rng.randrange(len(rows)), rows.pop(at))
        case 3:
            rows[at] = b""
        case 4:
            rows[at : at + 2] = [b"".join(rows[at : at + 2])]
        case _:
            rows[at:at] = [b""] * rng.choice((1, 3000))
    return b"\n".join(rows)


def control(rng: Random, data: bytes) -> bytes:
    """Characters that belong in no text."""
    start, _ = _span(rng, data)
    return data[:start] + rng.choice(CONTROLS) + data[start:]


def encoding(rng: Random, data: bytes) -> bytes:
    """The text in another encoding, or with other ends of lines."""
    text = data.decode("latin-1")
    match rng.randrange(6):
        case 0:
            return text.encode("utf-16")
        case 1:
            return b"\xef\xbb\xbf" + data
        case 2:
            return data.replace(b"\n", b"\r\n")
        case 3:
            return data.replace(b"\n", b"\r")
        case 4:
            return text.encode("utf-32-be")
        case _:
            return data.replace(b" ", "\u00a0".encode()).replace(b".", b",")


def nested(rng: Random, data: bytes) -> bytes:
    """Thousands of brackets, tags or dashes."""
    start, _ = _span(rng, data)
    depth = rng.choice((50, 500, 20000))
    opened, closed = rng.choice(BRACKETS)
    return data[:start] + opened * depth + (closed * depth if rng.random() < 0.5 else b"") + data[start:]


def entities(rng: Random, data: bytes) -> bytes:
    """Entities of XML, or aliases of YAML, that stand for billions of what there is."""
    if rng.random() < 0.5:
        told = "".join(f'<!ENTITY e{k} "{f"&e{k - 1};" * 10}">' for k in range(1, 11))
        head = f'<!DOCTYPE a [<!ENTITY e0 "0 0 0 ">{told}]>'.encode()
        return re.sub(rb">\s*([0-9])", rb">&e10;\1", data, count=1).replace(b"?>", b"?>" + head, 1)
    bomb = b"a0: &a0 [x, x, x, x, x, x, x, x, x]\n"
    bomb += b"".join(b"a%d: &a%d [%s]\n" % (k, k, b", ".join([b"*a%d" % (k - 1)] * 9)) for k in range(1, 12))
    return bomb + data


def tree(rng: Random, data: bytes) -> bytes:
    """A value in a tree of JSON that becomes another, is left out, or doubled; of a .glb, in its first chunk."""
    is_glb = data[:4] == b"glTF" and len(data) > 20
    size = int.from_bytes(data[12:16], "little") if is_glb else len(data)
    text, rest = (data[20 : 20 + size], data[20 + size :]) if is_glb else (data, b"")
    try:
        root = json.loads(text)
    except ValueError:
        return text_number(rng, data)
    places = list(_places(root))
    for _ in range(rng.choice((1, 1, 2))):
        if places:
            owner, key = rng.choice(places)
            _change(rng, owner, key, places)
    made = json.dumps(root).encode()
    if not is_glb:
        return made
    made += b" " * (-len(made) % 4)
    return b"glTF" + struct.pack("<III", 2, 20 + len(made) + len(rest), len(made)) + b"JSON" + made + rest


def _places(value: Any) -> list[tuple[Any, Any]]:
    """Every list or mapping of a tree with each of its keys."""
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [place for key, inner in inside for place in [(value, key), *_places(inner)]]


def _change(rng: Random, owner: Any, key: Any, places: Sequence[tuple[Any, Any]]) -> None:
    if (key not in owner) if isinstance(owner, dict) else key >= len(owner):
        return  # gone with an earlier change
    match rng.randrange(4):
        case 0:
            del owner[key]
        case 1:
            other, there = rng.choice(places)
            if (there in other) if isinstance(other, dict) else there < len(other):
                owner[key] = json.loads(json.dumps(other[there]))
        case _:
            owner[key] = rng.choice(VALUES)


def member(rng: Random, data: bytes) -> bytes:
    """A member of an archive that is damaged, left out, named otherwise, or a thousand times its size unpacked."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
    except Exception:  # noqa: BLE001 - what is no archive is damaged as any file
        return flip_bits(rng, data)
    if not members:
        return flip_bits(rng, data)
    name = rng.choice(sorted(members))
    match rng.randrange(8):
        case 0:
            del members[name]
        case 1:
            members[rng.choice(("../../a", "\x1b[31m", "a" * 300, "points.npy", "faces.npy", "/etc/a"))] = members[name]
        case 2:
            members[name] += bytes(rng.choice((2**20, 2**24)))
        case 3:
            members["junk"] = bytes(2**24)
        case 4:
            members[name] = re.sub(rb"\(\d+,", b"(1000000,", members[name]) + bytes(24 * 10**6)
        case _:
            members[name] = damaged(rng, members[name])
    return zipped(members)


def chunk(rng: Random, data: bytes) -> bytes:
    """A field of a chunk of a PNG, its checksum right."""
    if data[:4] != b"\x89PNG":
        return binary_number(rng, data)
    made, at = bytearray(data[:8]), 8
    while at + 12 <= len(data):
        size = int.from_bytes(data[at : at + 4], "big")
        body = data[at + 4 : at + 8 + size]
        if rng.random() < 0.3 and size:
            body = (
                body[:4] + binary_number(rng, body[4:]) if rng.random() < 0.7 else body[:4] + flip_bits(rng, body[4:])
            )
        made += (len(body) - 4).to_bytes(4, "big") + body + zlib.crc32(body).to_bytes(4, "big")
        at += 12 + size
    return bytes(made)


def bomb(rng: Random, data: bytes) -> bytes:
    """Thousands of times as much of what there is."""
    half = len(data) // 2
    return (
        data[:half] + rng.choice((b"\0", b"\n", b"0 0 0\n", b"0 ", b" ", data[half : half + 40])) * 2**15 + data[half:]
    )


ANY: tuple[Mutation, ...] = (flip_bits, overwrite, truncate, remove, repeat, insert, swap, binary_number)
TEXT: tuple[Mutation, ...] = (text_number, text_number, word, words_exchanged, lines, lines, control, encoding, nested)
SHAPED: tuple[Mutation, ...] = (tree, member, chunk, entities)
_RARE: tuple[Mutation, ...] = (bomb,)


def damaged(rng: Random, data: bytes) -> bytes:
    """The file after one to three mutations of the kinds that fit what it holds."""
    is_text = b"\0" not in data[:2000]
    kinds: list[tuple[Mutation, ...]] = [ANY, TEXT, TEXT] if is_text else [ANY, ANY, TEXT]
    if data[:4] in (b"PK\3\4", b"glTF", b"\x89PNG") or data[:1] in (b"{", b"[") or data[:5] == b"<?xml":
        kinds += [SHAPED, SHAPED]
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        data = rng.choice(_RARE if rng.random() < 0.004 else rng.choice(kinds))(rng, data)
    return data


def packed(rng: Random, data: bytes) -> bytes:
    """The file in gzip, which is sound, damaged itself, or a bomb."""
    if rng.random() < 0.01:
        data += rng.choice((b"\0", b"\n", b"0 0 0\n")) * 2**22
    made = gzip.compress(data, compresslevel=1, mtime=0)
    return rng.choice((flip_bits, truncate, binary_number))(rng, made) if rng.random() < 0.2 else made
