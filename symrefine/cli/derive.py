"""`symrefine derive`: the exact n-tuples of a dimension and vector of moments."""

import argparse
from typing import TYPE_CHECKING

from symrefine.cli.outputs import STDOUT, check_outputs, say, write_all
from symrefine.cli.signs import waiting
from symrefine.cli.values import natural, orders
from symrefine.errors import InputError
from symrefine.files import text_writer

if TYPE_CHECKING:
    from symrefine.ntuples.notation import NTupleBasis

HELP = "derive n-tuples of moments exactly, in any dimension"
DESCRIPTION = (
    "Derive all vectors made of moments that turn with the object (n-tuples: doublets in 2-D, triplets in 3-D), as "
    "exact polynomials with integer coefficients. Prints them as text unless told otherwise."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("--dim", type=natural, required=True, metavar="N", help="dimension of the space, from 2")
    parser.add_argument(
        "--orders", type=orders, required=True, metavar="P,Q", help="order of each factor: 3, or 2,3, or 2,2,3"
    )
    parser.add_argument(
        "--affine", action="store_true", help="those that follow every linear map, up to a power of its determinant"
    )
    parser.add_argument("--json", metavar="FILE|-", help="write them as JSON; - is stdout, with nothing else")
    parser.add_argument("--latex", action="store_true", help="print a LaTeX document")
    parser.add_argument("--python", action="store_true", help="print a Python function that evaluates them")


def run(args: argparse.Namespace) -> int:
    """Derive and write in the form asked for."""
    chosen = [f"--{name}" for name in ("latex", "python") if getattr(args, name)]
    chosen += ["--json -"] if args.json == STDOUT else []
    if len(chosen) > 1:
        raise InputError(f"{' and '.join(chosen)} both write to stdout; choose one")
    check_outputs({"--json": args.json}, [])
    from symrefine.ntuples import notation

    with waiting("deriving"):
        basis = _basis(args)
    if args.json not in (None, STDOUT):
        write_all({args.json: text_writer(notation.to_json(basis))})
    write = notation.to_latex if args.latex else notation.to_python if args.python else notation.to_text
    say((notation.to_json if args.json == STDOUT else write)(basis))
    return 0


def _basis(args: argparse.Namespace) -> "NTupleBasis":
    from symrefine.ntuples.affine import derive_affine
    from symrefine.ntuples.derive import derive

    return (derive_affine if args.affine else derive)(args.dim, args.orders)
