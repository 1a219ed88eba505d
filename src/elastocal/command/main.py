"""The application of all subcommands; bad input ends in one line."""

from __future__ import annotations

import sys

import typer

from elastocal.command.certificate import certificate
from elastocal.command.check import check
from elastocal.command.correct import correct
from elastocal.command.diagnose import diagnose
from elastocal.command.export import export
from elastocal.command.importing import importing
from elastocal.command.init import init
from elastocal.command.plan import plan
from elastocal.errors import InputError, fault_of_machine

# Without the boxes of rich the last line says what is wrong with an option.
app = typer.Typer(
    name="elastocal", no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None
)
app.command()(init)
app.command()(diagnose)
app.command()(correct)
app.command()(plan)
app.command()(check)
app.command()(export)
app.command()(certificate)
app.add_typer(importing)


@app.callback()
def elastocal() -> None:
    """From a robot and a tracker to a corrected robot."""


def main() -> None:
    """Run the command; exit code 1 with one line on standard error where the input is wrong, or the machine fails."""
    try:
        app()
    except InputError as error:
        sys.exit(str(error))
    except (OSError, MemoryError, ImportError) as error:
        sys.exit(str(fault_of_machine(error)))
