"""What claims need: sizes of the effect of equation 6, and starts."""

import numpy as np
from made_studies import few_of

from elastocal.study.steps.claim_checks import start_columns, stiffness_columns


def test_the_effect_of_the_loaded_arm_grows_with_the_load(kuka):
    found = stiffness_columns(few_of(kuka), [1000.0, 3000.0])
    for name in ("first_order", "by_k_c", "loaded", "bias"):
        assert 2.9 < found[name][1] / found[name][0] < 3.1, name
        assert 0 < found[name][0] < 1.0
    assert found["offset_rank"].tolist() == [5, 5] and found["rank"].tolist() == [6, 6]


def test_a_start_from_which_steps_do_not_settle_is_counted(kuka, strategies):
    # Springs so soft that the first step turns joints by radians.
    found = start_columns(few_of(kuka), strategies["6DoF"], [1e-6, 1.0])
    assert found["unsettled"][1] > 0 or np.nanmax(found["difference"]) > 1e-3
