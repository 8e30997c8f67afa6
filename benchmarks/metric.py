"""A benchmark figure, and its comparison with the stored one."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

STORED = Path(__file__).parent / "stored.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """A figure that is better when smaller; `target` is what the project set itself, `rel_tol` the noise of a rerun."""

    key: str
    value: float
    unit: str
    target: float
    rel_tol: float = 0.4


def report(metrics: Iterable[Metric]) -> list[Metric]:
    """Print each figure beside its target and the stored value as soon as it is known; all of them."""
    stored = json.loads(STORED.read_text()) if STORED.exists() else {}
    print(f"{'figure':44s} {'value':>9s} {'target':>9s} {'stored':>9s}  unit", flush=True)
    found = []
    for m in metrics:
        before = f"{stored[m.key]:9.2f}" if m.key in stored else f"{'-':>9s}"
        verdict = "" if m.value <= m.target else "  over target"
        print(f"{m.key:44s} {m.value:9.2f} {m.target:9.2f} {before}  {m.unit}{verdict}", flush=True)
        found.append(m)
    return found


def regressions(metrics: Sequence[Metric]) -> list[str]:
    """Keys whose value is worse than the stored one by more than the tolerance."""
    stored = json.loads(STORED.read_text()) if STORED.exists() else {}
    return [m.key for m in metrics if m.key in stored and m.value > stored[m.key] * (1.0 + m.rel_tol)]


def store(metrics: Sequence[Metric]) -> None:
    """Make these the stored values."""
    STORED.write_text(json.dumps({m.key: round(m.value, 3) for m in metrics}, indent=2) + "\n")
