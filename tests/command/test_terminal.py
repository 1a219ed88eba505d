"""Quantities need their unit, lists their count; what is printed does not steer a terminal."""

import io

import pytest
from rich.console import Console
from support import refused

from elastocal.command.terminal import angle_rad, length_m, print_lines


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


def test_lines_are_printed_as_they_are_but_for_what_would_steer_a_terminal():
    console = Console(file=io.StringIO())
    print_lines(["    [bold] a\x1b[2Jb\u202ec 4.00\u00a0mm"], console)
    assert console.file.getvalue() == "    [bold] a\\x1b[2Jb\\u202ec 4.00\u00a0mm\n"
