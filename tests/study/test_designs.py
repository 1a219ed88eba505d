"""Designs against each other."""

import pandas as pd
from made_studies import few_of

from elastocal.study.designs import evaluate_designs

LOADS = {"random": None, "hanging": [0, 0, -1]}


def test_chosen_configurations_leave_less_than_random_ones_and_a_hanging_weight_does_not_move_joint_1(
    kuka,
):
    table = pd.concat(
        [
            pd.DataFrame(block)
            for block in evaluate_designs(few_of(kuka), 150, [6, 12], LOADS)
        ]
    )
    for (load, _), cell in table.groupby(["load", "configurations"]):
        rms = cell.set_index("design").rms
        assert set(rms.index) == {"random", "D", "A", "I"} and set(
            cell.unobservable
        ) == {"1" if load == "hanging" else ""}
        assert rms["I"] < rms["random"]
