"""Rows that no candidate explains."""

from dataclasses import replace

import numpy as np
import pytest
from bad_rows import damaged
from made_folders import PLAN, made_folder, made_table

from elastocal.diagnosis.fitted_subset import select_initial_subset
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import cases_in

SETTINGS = Settings()
NOISE_M = 6e-5
BAD = 11


@pytest.fixture
def case(cases):
    return cases[0]


@pytest.mark.parametrize(
    "shifts", [{BAD: 0.02}, {BAD: 0.02, 3: -0.1}, {0: 1e3, 5: 1.0, 20: 0.03}]
)
def test_rows_are_found_beside_an_effect_that_the_model_lacks(case, shifts):
    kept = select_initial_subset(damaged(case, shifts), SETTINGS).kept
    # A bad repeat takes the others of its state along, until a model says which it is.
    assert not kept[list(shifts)].any() and (~kept).sum() <= 2 * len(shifts)


@pytest.mark.parametrize("error_rad", [3e-4, 1e-3])
def test_no_row_is_a_gross_error_where_all_measurements_of_a_pose_err_together(
    error_rad, kuka, config_folder, tmp_path
):
    table = made_table(kuka, "made", plan=replace(PLAN, poses=40))
    drawn = error_rad * np.random.default_rng(0).standard_normal(
        (max(table["pose"]) + 1, 6)
    )
    table |= {
        f"q{joint}": table[f"q{joint}"] + drawn[table["pose"], joint - 1]
        for joint in range(1, 7)
    }
    whole, _ = cases_in(
        made_folder(tmp_path / "made", kuka, table=table), config_folder / "robots"
    )
    assert select_initial_subset(whole, SETTINGS).kept.all()
