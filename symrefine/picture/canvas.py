"""A picture that is written on: a title above, names beside what they name, saved as PNG."""

import io
from typing import Any

from symrefine.picture.palette import Colour

DPI = 100
POINTS_PER_PIXEL = 72.0 / DPI
INK, SOFT = "#14181f", "#48505e"
# Where the title begins, in pixels from the left and from above, and the height that is kept for it.
LEFT, BASE, TITLE = 24, 50, 76


class Canvas:
    """A white figure of matplotlib, `width` x `height` pixels, with a title `group: meaning` unless that is empty."""

    def __init__(self, width: int, height: int, title: str) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self.width, self.height = width, height
        self.figure: Any = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
        FigureCanvasAgg(self.figure)
        if title:
            self._write_title(title)

    def name(self, text: str, x: float, y: float, colour: Colour, size: float) -> None:
        """A name whose middle is at (x, y), pixels from the upper left, with letters of `size` pixels."""
        from matplotlib.patheffects import withStroke

        written = self.figure.text(
            x / self.width,
            1.0 - y / self.height,
            text,
            color=tuple(0.8 * c / 255 for c in colour),
            fontsize=POINTS_PER_PIXEL * size,
            fontweight="bold",
            ha="center",
            va="center_baseline",
            parse_math=False,
        )
        written.set_path_effects([withStroke(linewidth=4, foreground="white")])

    def panel(self, left: float, top: float, width: float, height: float) -> Any:
        """Axes of matplotlib within these pixels, counted from the upper left, without a frame."""
        box = left / self.width, 1.0 - (top + height) / self.height, width / self.width, height / self.height
        axes = self.figure.add_axes(box)
        axes.set_axis_off()
        return axes

    def png(self) -> bytes:
        """The finished picture."""
        data = io.BytesIO()
        self.figure.savefig(data, format="png", dpi=DPI, metadata={"Software": None})
        return data.getvalue()

    def _write_title(self, title: str) -> None:
        """The group in large letters and its meaning beside it, smaller where it is long."""
        name, _, meaning = title.partition(": ")
        base = 1 - BASE / self.height
        text = self.figure.text(
            LEFT / self.width, base, name, fontsize=27, fontweight="bold", color=INK, parse_math=False
        )
        start = text.get_window_extent().x1 + 18
        size = min(17.0, (self.width - LEFT - start) / (0.62 * max(1, len(meaning))))
        self.figure.text(start / self.width, base, meaning, fontsize=size, color=SOFT, parse_math=False)
