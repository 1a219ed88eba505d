"""Distances of rows from what the other rows predict."""

import numpy as np
import pytest

from elastocal.diagnosis.fitted_subset import fit_subset
from elastocal.diagnosis.gross_errors import (
    find_gross_errors,
)
from elastocal.diagnosis.settings import Settings

SETTINGS = Settings()
NOISE_M = 6e-5
BAD = 11


def test_the_distance_of_a_row_is_that_from_a_fit_without_it(cases):
    case, _ = cases
    measurements = case.campaign.measurements
    every = np.ones(len(measurements), bool)
    whole = fit_subset(case, every, SETTINGS)
    without = fit_subset(case, np.arange(len(measurements)) != BAD, SETTINGS)
    found = []
    for part in (whole, without):
        found.append(
            find_gross_errors(
                part.declared, whole.noise, measurements, part.kept, SETTINGS
            ).distance
        )
    # Weights of the robust fit differ a little, since the model lacks something.
    assert found[0][BAD] == pytest.approx(found[1][BAD], rel=0.1)
