"""Drawings for small pictures: arrows, stars, gears, and letters whose symmetry is measured on their own outlines."""

from collections.abc import Iterator

import numpy as np

from experiments.objects.drawings import Drawing, box, letter, polar, star

# Letters by the symmetry that they were drawn with, by family and weight of the font. The outlines of those that have
# one miss their images by less than DRAWN_SO of the diagonal; of the others 5 % of the outline miss them by more than
# 2.2 % in any pose, or a serif by 8 %. What lies between is left out.
DRAWN_SO = 0.002
LETTERS = {
    ("DejaVu Serif", "normal"): {"none": "ABCEFGJKLNPQRVY", "upright": "HT", "both": "I"},
    ("DejaVu Serif", "bold"): {"none": "ABEFGJKLMNPQRUVWY", "upright": "T", "both": "I"},
    ("DejaVu Sans", "normal"): {"none": "BEFGJLPQR", "upright": "AHMTUVWY", "level": "C", "both": "I", "half": "N"},
}
_GROUPS = {"none": "C1", "upright": "D1", "level": "D1", "both": "D2", "half": "C2"}


def _arrow(shaft: float, head: float, width: float) -> Drawing:
    shape = [[-1, -shaft], [1 - head, -shaft], [1 - head, -width], [1, 0], [1 - head, width], [1 - head, shaft]]
    points = np.array([*shape, [-1, shaft]])
    return Drawing(name=f"arrow {shaft} {head} {width}", layers=((points, 1.0),), group="D1")


def _double_arrow() -> Drawing:
    half = np.array([[0.4, -0.15], [0.4, -0.45], [1.0, 0.0], [0.4, 0.45], [0.4, 0.15]])
    return Drawing(name="double arrow", layers=((np.concatenate([half, -half]), 1.0),), group="D2")


def _bent_arrow() -> Drawing:
    shape = [[-0.8, -0.9], [-0.45, -0.9], [-0.45, 0.3], [0.35, 0.3], [0.35, 0.0], [0.9, 0.5], [0.35, 1.0], [0.35, 0.7]]
    return Drawing(name="bent arrow", layers=((np.array([*shape, [-0.8, 0.7]]), 1.0),), group="C1")


def _gear(teeth: int) -> Drawing:
    rim = polar(lambda t: 0.84 + 0.16 * np.tanh(3 * np.cos(teeth * t)))
    layers = ((rim, 1.0), (polar(lambda t: np.full(len(t), 0.3)), 0.0))
    return Drawing(name=f"gear {teeth}", layers=layers, group=f"D{teeth}")


def _ratchet(teeth: int) -> Drawing:
    rim = polar(lambda t: 0.65 + 0.35 * np.mod(t * teeth / (2 * np.pi), 1.0))
    return Drawing(name=f"ratchet {teeth}", layers=((rim, 1.0),), group=f"C{teeth}")


def _flag() -> Drawing:
    layers = ((box(-0.6, -1.0, -0.45, 1.0), 1.0), (box(-0.45, 0.2, 0.7, 1.0), 1.0))
    return Drawing(name="flag", layers=layers, group="C1")


def _plus() -> Drawing:
    layers = ((box(-1.0, -0.25, 1.0, 0.25), 1.0), (box(-0.25, -1.0, 0.25, 1.0), 1.0))
    return Drawing(name="plus", layers=layers, group="D4")


def _letters() -> Iterator[Drawing]:
    for (family, weight), kinds in LETTERS.items():
        for kind, texts in kinds.items():
            angle = 0.5 * np.pi if kind == "upright" else 0.0
            for text in texts:
                layers = letter(text, family, weight)
                name = f"{text} {family} {weight}"
                yield Drawing(name=name, layers=layers, group=_GROUPS[kind], angle_rad=angle)


ICONS = {
    d.name: d
    for d in (
        _arrow(0.16, 0.75, 0.5),
        _arrow(0.1, 0.4, 0.35),
        _arrow(0.3, 1.0, 0.8),
        _double_arrow(),
        _bent_arrow(),
        _flag(),
        _plus(),
        *(Drawing(name=f"star {n}", layers=((star(n, 0.45), 1.0),), group=f"D{n}") for n in (4, 5, 6, 7)),
        *(_gear(n) for n in (5, 6, 8)),
        *(_ratchet(n) for n in (3, 4, 5)),
        *_letters(),
    )
}
