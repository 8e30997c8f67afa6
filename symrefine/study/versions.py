"""What a row was made with: the code's commit, with a mark for changes that are not committed, and the libraries."""

import hashlib
import subprocess
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

# Column to the names that the library may be installed under.
LIBRARIES = {"numpy": ("numpy",), "scipy": ("scipy",), "casadi": ("casadi",), "open3d": ("open3d-cpu", "open3d")}
_PACKAGE = Path(__file__).parents[1]


def library_versions() -> Mapping[str, str]:
    """Versions of the libraries that compute; "-" for one that is not installed."""
    return {column: _installed(names) for column, names in LIBRARIES.items()}


def _installed(names: tuple[str, ...]) -> str:
    for name in names:
        try:
            return version(name)
        except PackageNotFoundError:
            continue
    return "-"


def code_version(experiment: str, root: Path) -> str:
    """The git commit of the package; outside of git the package's version.

    Where the Python files of the package or around the experiment differ from the commit, `+dirty.` and a hash of
    their contents follow, so that two different states never carry the same name.

    Args:
        experiment: name of the module.
        root: directory that the name counts from.
    """
    package, dot, _ = experiment.partition(".")
    # A folder of the name of a lone module is none of its code: its results may go there.
    top = (root / package).resolve() if dot else root.resolve()
    files = [*_PACKAGE.rglob("*.py"), *(top.rglob("*.py") if dot else top.glob("*.py"))]
    # A package that is installed inside of somebody's repository is no part of it.
    commit = _git("rev-parse", "--short=10", "HEAD") if _git("ls-files", "--error-unmatch", __file__) else None
    if commit is None:
        return f"symrefine {version('symrefine')}+{_digest(files)}"
    changes = _git("status", "--porcelain", "--untracked-files=all", "--", str(_PACKAGE), str(top))
    if changes is None or not dot:  # the experiment stands outside of the package's repository
        return f"{commit}+{_digest(files)}"
    dirty = any(line.rstrip('"').endswith(".py") for line in changes.splitlines())
    return f"{commit}+dirty.{_digest(files)}" if dirty else commit


def _git(*arguments: str) -> str | None:
    try:
        done = subprocess.run(
            ["git", "-C", str(_PACKAGE), "--no-optional-locks", *arguments], capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()


def _digest(files: list[Path]) -> str:
    digest = hashlib.sha256()
    for path in sorted(files):
        digest.update(f"{path.parent.name}/{path.name}\n".encode() + path.read_bytes())
    return digest.hexdigest()[:8]
