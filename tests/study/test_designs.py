"""Random designs against optimal ones."""

import pandas as pd
from made_studies import few_of

from elastocal.study.designs import evaluate_designs

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
