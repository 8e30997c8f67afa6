"""What was made of an object with its symmetry: the nearest exactly symmetric shape, a scan with what nobody saw."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from symrefine.complete import Completion as BareCompletion
from symrefine.detection.result import Detection
from symrefine.files import Writer, bytes_writer, text_writer
from symrefine.front.answers import Options, Pictured
from symrefine.shape import Shape
from symrefine.symmetrize import Symmetrized as BareSymmetrized


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Derived(Pictured):
    """What every object can do that was made of another one: its page is that of what was found in that one.

    Attributes:
        source: the object as it was.
        detection: the symmetry that was found in it.
        options: what it was asked with.
        timings: seconds by stage, those of the detection among them.
    """

    source: Shape
    detection: Detection
    options: Options
    timings: Mapping[str, float]

    def _read(self) -> tuple[str, ...]:
        return (self.source.source,)

    def _drawn(self) -> tuple[Detection, Shape]:
        """What the picture shows: what was found, and the object."""
        return self.detection, self.source

    def _picture(self, width: int, height: int) -> bytes:
        from symrefine.picture.draw import picture_png

        return picture_png(*self._drawn(), width=width, height=height)

    def kinds(self) -> dict[str, Callable[[], Writer]]:
        objects = {suffix: partial(self._object, suffix) for suffix in self._suffixes()}
        return super().kinds() | {".html": self._page} | objects

    def _page(self) -> Writer:
        from symrefine.report.page import html_page

        return text_writer(html_page(self.detection, self.source))

    def _suffixes(self) -> Iterable[str]:
        """Of files that hold the object itself."""
        raise NotImplementedError

    def _object(self, suffix: str) -> Writer:
        """What fills such a file."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Symmetrized(Derived, BareSymmetrized):
    """What `symmetrize` made, with a voice; `save("exact.ply")` writes the shape.

    It has all that `symrefine.symmetrize.nearest.Symmetrized` has.

    Attributes:
        outliers: points of the source that are no part of the object, and not in the result.
    """

    outliers: int

    def _record(self, options: Options, load_s: float | None) -> dict[str, Any]:
        from symrefine.export.made import symmetrized_record

        return symmetrized_record(
            self,
            self.detection,
            self.source,
            outliers=self.outliers,
            options=options,
            timings=self.timings,
            load_s=load_s,
        )

    def _drawn(self) -> tuple[Detection, Shape]:
        return replace(self.detection, outliers=self.detection.outliers[:0]), self.shape

    def _suffixes(self) -> Iterable[str]:
        from symrefine.export.models import MODELS

        return MODELS

    def _object(self, suffix: str) -> Writer:
        from symrefine.export.models import model_bytes

        return bytes_writer(model_bytes(suffix, self.shape))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Completion(Derived, BareCompletion):
    """What `complete` made, with a voice; `save("full.ply")` writes the points, those inferred marked.

    It has all that `symrefine.complete.Completion` has.
    """

    def _record(self, options: Options, load_s: float | None) -> dict[str, Any]:
        from symrefine.export.made import completed_record

        return completed_record(self, self.source, options=options, timings=self.timings, load_s=load_s)

    def _suffixes(self) -> Iterable[str]:
        from symrefine.export.models import MARKED

        return MARKED

    def _object(self, suffix: str) -> Writer:
        from symrefine.export.models import marked_bytes

        return bytes_writer(marked_bytes(suffix, self.points, self.inferred))
