"""Which source files a script runs: the closure of its imports, read from the sources without running them."""

import ast
from functools import cache
from pathlib import Path


def closure(script, roots):
    """Source files that a script imports, directly or not.

    Parameters
    ----------
    script : Path
    roots : sequence of Path
        Folders in which modules are looked up; imports that are in none of them are somebody else's.

    Returns
    -------
    list of Path
        Sorted, without the script itself.
    """
    found, waiting = set(), [Path(script)]
    while waiting:
        for file in _imported(waiting.pop(), tuple(roots)) - found:
            found.add(file)
            waiting.append(file)
    return sorted(found)


@cache
def _imported(file, roots):
    names = set()
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    found = {path for name in names for root in roots for path in _files(name, root)}
    # A catalogue looks up the modules beside it by itself.
    return frozenset(found | set(file.parent.glob("*.py")) if "pkgutil" in names else found)


def _files(name, root):
    """A module and the packages above it, where `root` has them."""
    parts = name.split(".")
    candidates = [root.joinpath(*parts[:depth], "__init__.py") for depth in range(1, len(parts) + 1)]
    candidates.append(root.joinpath(*parts).with_suffix(".py"))
    return [path for path in candidates if path.is_file()]
