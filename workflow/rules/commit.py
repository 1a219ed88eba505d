"""The commit that the pipeline is run from, and whether its sources were edited
since."""

import subprocess
from collections.abc import Iterable
from pathlib import Path

UNKNOWN = "unknown"


def commit_of(folder: Path, sources: Iterable[str]) -> str:
    """The commit of a checkout.

    `folder`: top of the checkout. `sources`: what the results are made from: edits
    elsewhere, such as in a page, change no result. Returns the commit, with ``-dirty``
    behind it where sources differ from it; ``unknown`` without a checkout or without
    git.
    """
    # A copy of the sources inside of another repository is not that repository's
    # commit.
    if not (folder / ".git").exists():
        return UNKNOWN
    try:
        commit = _git(folder, "rev-parse", "HEAD")
        edited = _git(folder, "status", "--porcelain", "--", *sources)
    except (OSError, subprocess.CalledProcessError):
        return UNKNOWN
    return f"{commit}-dirty" if edited else commit


def _git(folder: Path, *words: str) -> str:
    # A lock for refreshing git's index would disturb a commit that is under way.
    command = ["git", "--no-optional-locks", "-C", str(folder), *words]
    return subprocess.run(
        command, capture_output=True, text=True, check=True
    ).stdout.strip()
