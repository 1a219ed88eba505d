"""Where the pipeline is that the command runs, with its robots, and where its results are."""

from pathlib import Path

from elastocal.errors import InputError

_SNAKEFILE = "Snakefile"
# Where a wheel has the Snakefile, rules and configuration; see `data-files` in pyproject.toml.
_INSTALLED = f"share/elastocal/{_SNAKEFILE}"


def pipeline() -> Path:
    """The folder with the Snakefile: of the checkout, where there is one, else what this package installed; none is refused."""
    found = _checkout() or _installed()
    if found is None:
        allowed = "a folder inside of a checkout of elastocal, or its wheel installed in an environment"
        raise InputError(Path.cwd(), "", "no Snakefile here or above", allowed)
    return found


def workplace() -> Path:
    """The folder in which results/ and reports/ are: the checkout, where there is one, else the working directory."""
    return _checkout() or Path.cwd()


def _checkout() -> Path | None:
    """The working directory or one above it, else the one that this package is run from."""
    for folder in (Path.cwd(), *Path.cwd().parents, *Path(__file__).resolve().parents):
        if (folder / _SNAKEFILE).is_file() and (folder / "config" / "robots").is_dir():
            return folder
    return None


def _installed() -> Path | None:
    """What the wheel of this package brought, wherever the installer has put it."""
    from importlib import metadata

    try:
        files = metadata.distribution("elastocal").files or []
    except metadata.PackageNotFoundError:
        return None
    found = [Path(str(file.locate())).resolve() for file in files if file.as_posix().endswith(_INSTALLED)]
    return next((file.parent for file in found if file.is_file()), None)
