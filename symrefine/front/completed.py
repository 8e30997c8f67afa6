"""A scan with what its symmetry says of the parts that nobody saw."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from symrefine.complete import Completion as BareCompletion
from symrefine.files import Writer, bytes_writer
from symrefine.front.answers import Options, Pictured
from symrefine.shape import Shape


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Completion(Pictured, BareCompletion):
    """What `complete` made, with a voice; `save("full.ply")` writes the points, those inferred marked.

    It has all that `symrefine.complete.Completion` has.

    Attributes:
        source: the scan.
        options: what it was asked with.
        timings: seconds by stage, those of the detection among them.
    """

    source: Shape
    options: Options
    timings: Mapping[str, float]

    def _read(self) -> tuple[str, ...]:
        return (self.source.source,)

    def _record(self, options: Options, load_s: float | None) -> dict[str, Any]:
        from symrefine.export.made import completed_record

        return completed_record(self, self.source, options=options, timings=self.timings, load_s=load_s)

    def _picture(self, width: int, height: int) -> bytes:
        from symrefine.picture.draw import picture_png

        return picture_png(self.detection, self.source, width=width, height=height)

    def kinds(self) -> dict[str, Callable[[], Writer]]:
        from symrefine.export.models import MARKED

        return (
            Pictured.kinds(self) | {".html": self._page} | {suffix: partial(self._marked, suffix) for suffix in MARKED}
        )

    def _page(self) -> Writer:
        """The page of what was found in the scan; its model shows what is inferred."""
        from symrefine.report import write_html

        return partial(write_html, self.detection, self.source)

    def _marked(self, suffix: str) -> Writer:
        from symrefine.export.models import marked_bytes

        return bytes_writer(marked_bytes(suffix, self.points, self.inferred))
