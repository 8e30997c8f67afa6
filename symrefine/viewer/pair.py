"""An alignment as a rerun recording: both objects as they came, the way of the source to the target, every map.

Steps of the timeline "story": before, some steps of the way, then one step for each map that is shown, with what either
side says of it by colour. Positions are relative to the centre of the target, in units of the target.
"""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from symrefine.align.alignment import Alignment
from symrefine.geometry import Array
from symrefine.picture.camera import Camera, look_at, seen_from
from symrefine.picture.pair import Pair, Side
from symrefine.picture.pair_words import headline, named, summary
from symrefine.picture.palette import CONTRADICTED, INFERRED, Colour, shade
from symrefine.picture.words import percent
from symrefine.viewer.layout import FILL, FOV_RAD, framed, view3d
from symrefine.viewer.marks import bright
from symrefine.viewer.recording import Recording, display_scale, new_stream
from symrefine.viewer.story import POINT, go_to, say
from symrefine.viewer.text import table

# Steps between before and after, and points of either side.
WAY, MOST = 6, 20_000
# Width of the view over its height, about.
ASPECT = 1.1
# What is told of a side over the story: entity under /series, title and colour.
SERIES: dict[str, tuple[str, Colour]] = {
    "met": ("met [%]", (86, 180, 233)),
    "contradicted": ("contradicted [%]", CONTRADICTED),
    "unseen": ("nobody looked [%]", INFERRED),
}
_NAMES = ("source", "target")


def recorded_pair(found: Alignment, pair: Pair) -> Recording:
    """The recording of an alignment."""
    digest = hashlib.sha256()
    for side in pair.sides:
        digest.update(side.shape.points.tobytes() + side.name.encode())
    digest.update(repr((found.matrix.tolist(), found.translation.tolist(), pair.tolerance)).encode())
    name = f"{Path(pair.source.name).stem}-onto-{Path(pair.target.name).stem}"
    return Recording(
        stream=new_stream(name, digest.hexdigest()[:32]),
        layout=_layout(pair),
        log=lambda stream: _log(stream, found, pair),
    )


def _layout(pair: Pair) -> Any:
    """Both objects on the left, the page, the shares of both sides and the log on the right."""
    series = [rrb.TimeSeriesView(origin=f"/series/{name}", name=f"What the {name} says") for name in _NAMES]
    right = rrb.Vertical(
        rrb.TextDocumentView(origin="/report", name="Report"),
        rrb.Tabs(*series, active_tab=0),
        rrb.TextLogView(origin="/log", name="Log"),
        row_shares=[4, 4, 2],
    )
    return framed(view3d("Story", view(pair)[0], display_scale(pair.diagonal)), right)


def view(pair: Pair) -> tuple[Camera, Array]:
    """A camera that has both objects in view, before and after, and where the source stands before [3]."""
    way = pair.ways[0]
    after = pair.stage(way.matrix, way.shift)
    best = look_at(after, aspect=ASPECT, fov_rad=FOV_RAD)
    beside = pair.beside(-best.frame[0])
    points = np.concatenate([after.stage.points, pair.source.outline + beside])
    return seen_from(best.frame[2], points, best.up, aspect=ASPECT, fov_rad=FOV_RAD, fill=FILL), beside


def _log(stream: Any, found: Alignment, pair: Pair) -> None:
    stream.log("object", rr.Transform3D(scale=display_scale(pair.diagonal)), static=True)
    document = rr.TextDocument(markdown(found, pair), media_type=rr.MediaType.MARKDOWN)
    stream.log("report", document, static=True)
    for name in _NAMES:
        for entity, (title, colour) in SERIES.items():
            style = rr.SeriesLines(names=[title], colors=[bright(colour)], widths=[2.0])
            stream.log(f"series/{name}/{entity}", style, static=True)
            dots = rr.SeriesPoints(names=[title], colors=[bright(colour)], marker_sizes=[3.0])
            stream.log(f"series/{name}/{entity}", dots, static=True)
    places = [_log_points(stream, pair, side) for side in pair.sides]
    beside = view(pair)[1]
    for step, share in enumerate(np.linspace(0.0, 1.0, WAY + 1)[:-1].tolist()):
        go_to(stream, step)
        _place(stream, *pair.ways[0].part(share, beside))
        if step == 0:
            say(stream, f"before: {pair.source.name} beside {pair.target.name}, as it came")
    for index, way in enumerate(pair.ways):
        go_to(stream, WAY + index)
        _place(stream, way.matrix, way.shift)
        _judge(stream, pair, index, places)
    stream.reset_time()


def _log_points(stream: Any, pair: Pair, side: Side) -> Array:
    """Log the points of a side in its own colour at the first step; [N, 3] in its own frame."""
    surface = side.surface(dense=True)
    points = surface.points if not side.atoms else side.shape.points
    points = points[:: max(1, -(-len(points) // MOST))]
    go_to(stream, 0)
    radius = POINT * pair.diagonal * (4.0 if side.atoms else 1.0)
    stream.log(
        f"object/{_NAMES[side.index]}/points",
        rr.Points3D(points.astype(np.float32), colors=[bright(side.colour)], radii=[radius]),
    )
    return points


def _place(stream: Any, matrix: Array, shift: Array) -> None:
    stream.log("object/source", rr.Transform3D(mat3x3=matrix, translation=shift))


def _judge(stream: Any, pair: Pair, index: int, places: list[Array]) -> None:
    """What either side says of a map: by colour, as shares, and in a line."""
    for side, points, shares in zip(pair.sides, places, pair.shares(index), strict=True):
        name = _NAMES[side.index]
        own = np.tile(shade(bright(side.colour)), (len(points), 1))
        colours = pair.coloured(own, pair.misses(side.index, points)[index])
        stream.log(f"object/{name}/points", rr.Points3D.from_fields(colors=np.round(255 * colours).astype(np.uint8)))
        for entity in SERIES:
            stream.log(f"series/{name}/{entity}", rr.Scalars([100.0 * getattr(shares, entity)]))
    what, by = named(pair.ways[index])
    one, other = pair.shares(index)
    say(stream, f"map {index + 1} of {pair.equivalents}: {what} {by}; source {one}; target {other}")


def markdown(found: Alignment, pair: Pair) -> str:
    """The report as a page."""
    heads = ["", "map", "source meets", "target meets"]
    rows = [
        [str(k + 1), " ".join(named(way)).strip(), *(percent(shares.met) for shares in pair.shares(k))]
        for k, way in enumerate(pair.ways)
    ]
    matrix = "\n".join(" ".join(f"{x + 0.0:13.8g}" for x in row) for row in pair.ways[0].transform)
    colours = (
        "Blue: the source, grey: the target, where they meet. Red: one contradicts. Green: nobody looked there. Pink: "
        "strays. Before, the source stands beside the target."
    )
    title = f"# {headline(found, pair)}"
    about = f"`{pair.source.name}` onto `{pair.target.name}`. {summary(found, pair)}"
    return "\n\n".join([title, about, table(heads, rows), f"```\n{matrix}\n```", colours]) + "\n"
