"""Find the source files that a script runs.

They are the closure of its imports, read from the sources without running them.
"""

import ast
from functools import cache
from itertools import accumulate
from operator import attrgetter
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
        files |= _files_of_module(name, source)
    for file in [*files]:
        files |= _data_files(file)
    # The parts of paths compare faster than the paths, and alike.
    return sorted(files - {script}, key=attrgetter("parts"))


def _files_in_own_folder(script: Path) -> set[Path]:
    """Return a script and the files of its folder that it imports."""
    files: set[Path] = set()
    pending = [script]
    while pending:
        file = pending.pop()
        files.add(file)
        pending += _imported_siblings(file) - files
    return files


# The rules share most of their modules, so the questions to the disk are cached.
@cache
def _imported_siblings(file: Path) -> frozenset[Path]:
    """Return the files of a script's folder that it imports itself."""
    siblings = (file.with_name(f"{name}.py") for name in _imports(file))
    return frozenset(sibling for sibling in siblings if sibling.is_file())


@cache
def _files_of_module(module: str, source: Path) -> frozenset[Path]:
    """Return the file of a module of the packages and those of the packages that contain
    it, which are imported with it."""
    names = accumulate(module.split("."), "{}.{}".format)
    return frozenset(
        _file(name, source) for name in names if name.split(".")[0] in PACKAGES
    )


@cache
def _data_files(file: Path) -> frozenset[Path]:
    """Return the data files that a module may read, because they stand beside it under
    the same name."""
    data_files = map(file.with_suffix, DATA_SUFFIXES)
    return frozenset(data_file for data_file in data_files if data_file.is_file())


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
