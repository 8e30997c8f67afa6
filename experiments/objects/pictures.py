"""Pictures of drawings: any pose, several finishes, and siblings with one detail that breaks the symmetry."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from PIL import Image, ImageDraw
from scipy.ndimage import gaussian_filter

from experiments.objects.drawings import Drawing, Layer, ellipse
from symrefine.geometry import Array

# Each pixel is the mean of so many by so many.
FINER = 4
DEFECTS = ("none", "bump", "bite")
FINISHES = ("clean", "binary", "blurred", "noisy", "photo")
# Blur in fractions of the side of a picture, and grain as a fraction of the contrast.
BLUR, GRAIN = 0.01, 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Turn, size of the object's radius in pixels, and shift of its middle, in a picture `side` pixels wide."""

    angle_rad: float = 0.0
    radius: float = 100.0
    shift: Array = field(default_factory=lambda: np.zeros(2))
    side: int = 256

    def apply(self, points: Array) -> Array:
        """Points of the drawing, fitted into the unit circle, in pixels, y up."""
        c, s = np.cos(self.angle_rad), np.sin(self.angle_rad)
        return self.radius * points @ np.array([[c, s], [-s, c]]) + 0.5 * self.side + self.shift


def random_pose(rng: np.random.Generator, side: int = 256) -> Pose:
    """Any angle, a radius between 30 and 40 % of the picture, and a shift that keeps the object inside."""
    radius = side * rng.uniform(0.30, 0.40)
    return Pose(angle_rad=rng.uniform(0, 2 * np.pi), radius=radius, shift=rng.uniform(-0.08, 0.08, 2) * side, side=side)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """Middle of the box of a drawing, and the radius about it that holds everything."""

    middle: Array
    reach: float

    def apply(self, points: Array) -> Array:
        """Points in the unit circle."""
        return (points - self.middle) / self.reach


def fit(layers: Sequence[Layer]) -> Fit:
    """The fit of all layers together."""
    everything = np.concatenate([points for points, _ in layers])
    middle = 0.5 * (everything.min(axis=0) + everything.max(axis=0))
    return Fit(middle=middle, reach=float(np.linalg.norm(everything - middle, axis=1).max()))


def coverage(drawing: Drawing, pose: Pose) -> Array:
    """Share of each pixel [side, side] that the object covers, first row on top."""
    size, fitted = pose.side * FINER, fit(drawing.layers)
    image = Image.new("L", (size, size), 0)
    pen = ImageDraw.Draw(image)
    for points, grey in drawing.layers:
        x, y = FINER * pose.apply(fitted.apply(points)).T
        pen.polygon(list(zip(x - 0.5, size - y - 0.5, strict=True)), fill=round(255 * grey))
    fine = np.asarray(image, dtype=np.float64) / 255.0
    return fine.reshape(pose.side, FINER, pose.side, FINER).mean(axis=(1, 3))


def picture(share: Array, finish: str, rng: np.random.Generator) -> Image.Image:
    """The object dark on light, finished in one of `FINISHES`."""
    if finish == "photo":
        return photograph(share, rng)
    if finish == "binary":
        share = (share >= 0.5).astype(np.float64)
    if finish == "blurred":
        share = gaussian_filter(share, BLUR * len(share))
    if finish == "noisy":
        # Away from black and white, where clipping would hide half of the grain.
        share = 0.2 + 0.6 * share + rng.normal(0.0, 0.6 * GRAIN, share.shape)
    return Image.fromarray(np.clip(255.0 * (1.0 - share), 0, 255).round().astype(np.uint8))


def photograph(share: Array, rng: np.random.Generator) -> Image.Image:
    """A colour picture of the object: teal on cream, blurred, uneven light, grain."""
    ink, paper = np.array([24.0, 86.0, 98.0]), np.array([244.0, 238.0, 224.0])
    soft = gaussian_filter(share, 0.8)[:, :, None]
    light = 1.0 - 0.08 * np.linspace(0.0, 1.0, share.shape[1])[None, :, None]
    pixels = (soft * ink + (1.0 - soft) * paper) * light + rng.normal(0.0, 4.0, (*share.shape, 3))
    return Image.fromarray(np.clip(pixels, 0, 255).round().astype(np.uint8))


def sibling(drawing: Drawing, defect: str, size_rel: float) -> Drawing:
    """The drawing with a disc added to its edge ("bump") or taken out of it ("bite"), far from all its images.

    Args:
        size_rel: radius of the disc over the diagonal of the object, which is taken as twice its reach.
    """
    if defect == "none":
        return drawing
    points = _edge(drawing)
    x, y = points[np.argmax(_clearance(drawing, points))]
    disc = ellipse(x, y, 2.0 * size_rel * fit(drawing.layers).reach)
    left, angle = ("D1", float(np.arctan2(y, x))) if drawing.group == "O(2)" else ("C1", 0.0)
    layers = (*drawing.layers, (disc, float(defect == "bump")))
    return replace(drawing, name=f"{drawing.name}, {defect}", layers=layers, group=left, angle_rad=angle)


def _edge(drawing: Drawing) -> Array:
    """Points [N, 2] on the edge of what is seen, in the frame of the drawing."""
    pose = Pose()
    inside = coverage(drawing, pose) >= 0.5
    row, column = np.nonzero(inside[:-1] != inside[1:])
    pixels = np.column_stack([column + 0.5, pose.side - row - 1.0])
    fitted = fit(drawing.layers)
    return (pixels - pose.apply(np.zeros((1, 2)))) / pose.radius * fitted.reach + fitted.middle


def _clearance(drawing: Drawing, points: Array) -> Array:
    """Distance [N] of points from the nearest of their images under the group."""
    z = points @ np.array([1.0, 1j])
    folds = max(drawing.fold, 1)
    apart = [2.0 * np.abs(z) * np.sin(np.pi / folds)] if folds > 1 else [2.0 * np.abs(z)]
    apart += [2.0 * np.abs((z * np.exp(-1j * a)).imag) for a in drawing.line_angles]
    return np.min(apart, axis=0)
