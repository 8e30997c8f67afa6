"""The gallery, like the paper's last figure: `python -m experiments.studies.gallery [--out out/gallery]`.

Every object in a random pose, unit and scale, as points with noise and without normals, judged against the symmetry
that is stated for it. Writes `gallery.png` with the objects of the project's own making and, where they are fetched,
`models.png` with the real ones; each picture shows the object with what was found in those points. As an experiment it
gives a row for an object and a method: ours, or trimesh's inertia on the mesh itself.
"""

import argparse
import io
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from experiments.objects.exhibits import Exhibit, check_exhibit, exhibit
from experiments.objects.household import OBJECTS
from experiments.objects.models import PREFIX, available
from experiments.objects.poses import FORMS, Pose, observed, posed
from experiments.peers.trimesh_inertia import trimesh_symmetry
from experiments.studies.measure import judge
from symrefine.detection.result import Detection
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.files import replacing
from symrefine.geometry import Array, Plane, line_angle_rad
from symrefine.groups import PointGroup
from symrefine.picture.camera import FOV_RAD, look_at
from symrefine.picture.painter import paint
from symrefine.picture.scene import make_scene
from symrefine.picture.surface import make_surface
from symrefine.picture.words import symbol
from symrefine.shape import Shape
from symrefine.viewer import record as write_recording

METHODS = ("symrefine", "trimesh")
Result = int | float | str | bool | None

# Of the contact sheet, in pixels.
COLUMNS, TILE_WIDTH, TILE_HEIGHT, CAPTION, MARGIN = 8, 288, 236, 44, 14
DPI = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One object as a method sees it; `points` and `noise_rel` (fractions of the diagonal) belong to a cloud."""

    name: str
    method: str = "symrefine"
    form: str = "cloud"
    points: int = 20000
    noise_rel: float = 0.0
    seed: int = 0


def check(case: Case) -> None:
    """Refuse what cannot be run.

    Raises:
        InputError: field, value and what would be right.
    """
    check_exhibit(case.name)
    for field, value, choices in (("method", case.method, METHODS), ("form", case.form, FORMS)):
        if value not in choices:
            raise InputError(f"{field}: value is {value!r}, expected one of {list(choices)}")
    if case.method == "trimesh" and case.form != "mesh":
        raise InputError(f"form: value is {case.form!r}, expected 'mesh': trimesh's symmetry takes meshes only")
    if case.form == "mesh" and case.noise_rel:
        raise InputError(f"noise_rel: value is {case.noise_rel}, expected 0: noise belongs to form 'cloud'")
    if case.points < 1000:
        raise InputError(f"points: value is {case.points}, expected at least 1000")
    if not 0 <= case.noise_rel <= 0.1:
        raise InputError(f"noise_rel: value is {case.noise_rel}, expected 0 to 0.1")


def given(case: Case) -> tuple[Exhibit, Pose, Shape]:
    """The object, the pose it is put in, and what the method gets."""
    thing = exhibit(case.name)
    rng = np.random.default_rng([case.seed, *case.name.encode()])
    pose = Pose.random(rng)
    return thing, pose, posed(observed(thing.mesh, case.form, case.points, case.noise_rel, rng), pose)


def run(case: Case) -> dict[str, Result]:
    """A row: what was found against what is stated."""
    thing, pose, shape = given(case)
    start = time.perf_counter()
    if case.method == "trimesh":
        row = _theirs(thing, pose, shape)
    else:
        row = _ours(thing, pose, detect(shape, seed=case.seed))
    return {"kind": thing.kind, "group": thing.group, **row, "total_s": time.perf_counter() - start}


def _ours(thing: Exhibit, pose: Pose, found: Detection) -> dict[str, Result]:
    score = judge(found, thing, pose)
    return {
        "answer": found.point_group,
        "right": score.right,
        "found": score.found,
        "true": score.true,
        "false": score.false,
        "worst_deg": score.worst_deg,
        "offset_rel": score.offset_rel,
        "iterations": found.iterations,
        "nearest_miss": min((m.excess for m in found.near_misses), default=float("nan")),
    }


def _theirs(thing: Exhibit, pose: Pose, mesh: Shape) -> dict[str, Result]:
    """trimesh knows no planes and no orders: it is right if it sees an axis exactly where there is one."""
    found = trimesh_symmetry(mesh)
    angle = float("nan")
    if found.axis is not None and thing.axis is not None:
        angle = float(np.degrees(line_angle_rad(found.axis, pose.turn @ thing.axis)))
    return {
        "answer": found.kind,
        "right": found.kind == ("none" if thing.axis is None else "radial"),
        "found": 0,
        "true": len(thing.normals),
        "false": 0,
        "worst_deg": angle,
        "offset_rel": float("nan"),
        "iterations": 0,
        "nearest_miss": float("nan"),
    }


def record(case: Case, path: Path) -> None:
    """A recording of our run."""
    _, _, shape = given(case)
    write_recording(detect(shape, seed=case.seed), shape, path)


def in_own_frame(found: Detection, pose: Pose) -> Detection:
    """What was found in a pose, carried back to the object's own frame, where it stands upright; without misses."""

    def plane(p: Plane) -> Plane:
        point = back(p.offset * p.normal)
        normal = p.normal @ pose.turn
        return Plane(normal=normal, offset=float(normal @ point))

    def back(point: Array) -> Array:
        return np.asarray((point - pose.shift) @ pose.turn / pose.scale)

    return replace(
        found,
        group=PointGroup(name=found.group.name, frame=found.group.frame @ pose.turn),
        center=back(found.center),
        planes=tuple(replace(p, plane=plane(p.plane)) for p in found.planes),
        axes=tuple(
            replace(a, axis=replace(a.axis, point=back(a.axis.point), direction=a.axis.direction @ pose.turn))
            for a in found.axes
        ),
        near_misses=(),
        diagonal=found.diagonal / pose.scale,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tile:
    """An object of the contact sheet: [TILE_HEIGHT, TILE_WIDTH, 3] picture 0 to 1, and what is written below it."""

    name: str
    group: str
    answer: str
    right: bool
    picture: Array


def painted(found: Detection, mesh: Shape) -> Array:
    """The mesh with what was found, as a picture without names."""
    scene = make_scene(found, mesh)
    camera = look_at(scene, aspect=TILE_WIDTH / TILE_HEIGHT, fov_rad=FOV_RAD)
    return paint(scene, make_surface(mesh, scene), camera, TILE_WIDTH, TILE_HEIGHT)


def make_tile(case: Case) -> tuple[Tile, dict[str, Result]]:
    """Detect, judge and paint one object."""
    thing, pose, shape = given(case)
    start = time.perf_counter()
    found = detect(shape, seed=case.seed)
    row = _ours(thing, pose, found) | {"kind": thing.kind, "group": thing.group}
    row["total_s"] = time.perf_counter() - start
    tile = Tile(
        name=case.name.removeprefix(PREFIX).replace("_", " "),
        group=thing.group,
        answer=found.point_group,
        right=bool(row["right"]),
        picture=painted(in_own_frame(found, pose), thing.mesh),
    )
    return tile, row


def contact_sheet(tiles: Sequence[Tile]) -> bytes:
    """PNG of all tiles on white, captions below; a wrong answer is written in red beside what is true."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = min(COLUMNS, len(tiles))
    step_x, step_y = TILE_WIDTH + MARGIN, TILE_HEIGHT + CAPTION + MARGIN
    width, height = MARGIN + columns * step_x, MARGIN + -(-len(tiles) // columns) * step_y
    sheet = np.ones((height, width, 3))
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    FigureCanvasAgg(figure)
    for number, tile in enumerate(tiles):
        x, y = MARGIN + number % columns * step_x, MARGIN + number // columns * step_y
        sheet[y : y + TILE_HEIGHT, x : x + TILE_WIDTH] = tile.picture
        middle, below = (x + TILE_WIDTH / 2) / width, 1 - (y + TILE_HEIGHT + CAPTION / 2) / height
        said = symbol(tile.answer) if tile.right else f"{symbol(tile.answer)}, is {symbol(tile.group)}"
        colour = "#14181f" if tile.right else "#b3261e"
        figure.text(middle - 6 / width, below, tile.name, fontsize=13, color="#48505e", ha="right", va="center")
        figure.text(middle + 6 / width, below, said, fontsize=13, color=colour, weight="bold", ha="left", va="center")
    figure.figimage(sheet, origin="upper")
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=DPI, metadata={"Software": None})
    return smaller(data)


def smaller(png: io.BytesIO) -> bytes:
    """The same picture in 256 colours, a third of the size."""
    from PIL import Image

    data = io.BytesIO()
    with Image.open(png) as image:
        image.convert("RGB").quantize(256, dither=Image.Dither.NONE).save(data, format="png", optimize=True)
    return data.getvalue()


def line_of(name: str, row: dict[str, Result]) -> str:
    """One object as a line of the printed table."""
    angle = "" if np.isnan(float(row["worst_deg"] or 0.0)) else f"{row['worst_deg']:.3f}"
    verdict = "" if row["right"] else "  WRONG"
    planes = f"{row['found']}/{row['true']}"
    return f"{name:18s} {row['kind']:10s} {row['group']:6s} {row['answer']:6s} {planes:>6s} {angle:>9s}{verdict}"


def show(names: Sequence[str], path: Path, options: argparse.Namespace) -> tuple[int, list[str]]:
    """Print and paint some objects; returns how many are right and the names of the others."""
    tiles, wrong = [], []
    for name in names:
        case = Case(name=name, points=options.points, noise_rel=options.noise, seed=options.seed)
        check(case)
        tile, row = make_tile(case)
        print(line_of(name, row), flush=True)
        tiles.append(tile)
        wrong += [] if tile.right else [name]
    with replacing(path) as draft:
        draft.write_bytes(contact_sheet(tiles))
    return len(names) - len(wrong), wrong


def main(arguments: list[str] | None = None) -> int:
    """Print the table, write the sheets; 2 if something is wrong with the input."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.studies.gallery", description=__doc__.partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=Path("out/gallery"), help="folder (default: %(default)s)")
    parser.add_argument("--points", type=int, default=20000, help="of each object (default: %(default)s)")
    parser.add_argument("--noise", type=float, default=0.005, help="fraction of the diagonal (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of poses and noise (default: %(default)s)")
    options = parser.parse_args(arguments)
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        print(f"Random poses, {options.points:,} points, noise {100 * options.noise:g} % of the diagonal, no normals")
        print("object             kind       group  answer planes  error deg")
        right, wrong = show(list(OBJECTS), options.out / "gallery.png", options)
        fetched = [PREFIX + name for name in available()]
        if fetched:
            more, missed = show(fetched, options.out / "models.png", options)
            right, wrong = right + more, wrong + missed
        else:
            print("no real models: python -m experiments.objects.models fetch brings them")
        print(f"\n{right} of {right + len(wrong)} right" + (f"; wrong: {', '.join(wrong)}" if wrong else ""))
    except (InputError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
