"""Digests of source files: of a module that of its syntax tree without docstrings, so an edit of a comment is no edit.

To parse all modules takes seconds, so the digests are kept by the bytes of the files that they are of.
"""

from __future__ import annotations

import ast
import hashlib
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from elastocal.io.json_files import read_json, write_json
from elastocal.io.texts import check_file

if TYPE_CHECKING:
    from collections.abc import Iterable

_KEPT = Path(".snakemake/source_digests.json")
_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def source_digest(path: str | Path) -> str:
    """SHA-256 of a module's syntax tree without docstrings; of its bytes where a file is no Python."""
    check_file(path)
    content = Path(path).read_bytes()
    digest = hashlib.sha256(content).hexdigest()
    return digest if Path(path).suffix != ".py" else _kept().get(digest) or _of_tree(content, digest)


def keep_source_digests(paths: Iterable[str | Path]) -> None:
    """Keep the digests of modules for the jobs of this run and for later runs."""
    contents = {hashlib.sha256(content).hexdigest(): content for content in map(Path.read_bytes, map(Path, paths))}
    if contents.keys() - _kept().keys():
        _KEPT.parent.mkdir(parents=True, exist_ok=True)
        write_json(_KEPT, {digest: _of_tree(content, digest) for digest, content in contents.items()})


@cache
def _kept() -> dict[str, str]:
    try:
        return dict(read_json(_KEPT))
    except (OSError, ValueError):
        return {}


@cache
def _of_tree(content: bytes, otherwise: str) -> str:
    try:
        tree = ast.parse(content)
    except (SyntaxError, ValueError):
        return otherwise
    for node in ast.walk(tree):
        if isinstance(node, _DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            node.body.pop(0)
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest()
