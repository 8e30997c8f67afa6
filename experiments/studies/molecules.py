"""Point groups of molecules, and pymatgen beside us.

    python -m experiments.studies.molecules [--large] [--seeds N] [--tolerances ...] [--jobs N]

The molecules of `molecule_sets` in random poses, with their elements as labels; as they are, and with Gaussian noise of
1 % of the mean bond length on every coordinate. With --large those of `assemblies`, of 101 to 4,000 atoms, with noise
of 3 %; pymatgen, which takes minutes for them, is not asked then.
"""

import argparse
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from itertools import islice
from time import perf_counter

import numpy as np

from experiments.objects.assemblies import ASSEMBLIES
from experiments.objects.molecule_sets import MOLECULES, Molecule, molecule
from experiments.peers.pymatgen_groups import point_group_pymatgen
from experiments.studies.jobs import add_jobs, in_order
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.geometry import Array, random_orthogonal
from symrefine.shape import Shape
from symrefine.surface.misses import TOLERANCE

# An answer is sure from this probability on.
SURE = 0.95
# The group of each, and what makes it.
KNOWN = {name: (group, partial(molecule, name)) for name, (group, _) in MOLECULES.items()} | ASSEMBLIES
NOISE_BOND, NOISE_LARGE = 0.01, 0.03
TOLERANCES = (TOLERANCE, 0.03, 0.04, 0.06)
# In angstroms: its default, and two smaller ones.
PYMATGEN_TOLERANCES = (0.3, 0.1, 0.03)
Row = dict[str, int | float | str | bool | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One molecule once.

    Attributes:
        molecule: its name in `molecule_sets`.
        noise_bond: standard deviation of every coordinate as a fraction of the mean bond length.
        method: who is asked, "symrefine" or "pymatgen".
        tolerance: symrefine's as a fraction of the diagonal; pymatgen's in angstroms.
        seed: of the pose and the noise.
    """

    molecule: str
    noise_bond: float = 0.0
    method: str = "symrefine"
    tolerance: float = TOLERANCE
    seed: int = 0


def check(case: Case) -> None:
    """Whether such a case can be run.

    Raises:  InputError: it cannot.
    """
    if case.molecule not in KNOWN:
        raise InputError(f"molecule: value is {case.molecule!r}, expected one of {', '.join(KNOWN)}")
    if not 0 <= case.noise_bond <= 0.5:
        raise InputError(f"noise_bond: value is {case.noise_bond}, expected a fraction of the bond length in [0, 0.5]")
    if case.method not in ("symrefine", "pymatgen"):
        raise InputError(f"method: value is {case.method!r}, expected 'symrefine' or 'pymatgen'")
    if case.method == "pymatgen" and not has_pymatgen():
        raise InputError("method: value is 'pymatgen', which is not installed; expected 'symrefine', or install it")
    most = 0.2 if case.method == "symrefine" else 2.0
    if not 0 < case.tolerance <= most:
        raise InputError(f"tolerance: value is {case.tolerance}, expected a number in (0, {most:g}]")


def run(case: Case) -> Row:
    """The group of one molecule in a random pose, compared with the truth."""
    check(case)
    truth, made = KNOWN[case.molecule]
    given = made()
    points = posed(given, case)
    start = perf_counter()
    group, doubt, confidence = _asked(given, points, case)
    return {
        "truth": truth,
        "group": group,
        "right": group == truth,
        "sure": confidence >= SURE,
        "atoms": len(given.symbols),
        "undetermined": doubt,
        "detect_s": perf_counter() - start,
    }


def posed(given: Molecule, case: Case) -> Array:
    """The atoms [N, 3] in a random pose, moved by the noise."""
    rng = np.random.default_rng([case.seed, list(KNOWN).index(case.molecule)])
    turn, shift = random_orthogonal(rng), rng.uniform(-5, 5, 3)
    noise = rng.normal(scale=case.noise_bond * given.mean_bond, size=given.positions.shape)
    return (given.positions + noise) @ turn.T + shift


def _asked(given: Molecule, points: Array, case: Case) -> tuple[str, bool, float]:
    """The answer, whether it was called undetermined, and how sure it is."""
    if case.method == "pymatgen":
        try:
            return point_group_pymatgen(given.symbols, points, case.tolerance), False, 1.0
        except (ValueError, ArithmeticError, IndexError, np.linalg.LinAlgError) as error:
            return f"error: {error}", False, 0.0
    found = detect(Shape(points, labels=np.array(given.numbers), elements=True), tolerance=case.tolerance)
    return found.point_group, bool(found.undetermined), found.confidence


def has_pymatgen() -> bool:
    """Whether pymatgen is installed here."""
    return find_spec("pymatgen") is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """What stands in one line of the table: all molecules once for each seed."""

    method: str
    tolerance: float
    noise_bond: float
    seeds: int
    names: Sequence[str]

    def cases(self) -> list[Case]:
        """One after the other."""
        return [
            Case(molecule=name, noise_bond=self.noise_bond, method=self.method, tolerance=self.tolerance, seed=seed)
            for name in self.names
            for seed in range(self.seeds)
        ]


def main() -> None:
    """Print how many groups are right, by method, tolerance and noise, and every miss."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10, help="poses and noises of each molecule")
    parser.add_argument("--tolerances", type=float, nargs="*", default=TOLERANCES, help="fractions of the diagonal")
    parser.add_argument("--large", action="store_true", help="those of hundreds and thousands of atoms")
    add_jobs(parser)
    options = parser.parse_args()
    names, noisy = (ASSEMBLIES, NOISE_LARGE) if options.large else (MOLECULES, NOISE_BOND)
    groups = len({group for group, _ in (KNOWN[name] for name in names)})
    print(f"{len(names)} molecules of {groups} groups; {options.seeds} seeds where there is noise")
    asked: list[tuple[str, float]] = [("symrefine", t) for t in options.tolerances]
    if has_pymatgen():
        asked += [("pymatgen", t) for t in PYMATGEN_TOLERANCES if not options.large]
    else:
        print("pymatgen is not installed: pip install pymatgen, to see it beside us")
    blocks = [
        Block(method=method, tolerance=tolerance, noise_bond=noise, seeds=seeds, names=tuple(names))
        for method, tolerance in asked
        for noise, seeds in ((0.0, 1), (noisy, options.seeds))
    ]
    rows = in_order(run, [case for block in blocks for case in block.cases()], options.jobs)
    for block in blocks:
        cases = block.cases()
        report(block, [case.molecule for case in cases], list(islice(rows, len(cases))))


def report(block: Block, names: Sequence[str], rows: Sequence[Row]) -> None:
    """Print one line, and the molecules that came out wrong."""
    right = sum(bool(row["right"]) for row in rows)
    false = sum(bool(row["sure"]) and not row["right"] for row in rows)
    scale = "of the diagonal" if block.method == "symrefine" else "angstrom"
    seconds = np.median([float(row["detect_s"] or 0) for row in rows])
    print(
        f"\n{block.method}, tolerance {block.tolerance:g} {scale}, noise {block.noise_bond:.0%} of the bond: "
        f"right {right} of {len(rows)} ({right / len(rows):.1%}), sure and wrong {false}, "
        f"median {1000 * seconds:.0f} ms",
        flush=True,
    )
    every = zip(names, rows, strict=True)
    wrong = Counter((name, str(row["truth"]), str(row["group"])) for name, row in every if not row["right"])
    for (name, truth, group), count in sorted(wrong.items()):
        print(f"  {name}: {truth} -> {group}, {count} of {block.seeds}")


if __name__ == "__main__":
    main()
