"""The application of all subcommands, in the order of the work; bad input ends in one
line."""

import sys
from collections.abc import Callable
from typing import Annotated, Any

import typer
from typer import Option
from typer.core import TyperGroup

import elastocal
from elastocal.command.campaign import check, diagnose, init
from elastocal.command.demo import demo
from elastocal.command.importing import importing
from elastocal.command.plan import plan
from elastocal.command.results import certificate, correct, export
from elastocal.command.terminal import example
from elastocal.errors import InputError, describe_system_fault

# Each subcommand with an example, in the order in which a calibration needs them;
# `import` is a group of its own.
COMMANDS: dict[Callable[..., None], str] = {
    demo: "",
    init: "campaigns/cell --robot robot.yaml",
    plan: "robot.yaml --folder campaigns/cell --force 200 --pull",
    check: "campaigns/cell",
    diagnose: "campaigns/cell",
    correct: "campaigns/cell path.csv --output targets.csv",
    certificate: "campaigns/cell --tolerance 0.2mm",
    export: "campaigns/cell --output calibrated",
}


class InOrder(TyperGroup):
    """Lists subcommands in the order of the work; typer would list groups last."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Names of all subcommands."""
        return [
            "demo",
            "import",
            *(command.__name__ for command in COMMANDS if command is not demo),
        ]


# Without the boxes of rich the last line says what is wrong with an option.
app = typer.Typer(
    name="elastocal",
    cls=InOrder,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    epilog=example("elastocal demo"),
)
for _command, _typed in COMMANDS.items():
    app.command(epilog=example(f"elastocal {_command.__name__} {_typed}".strip()))(
        _command
    )
app.add_typer(importing)


@app.callback(invoke_without_command=True)
def with_version(
    version: Annotated[
        bool, Option("--version", help="Print the version and exit.")
    ] = False,
) -> None:
    """From a robot and a laser tracker to a corrected robot.

    The order of the work: plan, measure, check, diagnose, correct, certificate.
    """
    if version:
        typer.echo(f"elastocal {elastocal.__version__}")
        raise typer.Exit


def main() -> None:
    """Run the command; exit code 1 with one line on standard error where the input is
    wrong, or the machine fails."""
    try:
        app()
    except InputError as error:
        sys.exit(str(error))
    except (OSError, MemoryError, ImportError) as error:
        sys.exit(str(describe_system_fault(error)))
