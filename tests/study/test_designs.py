"""Random designs against optimal ones."""

import numpy as np
import pandas as pd
from made_studies import few_of

from elastocal.study.designs import evaluate_designs
from elastocal.study.in_memory import StudyInMemory

LOADS = {"random": None, "hanging": [0, 0, -1]}


def test_optimal_designs_leave_less_error_and_a_hanging_weight_does_not_move_joint_1(
    kuka,
):
    blocks = evaluate_designs(few_of(kuka), 150, [6, 12], LOADS)
    table = pd.concat(map(pd.DataFrame, blocks))
    for (load, _), cell in table.groupby(["load", "configurations"]):
        rms = cell.set_index("design").rms
        assert set(rms.index) == {"random", "D", "A", "I"}
        assert set(cell.unobservable) == {"1" if load == "hanging" else ""}
        assert rms["I"] < rms["random"]


def test_all_configurations_are_within_the_limits_and_none_judges_what_it_chose(
    kuka, monkeypatch
):
    """Candidates, the criterion's configurations and the test configurations are three
    draws, and every one respects the joint limits."""
    drawn = {}
    draw = StudyInMemory.draw_experiments

    def draw_and_note(study, sets, configurations=None, purpose="identification"):
        experiments = draw(study, sets, configurations, purpose)
        drawn[purpose] = experiments.joint_angles.reshape(-1, 6)
        return experiments

    monkeypatch.setattr(StudyInMemory, "draw_experiments", draw_and_note)
    list(evaluate_designs(few_of(kuka), 50, [6], {"random": None}))
    assert set(drawn) == {"candidates of designs", "criterion of designs", "test"}
    low, high = kuka.joint_limits.T
    for angles in drawn.values():
        assert (angles >= low).all() and (angles <= high).all()
        # A full turn leaves the limits of joint 2 in most draws.
        assert np.ptp(angles[:, 1]) < 2 * np.pi
    firsts = {round(angles[0, 0], 12) for angles in drawn.values()}
    assert len(firsts) == 3
