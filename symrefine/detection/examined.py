"""What a decision is made from, and what it tells at any tolerance: the chain of groups, each inside the next."""

import math
from dataclasses import dataclass, replace

import numpy as np

from symrefine.decide.chain import excluding
from symrefine.decide.hypotheses import Hypothesis
from symrefine.decide.looks import exact_need
from symrefine.decide.pool import Pool
from symrefine.decide.posterior import ALIKE, Alternative, Decision, Link, decide, least_told, meant, odd
from symrefine.detection.measure import Measured, doubt
from symrefine.detection.sketch import Sample
from symrefine.fit.placed import SAMPLED
from symrefine.fit.vertices import OnVertices, on_vertices
from symrefine.geometry import Mask
from symrefine.groups import PointGroup, is_subgroup
from symrefine.rounding import START_ERROR
from symrefine.shape import Index
from symrefine.surface.misses import SHARES
from symrefine.surface.surface import Surface


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Examined:
    """What a decision is made from: the table of needs as a chain of groups, each inside the next, C1 first.

    Attributes:
        measured: the shape, or the sample that stands for it.
        surface: what judges.
        pool: everything that was tried.
        links: of the chain.
        outliers: indices of the points that are no part of the object, ascending.
        outlier_share: of all points.
        sample: how many points stand for how many, if they stand for more than themselves.
        exact: the group that maps the vertices of a mesh onto one another, where they put it, if that can be told; of
            points of a cloud, where noise leaves nothing else to be told. `proof` is what of it maps the faces, too.
        no_floor: whether it was told that it stands on one, and none was found.
        denied: if points were taken for a clump because they alone speak against it, the group that they leave.
        sparse: whether points stand for themselves though nobody said so: of a surface they are too few to be told.
        hides: whether points that were not, as they seem to be a part of it, alone speak against a larger group.
    """

    measured: Measured
    surface: Surface
    pool: Pool
    links: tuple[Hypothesis, ...]
    outliers: Index
    outlier_share: float
    sample: Sample | None
    exact: OnVertices | None
    proof: OnVertices | None
    no_floor: bool = False
    denied: Hypothesis | None = None
    hides: bool = False
    sparse: bool = False

    def among(self, left: Mask) -> "Examined":
        """The same of all points, of which those of the floor, that others are left of [N], are outliers, too."""
        own, apart = np.flatnonzero(left), float(1.0 - left.mean())
        outliers = np.union1d(np.flatnonzero(~left), own[self.outliers])
        return replace(self, outliers=outliers, outlier_share=apart + (1.0 - apart) * self.outlier_share)

    @property
    def has_strays_left(self) -> bool:
        """Whether so many strays are left beside the surface that what they deny is no evidence.

        More than the share that details may have is lonely, and as many were set apart: thin parts are lonely, too.
        """
        found = len(self.measured.strays) / self.measured.count
        return min(found, float(self.surface.cloud.lonely.mean())) > SHARES[-1]

    def vertices_of(self, found: Hypothesis) -> OnVertices | None:
        """Where the vertices of a mesh put a group of the chain, if it maps them onto one another.

        Those of a cloud, if they were asked.
        """
        known, group = self.exact, found.group
        same = next((k for k in (self.proof, known) if k is not None and k.group.name == group.name), None)
        if same is not None or group.name == "C1" or (known is None and self.measured.shape.faces is None):
            return same
        if known is not None and not group.is_finite:
            return known.rounded(group) if is_subgroup(known.group, group, START_ERROR) else None
        # What corners prove may be less than what all vertices have, where a hole makes corners of a few.
        moments = self.measured.moments
        center, diagonal = moments.restored(found.placed.center), moments.scale * self.surface.diagonal
        return on_vertices(self.measured.shape, group, center, diagonal=diagonal)

    def exact_part(self, found: Hypothesis) -> OnVertices | None:
        """What of a group of the chain maps the vertices of a mesh onto one another, where not all of it does."""
        known, group = self.exact, found.group
        if known is None or known.group.name == "C1" or not group.is_finite:
            return None
        return known if is_subgroup(known.group, group, START_ERROR) else None

    def decided(self, tolerance: float, *, shown: bool = False) -> Decision:
        """The likeliest group of the chain at a tolerance; with `shown` as if what no camera saw kept to the rest."""
        missing = 0.0 if shown else self.surface.unclosed
        # What holds at no tolerance that can be told holds at no smaller one.
        return decide(self.known(tolerance), max(tolerance, self.least), self.surface.floor, unclosed=missing)

    @property
    def proven(self) -> Hypothesis | None:
        """The largest group of the chain that holds by what was not measured, if there is one."""
        return next((h for h in self.links if h.proven), None)

    @property
    def least(self) -> float:
        """The smallest tolerance at which that is read which was measured, if some is proven anyway; else 0."""
        return 0.0 if self.proven is None else least_told(self.surface.floor)

    def known(self, tolerance: float) -> list[Link]:
        """The groups beyond C1 as the decision sees them at a tolerance."""
        needs, links = [*(h.need for h in self.links), math.inf], self.links_at(tolerance)
        return [self._link(h, beyond, tolerance) for h, beyond in zip(links, needs[1:], strict=True)][1:]

    def links_at(self, tolerance: float) -> tuple[Hypothesis, ...]:
        """The links with those of their rivals that exclude them at a tolerance."""
        return excluding(self.links, ALIKE * tolerance)

    def _link(self, found: Hypothesis, beyond: float, tolerance: float) -> Link:
        """A group of the chain, where the next one needs so much."""
        proof = self.proof if self.proven is not None and self.proven.holds(found.placed) else None
        if proof is not None:
            sure = meant(Link(need=proof.miss), tolerance)
        else:
            # At the tolerance that was asked for, so that a larger one takes no group away that a smaller one tells.
            elsewhere = meant(Link(need=found.elsewhere), self.surface.tolerance, self.surface.floor)
            sure = (1.0 - elsewhere) * self._foreign(found) * found.named * found.apart
        return Link.of(found.group, found.need, beyond, believed=found.believed, placed=sure, proven=proof is not None)

    def _foreign(self, found: Hypothesis) -> float:
        """How likely it is that no part of the object was taken for a clump, if that alone speaks against a group."""
        return 1.0 if self.denied is None or self.denied.holds(found.placed) else 1.0 - odd(found.group)

    def link(self, tolerance: float) -> Hypothesis:
        """The likeliest group of the chain at a tolerance, where it stands."""
        return self.links[self.decided(tolerance).index]

    def choices(self, tolerance: float) -> tuple[Alternative, ...]:
        """Every group of the chain, C1 first, as likely as at a tolerance."""
        found = zip(self.links, self.decided(tolerance).probabilities, strict=True)
        return tuple(Alternative(point_group=h.group.name, probability=p, forgiven=h.need) for h, p in found)

    def size(self, tolerance: float) -> tuple[float, float]:
        """Order of the group that is decided, and of what stands for it if that is infinite; 0 if none is."""
        if self.doubt(tolerance):
            return 0.0, 0.0
        return _size(self.link(tolerance).group)

    def rivals(self, tolerance: float) -> list[Hypothesis]:
        """Larger groups than the one that is decided, the ones that need least first."""
        order = self.size(tolerance)
        every = (*self.links, *self.pool.small, *self.pool.failed, *self.pool.turned_down())
        return sorted((h for h in every if _size(h.group) > order), key=lambda h: h.need)

    def doubt(self, tolerance: float) -> str:
        """Why the data support no decision at a tolerance, or nothing if they do."""
        reason = doubt(self.measured, self.surface, tolerance)
        if self.least > tolerance and not self.measured.flaw:
            index = self.decided(tolerance).index
            if index and self.known(tolerance)[index - 1].proven:  # which asks for nothing that was measured
                larger = [h.group.name for h in self.links[index + 1 :] if h.need <= exact_need(self.surface.floor)]
                points = "points" if self.measured.shape.faces is None else "vertices"
                proven = f"its {points} prove {self.links[index].group.name}"
                return f"{reason}; {proven}, and {' or '.join(larger)} may hold as well" if larger else ""
        return reason or self._nothing_carries(tolerance)

    def _nothing_carries(self, tolerance: float) -> str:
        """The groups between which it stands, where even the likeliest is more likely wrong than right."""
        probabilities = self.decided(tolerance, shown=True).probabilities
        if max(probabilities) >= 0.5:
            return ""
        by = sorted(zip(probabilities, self.links, strict=True), key=lambda k: -k[0])
        told = ", ".join(f"{h.group.name} ({100 * p:.0f} %)" for p, h in by[:3])
        return f"no group is more likely than not: {told}"


def _size(group: PointGroup) -> tuple[float, float]:
    return group.order, group.sampled(SAMPLED).order
