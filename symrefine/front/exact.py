"""The nearest exactly symmetric shape."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from symrefine.detection.result import Detection
from symrefine.files import Writer, bytes_writer
from symrefine.front.answers import Options, Pictured
from symrefine.shape import Shape
from symrefine.symmetrize import Symmetrized as BareSymmetrized


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Symmetrized(Pictured, BareSymmetrized):
    """What `symmetrize` made, with a voice; `save("exact.ply")` writes the shape.

    It has all that `symrefine.symmetrize.nearest.Symmetrized` has.

    Attributes:
        source: the shape as it was.
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

    def _record(self, options: Options, load_s: float | None) -> dict[str, Any]:
        from symrefine.export.made import symmetrized_record

        return symmetrized_record(
            self, self.detection, self.source, options=options, timings=self.timings, load_s=load_s
        )

    def _picture(self, width: int, height: int) -> bytes:
        from symrefine.picture.draw import picture_png

        return picture_png(self.detection, self.shape, width=width, height=height)

    def kinds(self) -> dict[str, Callable[[], Writer]]:
        from symrefine.export.models import MODELS

        return (
            Pictured.kinds(self) | {".html": self._page} | {suffix: partial(self._model, suffix) for suffix in MODELS}
        )

    def _page(self) -> Writer:
        """The page of what was found in the shape as it was, and is exact now."""
        from symrefine.report import write_html

        return partial(write_html, self.detection, self.source)

    def _model(self, suffix: str) -> Writer:
        from symrefine.export.models import model_bytes

        return bytes_writer(model_bytes(suffix, self.shape))
