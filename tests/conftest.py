"""What every test obeys."""

from __future__ import annotations


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Bytes name no test: archives carry the second they were made in, and two workers would disagree."""
    return argname if isinstance(val, bytes) else None
