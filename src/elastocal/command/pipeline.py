"""Where the pipeline is that the command runs, with its robots, where its results are, and a diagnosed campaign among them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from elastocal.command.terminal import print_lines
from elastocal.errors import InputError

if TYPE_CHECKING:
    from elastocal.loop.calibrated_files import Diagnosed

_SNAKEFILE = "Snakefile"
# Where a wheel has the Snakefile, rules and configuration; see `data-files` in pyproject.toml.
_INSTALLED = f"share/elastocal/{_SNAKEFILE}"
PhysicsOnly = Annotated[
    bool, Option("--physics-only", help="Leave out the regression on what the model leaves: correct by named effects alone.")
]


def pipeline() -> Path:
    """The folder with the Snakefile: of the checkout, where there is one, else what this package installed; none is refused."""
    found = _checkout() or _installed()
    if found is None:
        allowed = "a folder inside of a checkout of elastocal, or its wheel installed in an environment"
        raise InputError(Path.cwd(), "", "no Snakefile here or above", allowed)
    return found


def robots() -> Path:
    """The folder of the robot files that campaigns name."""
    return pipeline() / "config" / "robots"


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


def diagnosed_campaign(folder: Path) -> Diagnosed:
    """A campaign with what its diagnosis found, as `load_diagnosed`; results by other libraries or pins come with a warning."""
    from elastocal.io.origin import environment
    from elastocal.loop.calibrated_files import load_diagnosed

    found = load_diagnosed(folder, robots(), workplace())
    was, now = found.origin["environment"], environment(pipeline())
    if other := [name for name in sorted(was | now) if was.get(name) != now.get(name)]:
        from rich.console import Console

        there, here = (", ".join(f"{name} {each.get(name, 'none')[:12]}" for name in other) for each in (was, now))
        print_lines([f"warning: {folder} was diagnosed with {there}; here are {here}"], Console(stderr=True))
    return found
