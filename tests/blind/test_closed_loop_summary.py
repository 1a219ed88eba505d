"""Errors of the closed loop: per case, together with limits, and against the goal."""

import numpy as np
import pytest
from made_proofs import made_moves

from elastocal_proof.blind.closed_loop import FOUND, MODELS, TRUE
from elastocal_proof.blind.closed_loop_summary import GOAL, case_errors, goals, summary


def test_each_case_and_part_has_the_rms_of_every_model_and_its_ratio_to_the_floor():
    errors = case_errors({"one": made_moves(), "two": made_moves(seed=2)})
    assert len(errors) == 2 * 8 * 3
    assert errors[FOUND].mean() == pytest.approx(1.1e-4, rel=0.05)
    np.testing.assert_allclose(errors["over_floor"], errors[FOUND] / errors[TRUE])
    assert errors["calibration"].mean() == pytest.approx(1.0, rel=0.1)


def test_a_pose_that_one_model_could_not_correct_counts_for_none():
    table = made_moves(cases=1)
    table.loc[(table["pose"] == 3) & (table["model"] == "geometry"), "corrected"] = False
    table.loc[table["pose"] == 3, "measured_error_m"] = 1.0
    assert case_errors({"one": table})[list(MODELS)].to_numpy().max() < 0.01


def test_limits_hold_the_rms_and_the_floor_is_one():
    errors = case_errors({"one": made_moves(cases=20)})
    table = summary(errors, 1)
    assert set(table["robot"]) == {"one", "all"}
    assert ((table["rms_mm_low"] <= table["rms_mm"]) & (table["rms_mm"] <= table["rms_mm_high"])).all()
    assert (table.loc[table["model"] == TRUE, "over_floor"] == 1.0).all()
    found = table[(table["model"] == FOUND) & (table["robot"] == "all")]
    assert ((found["over_floor_low"] < 1.1) & (found["over_floor_high"] > 1.1)).all()


def test_the_goal_is_counted_where_the_effect_was_named_and_where_not():
    errors = case_errors({"one": made_moves()})
    errors["over_floor"] = np.where(errors["seed"] < 4, GOAL - 0.01, GOAL + 0.01)
    table = goals(errors)
    assert table["within"].tolist() == [2] * 6 and table["cases"].tolist() == [4] * 6
    assert ((table["share_low"] < 0.5) & (table["share_high"] > 0.5)).all()
