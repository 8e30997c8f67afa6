"""The lists of n-tuples that the paper offers for download: several orders in 2-, 3- and 4-D, and affine ones.

    python -m experiments.studies.tuple_lists [--out DIR]

writes DIR/<dim>d_<orders>.txt and .json for each vector of moments, affine_<dim>d_<orders> for the affine n-tuples, and
DIR/index.txt with one line for each.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from symrefine.ntuples.affine import derive_affine
from symrefine.ntuples.derive import derive
from symrefine.ntuples.notation import NTupleBasis, title, to_json, to_text

# 2-D: the ten vectors of the paper's section "Experiments in 2D space", single orders and three factors.
ORDERS: dict[int, tuple[tuple[int, ...], ...]] = {
    2: (
        (3,), (5,), (7,), (2, 3), (2, 5), (3, 4), (4, 5), (3, 6), (5, 6), (6, 7), (6, 9), (7, 8), (8, 9),
        (2, 2, 3), (3, 3, 3), (2, 3, 4), (2, 2, 5), (2, 2, 2, 3),
    ),
    3: (
        (3,), (5,), (7,), (2, 3), (2, 5), (3, 4), (4, 5), (3, 6), (5, 6), (6, 7), (7, 8), (8, 9),
        (2, 2, 3), (3, 3, 3), (2, 3, 4), (2, 2, 5), (3, 4, 4), (2, 2, 2, 3),
    ),
    4: ((3,), (5,), (2, 3), (2, 5), (3, 4), (4, 5), (2, 2, 3), (3, 3, 3)),
}  # fmt: skip
AFFINE_ORDERS: dict[int, tuple[tuple[int, ...], ...]] = {
    2: ((2, 3), (3, 4), (4, 5), (2, 2, 3), (2, 2, 5), (2, 3, 4), (3, 4, 4)),
    3: ((2, 2, 3), (4, 4, 5), (3, 3, 3, 4), (2, 2, 4, 5), (2, 3, 3, 5), (2, 3, 4, 4), (2, 2, 2, 3, 4)),
    4: ((2, 2, 2, 3),),
}


def bases() -> Iterator[tuple[str, NTupleBasis]]:
    """File name and basis of every list."""
    for dim, several in ORDERS.items():
        for orders in several:
            yield f"{dim}d_{'_'.join(map(str, orders))}", derive(dim, orders)
    for dim, several in AFFINE_ORDERS.items():
        for orders in several:
            yield f"affine_{dim}d_{'_'.join(map(str, orders))}", derive_affine(dim, orders)


def write_lists(out: Path) -> list[str]:
    """Writes every list below `out`; the lines of its index."""
    out.mkdir(parents=True, exist_ok=True)
    lines = []
    for name, basis in bases():
        (out / f"{name}.txt").write_text(to_text(basis), encoding="utf-8")
        (out / f"{name}.json").write_text(to_json(basis), encoding="utf-8")
        power = f", det^{basis.det_power}" if basis.det_power else ""
        lines.append(f"{name}: {title(basis)}{power}")
    (out / "index.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return lines


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; 2 if the folder cannot be written."""
    parser = argparse.ArgumentParser(description="Write lists of moment n-tuples as text and JSON.")
    parser.add_argument("--out", type=Path, default=Path("out/tuple_lists"), help="folder (default: out/tuple_lists)")
    out = parser.parse_args(argv).out
    try:
        lines = write_lists(out)
    except OSError as error:
        print(f"tuple_lists: cannot write to {out}: {error.strerror}", file=sys.stderr)
        return 2
    print("\n".join([*lines, f"{len(lines)} lists in {out}"]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
