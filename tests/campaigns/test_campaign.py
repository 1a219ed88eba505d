"""Measurements of a campaign, chosen by mask or index."""

from dataclasses import replace

import numpy as np
from made_cells import assert_same


def test_selected_measurements_come_in_the_order_of_the_index(cell):
    measurements = replace(cell.read().measurements, time_s=None)
    chosen = measurements.select(np.array([5, 2]))
    assert len(chosen) == 2 and chosen.row.tolist() == [6, 3] and chosen.time_s is None
    np.testing.assert_array_equal(chosen.position, measurements.position[[5, 2]])
    assert_same(measurements.select(measurements.load == 1), measurements.select(np.flatnonzero(measurements.load == 1)))
