"""How n-tuples are written down: as exact polynomials in the moments, and these as text, JSON, LaTeX and Python.

A moment m_(p1..pn) is named by its exponents (p1, .., pn); a monomial is a product of moments, one exponent tuple for
each factor; a component is a sum of integer coefficients times monomials; an n-tuple has n components.
"""

import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from symrefine.geometry import Array

Exponents = tuple[int, ...]
Monomial = tuple[Exponents, ...]
Component = tuple[tuple[int, Monomial], ...]
NTuple = tuple[Component, ...]
Kind = Literal["polar", "axial", "affine"]

# Moments to a line: in LaTeX it stays within the page.
_WIDTH = 8
# Vectors up to which a basis is worth shortening for the eye (about a second).
_READABLE = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class NTupleBasis:
    """Exact basis of all n-tuples of one vector of moments v^(kk'..)_(pp'..).

    Attributes:
        dim: n, the dimension of the space.
        orders: the moment orders of the factors, ascending; a repeated order is a power of the same moment vector.
        tuples: the basis, n components each; the coefficients of an n-tuple are integers without a common divisor.
        kinds: the law each n-tuple x obeys: "polar" x(RX) = R x(X), "axial" x(RX) = det(R) R x(X) for orthogonal R,
            "affine" x(AX) = det(A)^det_power A x(X) for every linear A.
        det_power: w of the affine law; 0 for the others.
        note: why there are no n-tuples, where there are none.
    """

    dim: int
    orders: tuple[int, ...]
    tuples: tuple[NTuple, ...]
    kinds: tuple[Kind, ...]
    det_power: int = field(default=0)
    note: str = field(default="")

    def __len__(self) -> int:
        return len(self.tuples)

    @property
    def mass_power(self) -> int:
        """Power of m_0..0 that turns the affine law of a density into x(AX) = A x(X), up to sign(det A)^det_power.

        A density has m_p(AX) = |det A| times what a discrete set has: once for each factor, and once for m_0..0.
        """
        return self.det_power + len(self.orders)

    @property
    def moments(self) -> tuple[Exponents, ...]:
        """Exponents of every moment that occurs, by order and then as the paper lists them: m_200, m_110, .., m_002."""
        found = {e for t in self.tuples for c in t for _, monomial in c for e in monomial}
        return tuple(sorted(found, key=lambda e: (sum(e), tuple(-p for p in e))))

    def evaluate(self, moments: Mapping[Exponents, float]) -> Array:
        """Values [k, n] of the k n-tuples for moments given by their exponents."""
        values = np.zeros((len(self.tuples), self.dim))
        for row, ntuple in enumerate(self.tuples):
            for column, component in enumerate(ntuple):
                values[row, column] = sum(c * math.prod(moments[e] for e in monomial) for c, monomial in component)
        return values


def law(basis: NTupleBasis, kind: Kind) -> str:
    """The law of transformation as one line of text."""
    if kind == "polar":
        return "x(RX) = R x(X) for every orthogonal R, det R = +1 and -1"
    if kind == "axial":
        return "x(RX) = det(R) R x(X) for every orthogonal R: turns as a vector, is reflected as a pseudo-vector"
    return (
        f"x(AX) = det(A)^{basis.det_power} A x(X) for every linear A and discrete set X; "
        f"for a density, x / m_{'0' * basis.dim}^{basis.mass_power} takes A alone"
        + (" up to the sign of det A" if basis.det_power % 2 else "")
    )


def title(basis: NTupleBasis) -> str:
    """One line: how many n-tuples, of what, where."""
    noun = {2: "doublet", 3: "triplet"}.get(basis.dim, f"{basis.dim}-tuple")
    plural = "" if len(basis) == 1 else "s"
    counts = ", ".join(f"{n} {kind}" for kind, n in Counter(basis.kinds).items())
    head = f"{len(basis)} {noun}{plural} of {vector_name(basis.orders)} in {basis.dim}-D"
    return f"{head}: {counts}" if counts else head


def vector_name(orders: tuple[int, ...]) -> str:
    """The paper's name of the vector of moments: (2, 2, 3) is v^(2,1)_(2,3)."""
    powers = Counter(orders)
    return f"v^({','.join(map(str, powers.values()))})_({','.join(map(str, powers))})"


# --- a readable basis -------------------------------------------------------------------------------------------------


def primitive(vector: Sequence[int]) -> list[int]:
    """The vector without common divisor, its first entry that is not 0 positive."""
    leading = next((c for c in vector if c), 0)
    scale = math.gcd(*vector) * (1 if leading > 0 else -1)
    return [c // scale for c in vector] if scale else list(vector)


def shortened(vectors: list[list[int]], sizes: Sequence[int]) -> list[list[int]]:
    """A basis of the same space with fewer terms: while adding a multiple of one vector to another shortens it, do so.

    Long bases stay as they are: the search is quadratic in their length, and nobody reads them.

    Args:
        vectors: linearly independent integer vectors.
        sizes: how many terms an entry of the vectors stands for.
    """
    basis = [primitive(v) for v in vectors]
    changed = len(basis) <= _READABLE
    while changed:
        changed = False
        for k, target in enumerate(basis):
            candidates = (_best_combination(target, other, sizes) for j, other in enumerate(basis) if j != k)
            best = min((c for c in candidates if c), key=lambda v: _length(v, sizes), default=target)
            if _length(best, sizes) < _length(target, sizes):
                basis[k], changed = best, True
    return basis


def _length(vector: Sequence[int], sizes: Sequence[int]) -> tuple[int, int]:
    return sum(s for c, s in zip(vector, sizes, strict=True) if c), sum(map(abs, vector))


def _best_combination(target: list[int], other: list[int], sizes: Sequence[int]) -> list[int]:
    """The multiple of `other` that cancels the most terms of `target`; empty if none are shared."""
    cancelled: Counter[tuple[int, int]] = Counter()
    for a, b, size in zip(target, other, sizes, strict=True):
        if a and b:
            divisor = math.gcd(a, b) * (1 if b > 0 else -1)
            cancelled[a // divisor, b // divisor] += size
    if not cancelled:
        return []
    (a, b), _ = min(cancelled.items(), key=lambda item: (-item[1], item[0]))
    return primitive([b * t - a * o for t, o in zip(target, other, strict=True)])


# --- text -------------------------------------------------------------------------------------------------------------


def to_text(basis: NTupleBasis) -> str:
    """Readable list: title, law, and every component, a few terms a line."""
    lines, factors = [title(basis)], len(basis.orders)
    lines += [basis.note] if basis.note else []
    lines += [f"{kind}: {law(basis, kind)}" for kind in dict.fromkeys(basis.kinds)]
    for number, (ntuple, kind) in enumerate(zip(basis.tuples, basis.kinds, strict=True), start=1):
        lines += ["", f"x_v{number} ({kind})"]
        for axis, component in enumerate(ntuple, start=1):
            head = f"  [{axis}] "
            lines += _wrapped(_signed_terms(component, _text_monomial), head, " " * len(head), _WIDTH // factors)
    return "\n".join(lines) + "\n"


def _written(monomial: Monomial, moment: Callable[[Exponents], str], power: str, times: str = " ") -> str:
    """A product of moments, repeated ones as powers."""
    return times.join(moment(e) + (power.format(k) if k > 1 else "") for e, k in Counter(monomial).items())


def _text_moment(exponents: Exponents) -> str:
    # A letter of its own and the separator "_": in Python no exponents can collide with each other or with a parameter.
    return "m" + ("" if max(exponents) < 10 else "_").join(map(str, exponents))


def _text_monomial(monomial: Monomial) -> str:
    return _written(monomial, _text_moment, "^{}")


def _signed_terms(component: Component, write: Callable[[Monomial], str], times: str = " ") -> list[str]:
    """Terms with their signs, "+ 2 m20 m12"; the first one bare if positive."""
    terms = []
    for position, (coefficient, monomial) in enumerate(component):
        sign = "- " if coefficient < 0 else "+ " if position else ""
        size = f"{abs(coefficient)}{times}" if abs(coefficient) != 1 else ""
        terms.append(sign + size + write(monomial))
    return terms


def _wrapped(terms: list[str], head: str, indent: str, per_line: int) -> list[str]:
    """The terms, a few a line, the first line after `head`, the others after `indent`."""
    step = max(1, per_line)
    chunks = [" ".join(terms[k : k + step]) for k in range(0, len(terms), step)]
    return [(indent if k else head) + chunk for k, chunk in enumerate(chunks)]


# --- JSON -------------------------------------------------------------------------------------------------------------


def to_json(basis: NTupleBasis) -> str:
    """JSON: `tuples[k][i]` is the list of `[coefficient as a string, [[p1..pn] of each factor]]` of component i."""
    tuples = [[[[str(c), [list(e) for e in m]] for c, m in comp] for comp in ntuple] for ntuple in basis.tuples]
    head = {
        "dim": basis.dim,
        "orders": list(basis.orders),
        "kinds": list(basis.kinds),
        "laws": {kind: law(basis, kind) for kind in dict.fromkeys(basis.kinds)},
        "det_power": basis.det_power,
        "note": basis.note,
    }
    return json.dumps({**head, "tuples": tuples}, separators=(",", ":")) + "\n"


# --- LaTeX ------------------------------------------------------------------------------------------------------------


def to_latex(basis: NTupleBasis, *, document: bool = True) -> str:
    """LaTeX with amsmath only: one `align*` for each n-tuple; a whole document, or its body alone."""
    body = [f"% {title(basis)}"] + ([f"% {basis.note}"] if basis.note else [])
    for number, ntuple in enumerate(basis.tuples, start=1):
        lines = [line for axis, c in enumerate(ntuple, start=1) for line in _latex_component(c, number, axis)]
        body += [r"\begin{align*}", " \\\\\n".join(lines), r"\end{align*}"]
    text = "\n".join(body) + "\n"
    return f"{_latex_preamble(basis)}{text}\\end{{document}}\n" if document else text


def _latex_preamble(basis: NTupleBasis) -> str:
    powers = Counter(basis.orders)
    name = f"v^{{({','.join(map(str, powers.values()))})}}_{{({','.join(map(str, powers))})}}"
    return (
        "\\documentclass{article}\n\\usepackage{amsmath}\n\\allowdisplaybreaks\n\\begin{document}\n"
        f"\\noindent The $n$-tuples of ${name}$ for $n = {basis.dim}$: {len(basis)}.\n"
    )


def _latex_component(component: Component, number: int, axis: int) -> list[str]:
    head = f"x_{{\\mathrm{{v}}{number},{axis}}} &= "
    factors = len(component[0][1])
    return _wrapped(_signed_terms(component, _latex_monomial), head, r"&\quad ", _WIDTH // factors)


def _latex_monomial(monomial: Monomial) -> str:
    return _written(monomial, _latex_moment, "^{{{}}}")


def _latex_moment(exponents: Exponents) -> str:
    return f"m_{{{('' if max(exponents) < 10 else ',').join(map(str, exponents))}}}"


# --- Python -----------------------------------------------------------------------------------------------------------


def to_python(basis: NTupleBasis, *, name: str = "ntuples") -> str:
    """Source of a function `name(m)` that evaluates the n-tuples, lists of n values, from moments given by exponents.

    The values may be numbers of any kind, or arrays of one shape. Sums are built a few terms a line: an expression of
    thousands of terms would exceed the depth that Python's compiler accepts.
    """
    lines, factors = [f"def {name}(m):", f'    """{title(basis)}."""'], len(basis.orders)
    lines += [f"    {_text_moment(e)} = m[{', '.join(map(str, e))}]" for e in basis.moments]
    names = [[f"x{k}_{axis}" for axis in range(1, basis.dim + 1)] for k in range(1, len(basis) + 1)]
    for ntuple, row in zip(basis.tuples, names, strict=True):
        for component, variable in zip(ntuple, row, strict=True):
            terms = _signed_terms(component, _python_monomial, times=" * ")
            lines += _wrapped(terms, f"    {variable} = ", f"    {variable} = {variable} ", _WIDTH // factors)
    lines += ["    return [", *(f"        [{', '.join(row)}]," for row in names), "    ]"]
    return "\n".join(lines) + "\n"


def _python_monomial(monomial: Monomial) -> str:
    return _written(monomial, _text_moment, "**{}", " * ")
