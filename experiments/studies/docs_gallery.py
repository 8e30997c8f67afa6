"""The page `docs/gallery.md`: `python -m experiments.studies.docs_gallery [--out docs]`.

Makes a file of each kind, runs the command that the page shows, and puts what it said and a picture of what it found
into the page. Takes a minute; but for the seconds that the commands take, the same bytes each time.
"""

import argparse
import io
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.objects.damage import clump, view
from experiments.objects.drawings import DRAWINGS
from experiments.objects.household import OBJECTS
from experiments.objects.molecule_sets import molecule
from experiments.objects.pictures import Pose as PicturePose
from experiments.objects.pictures import coverage, picture
from experiments.objects.poses import Pose, observed, posed
from experiments.objects.shapes import box, join, sample
from experiments.studies.gallery import smaller
from symrefine.detection.story import detect
from symrefine.export.models import model_bytes
from symrefine.files import whole
from symrefine.geometry import Array, unit
from symrefine.load import IMAGES, load
from symrefine.picture.draw import picture_png
from symrefine.plane import detect_planar
from symrefine.shape import Shape

Rng = np.random.Generator
WIDTH, HEIGHT = 760, 520
# Where the camera of the scan stands, seen from the stool.
SIDE = unit(np.array([-1.0, 0.7, 0.6]))
INTRODUCTION = """# Gallery

Each picture shows what the command beside it found, and below stands what the command said. The files are of the
project's own making; `python -m experiments.studies.docs_gallery` makes them, runs the commands and writes this page.
[All forty objects](#forty-objects) of the benchmark stand at the end.
"""
ENDING = """## Forty objects

Each as 20,000 points with 0.5 % noise, without normals, in a random pose, unit and scale
(`python -m experiments.studies.gallery`). Below each stands the group that was found.

![Forty objects with their planes and axes](gallery.png)
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """What the gallery shows: a title, a remark, a file that `make` writes, and the commands that read it."""

    title: str
    remark: str
    file: str
    make: Callable[[Path, Rng], None]
    commands: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Of the picture."""
        return f"gallery_{Path(self.file).stem}.png"


def mesh(name: str) -> Callable[[Path, Rng], None]:
    """A household object as it is."""
    return lambda path, rng: put(path, posed(OBJECTS[name].build(), Pose.random(rng)))


def cloud(name: str, noise_rel: float) -> Callable[[Path, Rng], None]:
    """A household object as 20,000 noisy points in a random pose."""
    return lambda path, rng: put(
        path, posed(observed(OBJECTS[name].build(), "cloud", 20000, noise_rel, rng), Pose.random(rng))
    )


def brick(path: Path, rng: Rng) -> None:
    """A box of three different edges."""
    put(path, Shape(points=sample(join([box((0, 0, 0), (1.0, 0.6, 0.3))]), 20000, 0.002, rng)))


def scan(path: Path, rng: Rng) -> None:
    """A stool from one side: a .pcd, whose header says where the camera stood."""
    seen = view(OBJECTS["stool3"].build(), SIDE, rng)
    assert seen.viewpoint is not None
    place = " ".join(f"{x:.5f}" for x in seen.viewpoint[0])
    rows = "\n".join(" ".join(f"{x:.5f}" for x in p) for p in seen.points)
    count = len(seen.points)
    path.write_text(
        "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        f"WIDTH {count}\nHEIGHT 1\nVIEWPOINT {place} 1 0 0 0\nPOINTS {count}\nDATA ascii\n{rows}\n",
        encoding="ascii",
    )


def clumped(path: Path, rng: Rng) -> None:
    """A flower with a clump of points beside it."""
    put(path, Shape(points=clump(OBJECTS["flower"].build(), 0.03, rng).points))


def ferrocene(path: Path, _: Rng) -> None:
    """A molecule as a chemical .xyz."""
    found = molecule("ferrocene, staggered")
    rows = [f"{s} " + " ".join(f"{x:.6f}" for x in p) for s, p in zip(found.symbols, found.positions, strict=True)]
    path.write_text("\n".join([str(len(rows)), "ferrocene, staggered", *rows, ""]), encoding="ascii")


def snowflake(path: Path, rng: Rng) -> None:
    """A picture, a little turned and blurred."""
    pose = PicturePose(angle_rad=0.2, radius=150.0, side=360)
    picture(coverage(DRAWINGS["snowflake"], pose), "blurred", rng).save(path)


ENTRIES = (
    Entry(
        title="A mesh with one mirror plane",
        remark="The body alone would map onto itself under any plane through its axis; the handle does not.",
        file="mug.ply",
        make=mesh("mug"),
    ),
    Entry(
        title="A chiral rotor",
        remark="Three blades and no mirror plane.",
        file="propeller.ply",
        make=mesh("propeller"),
    ),
    Entry(
        title="A noisy cloud",
        remark="20,000 points, 1 % noise, no normals, any pose and unit.",
        file="table.ply",
        make=cloud("table", 0.01),
    ),
    Entry(
        title="A surface of revolution",
        remark="The axis has infinite order, and every plane through it is a mirror.",
        file="bottle.ply",
        make=cloud("bottle", 0.003),
    ),
    Entry(
        title="Where all n-tuples vanish",
        remark="The method of the paper has nothing to start from here; the directional spectrum of the moments has.",
        file="brick.ply",
        make=brick,
    ),
    Entry(
        title="A view of one camera",
        remark="Grey was seen, green is inferred: images where nobody looked. The camera's place is in the file; "
        "elsewhere `--viewpoint` says it.",
        file="stool.pcd",
        make=scan,
        commands=("symrefine detect stool.pcd", "symrefine complete stool.pcd -o whole.ply"),
    ),
    Entry(
        title="A clump that belongs to something else",
        remark="Set apart and told, not silently dropped.",
        file="flower.ply",
        make=clumped,
    ),
    Entry(
        title="A molecule",
        remark="Atoms stand for themselves, and elements are labels that no operation exchanges.",
        file="ferrocene.xyz",
        make=ferrocene,
    ),
    Entry(
        title="A picture",
        remark="Mirror lines and turns of the plane.",
        file="snowflake.png",
        make=snowflake,
    ),
)


def put(path: Path, shape: Shape) -> None:
    """Write a mesh or cloud."""
    path.write_bytes(model_bytes(path.suffix, shape))


def said(command: str, folder: Path) -> str:
    """What a command prints up to its tables, without the seconds it took.

    Raises:
        subprocess.CalledProcessError: the command failed.
    """
    name, *arguments = shlex.split(command)
    done = subprocess.run(
        [sys.executable, "-m", name, *arguments], cwd=folder, capture_output=True, text=True, check=True
    )
    # Seconds would differ from one building to the next.
    return re.sub(r"; [0-9.e+]+ s$", "", done.stdout.partition("\n\n")[0].strip(), flags=re.MULTILINE)


def painted(path: Path) -> bytes:
    """A picture of what is found in a file."""
    if path.suffix in IMAGES:
        return planar(path)
    shape = load(path)
    return smaller(io.BytesIO(picture_png(detect(shape), shape, width=WIDTH, height=HEIGHT, title=False)))


def planar(path: Path) -> bytes:
    """A picture with its mirror lines."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    found = detect_planar(load(path))
    with Image.open(path) as image:
        grey = np.asarray(image.convert("L"))
    figure = Figure(figsize=(WIDTH / 100, HEIGHT / 100), dpi=100)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.02, 1.0, 0.96))
    axes.imshow(grey, cmap="gray", extent=(0, grey.shape[1], 0, grey.shape[0]), vmin=-120)
    for line in found.lines:
        ends = _across(line.line.normal, found.center, 0.58 * found.diagonal)
        axes.plot(*ends.T, color="#d55e00", linewidth=1.8)
    axes.plot(*found.center, "o", color="#0072b2", markersize=8, markeredgecolor="white")
    axes.set_axis_off()
    data = io.BytesIO()
    figure.savefig(data, format="png", facecolor="white", metadata={"Software": None})
    return smaller(data)


def _across(normal: Array, center: Array, half: float) -> Array:
    """Ends [2, 2] of a line about a centre on it."""
    along = np.array([-normal[1], normal[0]])
    return np.stack([center - half * along, center + half * along])


def section(entry: Entry, folder: Path, figures: Path, number: int) -> str:
    """An entry of the page, its picture drawn."""
    entry.make(folder / entry.file, np.random.default_rng(number))
    with whole(figures / entry.name) as draft:
        draft.write_bytes(painted(folder / entry.file))
    commands = entry.commands or (f"symrefine detect {entry.file}",)
    told = "\n".join(f"$ {command}\n{said(command, folder)}" for command in commands)
    return (
        f"## {entry.title}\n\n{entry.remark}\n\n```console\n{told}\n```\n\n"
        f"![{entry.title}: {entry.file} with what was found](figures/{entry.name})\n"
    )


def main(arguments: list[str] | None = None) -> None:
    """Write the page and its pictures."""
    parser = argparse.ArgumentParser(prog="python -m experiments.studies.docs_gallery", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs"), help="folder (default: %(default)s)")
    out: Path = parser.parse_args(arguments).out
    figures = out / "figures"
    figures.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        sections = [section(entry, Path(folder), figures, number) for number, entry in enumerate(ENTRIES)]
    with whole(out / "gallery.md") as draft:
        draft.write_text("\n".join([INTRODUCTION, *sections, ENDING]), encoding="utf-8")


if __name__ == "__main__":
    main()
