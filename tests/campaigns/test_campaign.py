"""Readings of a campaign, chosen by mask or index."""

from dataclasses import replace

import numpy as np
from made_cells import assert_same


def test_selected_readings_come_in_the_order_of_the_index(cell):
    readings = replace(cell.read().readings, time_s=None)
    chosen = readings.select(np.array([5, 2]))
    assert len(chosen) == 2 and chosen.row.tolist() == [6, 3] and chosen.time_s is None
    np.testing.assert_array_equal(chosen.position, readings.position[[5, 2]])
    assert_same(readings.select(readings.load == 1), readings.select(np.flatnonzero(readings.load == 1)))
