"""Configs: what is right is read, what is wrong is named with its line and key path."""

from pathlib import Path

import pytest

from experiments.studies.accuracy import DEFAULT, Config
from symrefine.errors import InputError
from symrefine.study.document import read_document
from symrefine.study.typed import typed


def edited(tmp_path: Path, old: str, new: str) -> Path:
    text = DEFAULT.read_text()
    assert old in text
    path = tmp_path / "edited.yaml"
    path.write_text(text.replace(old, new))
    return path


def test_shipped_config_is_read() -> None:
    config = typed(read_document(DEFAULT), Config)
    assert config.table.points == [20000, 5000]
    assert config.table.target_deg[1] == [2 * t for t in config.table.target_deg[0]]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("seeds: 10", "sedes: 10", r":2: sedes: unknown key; expected one of \['seeds'"),
        ("seeds: 10", "seeds: ten", r":2: seeds: expected int, got 'ten'"),
        ("seeds: 10", "seeds: true", r":2: seeds: expected int, got True"),
        ("  points: [20000, 5000]", "  points: [20000, 1.5]", r":4: table.points\[1\]: expected int, got 1.5"),
        ("  points: [20000, 5000]", "  points: 20000", ":4: table.points: expected a list"),
        ("  points: 20000\n", "", "shapes: missing points"),
        ("seeds: 10", "seeds: [10", "not YAML"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        typed(read_document(edited(tmp_path, old, new)), Config)
    assert "\n" not in str(caught.value)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such config file"):
        typed(read_document(tmp_path / "none.yaml"), Config)


def test_numbers_in_exponent_notation_are_numbers(tmp_path: Path) -> None:
    config = typed(read_document(edited(tmp_path, "noise_rel: [0.0, 0.01]", "noise_rel: [0, 1e-2]")), Config)
    assert config.shapes.noise_rel == [0.0, 0.01]
