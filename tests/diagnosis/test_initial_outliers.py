"""Tests of outliers that are found before it is known what the declared model lacks."""

from dataclasses import replace

import numpy as np
import pytest
from bad_rows import damaged
from made_folders import PLAN, make_folder, make_table

from elastocal.diagnosis.fitted_subset import select_initial_subset
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import read_cases

SETTINGS = Settings()
BAD_ROW = 11


@pytest.mark.parametrize(
    "shifts_m",
    [{BAD_ROW: 0.02}, {BAD_ROW: 0.02, 3: -0.1}, {0: 1e3, 5: 1.0, 20: 0.03}],
)
def test_bad_rows_are_found_although_the_model_lacks_an_effect(cases, shifts_m):
    kept = select_initial_subset(damaged(cases[0], shifts_m), SETTINGS).kept
    assert not kept[list(shifts_m)].any()
    # A bad repeat takes the other repeat of its state along, until a model tells which
    # of the two is bad.
    assert (~kept).sum() <= 2 * len(shifts_m)


@pytest.mark.parametrize("error_rad", [3e-4, 1e-3])
def test_an_error_that_the_measurements_of_a_pose_share_makes_no_gross_errors(
    error_rad, kuka, config_folder, tmp_path
):
    table = make_table(kuka, "made", plan=replace(PLAN, poses=40))
    poses = max(table["pose"]) + 1
    joint_error = error_rad * np.random.default_rng(0).standard_normal((poses, 6))
    for joint in range(1, 7):
        error = joint_error[table["pose"], joint - 1]
        table[f"q{joint}"] = table[f"q{joint}"] + error
    folder = make_folder(tmp_path / "made", kuka, table=table)
    case, _ = read_cases(folder, config_folder / "robots")
    assert select_initial_subset(case, SETTINGS).kept.all()
