"""What assumptions are worth, on few data sets of a robot of the study."""

import numpy as np
import pandas as pd
import pytest
from made_studies import few_of

from elastocal.study.steps.assumptions import geometry_rows, weighting_rows


def test_geometry_known_or_not(kuka):
    table = pd.DataFrame(geometry_rows(few_of(kuka), zero_rad=1e-3, length_m=5e-4)).set_index("estimator")
    assert len(table) == 5
    identified = table.loc[["at once", "compliances from differences"]]
    assert not identified.leak.any() and identified.noise["at once"] < identified.noise["compliances from differences"]
    # Millimetres by a robot that is off by milliradians.
    assert 1e-3 < table.leak["compliances from loaded poses alone"] < 1e-2
    assert table.zero_leak["compliances from loaded poses alone"] == pytest.approx(1e-3)


def test_the_equal_weights_of_the_paper_cost_nothing_in_the_papers_case_alone(kuka):
    table = weighting_rows(few_of(kuka), orientation_ratios=[0.2, 1.0], tracker_m=[4, 0, 1], per_metre=[0.0, 1e-4])
    ratio = table["equal"] / table["weighted"]
    np.testing.assert_array_equal(table["orientation_ratio"], [0.2, 1, 1, 1])
    np.testing.assert_array_equal(table["per_metre"], [0, 0, 0, 1e-4])
    assert ratio[[1, 2]] == pytest.approx([1, 1]) and (ratio[[0, 3]] > 1.05).all()
