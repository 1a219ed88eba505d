"""A second target at places of the arm, against what the sets of points say of the same places."""

import numpy as np
import pandas as pd
import pytest
from made_studies import few_of

from elastocal.study.steps.arm_points import place_columns
from elastocal.study.steps.budget import budget_blocks

ARM = {"sets": 6, "radius_m": 0.15, "bar_m": 0.5, "acceptance_deg": 30}


@pytest.fixture(scope="module")
def table(kuka):
    return pd.DataFrame(place_columns(few_of(kuka), (4.0, 0.0, 1.5), ARM))


def test_a_target_on_the_flange_is_the_end_effector_measured_twice(kuka, table):
    (block,) = budget_blocks(few_of(kuka), {"twice": ["6DoF", "6DoF"]})
    expected = block["bound"][block["length"] == 20]
    np.testing.assert_allclose(table[table.side == "flange"].bound, expected, rtol=1e-6)


def test_a_reflector_that_stays_as_it_is_is_seen_less_often_than_one_that_is_turned(table):
    assert (table.fixed <= table.turned).all() and 0 < table.fixed.mean() < table.turned.mean() < 0.7
