"""Put the source of the site together: the repository's own pages, and pages made of
the code, its schemas and docstrings.

Usage: python docs/site/assemble.py FOLDER, from the top of the repository, with the
figures of `snakemake signatures` there. A page that did not change keeps its date, so
that Sphinx reads again only what did.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import catalogue
import commands
import file_formats
import interface
import interpretations

REPOSITORY = Path(__file__).resolve().parents[2]
SIGNATURES = REPOSITORY / "reports" / "figures" / "signatures"
# Pages that are read where the repository is hosted as well.
PAGES = (
    "*.md",
    "docs/**/*.md",
    "config/*.md",
    "data/**/*.md",
    "results/*.md",
    "reports/*.md",
    "benchmarks/*.md",
)
# Of the site alone.
NO_PAGES = ("docs/site/index.md",)
# In Markdown and in HTML.
LINK = re.compile(r"\]\(([^)#\s]+)")


def repository_pages() -> list[Path]:
    """Every page of the repository, relative to its top."""
    files = {
        path.relative_to(REPOSITORY)
        for pattern in PAGES
        for path in REPOSITORY.glob(pattern)
    }
    return sorted(path for path in files if path.as_posix() not in NO_PAGES)


def linked_files(page: Path) -> set[Path]:
    """Files of the repository to which one of its pages links, relative to its top;
    pictures too."""
    text = (REPOSITORY / page).read_text(encoding="utf-8")
    paths = {
        (REPOSITORY / page.parent / link).resolve()
        for link in LINK.findall(text)
        if "://" not in link
    }
    return {path.relative_to(REPOSITORY) for path in paths if path.is_file()}


def made_pages() -> dict[str, str]:
    """Pages made of the code, by their paths in the source of the site."""
    return {
        "reference/effects.rst": catalogue.page(),
        "reference/commands.md": commands.page(),
        "reference/interpretations.md": interpretations.page(),
        **{
            f"reference/files/{name}": text
            for name, text in file_formats.pages().items()
        },
        "reference/interface.rst": interface.page(),
    }


def assemble(folder: Path) -> None:
    """Make the source of the site in a folder; an unchanged page keeps its date."""
    pages = repository_pages()
    files = {Path("docs/site/index.md"): Path("index.md")}
    files |= {page: page for page in pages}
    files |= {file: file for page in pages for file in linked_files(page)}
    files |= {
        path.relative_to(REPOSITORY): Path("signatures") / path.name
        for path in sorted(SIGNATURES.glob("*.svg"))
    }
    contents = {
        folder / name: (REPOSITORY / file).read_bytes() for file, name in files.items()
    }
    contents |= {
        folder / name: text.encode("utf-8") for name, text in made_pages().items()
    }
    for path in folder.rglob("*"):
        if path.is_file() and path not in contents:
            path.unlink()
    for path, content in contents.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_bytes() != content:
            path.write_bytes(content)


if __name__ == "__main__":
    assemble(Path(sys.argv[1]))
