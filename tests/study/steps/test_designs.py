"""Designs of a robot of the study, from few candidates."""

import pandas as pd
from made_studies import few_of

from elastocal.study.steps.designs import JOINT_RANGES, design_worths


def test_designs_are_worth_more_than_random_ones(kuka):
    table = pd.DataFrame(design_worths(few_of(kuka), candidates=200, sizes=[5]))
    for _, within in table.groupby("joint_range"):
        rms = within.set_index("design").rms
        assert rms["bound"] <= rms["I"] < rms["random"] and set(rms.index) == {"random", "D", "A", "I", "bound"}
    assert table.joint_range.unique().tolist() == [*JOINT_RANGES]
