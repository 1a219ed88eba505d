"""Which source files a script runs: the closure of its imports, read from the sources without running them."""

import ast
from functools import cache
from itertools import accumulate
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
    for node in _statements(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    modules = _modules(roots)
    # With a module come the packages above it.
    above = {package for name in names for package in accumulate(name.split("."), "{}.{}".format)}
    found = {modules[name] for name in above & modules.keys()}
    # A catalogue looks up the modules beside it by itself.
    return frozenset(found | set(file.parent.glob("*.py")) if "pkgutil" in names else found)


def _statements(tree):
    """Statements at any depth. No expression holds one, so none is looked into: they are nearly all of a tree."""
    waiting = [tree]
    while waiting:
        for node in ast.iter_child_nodes(waiting.pop()):
            if isinstance(node, ast.stmt | ast.excepthandler | ast.match_case):
                waiting.append(node)
                yield node


@cache
def _modules(roots):
    """Files of all modules below `roots`, by name: one listing is quicker than a look for each name."""
    files = [(path, path.relative_to(root).with_suffix("").parts) for root in roots for path in root.rglob("*.py")]
    return {".".join(parts[:-1] if parts[-1] == "__init__" else parts): path for path, parts in files}
