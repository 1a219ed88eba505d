"""A diagnosed campaign as the subcommands that use its result find it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from elastocal.command.pipeline import pipeline, workplace
from elastocal.command.printed import print_lines
from elastocal.errors import InputError

if TYPE_CHECKING:
    from elastocal.loop.calibrated_files import Diagnosed

AcceptEnvironment = Annotated[
    bool, Option("--accept-environment", help="Use results of other library versions, with a warning.")
]
PhysicsOnly = Annotated[
    bool, Option("--physics-only", help="Leave out the regression on what the model leaves: correct by named effects alone.")
]


def diagnosed_campaign(folder: Path, accept_environment: bool = False, physics_only: bool = False) -> Diagnosed:
    """A campaign with what its diagnosis found, from the results of the pipeline, and what held-out poses said of its errors.

    An InputError refuses what `load_diagnosed` does, and results of another environment unless that is accepted: then a warning
    says so.
    """
    from elastocal.io.origin import environment
    from elastocal.loop.calibrated_files import load_diagnosed

    found = load_diagnosed(folder, pipeline() / "config" / "robots", workplace(), physics_only)
    was, now = found.origin["environment"], environment(pipeline())
    other = [name for name in sorted(was | now) if was.get(name) != now.get(name)]
    if other:
        from rich.console import Console

        there, here = (", ".join(f"{name} {each.get(name, 'none')[:12]}" for name in other) for each in (was, now))
        allowed = f"those of now, {here}: elastocal diagnose {folder}; or --accept-environment"
        error = InputError(folder, "", f"results by {there}", allowed)
        if not accept_environment:
            raise error
        print_lines([f"warning: {error}"], Console(stderr=True))
    return found
