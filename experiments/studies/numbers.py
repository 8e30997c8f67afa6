"""The numbers that stand at module level in the product's core, what each is for, and where it comes from.

    python -m experiments.studies.numbers [--kind KIND ...]

Counted is every upper-case name at the top of a module that is bound to a number, or to a tuple, list or dictionary of
numbers, in all rooms but those at the edges: commands, configs, files that are written, pages, pictures, recordings,
fleets. Its sentence is the comment above it in the source, its kind stands in the table here. A number without one of
the two is told, and `tests/test_numbers.py` fails.
"""

import argparse
import ast
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2] / "symrefine"
# Rooms that make no answer: they ask for one, or show, write and send what came out.
EDGES = {"cli", "study", "load", "export", "report", "picture", "viewer", "symmetrize", "fleet"}
KINDS = {
    "decides": "which group, map or point counts, and how sure: change it by a half, and some answer changes",
    "looks": "how much is looked at, where first and for how long: more costs time, and hardly an answer changes",
    "rounding": "what floating-point numbers and written digits leave",
    "limit": "what is refused, or done otherwise because it is too large or too many",
    "told": "what is told or drawn, and how long",
    "given": "mathematics, units, the paper, the layout of an array",
}
# By kind and module, relative to the core.
KIND_OF = {
    "decides": {
        "align.moment_fit": "MISFIT",
        "align.judge": "ITS_OWN",
        "align.shown": "MOST",
        "align.procrustes": "SIGNIFICANT",
        "align.rivals": "GOOD",
        "align.span": "SHARED",
        "align.sides": "RADII",
        "decide.ends": "KEPT PLACES",
        "decide.doubts": "STRAY",
        "decide.maps": "WELL NOTHING LEAD SHARE UNLIKE DENIED SURE",
        "decide.place": "SUPPORTED",
        "decide.posterior": "EVEN STEEPNESS EVEN_MIRROR ALIKE ALONE UNKNOWN BLURRED BROKEN "
        "EVEN_PICTURE EVEN_PICTURE_MIRROR STEEPNESS_PICTURE",
        "detection.measure": "HIDDEN",
        "detection.sketch": "BEYOND",
        "fit.finite": "NEAR ALIKE LAX CLEAN",
        "groups.axial": "_ACCIDENTS",
        "groups.elements": "DIRECTION_ERROR_RAD",
        "groups.orthogonal": "ROUGH",
        "ndim.sampled": "TURN_RAD",
        "ndim.search": "ALLOWED",
        "ntuples.rank": "SIGNIFICANT FLOOR",
        "plane.outline": "LEVELS LONGER NOISES",
        "plane.raster": "FEWEST JOINED",
        "propose.maps": "COMMON SAME",
        "surface.cameras": "WITHIN",
        "surface.clumps": "CLUMP COUNTERPART FILLED SIZES FRACTIONS",
        "surface.floor": "THICK",
        "surface.misses": "LIMITS SHARES SPECK SPECK_LIMIT ATOM_LIMITS SURE RIM",
        "surface.neighbourhoods": "WIDEST FLAT WIRE VOLUME WIDEST_BLOB",
        "surface.openings": "ASIDE OPEN FAR_ASIDE BENDS EVIDENT MOST PARTED",
        "surface.sampling": "ALONG FAR DENSER",
        "texture": "COLOUR_TOLERANCE RARE",
        "rounding": "TOLERANCE",
        "shape": "FEW SAME_MASS",
        "propose.folds": "LEAK",
    },
    "looks": {
        "align.landscape": "GRID GRID_DEGREE",
        "align.moment_fit": "LONGEST",
        "align.pair": "THIN REACH",
        "align.judge": "WORTH MOST_MAPS MIRRORS",
        "align.polish": "COARSE",
        "align.scaled": "WIDEST STEP",
        "align.shown": "COARSER MOST_PLANES MOVED",
        "align.sides": "ORDERS",
        "decide.explore": "LOOKED",
        "decide.hypotheses": "MOVED MOVED_EACH",
        "decide.looks": "COARSE GLANCED ASIDE",
        "decide.place": "HALVED",
        "detection.masses": "ORDER",
        "detection.measure": "PLANES SAMPLES",
        "detection.sketch": "MANY SAMPLE",
        "fit.anchors": "LEVER AROUND PROBES",
        "fit.matching": "ROBUST SCALE_FLOOR AGREE",
        "fit.placed": "FREE_TURNS SAMPLED FITTED",
        "fit.refine": "MAX_OUTER SETTLED WITHIN_NOISE LONGEST SHORT",
        "fit.vertices": "NEAR",
        "moments.moments": "BLOCK WAVES PARTS",
        "ndim.matched": "FIRST",
        "ndim.sampled": "LOW HIGH STARTS",
        "plane.outline": "OUTLINED STEPS",
        "poses.mean": "_STARTS",
        "propose.candidates": "PRIMES ON_AXIS LONGEST",
        "propose.folds": "BINS_PER_ORDER CHANCE",
        "propose.maps": "AROUND WITHIN PLANES MATCHES INVARIANT SEEDS TOLD ROUNDS",
        "propose.signatures": "SHELLS BINS",
        "propose.spectrum": "DIRECTIONS THIN",
        "propose.votes": "VOTERS AGREE_RAD TOLD DIRECTIONS FEET",
        "rounding": "START_ERROR",
        "stream": "CHUNK",
        "surface.cameras": "RAYS BESIDE",
        "surface.drift": "CELLS REACH",
        "surface.floor": "TRIALS FITS",
        "surface.misses": "DISCS",
        "surface.neighbourhoods": "NEIGHBOURS",
        "surface.openings": "NEIGHBOURS",
        "surface.painted": "FACES CHANCES",
        "surface.sampling": "LAST",
        "surface.surface": "PATCHES HOPELESS",
        "surface.skin": "AROUND",
        "surface.surroundings": "ASKED AROUND",
        "surface.tree": "LEAF ROW",
        "surface.wedge": "ACROSS PARTS",
        "texture": "_CELL",
        "samples": "GLANCE LOOK COUNT FOLLOWED",
        "surface.clumps": "SPARSE",
    },
    "rounding": {
        "align.moment_fit": "ROUNDING",
        "fit.vertices": "ROUNDED",
        "groups.axial": "_EXACT",
        "moments.harmonics": "FLOOR",
        "plane.raster": "_OFF",
        "poses.given": "_IDENTITY_RAD",
        "poses.symmetry": "_WRITTEN",
        "rounding": "SINGLE DOUBLE",
        "survey": "COARSE",
    },
    "limit": {
        "detection.textured": "MOST",
        "errors": "LONGEST",
        "fit.anchors": "LARGEST CANDIDATES",
        "geometry": "_AT_ONCE",
        "groups.names": "MAX_FOLD CLOSED_FOLD TURNS",
        "ndim.detection": "LARGEST_DIM",
        "ndim.roots": "MOST",
        "ndim.search": "HIGH_DIM",
        "ntuples.derive": "MONOMIAL_LIMIT UNKNOWN_LIMIT",
        "plane.raster": "SPARSE",
        "poses.given": "_MEET_REL",
        "review.cards": "MOST",
        "review.decisions": "LARGEST LONGEST_NOTE",
        "shape": "CAMERAS LARGEST",
        "rounding": "LARGEST_TOLERANCE",
        "units": "SCALES_MM",
    },
    "told": {
        "decide.posterior": "NEAR LEAST",
        "detection.story": "LADDER",
        "detection.verification": "BINS",
        "front.answers": "SIZE",
        "front.lines": "LABEL TOLD",
        "ntuples.notation": "_WIDTH _READABLE",
        "review.objects": "PICTURE _QUALITY",
        "survey": "SPARSE SPARSE_VOLUME",
        "units": "EVERYDAY_M",
    },
    "given": {
        "fit.residual": "SIZE",
        "groups.standard": "GOLDEN",
        "ntuples.contract": "PAPER_ORDERS",
        "ntuples.nullspace": "_LARGEST_PRIME",
        "plane.doublets": "PLANAR_ORDERS",
        "surface.openings": "TELLING",
        "surface.tree": "APART",
        "surface.surface": "NEAREST_SPREAD",
        "units": "METRES",
    },
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Number:
    """A number of the core: where it stands, what it is bound to, its kind and sentence, each empty if it has none."""

    module: str
    name: str
    value: str
    kind: str
    sentence: str

    @property
    def room(self) -> str:
        """The folder, or the module that is a room by itself."""
        return self.module.split(".")[0]


def numbers(root: Path = ROOT) -> list[Number]:
    """All numbers of the core, by module and line."""
    kinds = {(module, name): kind for kind, of in KIND_OF.items() for module, ns in of.items() for name in ns.split()}
    return [
        Number(module=module, name=name, value=value, kind=kinds.get((module, name), ""), sentence=sentence)
        for module, source in _modules(root)
        for name, value, sentence in _numbers_of(source)
    ]


def stale(found: Sequence[Number]) -> set[str]:
    """What the table here knows and the core does not have, or has twice."""
    there = {f"{n.module}.{n.name}" for n in found}
    known = Counter(f"{m}.{n}" for of in KIND_OF.values() for m, names in of.items() for n in names.split())
    return {name for name, times in known.items() if name not in there or times > 1}


def _modules(root: Path) -> Iterator[tuple[str, str]]:
    for path in sorted(root.rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        if parts[0] not in EDGES:
            yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path.read_text(encoding="utf-8")


def _numbers_of(source: str) -> Iterator[tuple[str, str, str]]:
    """Name, value and sentence of each."""
    lines, sentence, last = source.splitlines(), "", 0
    for node in ast.parse(source).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign):
            continue
        above = _comment_above(lines, node.lineno)
        # Numbers that follow one another without a gap share a sentence.
        sentence = above or (sentence if node.lineno == last + 1 else "")
        last = node.end_lineno or node.lineno
        names = _names(node)
        if names and node.value is not None and _is_number(node.value):
            each = node.value.elts if len(names) > 1 and isinstance(node.value, ast.Tuple) else [node.value]
            yield from ((name, ast.unparse(value), sentence) for name, value in zip(names, each, strict=True))


def _comment_above(lines: Sequence[str], number: int) -> str:
    first = number - 1
    while first > 0 and lines[first - 1].startswith("# "):
        first -= 1
    return " ".join(line.removeprefix("# ") for line in lines[first : number - 1])


def _names(node: ast.Assign | ast.AnnAssign) -> list[str]:
    """Upper-case names that are bound; none if others are among them."""
    target = node.targets[0] if isinstance(node, ast.Assign) else node.target
    each = target.elts if isinstance(target, ast.Tuple) else [target]
    names = [e.id for e in each if isinstance(e, ast.Name)]
    return names if all(name.isupper() for name in names) else []


def _is_number(node: ast.expr) -> bool:
    """Whether an expression is a number, is computed, or holds or takes one."""
    match node:
        case ast.Constant(value=value):
            return isinstance(value, int | float) and not isinstance(value, bool)
        case ast.Tuple(elts=each) | ast.List(elts=each) | ast.Set(elts=each) | ast.Dict(values=each):
            return any(map(_is_number, each))
        case ast.Call(args=each):
            return any(map(_is_number, each))
        case ast.BinOp() | ast.UnaryOp():
            return True
    return False


def report(found: Sequence[Number], kinds: Sequence[str]) -> Iterator[str]:
    """The numbers of some kinds with their sentences, then how many there are of each kind, as lines."""
    for kind in kinds:
        yield f"{kind}: {KINDS[kind]}"
        said = ""
        for n in (n for n in found if n.kind == kind):
            yield f"  {n.module}.{n.name} = {n.value}"
            if n.sentence != said:
                yield f"      {n.sentence}"
            said = n.sentence
        yield ""
    for n in found:
        if not (n.kind and n.sentence):
            yield f"{n.module}.{n.name} has no {'sentence' if n.kind else 'kind'}"
    rooms = {kind: Counter(n.room for n in found if n.kind == kind) for kind in KINDS}
    yield f"{len(found)} numbers at module level in the core"
    for kind, by in rooms.items():
        yield f"{by.total():4d} {kind:8s} " + ", ".join(f"{room} {count}" for room, count in by.most_common())


def main(arguments: list[str] | None = None) -> None:
    """Print what decides, and the counts."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.studies.numbers",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--kind", nargs="+", choices=KINDS, default=["decides"], help="to list (default: decides)")
    print("\n".join(report(numbers(), parser.parse_args(arguments).kind)))


if __name__ == "__main__":
    main()
