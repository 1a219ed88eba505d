"""The application: one line for what is wrong, a help that fits, every subcommand
registered."""

from pathlib import Path

import pytest

from elastocal.command import main
from elastocal.errors import InputError

NO_SUBCOMMANDS = {"__init__", "main", "terminal"}


@pytest.mark.parametrize(
    ("fault", "line"),
    [
        (
            InputError("robot.yaml", "chain", "'X'", "Tz(l1)"),
            "robot.yaml: chain: found 'X'; allowed: Tz(l1)",
        ),
        (
            FileExistsError(17, "File exists", "cell"),
            "cell: found File exists; allowed: a file or folder that is there",
        ),
    ],
)
def test_bad_input_and_faults_of_the_machine_end_in_one_line(monkeypatch, fault, line):
    def fail():
        raise fault

    monkeypatch.setattr(main, "app", fail)
    with pytest.raises(SystemExit) as stopped:
        main.main()
    # Python writes a text to standard error and ends with 1.
    assert (
        stopped.value.code.startswith(line)
        and len(stopped.value.code.splitlines()) == 1
    )


def callbacks(app):
    """Functions that an application and the applications inside of it run."""
    found = [command.callback for command in app.registered_commands]
    for group in app.registered_groups:
        found += [
            group.typer_instance.registered_callback.callback,
            *callbacks(group.typer_instance),
        ]
    return found


def test_every_module_of_a_subcommand_is_registered():
    modules = {
        path.stem for path in Path(main.__file__).parent.glob("*.py")
    } - NO_SUBCOMMANDS
    assert modules == {
        callback.__module__.rpartition(".")[2] for callback in callbacks(main.app)
    }
