"""Images, .png .jpg .jpeg and .bmp: pixels as weighted points of the plane.

Frame: the unit is a pixel, x points to the right and y up, the origin is the lower left corner of the picture as a
viewer shows it, so that the pixel in column c and row r of an H pixels high picture stands at (c + 1/2, H - r - 1/2).
Grey values run from 0 (black) to 1 (white); colours become grey by ITU-R 601, 0.299 R + 0.587 G + 0.114 B. Grain is
smoothed away, unless the picture is binary.
"""

import io
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.load.content import Content, Threshold, Wanted
from symrefine.load.text import shorten

if TYPE_CHECKING:
    from PIL.Image import Image

FORMATS = {".bmp": "BMP", ".jpeg": "JPEG", ".jpg": "JPEG", ".png": "PNG"}
# More pixels add nothing to the moments, only gigabytes.
LARGEST = 2**24
# Bytes of the file of such a picture beside a mesh: four channels of 16 bits, not packed, and as much again.
LARGEST_FILE = 2**28
_LUMA = (0.299, 0.587, 0.114)
_DEEP = {"I;16": 65535.0, "I;16B": 65535.0, "I;16L": 65535.0, "I": 65535.0}
# Of a histogram: as many as a byte has grey values.
BINS = 256
# Standard deviations of the border that a pixel must differ by from the background to weigh anything.
_NOISE = 5.0
# What smoothing leaves of the grain, as a fraction of the contrast; the narrowest Gaussian in pixels that is worth it,
# and the widest; pixels from which grain is estimated, at least.
_GRAIN, _SHARP, _SOFT, _SEEN = 0.02, 0.3, 5.0, 400


def read_image(data: bytes, suffix: str, wanted: Wanted) -> Content:
    """Pixels of the object in a picture, with their weights; what weighs nothing is left out.

    Args:
        suffix: one of `FORMATS`, which the content has to agree with.
        wanted: whether to make the picture binary, or to exchange object and background.

    Raises:
        InputError: damaged, animated, too large, of one grey value only.
    """
    grey = _grey(open_image(data, suffix))
    if np.ptp(grey) == 0.0:
        size = f"{grey.shape[1]} x {grey.shape[0]} pixels"
        raise InputError(f"all {size} have the same grey value {grey.flat[0]:.3g}: there is no object")
    weights = pixel_weights(without_grain(grey), threshold=wanted.threshold, invert=wanted.invert)
    if np.ptp(weights) == 0.0:
        low, high = float(grey.min()), float(grey.max())
        remedy = (
            "try threshold 'otsu' (--threshold otsu), which parts dark from light"
            if wanted.threshold is None
            else f"choose a threshold between them, not {wanted.threshold}"
        )
        raise InputError(f"nothing stands out: grey values run from {low:.3g} to {high:.3g}; {remedy}")
    row, column = np.nonzero(weights)
    points = np.column_stack([column + 0.5, len(grey) - row - 0.5])
    return Content(points=points, weights=weights[row, column])


def pixel_weights(grey: Array, *, threshold: Threshold | None = None, invert: bool = False) -> Array:
    """What each pixel weighs: 1 and 0 in a binary picture, its distance from the background in a grey one.

    The background is what most of the border shows; the border of a volume is its six sides. A picture with two grey
    values is binary; of a grey one the background is the median of its border, and pixels within the scatter of the
    border weigh nothing.

    Args:
        grey: [H, W] or [A, B, C] values from 0 (black) to 1 (white).
        threshold: make it binary first, light being what reaches the threshold.
        invert: exchange object and background; in a grey picture, weights become their largest value minus them.
    """
    if threshold is not None:
        grey = parted(grey, otsu(grey) if threshold == "otsu" else threshold)
    inside = np.zeros(grey.shape, dtype=bool)
    inside[(slice(1, -1),) * grey.ndim] = True
    return weighing(grey[~inside], lambda: [grey], invert=invert)(grey)


def parted(grey: Array, level: float) -> Array:
    """A binary picture: light is what reaches the level."""
    return (grey >= level).astype(grey.dtype)


def weighing(border: Array, pieces: Callable[[], Iterable[Array]], *, invert: bool) -> Callable[[Array], Array]:
    """What grey values weigh in a picture of which no more than pieces are at hand, as `pixel_weights` has it.

    Args:
        border: [N] grey values there.
        pieces: all grey values, piece by piece; asked for a few times.
    """
    levels = np.array([min(piece.min() for piece in pieces()), max(piece.max() for piece in pieces())])
    if all(((piece == levels[0]) | (piece == levels[1])).all() for piece in pieces()):
        # The level that most of the border has; of the whole picture if that is a tie; then the lightest.
        counts = [sum(int((piece == level).sum()) for piece in pieces()) for level in levels]
        votes = [(int((border == level).sum()), counts[k], k) for k, level in enumerate(levels)]
        background = levels[max(votes)[-1]]
        return lambda grey: ((grey != background) != invert).astype(grey.dtype)
    level = float(np.median(border))
    scatter = 1.4826 * float(np.median(np.abs(border - level)))

    def contrast(grey: Array) -> Array:
        apart = np.abs(grey - level)
        apart[apart <= _NOISE * scatter] = 0.0
        return apart

    if not invert:
        return contrast
    most = max(contrast(piece).max() for piece in pieces())
    return lambda grey: np.asarray(most - contrast(grey))


def without_grain(grey: Array) -> Array:
    """The picture blurred by as little as makes its grain a small part of its contrast; mostly, not at all.

    The grain is what pixels differ by from the mean of their four neighbours, in the median: edges do not count.
    """
    if min(grey.shape) < 3 or grey.size < _SEEN or len(np.unique(grey)) <= 2:
        return grey
    beside = 0.25 * (grey[:-2, 1:-1] + grey[2:, 1:-1] + grey[1:-1, :-2] + grey[1:-1, 2:])
    grain = 1.4826 * float(np.median(np.abs(grey[1:-1, 1:-1] - beside))) / np.sqrt(1.25)
    contrast = float(np.ptp(np.quantile(grey, [0.01, 0.99])))
    # A Gaussian leaves 1 / (2 sqrt(pi) width) of the noise of pixels.
    width = grain / max(_GRAIN * contrast * 2.0 * np.sqrt(np.pi), 1e-300)
    if width < _SHARP:
        return grey
    from scipy.ndimage import gaussian_filter

    return np.asarray(gaussian_filter(grey, min(width, _SOFT), mode="nearest"))


def otsu(grey: Array) -> float:
    """The grey value that parts a picture into the two most uniform classes."""
    return otsu_of(*np.histogram(grey, bins=BINS))


def otsu_of(counts: NDArray[np.int64], edges: Array) -> float:
    """The same from a histogram: how many grey values lie between each two edges."""
    middles = 0.5 * (edges[1:] + edges[:-1])
    below = np.cumsum(counts)[:-1]
    above = below[-1] + counts[-1] - below
    sums = np.cumsum(counts * middles)
    apart = sums[:-1] / np.maximum(below, 1) - (sums[-1] - sums[:-1]) / np.maximum(above, 1)
    score = below * above * apart**2
    # Between two clean levels every threshold is as good: take the middle of them.
    best = np.flatnonzero(score >= score.max() * (1.0 - 1e-12))
    return float(edges[1 + best[[0, -1]]].mean())


def open_image(data: bytes, suffix: str) -> "Image":
    """The picture as a viewer shows it, complete and undamaged."""
    from PIL import Image, ImageOps, UnidentifiedImageError

    kind = FORMATS[suffix]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if kind == "PNG":
                Image.open(io.BytesIO(data), formats=[kind]).verify()  # the checksums of all chunks
            image = Image.open(io.BytesIO(data), formats=[kind])
            check_size(image)
            image.load()
            return ImageOps.exif_transpose(image)
    except InputError:
        raise
    except Image.DecompressionBombError:
        raise InputError(f"more pixels than {LARGEST:,}; scale it down") from None
    except UnidentifiedImageError:
        raise InputError(f"not a {kind} image: begins with {shorten(data[:8].decode('latin-1'))}") from None
    except Exception as error:  # noqa: BLE001 (Pillow leaks many types on damaged files; nothing else in the block)
        raise InputError(f"not a whole {kind} image: {shorten(str(error), 80)}") from None


def check_size(image: "Image") -> None:
    """Refuse an image that is too large, or several, before it is decoded."""
    width, height = image.size
    if width * height > LARGEST:
        raise InputError(f"{width} x {height} pixels; at most {LARGEST:,} pixels: scale it down")
    frames = getattr(image, "n_frames", 1)
    if frames > 1:
        raise InputError(f"holds {frames} pictures, an animation or a series; save one of them by itself")


def is_deep(path: Path) -> bool:
    """Whether a file is a picture of one channel of 16 bits, as depth images are."""
    from PIL import Image

    suffix = path.suffix.lower()
    if suffix not in FORMATS or not path.is_file():
        return False
    with Image.open(path, formats=[FORMATS[suffix]]) as image:  # its header alone
        return image.mode in _DEEP


def _grey(image: "Image") -> Array:
    """Grey values [H, W] from 0 to 1, what is transparent painted in that of black and white which it differs from."""
    if image.mode in _DEEP or image.mode == "F":
        return np.asarray(image, dtype=np.float64) / _DEEP.get(image.mode, 1.0)
    if image.mode == "1":
        return np.asarray(image, dtype=np.float64)
    if not image.has_transparency_data:
        return _luma(np.asarray(image if image.mode == "L" else image.convert("RGB")))
    channels = np.asarray(image.convert("RGBA"))
    grey, alpha = _luma(channels[:, :, :3]), channels[:, :, 3] / 255.0
    visible = float((grey * alpha).sum()) / max(float(alpha.sum()), 1e-300)
    ground = 1.0 if visible <= 0.5 else 0.0
    return alpha * grey + (1.0 - alpha) * ground


def _luma(channels: NDArray[Any]) -> Array:
    """Grey values of 8-bit pixels, [H, W] or [H, W, 3]; equal channels keep their value exactly."""
    if channels.ndim == 2:
        return channels / 255.0
    red, green, blue = (channels[:, :, k].astype(np.float64) for k in range(3))
    # The weights sum to 1: written so, rounding cannot make two pixels of one grey differ.
    return np.asarray((green + _LUMA[0] * (red - green) + _LUMA[2] * (blue - green)) / 255.0)
