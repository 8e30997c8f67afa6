"""What was found in an object in space."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from symrefine.detection.result import Detection as BareDetection
from symrefine.files import Writer
from symrefine.front.answers import Found, Operations, Options
from symrefine.geometry import Array
from symrefine.groups import PointGroup
from symrefine.options import flag_of, whole_of


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Detection(Found, BareDetection):
    """What `detect` found in an object in space, with a voice.

    It has all that `symrefine.detection.result.Detection` has.
    """

    def _record(self, options: Options, load_s: float | None) -> dict[str, Any]:
        from symrefine.export.records import detection_record

        return detection_record(self, self.shape, options=options, load_s=load_s)

    def placed(self) -> tuple[PointGroup, Array]:
        """The group and the point [3] where its operations meet, as exactly as the shape has them.

        Raises:
            InputError: nothing is decided.
        """
        from symrefine.export.bop import decided

        return decided(self, self.shape)

    def operations(self, *, improper: bool = True, steps: int | None = None) -> Operations:
        """Operations of the group [N, 4, 4] in the units and the frame of the input, determinants with them.

        Args:
            improper: whether mirrors and the like belong to them.
            steps: turns that stand for a continuous axis, 72 if None; a sphere is given as an icosahedron.

        Raises:
            InputError: nothing is decided; options that are no yes or no, or no number of turns.
        """
        from symrefine.export.operations import STEPS, motions

        turns = STEPS if steps is None else whole_of("steps", steps, least=1)
        group, center = self.placed()
        return Operations.of(motions(group, center, improper=flag_of("improper", improper), steps=turns))

    def canonical_transform(self) -> Array:
        """[4, 4] from the input to its canonical pose: the centre at 0, the main axis along z.

        Raises:
            InputError: nothing is decided, or there is no axis and no mirror.
        """
        from symrefine.export.packages import canonical

        return canonical(self, self.shape).matrix(1.0)

    def chosen(self, point_group: str) -> "Detection":
        """The answer if a person says that another group is meant: its elements and operations, where it fits best.

        Args:
            point_group: one of those in `choices()`: C1, and groups each inside the next.

        Raises:
            InputError: no such group.
        """
        from symrefine.detection import story

        return Detection.of(story.chosen(self, point_group), shape=self.shape, options=self.options)

    def show(self) -> Any:
        """Open the recording in the viewer of rerun, or inline in a notebook.

        Raises:
            SymrefineError: there is no display; `save("x.rrd")` and `symrefine view x.rrd --web` do without one.
        """
        from symrefine.viewer import recorded

        return recorded(self, self.shape).show("detection")

    def kinds(self) -> dict[str, Callable[[], Writer]]:
        return Found.kinds(self) | {".rrd": self._recording}

    def _recording(self) -> Writer:
        from symrefine.viewer import record

        return partial(record, self, self.shape)
