"""Tests of studentized residuals against a fit without the row."""

import numpy as np
import pytest

from elastocal.diagnosis.fitted_subset import fit_subset
from elastocal.diagnosis.gross_errors import find_gross_errors
from elastocal.diagnosis.settings import Settings

SETTINGS = Settings()
BAD_ROW = 11


def test_the_distance_of_a_row_is_its_distance_from_a_fit_without_it(cases):
    case, _ = cases
    measurements = case.campaign.measurements
    rows = np.arange(len(measurements))
    whole = fit_subset(case, rows >= 0, SETTINGS)
    without_row = fit_subset(case, rows != BAD_ROW, SETTINGS)
    distances = [
        find_gross_errors(
            subset.declared, whole.noise, measurements, subset.kept, SETTINGS
        ).distance[BAD_ROW]
        for subset in (whole, without_row)
    ]
    # The weights of the robust fits differ a little, because the model lacks an effect.
    assert distances[0] == pytest.approx(distances[1], rel=0.1)
