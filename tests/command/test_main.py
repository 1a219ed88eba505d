"""The application: one line for what is wrong, a help that fits, every subcommand registered."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from elastocal.command import main
from elastocal.errors import InputError

NO_SUBCOMMANDS = {"__init__", "main", "pipeline", "terminal"}


@pytest.mark.parametrize(
    ("fault", "line"),
    [
        (InputError("robot.yaml", "chain", "'X'", "Tz(l1)"), "robot.yaml: chain: found 'X'; allowed: Tz(l1)"),
        (FileExistsError(17, "File exists", "cell"), "cell: found File exists; allowed: a name that nothing else has"),
        (MemoryError(), "memory: found none left; allowed: "),
    ],
)
def test_bad_input_and_faults_of_the_machine_end_in_one_line(monkeypatch, fault, line):
    def fail():
        raise fault

    monkeypatch.setattr(main, "app", fail)
    with pytest.raises(SystemExit) as stopped:
        main.main()
    # Python writes a text to standard error and ends with 1.
    assert stopped.value.code.startswith(line) and len(stopped.value.code.splitlines()) == 1


def callbacks(app):
    """Functions that an application and the applications inside of it run."""
    found = [command.callback for command in app.registered_commands]
    for group in app.registered_groups:
        found += [group.typer_instance.registered_callback.callback, *callbacks(group.typer_instance)]
    return found


def every_help(app, *words):
    """Help texts of an application, of its groups and of their subcommands, at 80 columns."""
    shown = CliRunner().invoke(main.app, [*words, "--help"], terminal_width=80)
    assert shown.exit_code == 0
    yield words, shown.output
    for command in app.registered_commands:
        called = [*words, command.callback.__name__]
        yield tuple(called), CliRunner().invoke(main.app, [*called, "--help"], terminal_width=80).output
    for group in app.registered_groups:
        yield from every_help(group.typer_instance, *words, group.typer_instance.info.name)


HELP = list(every_help(main.app))


@pytest.mark.parametrize(("words", "text"), HELP, ids=[" ".join(words) or "elastocal" for words, _ in HELP])
def test_help_is_whole_at_80_columns_and_has_an_example(words, text):
    assert not re.search(r"\w\.\.\.$", text, re.MULTILINE) and max(map(len, text.splitlines())) <= 80
    assert re.search(r"\n  Examples?:\n    elastocal ", text) or words == ("import",)


def test_every_module_of_a_subcommand_is_registered():
    modules = {path.stem for path in Path(main.__file__).parent.glob("*.py")} - NO_SUBCOMMANDS
    assert modules == {callback.__module__.rpartition(".")[2] for callback in callbacks(main.app)}
