"""What studies print, put into pages of the documentation between two markers that bear the study's name."""

from pathlib import Path

from symrefine.errors import InputError


def check(page: Path, name: str) -> None:
    """Refuse, before any work, a page without the markers of a study.

    Raises:
        InputError: no such page, or as `between_markers`.
    """
    if not page.is_file():
        raise InputError(f"{page}: no such page")
    between_markers(page.read_text(encoding="utf-8"), name, "", str(page))


def put(page: Path, name: str, content: str) -> None:
    """Replace what stands between the markers of a study in a page, whole or not at all.

    Raises:
        InputError: as `check`.
    """
    check(page, name)
    write(page, between_markers(page.read_text(encoding="utf-8"), name, content, str(page)))


def between_markers(text: str, name: str, content: str, source: str) -> str:
    """The text with what stands between the two markers of a name replaced.

    Raises:
        InputError: a marker is missing, there twice, or they are the wrong way round.
    """
    begin, end = (f"<!-- {name}:{which} -->" for which in ("begin", "end"))
    if (text.count(begin), text.count(end)) != (1, 1) or text.index(begin) > text.index(end):
        raise InputError(f"{source}: expected the markers {begin} and {end} once each, in this order")
    head, rest = text.split(begin)
    return f"{head}{begin}\n{content.rstrip()}\n{end}{rest.split(end)[1]}"


def write(path: Path, text: str) -> None:
    """Write a text file, whole or not at all."""
    from symrefine.files import replacing

    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as draft:
        draft.write_text(text, encoding="utf-8", newline="")
