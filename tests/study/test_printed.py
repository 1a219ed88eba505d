"""The paper's printed figures beside the tables of a study."""

import pandas as pd
import pytest
from made_studies import metrics_of, replicates_of

from elastocal.study.printed import OurResults, compare_figures
from elastocal.study.tables import Results


def test_table_2_is_that_of_one_data_set_with_its_scatter():
    """Interpretation R13: the yardstick is the scatter between data sets, not the error of
    a mean over all of them."""
    table2 = pd.DataFrame(
        {
            "robot": ["arm"],
            "mean_mm": [1.0],
            "mean_mm_std_error": [0.002],
            "mean_mm_one_set": [1.0],
            "mean_mm_one_set_std": [0.05],
        }
    )
    results = Results(metrics_of("A"), replicates_of("A"), 200.0, 20)
    printed = pd.DataFrame(
        [("2", "arm", "", "deviation_mean", "mm", 0.9)],
        columns=["table", "robot", "strategy", "quantity", "unit", "value"],
    )
    (row,) = compare_figures(printed, OurResults({"table2": table2}, results)).to_dict(
        "records"
    )
    assert row["ours"] == 1.0
    assert row["mc_std"] == 0.05
    assert row["z"] == pytest.approx(2.0)
    assert "R13" in row["interpretation"]
