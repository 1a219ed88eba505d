"""The application: errors end in one line, and every subcommand is registered."""

from pathlib import Path

import pytest

from elastocal.command import main
from elastocal.errors import InputError

WITHOUT_SUBCOMMAND = {"diagnosis_runs", "__init__", "main", "plan_places", "terminal"}


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
    # Python writes a text to standard error and ends with exit code 1.
    message = stopped.value.code
    assert message.startswith(line) and len(message.splitlines()) == 1


def list_callbacks(app):
    """List the functions that an application and its groups run."""
    callbacks = [command.callback for command in app.registered_commands]
    for group in app.registered_groups:
        callbacks.append(group.typer_instance.registered_callback.callback)
        callbacks += list_callbacks(group.typer_instance)
    return callbacks


def test_every_module_of_a_subcommand_is_registered():
    files = Path(main.__file__).parent.glob("*.py")
    modules = {path.stem for path in files} - WITHOUT_SUBCOMMAND
    callbacks = list_callbacks(main.app)
    registered = {callback.__module__.rpartition(".")[2] for callback in callbacks}
    assert modules == registered
