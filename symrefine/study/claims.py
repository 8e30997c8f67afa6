"""Claims of a paper beside our figures and those of others, and which of them ours miss."""

from collections.abc import Sequence
from dataclasses import dataclass

from symrefine.study.experiment import Experiment, Row
from symrefine.study.plan import chosen
from symrefine.study.schema import Claim
from symrefine.study.summary import EMPTY, Summary, short, summarise
from symrefine.study.tables import grid


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """A claim with our figure and those of others, by name.

    `met` is whether ours is as expected; None where nothing is expected or nothing was run.
    """

    claim: Claim
    ours: Summary
    peers: dict[str, Summary]
    met: bool | None

    @property
    def expected(self) -> str:
        """What ours should be, counted as ours is."""
        return self.claim.expect.of(self.ours.total)


def judge(claim: Claim, rows: Sequence[Row], experiment: Experiment) -> Verdict:
    """Our figure and those of others, and whether ours is as expected; a failed run of ours is a miss."""
    own, *others = (
        chosen(rows, (claim.where, who), experiment, [claim.value.column])
        for who in (claim.ours, *claim.peers.values())
    )
    ours = summarise(own, claim.value)
    met = None
    if claim.expect.said and own:
        met = claim.expect.holds(ours) and all(row["error"] is None for row in own)
    peers = {name: summarise(theirs, claim.value) for name, theirs in zip(claim.peers, others, strict=True)}
    return Verdict(claim=claim, ours=ours, peers=peers, met=met)


def verdict_rows(verdicts: Sequence[Verdict]) -> list[Row]:
    """The verdicts as flat rows."""
    return [
        {
            "claim": v.claim.claim,
            "source": v.claim.source,
            "paper": v.claim.paper,
            "ours": v.ours.text,
            "peers": "; ".join(f"{name}: {peer.text}" for name, peer in v.peers.items()),
            "value": v.claim.value.node.value,
            "expected": v.claim.expect.said,
            "met": v.met,
            "unit": v.claim.unit,
            "note": v.claim.note,
        }
        for v in verdicts
    ]


def claims_table(verdicts: Sequence[Verdict]) -> str:
    """A Markdown table: the claim, the paper's figure, ours, those of others, and whether ours holds."""
    peers = list({name: None for v in verdicts for name in v.peers})
    head = ["claim", "where", "paper", "ours", *peers, "as expected"]
    return grid(head, [_line(v, peers) for v in verdicts])


def _line(verdict: Verdict, peers: Sequence[str]) -> list[str]:
    claim = verdict.claim
    figures = [verdict.peers[name].text if name in verdict.peers else "" for name in peers]
    word = "" if verdict.met is None else f"{'yes' if verdict.met else '**no**'} ({verdict.expected})"
    unit = f" {claim.unit}" if claim.unit else ""
    shown = [text + unit if text not in ("", EMPTY) else text for text in (verdict.ours.text, *figures)]
    paper = claim.paper if isinstance(claim.paper, str) else short(claim.paper) + unit
    return [claim.claim, claim.source, paper, *shown, word]
