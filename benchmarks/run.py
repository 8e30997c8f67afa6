"""`make bench`: every benchmark beside its target and the stored figure (`--store` keeps them, `--gate` compares).

Some minutes; `--full` (`make bench BENCH_ARGS=--full`) goes to the ends of every range: 10,000,000 points in memory,
100,000,000 in chunks, 1,000,000 faces, all objects, and peers as far as patience lasts.
"""

import argparse
import sys
from itertools import chain

from benchmarks import alignment, damage, detection, everyday, growth
from benchmarks.metric import regressions, report, store


def main() -> int:
    """Run, print, and return 1 if gated and something got slower."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true", help="to the ends of every range, which takes half an hour")
    parser.add_argument("--store", action="store_true", help="keep these figures for later comparisons")
    parser.add_argument("--gate", action="store_true", help="fail where a figure is worse than the stored one")
    options = parser.parse_args()
    full = options.full
    parts = (
        detection.metrics(),
        damage.metrics(every=2 if full else 6),
        everyday.metrics(full=full),
        growth.metrics(full=full),
        alignment.metrics(full=full),
    )
    found = report(chain.from_iterable(parts))
    if options.store:
        store(found)
    worse = regressions(found) if options.gate else []
    for key in worse:
        print(f"slower than stored: {key}")
    return 1 if worse else 0


if __name__ == "__main__":
    sys.exit(main())
