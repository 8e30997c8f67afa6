"""The map that was found between two objects."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from symrefine.align.alignment import Alignment as BareAlignment
from symrefine.files import Writer, text_writer
from symrefine.front import lines
from symrefine.front.answers import Answer, Options, Pictured
from symrefine.shape import Shape

if TYPE_CHECKING:
    from symrefine.picture.pair import Pair


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Alignment(Pictured, BareAlignment):
    """What `align` found, with a voice. Of points of two or three coordinates there are pictures and pages too.

    It has all that `symrefine.align.alignment.Alignment` has.

    Attributes:
        source: what was moved.
        target: what it was moved onto.
        options: what it was asked with.
    """

    source: Shape
    target: Shape
    options: Options

    def _record(self, options: Options, load_s: float | None) -> dict[str, Any]:
        from symrefine.export.records import alignment_record

        return alignment_record(self, self.source, self.target, options=options, load_s=load_s)

    @property
    def _tolerance(self) -> float:
        """As a fraction of the diagonal."""
        return float(self.options.get("relative_tolerance", self.options["tolerance"]))

    @cached_property
    def _pair(self) -> "Pair":
        """What there is to show."""
        from symrefine.picture.pair import make_pair

        return make_pair(self, self.source, self.target, self._tolerance)

    def _picture(self, width: int, height: int) -> bytes:
        from symrefine.picture.pair_png import pair_png
        from symrefine.picture.pair_words import headline

        return pair_png(self._pair, headline(self, self._pair), width=width, height=height)

    def _repr_html_(self) -> str:
        return super()._repr_html_() if self._is_shown else lines.card(self.to_dict(), "")

    def show(self) -> Any:
        """Open the recording in the viewer of rerun, or inline in a notebook.

        Raises:
            InputError: points of more than three coordinates, or of one.
            SymrefineError: there is no display; `save("x.rrd")` and `symrefine view x.rrd --web` do without one.
        """
        from symrefine.viewer import recorded_pair

        return recorded_pair(self, self._pair).show("alignment")

    @property
    def _is_shown(self) -> bool:
        return self.target.dim in (2, 3)

    def kinds(self) -> dict[str, Callable[[], Writer]]:
        if not self._is_shown:
            return Answer.kinds(self)
        return Pictured.kinds(self) | {".html": self._page, ".rrd": self._recording}

    def _page(self) -> Writer:
        from symrefine.report.page import pair_html

        return text_writer(pair_html(self, self._pair, self.options))

    def _recording(self) -> Writer:
        from symrefine.viewer import recorded_pair

        return lambda path: recorded_pair(self, self._pair).write(path)
