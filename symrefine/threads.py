"""One thread for the linear algebra: answers depend on no setting of threads, and small products wait for nobody.

Sums that are shared out among threads are added in another order, which moves the last digits of an answer. And most
products here are so small that threads wait for one another longer than they work: on two cores an alignment took twice
the processor time, and no less of the clock.
"""

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController


class _State(threading.local):
    """Whether a thread of Python is within."""

    within = False


_state = _State()
# Held by the thread of Python that holds those of the linear algebra back.
_holder = threading.Lock()


@contextmanager
def one_thread() -> Iterator[None]:
    """No threads of OpenMP and of the linear algebra within; afterwards what was set before.

    GNU's OpenMP hangs in every process that is forked after it made some. Linear algebra whose threads are those of the
    process has one setting for all threads of Python: there the first of them holds it until it leaves.
    """
    if _state.within:  # as in every query of a tree
        yield
        return
    with ExitStack() as held:
        held.enter_context(_libraries("openmp").limit(limits=1))
        if _holder.acquire(blocking=False):  # whoever came later would take 1 for what was set before, and leave that
            held.callback(_holder.release)
            held.enter_context(_libraries("blas").limit(limits=1))
        _state.within = True
        try:
            yield
        finally:
            _state.within = False


@cache
def _libraries(kind: str) -> "ThreadpoolController":
    """Of one kind of what makes threads in numpy and pykdtree, which is loaded first lest it is missed.

    What limits some of the libraries of a controller sets all of them back afterwards: so each kind has its own.
    """
    import pykdtree.kdtree  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController().select(user_api=kind)
