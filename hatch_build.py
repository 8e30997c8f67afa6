"""What a package index is told beyond pyproject.toml: README as it can show it, and where the repository is.

README points into its checkout by relative links, which lead nowhere from a package index. With the address of the
repository (`tool.hatch.metadata.hooks.custom` in pyproject.toml) they are made absolute, at the tag of the version, so
that the page of an old version goes on showing its own pictures; without it none is left.
"""

import re
from pathlib import Path
from typing import Any
from urllib.parse import urljoin

from hatchling.metadata.plugin.interface import MetadataHookInterface

# Code, fenced or in a line, which stays as it is; a picture that is a paragraph; a picture or link.
TOKEN = re.compile(
    r"(?P<code>^```.*?^```$|`[^`\n]+`)"
    r"|(?P<paragraph>^!\[[^\]]*\]\((?P<lone>[^()\s]+)\)\n\n)"
    r"|(?P<picture>!?)\[(?P<words>[^\]]*)\]\((?P<target>[^()\s]+)\)",
    re.MULTILINE | re.DOTALL,
)
ABSOLUTE = re.compile(r"[a-z]+:|#", re.IGNORECASE)  # an address, or a place on the same page


class CustomMetadataHook(MetadataHookInterface):
    """Called by hatchling for every wheel and sdist."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Put the long description and the addresses of the project into the metadata, in place."""
        repository = str(self.config.get("repository", "")).rstrip("/")
        if repository and not re.fullmatch(r"https://[^\s/]+/\S+", repository):
            raise ValueError(
                f"tool.hatch.metadata.hooks.custom.repository is {repository!r}; expected https://HOST/PATH"
            )
        tag = f"v{metadata['version']}"
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": long_description(text, repository, tag)}
        metadata["urls"] = urls(repository, tag)


def urls(repository: str, tag: str) -> dict[str, str]:
    """Where a package index links to; nothing without a repository."""
    if not repository:
        return {}
    return {
        "Homepage": repository,
        "Documentation": f"{repository}/blob/{tag}/docs/index.md",
        "Changelog": f"{repository}/blob/{tag}/CHANGELOG.md",
        "Issues": f"{repository}/issues",
    }


def long_description(text: str, repository: str, tag: str) -> str:
    """README with absolute links and pictures; without a repository, links as their words and no pictures."""

    def seen_from_afar(token: re.Match[str]) -> str:
        target = token["target"] or token["lone"]
        if token["code"] or ABSOLUTE.match(target):
            return token[0]
        if repository:
            kind = "raw" if token["lone"] or token["picture"] else "blob"
            return token[0].replace(f"]({target})", f"]({urljoin(f'{repository}/{kind}/{tag}/', target)})")
        return "" if token["lone"] or token["picture"] else token["words"]

    return TOKEN.sub(seen_from_afar, text)
