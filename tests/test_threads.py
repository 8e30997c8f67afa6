"""The linear algebra has one thread while something is detected or aligned, and what it had before afterwards."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController, threadpool_limits

import symrefine
from symrefine.threads import one_thread

# Pools of the libraries that the product computes with; others may be loaded by the tests.
OURS = ("openblas", "mkl", "blis", "flexiblas")
SETTINGS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
with one_thread():
    """Loads them."""


def counts() -> list[int]:
    return [lib.num_threads for lib in ThreadpoolController().lib_controllers if lib.internal_api in OURS]


def test_what_was_set_comes_back_however_it_ends() -> None:
    with threadpool_limits(2):
        before = counts()
        with one_thread(), one_thread():
            assert set(counts()) == {1}
        assert counts() == before
        with pytest.raises(ValueError, match="told"), one_thread():
            raise ValueError("told")
        assert counts() == before


def test_threads_of_python_that_are_within_at_once_leave_what_was_set() -> None:
    script = """
from threading import Barrier, Thread
from tests.test_threads import counts, one_thread
before, met = counts(), Barrier(2, timeout=30)
def work():
    with one_thread():
        met.wait()
        assert set(counts()) == {1}
        met.wait()
threads = [Thread(target=work) for _ in range(2)]
for t in threads: t.start()
for t in threads: t.join()
assert set(before) == {2} and counts() == before, (before, counts())
with one_thread():
    assert set(counts()) == {1}
"""
    environment = os.environ | dict.fromkeys(SETTINGS, "2")
    subprocess.run([sys.executable, "-c", script], check=True, timeout=120, env=environment)


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["detect(one)", "align(one, other)"])
def test_an_answer_has_the_same_bytes_with_any_number_of_threads(verb: str) -> None:
    script = f"""
import json, numpy as np, symrefine
from experiments.objects.built_symmetry import specimen
from experiments.objects.shapes import sample
mesh, _ = specimen("household", "asymmetric")
rng = np.random.default_rng(1)
one, other = sample(mesh, 20000, 0.005, rng), sample(mesh, 20000, 0.005, rng) @ np.diag([1.0, -1.0, 1.0])
told = symrefine.{verb}.to_dict()
told.pop("timings")
print(json.dumps(told))
"""
    answers = []
    for threads in ("1", "2"):
        environment = os.environ | dict.fromkeys(SETTINGS, threads)
        done = subprocess.run(
            [sys.executable, "-c", script], check=True, timeout=120, env=environment, capture_output=True, text=True
        )
        answers.append(done.stdout)
    assert answers[0] == answers[1]
    assert json.loads(answers[0])


def test_more_threads_are_left_to_others_afterwards() -> None:
    with threadpool_limits(2):
        before = counts()
        symrefine.detect(np.random.default_rng(0).normal(size=(600, 3)))
        assert counts() == before
