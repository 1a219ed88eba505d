"""Which source files a script runs: the closure of its imports, read from the sources
without running them."""

import ast
from functools import cache
from itertools import accumulate
from pathlib import Path

import grimp
from grimp.exceptions import SourceSyntaxError

from elastocal.errors import InputError

PACKAGES = ("elastocal", "elastocal_proof")


def closure(script: Path, source: Path, *named: str) -> list[Path]:
    """Source files that a script imports, directly or not.

    `script`: imports modules of the packages and of its own folder. `source`: folder of
    the packages. `named`: modules that it imports because its rule names them. Returns
    sorted, without the script itself. Raises `InputError`: a source file that is no
    Python, such as an effect that is being written.
    """
    files = set()
    left = [script]
    modules = set(named)
    while left:
        file = left.pop()
        files.add(file)
        modules |= _imports(file) & _graph().modules
        left += {
            own
            for name in _imports(file)
            if (own := file.with_name(f"{name}.py")).is_file()
        } - files
    modules |= {found for name in modules for found in _upstream(name)}
    # With a module come the packages above it.
    names = {
        package
        for name in modules
        for package in accumulate(name.split("."), "{}.{}".format)
    }
    files |= {_file(name, source) for name in names if name.split(".")[0] in PACKAGES}
    # And the table beside it that has its name.
    return sorted(
        files - {script}
        | {table for file in files if (table := file.with_suffix(".json")).is_file()}
    )


@cache
def _graph() -> grimp.ImportGraph:
    # What is imported for annotations alone changes no result.
    try:
        graph = grimp.build_graph(
            *PACKAGES,
            include_external_packages=True,
            exclude_type_checking_imports=True,
            cache_dir=None,
        )
    except SourceSyntaxError as error:
        raise _no_python(error.filename, error) from None
    # A catalogue looks up the modules beside it by itself.
    for catalogue in graph.find_modules_that_directly_import("elastocal.io.modules"):
        for module in graph.find_children(catalogue.rpartition(".")[0]):
            if module != catalogue:
                graph.add_import(importer=catalogue, imported=module)
    return graph


@cache
def _upstream(module: str) -> set[str]:
    return _graph().find_upstream_modules(module)


@cache
def _imports(file: Path) -> frozenset[str]:
    """Names that a file imports: of modules, or of what is in them."""
    names = set()
    try:
        tree = ast.parse(file.read_bytes())
    except SyntaxError as error:
        raise _no_python(file, error) from None
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {node.module} | {
                f"{node.module}.{alias.name}" for alias in node.names
            }
    return frozenset(names)


def _no_python(file: Path | str, error: SourceSyntaxError | SyntaxError) -> InputError:
    return InputError(
        file,
        f"line {error.lineno}",
        (error.text or "").strip() or "the end of the file",
        "Python",
    )


@cache
def _file(module: str, source: Path) -> Path:
    path = source.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
