from pathlib import Path

import pytest

from elastocal.command import main
from elastocal.errors import InputError

NO_SUBCOMMANDS = {"__init__", "main", "pipeline", "campaign", "quantities"}


def test_bad_input_ends_in_one_line_and_exit_code_one(monkeypatch, capsys):
    def refuse():
        raise InputError("robot.yaml", "chain", "'X'", "Tz(l1)")

    monkeypatch.setattr(main, "app", refuse)
    with pytest.raises(SystemExit) as stopped:
        main.main()
    assert stopped.value.code == 1
    assert capsys.readouterr().err == "robot.yaml: chain: found 'X'; allowed: Tz(l1)\n"


def callbacks(app):
    """Functions that an application and the applications inside of it run."""
    found = [command.callback for command in app.registered_commands]
    for group in app.registered_groups:
        found += [group.typer_instance.registered_callback.callback, *callbacks(group.typer_instance)]
    return found


def test_every_module_of_a_subcommand_is_registered():
    modules = {path.stem for path in Path(main.__file__).parent.glob("*.py")} - NO_SUBCOMMANDS
    assert modules == {callback.__module__.rpartition(".")[2] for callback in callbacks(main.app)}
