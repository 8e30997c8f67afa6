"""Speed as ratios measured in one run, against a primitive or a peer."""

import os

# Before numpy is imported: spinning BLAS threads would count as work.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
