"""Check what a package index will show of wheels and sdists: status 1 if anything is wrong.

    description.py [--repository ADDRESS] FILE...

The long description is rendered as PyPI does it (readme_renderer). No picture and no link may be relative, as there is
nothing that it could be relative to; a link within the page must find its heading. With an address the pictures must be
there, and the links of the project.
"""

import argparse
import sys
import tarfile
import zipfile
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

from packaging.metadata import Metadata
from readme_renderer import markdown


class Page(HTMLParser):
    """What a page points to, and what in it can be pointed to."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.pictures = 0
        self.ids: set[str] = set()
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note its addresses and its name."""
        self.pictures += tag == "img"
        for name, value in attrs:
            if name in {"href", "src"}:
                self.targets.append(value or "")
            elif name == "id":
                self.ids.add(value or "")


def metadata(path: Path) -> bytes:
    """METADATA of a wheel, PKG-INFO of an sdist."""
    if path.suffix == ".whl":
        with zipfile.ZipFile(path) as wheel:
            return wheel.read(next(name for name in wheel.namelist() if name.endswith(".dist-info/METADATA")))
    with tarfile.open(path) as sdist:
        member = sdist.extractfile(path.name.removesuffix(".tar.gz") + "/PKG-INFO")
        assert member is not None
        return member.read()


def troubles(raw: bytes, repository: str) -> Iterator[str]:
    """What is wrong with metadata, a line each."""
    described = Metadata.from_email(raw, validate=True)
    html = markdown.render(described.description or "")
    if not html:
        yield "the long description cannot be rendered"
        return
    page = Page(html)
    yield from lost(page)
    if repository:
        if not page.pictures:
            yield "the pictures of README are missing"
        for name in ("Homepage", "Documentation", "Changelog", "Issues"):
            if not (described.project_urls or {}).get(name, "").startswith(repository):
                yield f"Project-URL does not name {name} in {repository}"


def lost(page: Page) -> Iterator[str]:
    """What of a page points to nowhere."""
    places = {name.removeprefix("user-content-") for name in page.ids}
    for target in page.targets:
        if target.startswith("#"):
            name = target.removeprefix("#").removeprefix("user-content-")
            if name not in places:
                yield f"no heading for the link to #{name}"
        elif not target.startswith("https://"):
            yield f"a relative picture or link is left: {target}"


def main(paths: list[Path], repository: str) -> int:
    """Status 1 and a line for each trouble."""
    found = [f"error: {path.name}: {trouble}" for path in paths for trouble in troubles(metadata(path), repository)]
    if len({metadata(path) for path in paths}) > 1:
        found.append(f"error: {', '.join(path.name for path in paths)} do not say the same")
    print("\n".join(found), end="\n" if found else "", file=sys.stderr)
    return bool(found)


if __name__ == "__main__":
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--repository", default="", help="the address that the metadata should have")
    asked.add_argument("paths", nargs="+", type=Path, metavar="FILE")
    sys.exit(main(**vars(asked.parse_args())))
