"""The map that was found between two objects."""

from dataclasses import dataclass
from typing import Any

from symrefine.align.alignment import Alignment as BareAlignment
from symrefine.front.answers import Answer, Options
from symrefine.shape import Shape


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Alignment(Answer, BareAlignment):
    """What `align` found, with a voice.

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
