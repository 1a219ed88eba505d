"""Lengths need their unit, and lists their count."""

import pytest
from support import refused

from elastocal.command.quantities import length_m, numbers


@pytest.mark.parametrize(
    ("text", "metres"), [("0.2mm", 2e-4), ("60um", 6e-5), ("60 µm", 6e-5), (".5mm", 5e-4), ("0.01m", 0.01)]
)
def test_a_length_is_read_with_its_unit(text, metres):
    assert length_m("--tolerance", text) == pytest.approx(metres)


@pytest.mark.parametrize("text", ["0.2", "0mm", "-1mm", "200mm", "mm", "1e3mm", "nan mm"])
def test_a_length_without_a_unit_or_of_no_sense_is_refused(text):
    with refused("--tolerance", "", "with its unit"):
        length_m("--tolerance", text)


def test_numbers_are_counted():
    assert numbers("--tracker", "1,2.5,-3", 3).tolist() == [1.0, 2.5, -3.0]
    for text in ("1,2", "1,2,x", "1,2,nan"):
        with refused("--tracker", "", "3 numbers"):
            numbers("--tracker", text, 3)
