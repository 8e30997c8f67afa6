"""Results with a voice: they print on six lines, become JSON, pages, pictures and recordings, and draw themselves."""

import base64
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from symrefine.errors import InputError
from symrefine.files import check_target, json_text, whole
from symrefine.front import lines
from symrefine.geometry import Array, homogeneous
from symrefine.shape import Shape

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Options = Mapping[str, Any]
# What answers are written as.
KINDS = ("json", "html", "png", "rrd")
# Width and height of a picture, in pixels.
SIZE = (1200, 900)


class Operations(np.ndarray[Any, np.dtype[np.float64]]):
    """Homogeneous matrices [N, n+1, n+1] of symmetry operations: the identity, other rotations, then the rest."""

    @classmethod
    def about(cls, matrices: Array, center: Array) -> "Operations":
        """Operations [N, n, n] about a centre [n]."""
        return cls.of(homogeneous(matrices, center))

    @classmethod
    def of(cls, matrices: Array) -> "Operations":
        """Homogeneous matrices [N, n+1, n+1], which nobody can write to."""
        found = np.array(matrices, dtype=np.float64).view(cls)
        found.flags.writeable = False
        return found

    @property
    def determinants(self) -> Array:
        """+1.0 or -1.0 for each [N]."""
        return np.asarray(np.rint(np.linalg.det(np.asarray(self)[..., :-1, :-1])))


class Answer:
    """What every result can do, whatever it is about."""

    __slots__ = ()
    options: Options

    @classmethod
    def of(cls, found: Any, **given: Any) -> Self:
        """A result of the core with what it is an answer to."""
        return cls(**{f.name: getattr(found, f.name) for f in fields(found)}, **given)

    def to_dict(self, *, options: Options | None = None, load_s: float | None = None) -> dict[str, Any]:
        """What `--json` writes, as dictionaries, lists, texts and numbers.

        Args:
            options: told instead of those that the answer was asked with.
            load_s: seconds that reading took.
        """
        return self._record(options or self.options, load_s)

    def _record(self, options: Options, load_s: float | None) -> dict[str, Any]:
        raise NotImplementedError

    def to_json(self) -> str:
        """`to_dict` as text; the schema stands in `symrefine/schema`."""
        return json_text(self.to_dict())

    def save(self, path: str | Path) -> None:
        """Write the answer, whole or not at all, as its suffix says: .json, .html (a page), .png, .rrd (a recording).

        Raises:
            InputError: another suffix, a kind of file that there is not for this kind of object, or no room.
        """
        path = Path(path)
        getattr(self, f"_write_{check_kind(path)}")(path)

    def _write_json(self, path: Path) -> None:
        with whole(path) as draft:
            draft.write_text(self.to_json(), encoding="utf-8", newline="")

    def _write_html(self, path: Path) -> None:
        raise _lacks(self, path)

    def _write_png(self, path: Path) -> None:
        raise _lacks(self, path)

    def _write_rrd(self, path: Path) -> None:
        raise _lacks(self, path)

    def __repr__(self) -> str:
        return "\n".join(lines.summary(self.to_dict()))


class Found(Answer):
    """What every detection can do."""

    __slots__ = ()
    shape: Shape

    def operations(self) -> Operations:
        """Operations, or what generates them, as homogeneous matrices in the units and the frame of the input."""
        raise NotImplementedError

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """The picture of `save("x.png")` on axes of matplotlib, on those of a new figure if None."""
        from io import BytesIO

        from matplotlib import pyplot as plt
        from matplotlib.image import imread

        if axes is None:
            axes = plt.figure(figsize=(8.0, 6.0), layout="constrained").add_subplot()
        axes.imshow(imread(BytesIO(self._picture())))
        axes.set_axis_off()
        return axes

    def _repr_html_(self) -> str:
        return lines.card(self.to_dict(), base64.b64encode(self._picture()).decode("ascii"))

    def _picture(self) -> bytes:
        from symrefine.picture.draw import picture_png

        return picture_png(self, self.shape, width=SIZE[0], height=SIZE[1])  # type: ignore[arg-type]

    def _write_html(self, path: Path) -> None:
        from symrefine.report import write_html

        write_html(self, self.shape, path)  # type: ignore[arg-type]

    def _write_png(self, path: Path) -> None:
        from symrefine.report import draw

        draw(self, self.shape, path)  # type: ignore[arg-type]


def check_kind(path: Path) -> str:
    """What kind of file an answer is to be written as: json, html, png or rrd.

    Raises:
        InputError: another suffix, or a place that cannot be written.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind not in KINDS:
        raise InputError(f"{path}: expected a name that ends in .{', .'.join(KINDS)}")
    check_target(path)
    return kind


def _lacks(answer: Answer, path: Path) -> InputError:
    return InputError(f"{path}: a {type(answer).__name__} cannot be written as {path.suffix}; .json holds all of it")
