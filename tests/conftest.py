"""What every test obeys."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from symrefine.cli import invoke


@pytest.fixture(autouse=True)
def no_signs_of_life(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a slow machine commands tell every ten seconds that they are alive; here stderr tells what went wrong."""
    monkeypatch.setattr("symrefine.cli.signs.EVERY", 3600.0)


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Status, stdout and stderr of a command line in this process."""

    def call(*words: object) -> tuple[int, str, str]:
        status = invoke([str(word) for word in words])
        return status, *capsys.readouterr()

    return call


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Bytes name no test: archives carry the second they were made in, and two workers would disagree."""
    return argname if isinstance(val, bytes) else None
