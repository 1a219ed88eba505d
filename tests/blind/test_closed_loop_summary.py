"""Errors of the closed loop: per case, together with limits, and against the goal."""

import numpy as np
import pytest
from made_proofs import made_moves

from elastocal_proof.blind.closed_loop import FOUND, TRUE
from elastocal_proof.blind.closed_loop_summary import case_errors, summary


def test_each_case_and_part_has_the_rms_of_every_model_and_its_ratio_to_the_floor():
    errors = case_errors({"one": made_moves(), "two": made_moves(seed=2)})
    assert len(errors) == 2 * 8 * 3
    assert errors[FOUND].mean() == pytest.approx(1.1e-4, rel=0.05)
    np.testing.assert_allclose(errors["over_floor"], errors[FOUND] / errors[TRUE])
    assert errors["calibration"].mean() == pytest.approx(1.0, rel=0.1)


def test_limits_hold_the_rms_and_the_floor_is_one():
    errors = case_errors({"one": made_moves(cases=20)})
    table = summary(errors, 1)
    assert set(table["robot"]) == {"one", "all"}
    assert ((table["rms_mm_low"] <= table["rms_mm"]) & (table["rms_mm"] <= table["rms_mm_high"])).all()
    assert (table.loc[table["model"] == TRUE, "over_floor"] == 1.0).all()
    found = table[(table["model"] == FOUND) & (table["robot"] == "all")]
    assert ((found["over_floor_low"] < 1.1) & (found["over_floor_high"] > 1.1)).all()
