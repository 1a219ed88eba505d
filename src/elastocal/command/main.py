"""The application of all subcommands, in the order of the work. Bad input ends in one
line."""

import sys
from collections.abc import Callable
from typing import Annotated, Any

import typer
from typer import Option
from typer.core import TyperGroup

import elastocal
from elastocal.command.boards import board, detect
from elastocal.command.campaign import check, diagnose, init
from elastocal.command.certificate import certificate
from elastocal.command.comparison import compare
from elastocal.command.correct import correct
from elastocal.command.demo import demo
from elastocal.command.export import export
from elastocal.command.importing import importing
from elastocal.command.plan import plan
from elastocal.command.terminal import format_example
from elastocal.command.verify import verify
from elastocal.errors import InputError, describe_system_fault

# Each subcommand with the words of an example, in the order in which a calibration needs
# them; `import` is a group of its own.
COMMANDS: dict[Callable[..., None], str] = {
    demo: "",
    init: "campaigns/cell --robot robot.yaml",
    plan: "robot.yaml --folder campaigns/cell --force 200 --pull",
    board: "--pdf board.pdf",
    detect: "images/ --board board.yaml --output boards.csv",
    check: "campaigns/cell",
    diagnose: "campaigns/cell",
    correct: "campaigns/cell path.csv --output targets.csv",
    certificate: "campaigns/cell --tolerance 0.2mm",
    verify: "campaigns/cell measured.csv",
    export: "campaigns/cell --output calibrated",
    compare: "campaigns/cell campaigns/cell_round2",
}


class InOrder(TyperGroup):
    """Lists subcommands in the order of the work; typer would list groups last."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all subcommands."""
        names = [command.__name__ for command in COMMANDS if command is not demo]
        return ["demo", "import", *names]


# Without the boxes of rich the last line says what is wrong with an option.
app = typer.Typer(
    name="elastocal",
    cls=InOrder,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    epilog=format_example("elastocal demo"),
)
for _command, _example in COMMANDS.items():
    _line = f"elastocal {_command.__name__} {_example}".strip()
    app.command(epilog=format_example(_line))(_command)
app.add_typer(importing)


@app.callback(invoke_without_command=True)
def with_version(
    *,
    version: Annotated[
        bool, Option("--version", help="Print the version and exit.")
    ] = False,
) -> None:
    """From a robot and measurements of its errors to a corrected robot.

    The steps in order: plan, measure, check, diagnose, correct, certificate,
    verify.
    """
    if version:
        typer.echo(f"elastocal {elastocal.__version__}")
        raise typer.Exit


def main() -> None:
    """Run the command.

    If the input is wrong, or the machine fails, the exit code is 1 and standard error
    has one line.
    """
    try:
        app()
    except InputError as error:
        sys.exit(str(error))
    except (OSError, MemoryError, ImportError) as error:
        sys.exit(str(describe_system_fault(error)))
