"""Which source files a script runs: the closure of its imports, read from the sources without running them."""

import ast
from functools import cache
from itertools import accumulate
from pathlib import Path

import grimp

PACKAGE = "elastocal"


def closure(script: Path, source: Path) -> list[Path]:
    """Source files that a script imports, directly or not.

    Parameters
    ----------
    script : Path
        Imports modules of the package and of its own folder.
    source : Path
        Folder of the package.

    Returns
    -------
    list of Path
        Sorted, without the script itself.
    """
    own, modules = _imports(script), set()
    files = {file for name in own if (file := script.with_name(f"{name}.py")).is_file()}
    for file in (script, *files):
        modules |= _imports(file) & _graph().modules
    modules |= {found for name in modules for found in _graph().find_upstream_modules(name)}
    # With a module come the packages above it.
    names = {package for name in modules for package in accumulate(name.split("."), "{}.{}".format)}
    return sorted(files | {_file(name, source) for name in names if name.split(".")[0] == PACKAGE})


@cache
def _graph() -> grimp.ImportGraph:
    # What is imported for annotations alone changes no result.
    graph = grimp.build_graph(PACKAGE, include_external_packages=True, exclude_type_checking_imports=True, cache_dir=None)
    # A catalogue looks up the modules beside it by itself.
    for catalogue in graph.find_modules_that_directly_import("pkgutil"):
        for module in graph.find_children(catalogue.rpartition(".")[0]):
            if module != catalogue:
                graph.add_import(importer=catalogue, imported=module)
    return graph


@cache
def _imports(file: Path) -> frozenset[str]:
    """Names that a file imports: of modules, or of what is in them."""
    names = set()
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(names)


def _file(module: str, source: Path) -> Path:
    path = source.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
