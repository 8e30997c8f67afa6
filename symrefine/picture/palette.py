"""The colours of all pictures."""

import numpy as np

from symrefine.geometry import Array
from symrefine.shape import Index

Colour = tuple[int, int, int]

# Okabe and Ito's colours, which colour-blind people tell apart too, without those that white swallows.
PALETTE: tuple[Colour, ...] = (
    (0, 114, 178), (213, 94, 0), (0, 158, 115), (180, 80, 150), (224, 150, 0), (64, 160, 220),
)  # fmt: skip
OBJECT: Colour = (168, 178, 194)
# Of two objects the one that moves.
SOURCE: Colour = (72, 150, 214)
AXIS: Colour = (38, 42, 52)
MISS: Colour = (120, 120, 128)
# What was seen and agrees is grey like any object; no plane has these.
INFERRED: Colour = (116, 190, 96)
CONTRADICTED: Colour = (200, 30, 70)
OUTLIER: Colour = (190, 70, 110)


def shade(colour: Colour) -> Array:
    """A colour as three numbers from 0 to 1."""
    return np.array(colour) / 255.0


def class_colours(labels: Index | None, count: int) -> Array:
    """Colours [count, 3], 0 to 1, by class: grey what most are of, or all where there are no classes."""
    if labels is None:
        return np.tile(shade(OBJECT), (count, 1))
    _, which, sizes = np.unique(labels, return_inverse=True, return_counts=True)
    colours = np.array([PALETTE[k % len(PALETTE)] for k in range(len(sizes))])
    colours[sizes.argmax()] = OBJECT
    return np.asarray(colours[which.reshape(-1)] / 255.0)


def plane_colour(index: int) -> Colour:
    """Colour of the plane listed at `index`."""
    return PALETTE[index % len(PALETTE)]
