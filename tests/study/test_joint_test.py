"""The joint test: a paper among studies, and one that is not."""

import numpy as np
import pandas as pd
import pytest
from made_studies import studies_of

from elastocal.study.joint_test import joint_table

BIASES = tuple(20.0 + 0.5 * k for k in range(8))


def print_figures(k_sigma, dev):
    rows = [("4", "arm", "A", "k_sigma_20", k_sigma), ("4", "arm", "A", "dev_20", dev), ("2", "arm", "", "deviation_mean", 1.0)]
    return pd.DataFrame(rows, columns=["table", "robot", "strategy", "quantity", "value"])


def test_a_paper_like_the_studies_lies_among_them():
    # k_sigma over the fixed joints is half of that over all.
    fixed, whole = joint_table(studies_of(biases=BIASES), print_figures(0.5 * 22 / 20, 22 / 20), 20).to_dict("records")
    assert fixed["cells"] == 2 and fixed["below"] == 0 and fixed["studies"] == 8
    assert fixed["statistic_p"] > 0.3 and fixed["below_p"] == 1.0
    assert whole["below"] == 1 and whole["statistic_p"] == pytest.approx(1 / 9)


def test_the_p_value_is_a_rank_and_no_smaller_than_one_over_the_studies():
    (fixed, _) = joint_table(studies_of(biases=BIASES), print_figures(5.0, 5.0), 20).to_dict("records")
    assert fixed["below"] == fixed["differ"] == 2 and fixed["statistic_p"] == pytest.approx(1 / 9)
    assert fixed["statistic"] > fixed["statistic_studies_largest"] >= fixed["statistic_studies_median"]
    assert np.isfinite(fixed["statistic"])
