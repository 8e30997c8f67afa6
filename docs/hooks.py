"""What mkdocs calls while it builds the site: text made from the code, so that it cannot lag behind.

`[[help detect]]` in a page becomes the help of that command, `[[schema]]` the JSON schema of the package. What the
package has on its front page is headed by its name there.
"""

import io
import json
import os
import re
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import symrefine
from symrefine.cli import invoke

ROOT = Path(__file__).resolve().parents[1]
SCHEMA = ROOT / "symrefine" / "schema" / "detection.schema.json"
# Settings of the notebooks' kernels, apart from those of who builds: no start-up files, no history, and silence about
# sockets of this machine that are not encrypted.
IPYTHON = ROOT / ".make" / "ipython"
KERNEL = {"IPKernelApp": {"log_level": "ERROR"}, "HistoryManager": {"enabled": False}}


def on_config(config: Any) -> Any:
    """Prepare what runs the notebooks."""
    profile = IPYTHON / "profile_default"
    profile.mkdir(parents=True, exist_ok=True)
    (profile / "ipython_kernel_config.json").write_text(json.dumps(KERNEL), encoding="utf-8")
    os.environ["IPYTHONDIR"] = str(IPYTHON)
    return config


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The text of a page with what it asks for."""
    markdown = re.sub(r"^\[\[help (\w+)\]\]$", lambda m: fenced(usage(m[1]), "text"), markdown, flags=re.MULTILINE)
    markdown = re.sub(r"^::: symrefine\.[\w.]*\b(\w+)$", headed, markdown, flags=re.MULTILINE)
    return markdown.replace("[[schema]]", schema())


def headed(asked: re.Match[str]) -> str:
    """What mkdocstrings is asked to show, headed `symrefine.detect` if that is how it is reached."""
    name = asked[1]
    if name not in symrefine.__all__:
        return asked[0]
    return f"{asked[0]}\n    options:\n      heading: symrefine.{name}\n      toc_label: {name}"


def usage(command: str) -> str:
    """What `symrefine COMMAND --help` prints, whatever the terminal."""
    os.environ["COLUMNS"] = "100"  # argparse asks for it
    with redirect_stdout(io.StringIO()) as said:
        status = invoke([command, "--help"])
    if status:
        raise ValueError(f"symrefine {command} --help ends with status {status}")
    return said.getvalue()


def schema() -> str:
    """The schema as it lies in the package."""
    if not SCHEMA.is_file():
        return "This version of the package holds no schema file yet."
    return fenced(SCHEMA.read_text(encoding="utf-8"), "json")


def fenced(text: str, language: str) -> str:
    """A block of code."""
    return f"```{language}\n{text.strip()}\n```"
