"""Find the commit that the pipeline runs from, and edits of its sources since then."""

import subprocess
from collections.abc import Iterable
from pathlib import Path

UNKNOWN = "unknown"


def commit_of(folder: Path, sources: Iterable[str]) -> str:
    """Return the commit of a checkout.

    Parameters
    ----------
    folder : Path
        Top of the checkout.
    sources : iterable of str
        Files and folders that results depend on; edits elsewhere, such as in a page,
        do not count.

    Returns
    -------
    str
        The commit, followed by ``-dirty`` if sources were edited; ``unknown`` without a
        checkout or without git.
    """
    # Sources that are copied into another repository do not belong to its commit.
    if not (folder / ".git").exists():
        return UNKNOWN
    try:
        commit = _git(folder, "rev-parse", "HEAD")
        edited = _git(folder, "status", "--porcelain", "--", *sources)
    except (OSError, subprocess.CalledProcessError):
        return UNKNOWN
    return f"{commit}-dirty" if edited else commit


def _git(folder: Path, *words: str) -> str:
    # Without this option git locks its index, which would disturb a concurrent commit.
    command = ["git", "--no-optional-locks", "-C", str(folder), *words]
    return subprocess.run(
        command, capture_output=True, text=True, check=True
    ).stdout.strip()
