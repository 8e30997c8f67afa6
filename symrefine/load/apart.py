"""A Python of its own for libraries that never end on a damaged file, or end the process that they work in."""

import os
import subprocess
import sys

from symrefine.errors import InputError

LONGEST_S = 120.0


def apart(code: str, data: bytes, *arguments: str, doing: str) -> "subprocess.CompletedProcess[bytes]":
    """What became of code that finds data on its stdin.

    Args:
        arguments: of `sys.argv`, from the second on.
        doing: what it is for, as a participle.

    Raises:
        InputError: it takes longer than `LONGEST_S`.
    """
    try:
        return subprocess.run(
            [sys.executable, "-c", code, *arguments],
            input=data,
            capture_output=True,
            timeout=LONGEST_S,
            check=False,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},  # each thread takes of the memory that the code may have
        )
    except subprocess.TimeoutExpired:
        raise InputError(f"cannot be {doing} within {LONGEST_S:g} s; the file may be damaged") from None
