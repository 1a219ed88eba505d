"""Errors of the closed loop: per case, together with limits, and against the goal."""

import numpy as np
import pandas as pd
import pytest
from made_proofs import made_moves

from elastocal_proof.blind.closed_loop import FOUND, TRUE
from elastocal_proof.blind.closed_loop_summary import case_errors, coverage, summary


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


def made_rows(true_rms_m, decision="pass", verdict="named", frame="base"):
    count = len(true_rms_m)
    stated = {"rms_m": 2e-5, "rms_bound_m": 3e-5, "worst_m": 5e-5, "worst_bound_m": 6e-5, "tolerance_m": 4e-5}
    rows = pd.DataFrame({"true_rms_m": true_rms_m, "true_worst_m": 2.0 * np.array(true_rms_m), "part": ["random"] * count})
    return rows.assign(frame=frame, decision=decision, verdict=verdict, **stated)


def share(found, question, frame="all"):
    (row,) = found[
        (found["question"] == question) & (found["frame"] == frame) & (found["part"] == "random") & (found["verdict"] == "all")
    ].to_dict("records")
    return row


def test_shares_are_of_the_cases_that_a_question_concerns_with_exact_intervals():
    found = coverage(pd.concat([made_rows([1e-5, 2e-5, 5e-5]), made_rows([3.5e-5], "fail", "several", "tracker")]))
    rms = share(found, "rms below its 95 % bound")
    assert (rms["cases"], rms["hits"]) == (4, 2)
    assert (rms["low"], rms["high"]) == pytest.approx((0.0676, 0.9324), abs=1e-4)
    denied = share(found, "pass that the truth denies")
    assert (denied["cases"], denied["hits"]) == (3, 1)
    assert share(found, "fail that the truth denies")["hits"] == 1
    assert share(found, "rms below its 95 % bound", "tracker")["hits"] == 0
