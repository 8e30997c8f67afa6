"""One thread for the linear algebra: answers depend on no setting of threads, and small products wait for nobody.

Sums that are shared out among threads are added in another order, which moves the last digits of an answer. And most
products here are so small that threads wait for one another longer than they work: on two cores an alignment took twice
the processor time, and no less of the clock.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController


class _State(threading.local):
    """Whether a thread of Python is within."""

    within = False


_state = _State()


@contextmanager
def one_thread() -> Iterator[None]:
    """No threads of OpenMP and of the linear algebra within; afterwards what was set before.

    GNU's OpenMP hangs in every process that is forked after it made some. Linear algebra whose threads are those of the
    process has one setting for all threads of Python: there the first of them holds it until it leaves.
    """
    if _state.within:  # as in every query of a tree
        yield
        return
    with _controller().limit(limits=1):
        _state.within = True
        try:
            yield
        finally:
            _state.within = False


@cache
def _controller() -> "ThreadpoolController":
    """Of what makes threads in numpy, scipy and pykdtree, which are loaded first lest one of them is missed."""
    import pykdtree.kdtree  # noqa: F401
    import scipy.linalg  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
