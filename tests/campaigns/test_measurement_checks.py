"""Checks of measurements: wrong units, contradictions and doubles are refused by row and column, and nothing that is right."""

import numpy as np
import pytest
from made_cells import WRENCH, Cell
from support import refused


@pytest.mark.parametrize(
    ("row", "column", "entry", "words"),
    [
        (1, "fz", 3.0, ["3 with load 0", "0 where load is 0"]),
        (4, "q1", 57.3, ["57.3", "of the same pose", "within 0.02 rad"]),
        (12, "rx, ry, rz", None, ["a turn of", "not degrees"]),
    ],
)
def test_implausible_cell_is_refused_by_row_and_column(cell, row, column, entry, words):
    for name in column.split(", "):
        cell.spoil(row, name, 45.0 if entry is None else entry)
    with refused(cell.measurements, f"row {row}, column {column}", *words):
        cell.read()


def test_what_few_rows_alone_are_off_is_left_to_the_diagnosis(cell):
    """A unit is wrong in a whole file; a mistyped cell is a gross error of its row."""
    cell.spoil(40, "y", 812.4)
    assert cell.read().measurements.position[39, 1] == 812.4
    for row in range(1, 25):
        cell.spoil(row, "y", 812.4)
    with refused(cell.measurements, "column y", "812.4", "metres, not millimetres", "reaches"):
        cell.read()


def test_whole_file_in_degrees_or_millimetres_is_refused(cell, tmp_path):
    for names, factor, words in ((["q1", "q2", "q3"], 57.3, "degrees"), (["x", "y", "z"], 1e3, "millimetres")):
        spoilt = Cell(tmp_path / words)
        tmp_path.joinpath(words).mkdir()
        for name in names:
            spoilt.table[name] = [factor * number for number in spoilt.table[name]]
        with refused(spoilt.measurements, f"column {names[0][0]}" if factor < 100 else "column ", words):
            spoilt.read()


def test_a_clock_that_runs_backwards_is_refused(cell):
    cell.table["time_s"] = [-time for time in cell.table["time_s"]]
    with refused(cell.measurements, "row 73, column time_s", "the poses before it were measured later", "rise"):
        cell.read()


@pytest.mark.parametrize("seed", range(4))
def test_poses_may_be_measured_in_any_order_and_stand_in_any_order(cell, seed):
    """Backwards in the file, or backwards by their numbers; loads and targets of a pose in any order; the clock of any zero."""
    order, count = np.random.default_rng(seed).permutation(10), len(cell.table["pose"])
    if seed == 0:
        cell.table["pose"] = [9 - pose for pose in cell.table["pose"]]
    elif seed == 1:
        cell.table = {name: values[::-1] for name, values in cell.table.items()}
    elif seed == 2:
        cell.table["time_s"] = [order[row // 8] * 600.0 - row % 8 for row in range(count)]
    cell.table["time_s"] = [time - 1.7e9 for time in cell.table["time_s"]]
    assert len(cell.read().measurements) == count


def test_the_same_measurement_twice_is_refused(cell):
    cell.spoil(7, "repeat", 0)
    found = "pose 0, load 1, repeat 0, target A again"
    with refused(cell.measurements, "row 7", found, "first in row 5"):
        cell.read()


def test_load_without_columns_of_the_wrench_is_refused(cell):
    cell.without(*WRENCH)
    with refused(cell.measurements, "row 5, column load", "found 1", "no columns fx"):
        cell.read()
