"""Results with a voice: they print on six lines, become JSON, pages, pictures and recordings, and draw themselves."""

import base64
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np

from symrefine.errors import InputError, about
from symrefine.files import Writer, bytes_writer, check_other, check_target, json_text, path_of, text_writer, write_all
from symrefine.front import lines
from symrefine.geometry import Array
from symrefine.poses.symmetry import homogeneous
from symrefine.shape import Shape

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from symrefine.picture.draw import Found as BareFound

Options = Mapping[str, Any]
# What detections are written as.
KINDS = (".json", ".html", ".png", ".rrd")
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
        """Write the answer, whole or not at all, as its suffix says: .json; of most also .png, .html (a page), .rrd.

        Raises:
            InputError: another suffix, a kind of file that there is not for this kind of answer, the input itself, or
                no room.
        """
        path = path_of(path)
        with about(str(path)):
            make = self._maker(path.suffix.lower())
        check_target(path)
        for name in self._read():
            check_other(path, name)
        with about(str(path)):
            write = make()  # pages and pictures take a while, so after all that may be refused
        write_all({str(path): write})

    def _read(self) -> tuple[str, ...]:
        """Files that the answer was made from, which it might be written over."""
        return ()

    def writer(self, suffix: str) -> Writer:
        """What fills a file with the answer, in the format of a suffix such as `.json`.

        Raises:
            InputError: a kind of file that there is not for this kind of answer.
        """
        return self._maker(suffix)()

    def _maker(self, suffix: str) -> Callable[[], Writer]:
        """What makes such a writer."""
        kinds = self.kinds()
        if suffix not in kinds:
            name = type(self).__name__
            kind, named = f"{'an' if name[0] in 'AEIOU' else 'a'} {name}", suffix or "a file without suffix"
            raise InputError(f"{kind} cannot be written as {named}; expected a name that ends in {', '.join(kinds)}")
        return kinds[suffix]

    def kinds(self) -> dict[str, Callable[[], Writer]]:
        """What makes the writer of each kind of file that there is, by its suffix."""
        return {".json": lambda: text_writer(self.to_json())}

    def __repr__(self) -> str:
        return "\n".join(lines.summary(self.to_dict()))


class Pictured(Answer):
    """What every answer can do of which there is a picture."""

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """The picture of `save("x.png")` on axes of matplotlib, on those of a new figure if None."""
        from io import BytesIO

        from matplotlib import pyplot as plt
        from matplotlib.image import imread

        if axes is None:
            axes = plt.figure(figsize=(8.0, 6.0), layout="constrained").add_subplot()
        axes.imshow(imread(BytesIO(self._picture(*SIZE))))
        axes.set_axis_off()
        return axes

    def _repr_html_(self) -> str:
        return lines.card(self.to_dict(), base64.b64encode(self._picture(*SIZE)).decode("ascii"))

    def _picture(self, width: int, height: int) -> bytes:
        """PNG of so many pixels."""
        raise NotImplementedError

    def kinds(self) -> dict[str, Callable[[], Writer]]:
        return super().kinds() | {".png": lambda: bytes_writer(self._picture(*SIZE))}


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Found(Pictured):
    """What every detection can do.

    Attributes:
        shape: what it was found in.
        options: what it was asked with.
    """

    shape: Shape
    options: Options

    def operations(self) -> Operations:
        """Operations, or what generates them, as homogeneous matrices in the units and the frame of the input."""
        raise NotImplementedError

    def _picture(self, width: int, height: int) -> bytes:
        from symrefine.picture.draw import picture_png

        return picture_png(cast("BareFound", self), self.shape, width=width, height=height)

    def kinds(self) -> dict[str, Callable[[], Writer]]:
        return super().kinds() | {".html": self._page}

    def _page(self) -> Writer:
        from symrefine.report.page import html_page

        return text_writer(html_page(cast("BareFound", self), self.shape))


def check_kind(path: Path) -> None:
    """Refuse, before any work, a name that no detection can be written as.

    Raises:
        InputError: another suffix than those of `KINDS`, or a place that cannot be written.
    """
    if path.suffix.lower() not in KINDS:
        raise InputError(f"{path}: expected a name that ends in {', '.join(KINDS)}")
    check_target(path)
