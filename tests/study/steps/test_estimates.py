"""Estimates in memory, by several strategies."""

import numpy as np
from made_studies import SIZE, USUAL

from elastocal.study.steps.estimates import estimates
from elastocal.study.steps.in_memory import StudyInMemory


def test_one_estimator_under_two_names_is_worked_out_once(kuka, strategies):
    some = [strategies[name] for name in ("6DoF", "6DoF-after-3DoF", "4-6DoF-after-3DoF")]
    found = estimates(StudyInMemory(kuka, "kuka", 1, USUAL, SIZE), some)
    assert found["6DoF"] is found["6DoF after 3DoF"] and found["6DoF"] is not found["4-6DoF after 3DoF"]
    (block,) = found["6DoF"]
    assert block.shape == (4, 5, 6) and np.isfinite(block[:, -1]).all()
