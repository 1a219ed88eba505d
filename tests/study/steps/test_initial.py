"""How far each robot bends before any calibration, against numbers written out."""

import numpy as np

from elastocal.study.steps.columns import deflection_columns
from elastocal.study.steps.initial import initial_blocks


def block_of(sets, displacements, rotation=0.0):
    """A block of the deflections table from displacements (sets, configurations, 3)."""
    displacements = np.array(displacements, float)
    rotations = np.full_like(displacements, rotation)
    return deflection_columns("6DoF", sets, np.concatenate([displacements, rotations], axis=-1))


TWO_SETS = [[[3, 4, 0], [0, 0, 1]], [[2, 3, 6], [0, -5, 12]]]


def test_statistics_are_of_the_lengths_of_the_displacements_set_by_set():
    (found,) = initial_blocks([block_of([0, 1], TWO_SETS)])
    # Lengths 5 and 1; 7 and 13.
    assert {name: np.asarray(values).tolist() for name, values in found.items()} == {
        "data_set": [0, 1],
        "configurations": [2, 2],
        "mean": [3.0, 10.0],
        "mean_square": [13.0, 109.0],
        "maximum": [5.0, 13.0],
    }
