"""`make bench`: every benchmark beside its target and the stored figure (`--store` keeps them, `--gate` compares)."""

import argparse
import sys

from benchmarks import alignment, detection
from benchmarks.metric import regressions, report, store


def main() -> int:
    """Run, print, and return 1 if gated and something got slower."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--store", action="store_true", help="keep these figures for later comparisons")
    parser.add_argument("--gate", action="store_true", help="fail where a figure is worse than the stored one")
    options = parser.parse_args()
    found = [*detection.metrics(), *alignment.metrics()]
    report(found)
    if options.store:
        store(found)
    worse = regressions(found) if options.gate else []
    for key in worse:
        print(f"slower than stored: {key}")
    return 1 if worse else 0


if __name__ == "__main__":
    sys.exit(main())
