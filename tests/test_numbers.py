"""The numbers at module level: each of the core has a kind and a sentence, and the command tells them."""

import pytest

from experiments.studies.numbers import KINDS, main, numbers, stale

FOUND = numbers()


def test_every_number_has_a_kind_and_a_sentence() -> None:
    missing = [f"{n.module}.{n.name}" for n in FOUND if not (n.kind and n.sentence)]
    assert not missing, f"a comment above it says where it comes from, KIND_OF what it is for: {missing}"


def test_the_table_knows_each_number_once_and_no_other() -> None:
    assert not stale(FOUND)


def test_what_is_counted(tmp_path) -> None:
    (tmp_path / "cli").mkdir()
    (tmp_path / "cli" / "a.py").write_text("# An edge.\nWIDE = 80\n")
    (tmp_path / "room.py").write_text(
        "import math\n\n# Half of\n# a whole.\nHALF, THIRD = 0.5, 1 / 3\nALIKE = [1, 2]\n\n"
        "LONE: float = math.sqrt(2.0)\nON = True\nNAME = 'x'\nlower = 3\nSAME = HALF\n"
    )
    seen = [(n.module, n.name, n.value, n.kind, n.sentence) for n in numbers(tmp_path)]
    assert seen == [
        ("room", "HALF", "0.5", "", "Half of a whole."),
        ("room", "THIRD", "1 / 3", "", "Half of a whole."),
        ("room", "ALIKE", "[1, 2]", "", "Half of a whole."),
        ("room", "LONE", "math.sqrt(2.0)", "", ""),
    ]


@pytest.mark.parametrize("kind", KINDS)
def test_the_command_lists_and_counts(kind, capsys) -> None:
    main(["--kind", kind])
    listed, counted = capsys.readouterr().out.split(f"{len(FOUND)} numbers at module level")
    of_kind = [n for n in FOUND if n.kind == kind]
    assert all(f"{n.module}.{n.name} = {n.value}\n" in listed for n in of_kind)
    assert f"{len(of_kind):4d} {kind}" in counted
