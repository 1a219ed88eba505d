"""Quantities need their unit, lists their count; what is printed does not steer a terminal."""

import io
from typing import get_args

import pytest
import typer
from rich.console import Console
from support import refused
from typer.testing import CliRunner

from elastocal.command.main import app
from elastocal.command.terminal import angle_rad, length_m, numbers, print_lines


@pytest.mark.parametrize(
    ("read", "text", "value"),
    [
        *((length_m, *pair) for pair in (("0.2mm", 2e-4), ("60um", 6e-5), ("60 µm", 6e-5), (".5mm", 5e-4), ("0.01m", 0.01))),
        *((angle_rad, *pair) for pair in (("0.01deg", 1.745329e-4), ("0.1mrad", 1e-4), ("60 µrad", 6e-5), (".001rad", 1e-3))),
    ],
)
def test_a_quantity_is_read_with_its_unit(read, text, value):
    assert read("--noise", text) == pytest.approx(value)


@pytest.mark.parametrize("text", ["0.2", "0mm", "-1mm", "200mm", "mm", "1e3mm", "nan mm", "0.000000000001mm", "90deg", "1"])
def test_a_quantity_without_a_unit_or_of_no_sense_is_refused(text):
    for read in (length_m, angle_rad):
        with refused("--tolerance", "", "with its unit"):
            read("--tolerance", text)


def test_numbers_are_counted():
    assert numbers("--tracker", "1,2.5,-3", 3).tolist() == [1.0, 2.5, -3.0]
    for text in ("1,2", "1,2,x", "1,2,nan", "1,2,inf", "1,2,1e300"):
        with refused("--tracker", "", "3 numbers"):
            numbers("--tracker", text, 3)


def numeric_options(command, words=()):
    """Of every subcommand: its words with its arguments, and each of its options that is a number."""
    for name, inner in getattr(command, "commands", {}).items():
        yield from numeric_options(inner, (*words, name))
    arguments = [p.name for p in command.params if p.param_type_name == "argument"]
    for option in command.params:
        if {int, float} & {option.type_descriptor.annotation, *get_args(option.type_descriptor.annotation)}:
            yield (*words, *arguments), option.opts[0]


@pytest.mark.parametrize("value", ["nan", "inf", "-1e300", "99999999999999999999"])
def test_every_option_that_is_a_number_has_a_range(value):
    """Whatever else is missing, the last line says which option is wrong."""
    found = set()
    for words, option in numeric_options(typer.main.get_command(app)):
        result = CliRunner().invoke(app, [*words, option, value])
        assert result.exit_code == 2 and f"'{option}'" in result.output.splitlines()[-1], (words, result.output)
        found.add(option)
    assert found == {"--force", "--risk", "--seed", "--poses", "--held-out", "--candidates", "--header", "--cores", "--floor"}


def test_lines_are_printed_as_they_are_but_for_what_would_steer_a_terminal():
    console = Console(file=io.StringIO())
    print_lines(["    [bold] a\x1b[2Jb\u202ec 4.00\u00a0mm"], console)
    assert console.file.getvalue() == "    [bold] a\\x1b[2Jb\\u202ec 4.00\u00a0mm\n"
