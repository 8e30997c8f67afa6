"""A picture of whatever was found: in space, in the plane, in more dimensions."""

from symrefine.detection.result import Detection
from symrefine.ndim.detection import SubspaceDetection
from symrefine.plane.detection import PlanarDetection
from symrefine.shape import Shape

Found = Detection | PlanarDetection | SubspaceDetection


def picture_png(found: Found, shape: Shape, *, width: int = 1200, height: int = 900, title: bool = True) -> bytes:
    """PNG of `width` x `height` pixels: the shape with what was found in it, told above with `title`.

    Args:
        found: what `detect`, `detect_planar` or `detect_nd` returned for this shape.
        shape: what it was given.
        width: in pixels.
        height: in pixels.
        title: whether the group and its meaning stand above.
    """
    if isinstance(found, PlanarDetection):
        from symrefine.picture.flat import flat_png

        return flat_png(found, shape, width=width, height=height, title=title)
    if isinstance(found, SubspaceDetection):
        from symrefine.picture.projections import projections_png

        return projections_png(found, shape, width=width, height=height, title=title)
    from symrefine.picture.space import space_png

    return space_png(found, shape, width=width, height=height, title=title)
