"""Find the source files that a script runs.

They are the closure of its imports, read from the sources without running them.
"""

import ast
from functools import cache
from itertools import accumulate
from pathlib import Path

import grimp
from grimp.exceptions import SourceSyntaxError

from elastocal.errors import InputError

PACKAGES = ("elastocal", "elastocal_proof")
DATA_SUFFIXES = (".csv", ".json", ".yaml")


def closure(script: Path, source: Path, *named: str) -> list[Path]:
    """Return the source files that a script imports, directly or indirectly.

    Parameters
    ----------
    script : Path
        Imports modules of the packages and of its own folder.
    source : Path
        Folder of the packages.
    *named : str
        Modules that the script imports because its rule names them.

    Returns
    -------
    list of Path
        Sorted, without the script itself.

    Raises
    ------
    InputError
        If a source file is not valid Python, such as an effect that is being written.
    """
    files = _files_in_own_folder(script)
    modules = set(named)
    for file in files:
        modules |= _imports(file) & _graph().modules
    modules |= {upstream for name in modules for upstream in _upstream(name)}
    for name in modules:
        # A module is imported with the packages that contain it.
        for package in accumulate(name.split("."), "{}.{}".format):
            if package.split(".")[0] in PACKAGES:
                files.add(_file(package, source))
    # A module may read a data file that stands beside it under the same name.
    for file in [*files]:
        data_files = map(file.with_suffix, DATA_SUFFIXES)
        files |= {data_file for data_file in data_files if data_file.is_file()}
    return sorted(files - {script})


def _files_in_own_folder(script: Path) -> set[Path]:
    """Return a script and the files of its folder that it imports."""
    files: set[Path] = set()
    pending = [script]
    while pending:
        file = pending.pop()
        files.add(file)
        siblings = {file.with_name(f"{name}.py") for name in _imports(file)}
        pending += {sibling for sibling in siblings if sibling.is_file()} - files
    return files


@cache
def _graph() -> grimp.ImportGraph:
    # Imports that only annotations need change no result.
    try:
        graph = grimp.build_graph(
            *PACKAGES,
            include_external_packages=True,
            exclude_type_checking_imports=True,
            cache_dir=None,
        )
    except SourceSyntaxError as error:
        raise _invalid_python(error.filename, error) from None
    # A catalogue imports all modules of its package by their names.
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
    """Return the names that a file imports: modules, or objects in them."""
    names = set()
    try:
        tree = ast.parse(file.read_bytes())
    except SyntaxError as error:
        raise _invalid_python(file, error) from None
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {node.module} | {
                f"{node.module}.{alias.name}" for alias in node.names
            }
    return frozenset(names)


def _invalid_python(
    file: Path | str, error: SourceSyntaxError | SyntaxError
) -> InputError:
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
